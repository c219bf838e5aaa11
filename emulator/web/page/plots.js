// The plots of one imu: measurement over truth, error, and the histogram of lateness.
import {duration} from "./metrics.js";

export const window_s = 20;
const axes = ["x", "y", "z"];
const quantities = [
  {key: "rate", name: "Rate", unit: "rad/s"},
  {key: "specific_force", name: "Specific force", unit: "m/s²"},
];
const color = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
const short = (number) => (number == null ? "–" : Number(number).toPrecision(4));

// Draws spans of time, such as faults, behind the curves, and their names over these.
function each_span({chartArea: area, scales: {x}, ctx}, options, draw) {
  ctx.save();
  ctx.fillStyle = color("fault");
  (options.list?.() ?? []).forEach(({begin_s, end_s, name}, i) => {
    const left = Math.max(area.left, x.getPixelForValue(begin_s)), right = Math.min(area.right, x.getPixelForValue(end_s ?? x.max));
    if (right >= area.left && left <= area.right) draw(left, Math.max(2, right - left), name, i);
  });
  ctx.restore();
}
const spans = {
  id: "spans",
  beforeDatasetsDraw(chart, _, options) {
    const {ctx, chartArea: area} = chart;
    ctx.globalAlpha = 0.2;
    each_span(chart, options, (left, width) => ctx.fillRect(left, area.top, width, area.height));
    ctx.globalAlpha = 1;
  },
  afterDatasetsDraw(chart, _, options) {
    const {ctx, chartArea: area} = chart;
    ctx.font = "600 11px sans-serif";
    each_span(chart, options, (left, _, name, i) => (
      ctx.fillText(name, Math.max(area.left, Math.min(left + 3, area.right - ctx.measureText(name).width)), area.top + 12 + 12 * (i % 4))));
  },
};

export class Plots {
  #series = {};   // by quantity: {values: [x, y, z], truths, errors}, each a list of points
  #charts = [];   // of samples
  #lateness;
  newest_s = -Infinity;  // time of the newest sample
  #newest = {};
  spans = [];     // {begin_s, end_s, name}; without end_s it goes on

