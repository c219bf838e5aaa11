// Lanes: the rows above the area of a chart that name what goes on in it, so that no name lies upon a curve.
import {color, fill} from "./shades.js";

const row_px = 15, gap_px = 5, font = "600 11px sans-serif", most_rows = 8, longest_name_px = 72;

// Returns the pixels of a span within the area; the right one is left of the left one if it is not shown. Without end_s
// the span goes on.
export function ends({chartArea: area, scales: {x}}, begin_s, end_s) {
  return [Math.max(area.left, x.getPixelForValue(begin_s)), Math.min(area.right, x.getPixelForValue(end_s ?? x.max))];
}

const measure = document.createElement("canvas").getContext("2d");
function width_of(text) {
  measure.font = font;
  return measure.measureText(text).width;
}
// Returns the text, cut to the width.
function cut(text, width) {
  if (width_of(text) <= width) return text;
  let length = text.length;
  while (length > 0 && width_of(`${text.slice(0, length)}…`) > width) --length;
  return `${text.slice(0, length)}…`;
}

// Returns the rows of the groups that have something from `begin_s` to `end_s`: [{name, color, marks, spans}]. Spans that
// would meet are in different rows. `width`: of the area.
// `groups`: [{name, color, marks: [{mark, begin_s, end_s}], spans: [{name, shade, begin_s, end_s}]}]; name and marks may be missing.
export function rows_of(groups, begin_s, end_s, width) {
  const at = (time_s) => (width * (Math.min(Math.max(time_s, begin_s), end_s) - begin_s)) / (end_s - begin_s);
  const is_shown = (one) => one.begin_s < end_s && !(one.end_s <= begin_s);
  const rows = [];
  for (const {name, color: of, marks = [], spans = []} of groups) {
    const shown = marks.filter(is_shown), own = [];
    if (shown.length > 0) own.push({name, color: of, marks: shown, spans: [], taken: []});
    for (const span of spans.filter(is_shown)) {
      const text = width_of(span.name) + 6, left = Math.max(0, Math.min(at(span.begin_s), width - text));
      const right = Math.max(left + text, at(span.end_s ?? end_s));
      let row = own.find(({taken}) => taken.every(([from, to]) => right < from || left > to));
      if (!row) own.push(row = {name: own.length ? undefined : name, color: of, marks: [], spans: [], taken: []});
      row.spans.push(span);
      row.taken.push([left, right]);
    }
    rows.push(...own);
  }
  return rows.slice(0, most_rows);
}

// The plugin: `chart.$groups` are those of rows_of(). There is room for one row at least, so that the area seldom changes;
// the element around the canvas gets the height of the rows as --lanes.
export const lanes = {
  id: "lanes",
  beforeInit(chart) {
    chart.$groups = [];
    chart.$rows = [];
    chart.$lanes = {position: "top", weight: 0, options: {}, width: 0, height: 0, isHorizontal: () => true, draw() {}, update(width) {
      const {min, max} = chart.options.scales.x;
      chart.$rows = rows_of(chart.$groups, min, max, width);
      Object.assign(this, {width, height: gap_px + row_px * Math.max(1, chart.$rows.length)});
    }};
    Chart.layouts.addBox(chart, chart.$lanes);
  },
  afterUpdate({canvas, $lanes: {height}}) { canvas.parentNode.style.setProperty("--lanes", `${height}px`); },
  afterDatasetsDraw(chart) {
    const {ctx, chartArea: area, $rows: rows, $lanes: box} = chart;
    ctx.save();
    ctx.font = font;
    ctx.textBaseline = "middle";
    rows.forEach(({name, color: of, marks, spans}, i) => {
      const top = box.top + i * row_px, middle = top + row_px / 2;
      const bar = (shade, {begin_s, end_s}) => {
        const [left, right] = ends(chart, begin_s, end_s);
        ctx.fillStyle = fill(ctx, shade);
        if (right >= left) ctx.fillRect(left, top + 1, Math.max(2, right - left), row_px - 2);
        return left;
      };
      for (const one of marks) bar(one.mark, one);
      for (const span of spans) {
        const left = bar(span.shade, span), text = cut(span.name, area.width - 6);
        ctx.lineWidth = 3;
        ctx.strokeStyle = color("card");
        ctx.fillStyle = color(span.shade === "unsent" ? "text" : span.shade);
        const x = Math.max(area.left, Math.min(left + 3, area.right - width_of(text) - 3));
        ctx.strokeText(text, x, middle);
        ctx.fillText(text, x, middle);
      }
      if (name === undefined) return;
      ctx.textAlign = "right";
      ctx.fillStyle = color(of);
      ctx.fillText(cut(name, area.left - 6), area.left - 4, middle);
      ctx.textAlign = "left";
    });
    ctx.restore();
  },
};

// The width of the names beside the rows, for which the axis leaves room.
export const names_px = (groups) => Math.min(longest_name_px, Math.max(0, ...groups.map(({name}) => (name === undefined ? 0 : width_of(name) + 8))));
