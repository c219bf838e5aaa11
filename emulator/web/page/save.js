// Files that the viewer saves: a picture of plots, and a table of what they show.
import {color, draw_shades} from "./shades.js";

function save(name, blob) {
  const link = Object.assign(document.createElement("a"), {href: URL.createObjectURL(blob), download: name.replace(/[^\w.-]+/g, "_")});
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 60000);
}

// `pictures`: [{text, canvas}]. The legend of the shades stands below.
export async function save_picture(name, title, pictures) {
  const margin = 16, gap = 12, text_px = 20, columns = Math.min(pictures.length, 3), scale = devicePixelRatio;
  const widths = pictures.map(({canvas}) => canvas.width / scale), heights = pictures.map(({canvas}) => canvas.height / scale);
  const width = Math.max(...widths), height = Math.max(...heights) + text_px + gap, lines = Math.ceil(pictures.length / columns);
  const canvas = document.createElement("canvas"), ctx = canvas.getContext("2d");
  canvas.width = scale * Math.max(560, 2 * margin + columns * (width + gap));
  canvas.height = scale * (2 * margin + 2 * text_px + lines * height + 44);
  ctx.scale(scale, scale);
  ctx.fillStyle = color("card");
  ctx.fillRect(0, 0, canvas.width, canvas.height);
  ctx.fillStyle = color("text");
  ctx.font = "600 15px sans-serif";
  ctx.fillText(title, margin, margin + 14);
  ctx.font = "13px sans-serif";
  pictures.forEach(({text, canvas: plot}, i) => {
    const x = margin + (i % columns) * (width + gap), y = margin + 2 * text_px + Math.floor(i / columns) * height;
    ctx.fillText(text, x, y, width);
    ctx.drawImage(plot, x, y + 6, widths[i], heights[i]);
  });
  draw_shades(ctx, margin, margin + 2 * text_px + lines * height, canvas.width / scale - 2 * margin);
  save(`${name}.png`, await new Promise((done) => canvas.toBlob(done, "image/png")));
}

// `rows`: of cells, the first one the header.
export function save_table(name, rows) {
  const cell = (value) => (/[",\n\r]/.test(value) ? `"${String(value).replaceAll('"', '""')}"` : value);
  save(`${name}.csv`, new Blob(rows.map((row) => `${row.map(cell).join(",")}\n`), {type: "text/csv"}));
}
