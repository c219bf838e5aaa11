// The shades of times in which the samples were not what a sensor measures, and their legend.
export const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// `name` of the legend, by the name of its colour.
export const shades = {
  extrapolated: "extrapolated beyond the truth",
  held: "motion held: no truth",
  unsent: "nothing sent",
  fault: "fault",
};

// Returns what fills a shade: each has a pattern of its own, too.
export function fill(ctx, shade) {
  const tile = document.createElement("canvas"), size = 8;
  tile.width = tile.height = size;
  const of = tile.getContext("2d");
  of.fillStyle = of.strokeStyle = color(shade);
  of.globalAlpha = shade === "unsent" ? 0.35 : 0.2;
  of.fillRect(0, 0, size, size);
  of.globalAlpha = 0.7;
  of.lineWidth = 1.5;
  of.beginPath();
  if (shade === "held") for (const x of [-size, 0, size]) of.moveTo(x, size), of.lineTo(x + size, 0);
  if (shade === "unsent") of.moveTo(0, size / 2), of.lineTo(size, size / 2);
  if (shade === "extrapolated") of.moveTo(size / 2, 0), of.lineTo(size / 2, size / 4);
  of.stroke();
  return ctx.createPattern(tile, "repeat");
}

// Fills a list with the legend.
export function list_shades(list) {
  list.replaceChildren(...Object.entries(shades).map(([shade, text]) => {
    const item = document.createElement("li"), canvas = Object.assign(document.createElement("canvas"), {width: 24, height: 14});
    const ctx = canvas.getContext("2d");
    ctx.fillStyle = fill(ctx, shade);
    ctx.fillRect(0, 0, canvas.width, canvas.height);
    item.append(canvas, text);
    return item;
  }));
}

// Draws the legend to a picture, from (x, y) to the right, in lines of at most `width`.
export function draw_shades(ctx, x, y, width) {
  const line_px = 20, left = x;
  ctx.save();
  for (const [shade, text] of Object.entries(shades)) {
    const item = ctx.measureText(text).width + 50;
    if (x > left && x + item > left + width) [x, y] = [left, y + line_px];
    ctx.fillStyle = fill(ctx, shade);
    ctx.fillRect(x, y, 24, 14);
    ctx.fillStyle = color("text");
    ctx.fillText(text, x + 30, y + 12);
    x += item;
  }
  ctx.restore();
}
