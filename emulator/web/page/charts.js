// Charts over time: their look, and what is drawn behind and over their curves.
import {color, fill} from "./shades.js";

// `options`: {shaded(), spans(): of Series}.
const spans = {
  id: "spans",
  beforeDatasetsDraw(chart, _, {shaded, spans: list}) {
    const {ctx, chartArea: area} = chart;
    ctx.save();
    const fills = new Map();
    const draw = (shade, begin_s, end_s) => {
      const [left, right] = ends(chart, begin_s, end_s);
      if (!fills.has(shade)) fills.set(shade, fill(ctx, shade));
      ctx.fillStyle = fills.get(shade);
      if (right >= left) ctx.fillRect(left, area.top, Math.max(2, right - left), area.height);
    };
    for (const {mark, begin_s, end_s} of shaded?.() ?? []) draw(mark, begin_s, end_s);
    for (const {begin_s, end_s} of list?.() ?? []) draw("fault", begin_s, end_s);
    ctx.restore();
  },
  afterDatasetsDraw(chart, _, {spans: list}) {
    const {ctx, chartArea: area} = chart;
    ctx.save();
    ctx.font = "600 11px sans-serif";
    let line = 0;
    for (const {name, begin_s, end_s} of list?.() ?? []) {
      const [left, right] = ends(chart, begin_s, end_s);
      if (right < left) continue;
      const x = Math.max(area.left, Math.min(left + 3, area.right - ctx.measureText(name).width)), y = area.top + 12 + 12 * (line++ % 4);
      ctx.lineWidth = 3;
      ctx.strokeStyle = color("card");
      ctx.strokeText(name, x, y);
      ctx.fillStyle = color("fault");
      ctx.fillText(name, x, y);
    }
    if (chart.$selection) {
      const [a, b] = chart.$selection;
      ctx.fillStyle = color("x");
      ctx.globalAlpha = 0.2;
      ctx.fillRect(Math.min(a, b), area.top, Math.abs(a - b), area.height);
    }
    ctx.restore();
  },
};
// Returns the pixels of a span; the right one is left of the left one if it is not shown. Without end_s it goes on.
function ends({chartArea: area, scales: {x}}, begin_s, end_s) {
  return [Math.max(area.left, x.getPixelForValue(begin_s)), Math.min(area.right, x.getPixelForValue(end_s ?? x.max))];
}

const time_text = (s, step) => `${s.toFixed(step < 0.01 ? 3 : step < 0.1 ? 2 : step < 1 ? 1 : Number.isInteger(s) ? 0 : 1)} s`;

// Adds a figure to the container: {figure, canvas, title(text)}.
export function add_figure(container) {
  const figure = document.createElement("figure"), caption = document.createElement("figcaption");
  const box = document.createElement("div"), canvas = document.createElement("canvas");
  box.className = "canvas";
  canvas.setAttribute("role", "img");
  box.append(canvas);
  figure.append(caption, box);
  container.append(figure);
  return {figure, canvas, get text() { return caption.textContent; }, title(text) {
    if (caption.textContent === text) return;
    caption.textContent = text;
    canvas.setAttribute("aria-label", text);
  }};
}

// `datasets`: [{label, color: a name, is_dashed}]. `unit()`: of the values. The pointer reads the values of a time.
export function line_chart(canvas, datasets, unit, options = {}) {
  return new Chart(canvas, {
    type: "line",
    data: {datasets: datasets.map(({label, color: name, is_dashed}) => (
      {label, $color: name, data: [], borderDash: is_dashed ? [5, 4] : [], borderWidth: is_dashed ? 1.5 : 1.2, pointRadius: 0, pointHoverRadius: 3}))},
    plugins: [spans],
    options: {
      animation: false, parsing: false, normalized: true, maintainAspectRatio: false,
      events: ["mousemove", "mouseout", "touchstart", "touchmove"],
      interaction: {mode: "index", axis: "x", intersect: false},
      plugins: {
        legend: {labels: {boxWidth: 18, boxHeight: 0}}, spans: options,
        tooltip: {animation: false, filter: ({raw}) => raw.y !== null, callbacks: {
          title: ([item]) => (item ? `${item.raw.x.toFixed(3)} s` : ""),
          label: ({dataset, raw}) => `${dataset.label} ${raw.y.toPrecision(5)} ${unit()}`.trim()}},
      },
      scales: {
        x: {type: "linear", ticks: {maxTicksLimit: 6, maxRotation: 0, callback(s, i, ticks) {
          return time_text(s, ticks.length > 2 ? ticks[2].value - ticks[1].value : 1);
        }}},
        y: {ticks: {maxTicksLimit: 5}},
      },
    },
  });
}

export function recolor(chart) {
  chart.options.color = color("text");
  for (const scale of Object.values(chart.options.scales)) {
    scale.ticks = {...scale.ticks, color: color("faint")};
    scale.grid = {color: color("line")};
    scale.title = {...scale.title, color: color("faint")};
  }
  for (const set of chart.data.datasets) if (set.$color) set.borderColor = set.backgroundColor = color(set.$color);
  chart.update("none");
}

// Draws a time of each curve: `curves` has a list of points for each dataset.
export function draw_lines(chart, curves, begin_s, end_s) {
  curves.forEach((list, i) => (chart.data.datasets[i].data = list));
  Object.assign(chart.options.scales.x, {min: begin_s, max: end_s});
  chart.update("none");
}
