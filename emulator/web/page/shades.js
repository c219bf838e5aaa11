// The shades of times in which the samples were not what a sensor measures, and their legend.
export const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

// What is shaded: `name` of the legend, by the name of its colour.
export const shades = {
  extrapolated: "extrapolated beyond the truth",
  held: "motion held: no truth",
  silent: "nothing sent: no truth",
  fault: "fault or command",
};

// Returns what fills a shade: each has a pattern of its own, too.
export function fill(ctx, shade) {
  const tile = document.createElement("canvas"), size = 8;
  tile.width = tile.height = size;
  const of = tile.getContext("2d");
  of.fillStyle = of.strokeStyle = color(shade);
  of.globalAlpha = shade === "silent" ? 0.35 : 0.2;
  of.fillRect(0, 0, size, size);
  of.globalAlpha = 0.7;
  of.lineWidth = 1.5;
  of.beginPath();
  if (shade === "held") for (const x of [-size, 0, size]) of.moveTo(x, size), of.lineTo(x + size, 0);
  if (shade === "silent") of.moveTo(0, size / 2), of.lineTo(size, size / 2);
  of.stroke();
  return ctx.createPattern(tile, "repeat");
}

// Fills a list with the legend of the shades.
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

// Draws that legend to a picture.
export function draw_shades(ctx, names, x, y) {
  ctx.save();
  for (const shade of names) {
    ctx.fillStyle = fill(ctx, shade);
    ctx.fillRect(x, y, 24, 14);
    ctx.fillStyle = color("text");
    ctx.fillText(shades[shade], x + 30, y + 12);
    x += ctx.measureText(shades[shade]).width + 50;
  }
  ctx.restore();
}