  constructor(container, table, imu) {
    this.table = table;
    for (const {key, name, unit} of quantities) {
      const series = (this.#series[key] = {values: [[], [], []], truths: [[], [], []], errors: [[], [], []]});
      this.#charts.push(this.#lines(container, `${name} of ${imu}, ${unit}: measured, and truth dashed`, [
        ...axes.map((axis, i) => ({label: axis, axis, data: series.values[i]})),
        ...axes.map((axis, i) => ({label: `${axis} truth`, axis, data: series.truths[i], dash: [5, 4]})),
      ]));
      this.#charts.push(this.#lines(container, `Error of ${name.toLowerCase()} of ${imu}, ${unit}: measured less truth`,
        axes.map((axis, i) => ({label: axis, axis, data: series.errors[i]}))));
    }
    const canvas = this.#canvas(container, `Lateness of ${imu}: share of the samples up to each duration`);
    this.#lateness = new Chart(canvas, {
      type: "bar",
      data: {labels: [], datasets: [{data: [], label: "share of the samples, %", backgroundColor: () => color("x")}]},
      options: {animation: false, maintainAspectRatio: false, plugins: {legend: {display: false}},
        scales: {y: {beginAtZero: true, title: {display: true, text: "%"}}}},
    });
    this.recolor();
  }

  #canvas(container, title) {
    const figure = document.createElement("figure"), caption = document.createElement("figcaption");
    const box = document.createElement("div"), canvas = document.createElement("canvas");
    box.className = "canvas";
    caption.textContent = title;
    canvas.setAttribute("role", "img");
    canvas.setAttribute("aria-label", title);
    box.append(canvas);
    figure.append(caption, box);
    container.append(figure);
    return canvas;
  }

  #lines(container, title, datasets) {
    return new Chart(this.#canvas(container, title), {
      type: "line",
      data: {datasets: datasets.map(({label, axis, data, dash}) => (
        {label, axis, data, borderDash: dash ?? [], borderWidth: dash ? 1.5 : 1.2, pointRadius: 0}))},
      plugins: [spans],
      options: {
        animation: false, parsing: false, normalized: true, maintainAspectRatio: false, events: [],
        plugins: {legend: {labels: {boxWidth: 18, boxHeight: 0}}, spans: {list: () => this.spans}},
        scales: {x: {type: "linear", ticks: {maxTicksLimit: 6, maxRotation: 0, callback: (s) => `${+s.toFixed(1)} s`}},
          y: {ticks: {maxTicksLimit: 5}}},
      },
    });
  }

  recolor() {
    for (const chart of [...this.#charts, this.#lateness]) {
      chart.options.color = color("text");
      for (const scale of Object.values(chart.options.scales)) {
        scale.ticks = {...scale.ticks, color: color("faint")};
        scale.grid = {color: color("line")};
      }
      for (const set of chart.data.datasets) if (set.axis) set.borderColor = set.backgroundColor = color(set.axis);
      chart.update("none");
    }
  }

  // Takes the parameters of a notification `samples`.
  add(params) {
    params.time_s.forEach((time_s, i) => {
      if (time_s < this.newest_s) this.clear();  // a new run
      this.newest_s = time_s;
      for (const {key} of quantities) {
        const series = this.#series[key], value = params[key][i], truth = params[`true_${key}`]?.[i];
        this.#newest[key] = {value, truth};
        for (let axis = 0; axis < axes.length; ++axis) {
          series.values[axis].push({x: time_s, y: value[axis]});
          if (!truth) continue;
          series.truths[axis].push({x: time_s, y: truth[axis]});
          series.errors[axis].push({x: time_s, y: truth[axis] === null ? null : value[axis] - truth[axis]});  // null: its truth has never come
        }
      }
    });
    for (const series of Object.values(this.#series))
      for (const list of Object.values(series).flat()) {
        const old = list.findIndex((point) => point.x >= this.newest_s - window_s);
        if (old > 0) list.splice(0, old);
      }
  }

  clear() {
    for (const series of Object.values(this.#series)) for (const list of Object.values(series).flat()) list.length = 0;
    this.spans = [];
    this.newest_s = -Infinity;
  }

  draw() {
    if (this.newest_s === -Infinity) return;
    this.spans = this.spans.filter(({end_s}) => !(end_s < this.newest_s - window_s));
    for (const chart of this.#charts) {
      chart.options.scales.x.max = this.newest_s;
      chart.options.scales.x.min = this.newest_s - window_s;
      chart.update("none");
    }
  }

  // The numbers for those who do not see the plots.
  describe() {
    const rows = quantities.filter(({key}) => this.#newest[key]).map(({key, name, unit}) => {
      const {value, truth} = this.#newest[key];
      return [`${name}, ${unit}`, ...axes.map((_, i) => short(value[i])), ...axes.map((_, i) => short(truth && truth[i] !== null ? value[i] - truth[i] : undefined))];
    });
    if (rows.length === 0) return;
    fill_table(this.table, ["", ...axes, ...axes.map((axis) => `error ${axis}`)], rows);
  }

  set_lateness(list) {
    const all = list.reduce((sum, b) => sum + b.count, 0);
    const [set] = this.#lateness.data.datasets;
    this.#lateness.data.labels = list.map((b) => duration(b.up_to_s));
    set.data = list.map((b) => (100 * b.count) / all);
    this.#lateness.update("none");
    this.#lateness.canvas.setAttribute("aria-label", "Lateness: " +
      list.map((b) => `up to ${duration(b.up_to_s)}: ${((100 * b.count) / all).toFixed(1)} %`).join(", "));
  }
}

// Gives a table its rows, which are known by the text of their first cells. Rows and cells that stay keep their
// elements, so that selections, and readers of the screen, stay where they are.
export function fill_table(table, head, rows) {
  const names = new Set([head, ...rows].map(([name]) => name)), old = new Map();
  for (const tr of [...table.rows]) {
    if (names.has(tr.cells[0].textContent)) old.set(tr.cells[0].textContent, tr);
    else tr.remove();
  }
  [head, ...rows].forEach((cells, place) => {
    const tr = old.get(cells[0]) ?? document.createElement("tr");
    cells.forEach((text, i) => {
      const cell = tr.cells[i] ?? tr.appendChild(document.createElement(i === 0 || place === 0 ? "th" : "td"));
      if (cell.tagName === "TH") cell.scope = place === 0 ? "col" : "row";
      if (cell.textContent !== String(text)) cell.textContent = text;
    });
    while (tr.cells.length > cells.length) tr.lastElementChild.remove();
    if (table.rows[place] !== tr) table.insertBefore(tr, table.rows[place] ?? null);
  });
}
