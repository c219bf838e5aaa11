// Charts over time: their look, and what is drawn behind and over their curves.
import {ends, lanes, names_px} from "./lanes.js";
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
    for (const {shade, begin_s, end_s} of list?.() ?? []) if (shade === "fault") draw(shade, begin_s, end_s);
    ctx.restore();
  },
  afterDatasetsDraw(chart) {
    if (!chart.$selection) return;
    const {ctx, chartArea: area} = chart, [a, b] = chart.$selection;
    ctx.save();
    ctx.fillStyle = color("x");
    ctx.globalAlpha = 0.2;
    ctx.fillRect(Math.min(a, b), area.top, Math.abs(a - b), area.height);
    ctx.restore();
  },
};

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

// Gives the time axis ticks at round times, as many as have room. No other ones: the ends of the axis are no round times.
function round_ticks(scale) {
  const least_px = 64, least_s = ((scale.max - scale.min) * least_px) / Math.max(least_px, scale.maxWidth);
  const power = 10 ** Math.floor(Math.log10(least_s));
  const step = [1, 2, 5, 10].map((n) => n * power).find((one) => one >= least_s * 0.999);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9)), first = Math.ceil(scale.min / step - 1e-6);
  scale.ticks = [];
  for (let i = first; i * step <= scale.max + 1e-6 * step; ++i)
    scale.ticks.push({value: i * step, label: (i * step).toFixed(decimals)});
}

// The legend has each curve as it is drawn, dashed or not, but no edges of bands.
const legend = {usePointStyle: true, pointStyleWidth: 26, boxHeight: 8, generateLabels: (chart) => chart.data.datasets.map((set, i) => (
  {text: set.label, datasetIndex: i, pointStyle: "line", strokeStyle: set.borderColor, fontColor: chart.options.color,
    lineWidth: 2, lineDash: set.borderDash})).filter((_, i) => !chart.data.datasets[i].$edge)};

// `datasets`: [{label, color: a name, is_dashed, edge}]; `edge`: "upper" or "lower" of a band, the two after one another. `unit()`:
// of the values. `clock`: of the times, for the axis. The pointer reads the values of a time.
export function line_chart(canvas, datasets, unit, clock, options = {}) {
  return new Chart(canvas, {
    type: "line",
    data: {datasets: datasets.map(({label, color: name, is_dashed, edge}) => (
      {label, $color: name, $edge: edge, data: [], borderDash: is_dashed ? [5, 4] : [], borderWidth: edge ? 0.4 : is_dashed ? 1.5 : 1.2,
        fill: edge === "upper" ? "+1" : false, pointRadius: 0, pointHoverRadius: edge ? 0 : 3}))},
    plugins: [spans, lanes],
    options: {
      animation: false, parsing: false, normalized: true, maintainAspectRatio: false,
      events: ["mousemove", "mouseout", "touchstart", "touchmove"],
      interaction: {mode: "index", axis: "x", intersect: false},
      plugins: {
        legend: {labels: legend}, spans: options,
        tooltip: {animation: false, filter: ({raw, dataset}) => raw.y !== null && dataset.$edge !== "lower", callbacks: {
          title: ([item]) => (item ? `${item.raw.x.toFixed(3)} s` : ""),
          label: ({dataset, raw}) => `${dataset.label} ${raw.y.toPrecision(5)} ${unit()}`.trim()}},
      },
      scales: {
        x: {type: "linear", title: {display: true, text: `${clock}, s`, padding: 0}, afterBuildTicks: round_ticks,
          ticks: {autoSkip: false, maxRotation: 0, callback: (_, i, ticks) => ticks[i].label}},
        y: {ticks: {maxTicksLimit: 5}, afterFit(scale) { scale.width = Math.max(scale.width, names_px(scale.chart.$groups)); }},
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
  const translucent = (hex) => hex + (hex.length === 4 ? "2" : "22");
  for (const set of chart.data.datasets) {
    if (!set.$color) continue;
    set.borderColor = color(set.$color);
    set.backgroundColor = set.$edge ? translucent(set.borderColor) : set.borderColor;
  }
  chart.update("none");
}

// Draws a time of each curve: `curves` has a list of points for each dataset. `groups`: of the rows above, rows_of().
export function draw_lines(chart, curves, begin_s, end_s, groups) {
  curves.forEach((list, i) => (chart.data.datasets[i].data = list));
  Object.assign(chart.options.scales.x, {min: begin_s, max: end_s});
  chart.$groups = groups;
  chart.update("none");
}
