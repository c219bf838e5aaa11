// The plots and numbers of one imu: measurement over truth, error, and the histogram of lateness.
import {add_figure, draw_lines, line_chart, recolor} from "./charts.js";
import {durations} from "./metrics.js";
import {choices, lateness, offset_m, quantities, sent_values} from "./quantities.js";
import {points} from "./series.js";
import {color} from "./shades.js";
import {range_of, zoom_by_pointer} from "./view.js";

const colors = ["x", "y", "z"];  // of the axes
const color_of = (i, axes) => (axes.length > colors.length ? `imu${i}` : colors[i]);
const short = (number) => (number == null ? "–" : Number(number).toPrecision(4));

export class Plots {
  #charts = [];   // [{quantity, is_error, chart, figure}]
  #available = new Set();  // keys of the quantities that samples have had
  #lateness;

  // `view`: of all plots, `series`: of this imu.
  constructor(container, table, imu, series, view) {
    Object.assign(this, {container, table, imu, series, view});
    const figure = add_figure(container);
    figure.title(`Lateness of ${imu}: share of the samples in each class, %`);
    this.#lateness = {figure, chart: new Chart(figure.canvas, {
      type: "bar",
      data: {labels: [], datasets: [{data: [], label: "share of the samples, %", backgroundColor: () => color("x")}]},
      options: {animation: false, maintainAspectRatio: false, plugins: {legend: {display: false}},
        scales: {x: {ticks: {autoSkip: false, maxRotation: 90, font: {size: 11}}}, y: {beginAtZero: true, ticks: {maxTicksLimit: 5}}}},
    })};
    this.recolor();
  }

  // Makes the charts of a quantity, when samples have it and it is shown for the first time.
  #add(quantity) {
    const {axes, has_truth} = quantity;
    const curves = axes.map((label, i) => ({label, color: color_of(i, axes)}));
    const bands = quantity.band ? axes.flatMap((axis, i) => [{label: `${axis}, 1 σ`, color: colors[i], edge: "upper"}, {label: "", color: colors[i], edge: "lower"}]) : [];
    const truths = has_truth ? axes.map((axis, i) => ({label: `${axis} truth`, color: colors[i], is_dashed: true})) : [];
    for (const is_error of has_truth ? [false, true] : [false]) {
      const figure = add_figure(this.container), unit = () => choices.unit(quantity).text;
      const chart = line_chart(figure.canvas, is_error ? curves : [...curves, ...truths, ...bands], unit, `clock of ${this.imu}`,
        {shaded: () => this.series.marked(...this.range()), spans: () => this.series.spans_shown});
      chart.options.plugins.legend.display = axes.length > 1;
      if (quantity.is_logarithmic) chart.options.scales.y.type = "logarithmic";
      zoom_by_pointer(chart, this.view, () => this.series.newest_shown_s);
      recolor(chart);
      this.#charts.push({quantity, is_error, chart, figure});
    }
    // In the order of `quantities`, whichever comes first; lateness last.
    this.#charts.sort((a, b) => quantities.indexOf(a.quantity) - quantities.indexOf(b.quantity));
    this.container.append(...this.#charts.map(({figure}) => figure.figure), this.#lateness.figure.figure);
  }

  // Returns true if samples of this imu have the quantity.
  has(key) { return key === lateness || this.#available.has(key); }

  recolor() {
    for (const {chart} of [...this.#charts, this.#lateness]) recolor(chart);
  }

  // The times that are shown.
  range() { return range_of(this.view, this.series.newest_shown_s, this.series.first_s); }

  draw() {
    for (const quantity of quantities) {
      const {key} = quantity;
      if (this.series.newest?.values[key]) this.#available.add(key);
      if (this.has(key) && choices.is_shown(key) && !this.#charts.some((one) => one.quantity === quantity)) this.#add(quantity);
    }
    this.#lateness.figure.figure.hidden = !choices.is_shown(lateness);
    for (const {quantity, figure} of this.#charts) figure.figure.hidden = !choices.is_shown(quantity.key);
    if (this.series.newest_shown_s === undefined) return;
    const [begin_s, end_s] = this.range(), rows = this.series.plotted(begin_s, end_s);
    for (const {quantity, is_error, chart, figure} of this.#charts) {
      if (figure.figure.hidden) continue;
      figure.title(this.#title(quantity, is_error, rows));
      const {values, truths} = this.#reader(quantity, rows);
      const curve = (read) => quantity.axes.map((_, i) => points(rows, (row) => row.time_s, (row) => read(row)?.[i]));
      const error = (row) => truths(row) && values(row)?.map((value, i) => value - truths(row)[i]);
      const {factor} = choices.unit(quantity), edge = (row, i, sign) => {
        const sigma = row.values[quantity.band]?.[i];
        return sigma == null ? undefined : sign * factor * sigma;
      };
      const bands = quantity.band ? quantity.axes.flatMap((_, i) => [1, -1].map((sign) => points(rows, (row) => row.time_s, (row) => edge(row, i, sign)))) : [];
      draw_lines(chart, is_error ? curve(error) : [...curve(values), ...(quantity.has_truth ? curve(truths) : []), ...bands], begin_s, end_s,
        [{spans: this.series.spans_shown}]);
    }
  }

  #title({name, key, band, ...quantity}, is_error, rows) {
    const words = quantity.words + (band ? ", over 1 σ as the unit reports it" : "");
    const {after} = choices.unit(quantity), from = rows.find((row) => row.values.position)?.values.position;
    if (is_error) return `Error of ${name.toLowerCase()} of ${this.imu}${after}: measured less truth`;
    if (key !== "position" || !from) return `${name} of ${this.imu}${after}: ${words}`;
    const [latitude, longitude] = from.map((rad) => ((rad * 180) / Math.PI).toFixed(6));
    return `${name} of ${this.imu}${after} from ${latitude}°, ${longitude}°, ${from[2].toFixed(1)} m: ${words}`;
  }

  // Returns what reads values and truths of rows, in the units that are shown.
  #reader(quantity, rows) {
    const {factor} = choices.unit(quantity), {key} = quantity;
    const from = key === "position" ? rows.find((row) => row.values.position)?.values.position : undefined;
    const scaled = (list) => list?.map((value) => factor * value);
    return {
      values: (row) => {
        const sent = sent_values(row, quantity);
        return scaled(from && sent ? offset_m(sent, from) : sent);
      },
      truths: (row) => scaled(row.truths[key])};
  }

  // The numbers for those who do not see the plots.
  describe() {
    const newest = this.series.newest_row_shown;
    if (!newest) return;
    set_text(this.table.caption, (newest.is_sent ? "Newest sample" : `Nothing is sent: ${this.series.why_unsent(newest)}`) +
      `, at ${newest.time_s.toFixed(3)} s` + (newest.solution ? `; the unit's solution: ${newest.solution}` : ""));
    const plotted = this.series.plotted(...this.range());
    const is_there = ({key, axes}) => newest.values[key] && choices.is_shown(key) && axes.length <= colors.length;
    const rows = quantities.filter(is_there).map((quantity) => {
      const {name, axes, has_truth, words} = quantity, {values, truths} = this.#reader(quantity, plotted);
      const value = values(newest), truth = truths(newest), difference = value && truth && value.map((one, i) => one - truth[i]);
      return [`${name}${axes[0] !== "x" && axes.length > 1 ? ` (${axes.join(", ")})` : ""}${choices.unit(quantity).after}` +
          (has_truth ? "" : `, ${words}`),
        ...colors.map((_, i) => (i < axes.length ? short(value?.[i]) : "")),
        ...colors.map((_, i) => (has_truth ? short(difference?.[i]) : ""))];
    });
    fill_table(this.table, ["", ...colors, ...colors.map((axis) => `error ${axis}`)], rows);
  }

  // `list`: of the classes, each of which ends where the next one begins; buckets().
  set_lateness(list) {
    const all = list.reduce((sum, b) => sum + b.count, 0), {chart} = this.#lateness, [set] = chart.data.datasets;
    const share = ({count}) => (100 * count) / all;
    chart.data.labels = list.map(({from_s, up_to_s}) => durations(from_s, up_to_s));
    set.data = list.map(share);
    chart.update("none");
    chart.canvas.setAttribute("aria-label", "Lateness, by classes: " +
      list.map((b, i) => `${chart.data.labels[i]}: ${share(b).toFixed(1)} %`).join(", "));
  }

  // What is saved: the plots that are shown, [{text, canvas}], and the table of what these show.
  pictures() {
    return [...this.#charts, this.#lateness].filter(({figure}) => !figure.figure.hidden).map(({figure: {text, canvas}}) => ({text, canvas}));
  }
  table_shown() {
    const [begin_s, end_s] = this.range(), rows = this.series.within(begin_s, end_s);
    const shown = quantities.filter(({key}) => this.has(key) && choices.is_shown(key));
    const columns = [["time_s", ({time_s}) => time_s], ["sample", ({k}) => k], ["truth", ({mark}) => mark ?? "interpolated"],
      ["sent", ({is_sent}) => (is_sent ? "yes" : "no")]];
    for (const quantity of shown) {
      const {column} = choices.unit(quantity), {values, truths} = this.#reader(quantity, this.series.plotted(begin_s, end_s));
      const name = quantity.key.replace(/_c$/, "");
      quantity.axes.forEach((axis, i) => {
        const of_axis = axis ? `${name}_${axis}` : name;
        columns.push([`${of_axis}_${column}`, (row) => values(row)?.[i]]);
        if (quantity.has_truth) columns.push([`true_${of_axis}_${column}`, (row) => truths(row)?.[i]]);
      });
    }
    return [columns.map(([head]) => head), ...rows.map((row) => columns.map(([, read]) => read(row) ?? ""))];
  }
}

function set_text(element, text) {
  if (element.textContent !== text) element.textContent = text;
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
      set_text(cell, String(text));
    });
    while (tr.cells.length > cells.length) tr.lastElementChild.remove();
    if (table.rows[place] !== tr) table.insertBefore(tr, table.rows[place] ?? null);
  });
}
