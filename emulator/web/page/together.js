// All imus in one view: a plot for each axis of a quantity, with a curve for each imu, on the clock of the first imu.
import {add_figure, draw_lines, line_chart, recolor} from "./charts.js";
import {choices, quantities, sent_values} from "./quantities.js";
import {points} from "./series.js";
import {range_of, zoom_by_pointer} from "./view.js";

const most_colors = 8;  // --imu0 and so on; further imus are dashed
const color_of = (i) => `imu${i % most_colors}`;

export class Together {
  #charts = [];   // [{chart, figure, axis}]
  #made_of = "";  // what the charts are for
  #newest_s;

  // `imus()`: [{name, series}].
  constructor(root, imus, view) {
    Object.assign(this, {root, imus, view, container: root.querySelector(".plots"), select: root.querySelector("select")});
    this.select.addEventListener("change", () => this.draw());
  }

  #chosen() {
    const [key, kind] = this.select.value.split(" ");
    return {quantity: quantities.find((one) => one.key === key), is_error: kind === "error"};
  }

  // The quantities that an imu has.
  #offer(all) {
    const has = quantities.filter(({key}) => key !== "position" && all.some(({series}) => series.newest?.values[key]));
    const options = has.flatMap(({key, name, has_truth}) => [[key, name], ...(has_truth ? [[`${key} error`, `Error of ${name.toLowerCase()}`]] : [])]);
    if (this.select.dataset.options === (this.select.dataset.options = String(options)) && this.select.options.length) return;
    const chosen = this.select.value;
    this.select.replaceChildren(...options.map(([value, text]) => Object.assign(document.createElement("option"), {value, textContent: text})));
    if (options.some(([value]) => value === chosen)) this.select.value = chosen;
  }

  #make(quantity, all) {
    for (const {chart} of this.#charts) chart.destroy();
    this.container.replaceChildren();
    this.#charts = quantity.axes.map((axis) => {
      const figure = add_figure(this.container);
      const chart = line_chart(figure.canvas, all.map(({name}, i) => ({label: name, color: color_of(i), is_dashed: i >= most_colors})),
        () => choices.unit(quantity).text, `clock of ${all[0].name}`);
      zoom_by_pointer(chart, this.view, () => this.#newest_s);
      recolor(chart);
      return {chart, figure, axis};
    });
  }

  recolor() {
    for (const {chart} of this.#charts) recolor(chart);
  }

  #all() { return this.imus().filter(({series}) => series.newest_shown_s !== undefined); }
  // An imu's clock may have begun with its supply, another one's with the truth. Returns what is added to each to have the
  // clock of the first.
  #moves_s(all) { return all.map(({series}) => all[0].series.offset_shown_s - series.offset_shown_s); }

  draw() {
    const all = this.#all();
    this.#offer(all);
    const {quantity, is_error} = this.#chosen();
    if (!quantity) return;
    const made_of = JSON.stringify([quantity.key, all.map(({name}) => name)]);
    if (made_of !== this.#made_of) this.#make(quantity, all);
    this.#made_of = made_of;
    const moves_s = this.#moves_s(all);
    this.#newest_s = Math.max(...all.map(({series}, i) => series.newest_shown_s + moves_s[i]));
    const [begin_s, end_s] = range_of(this.view, this.#newest_s, Math.min(...all.map(({series}, i) => series.first_s + moves_s[i])));
    const groups = all.map(({name, series}, i) => {
      const moved = (span) => ({...span, begin_s: span.begin_s + moves_s[i], end_s: span.end_s === undefined ? undefined : span.end_s + moves_s[i]});
      return {name, color: color_of(i), marks: series.marked(begin_s - moves_s[i], end_s - moves_s[i]).map(moved),
        spans: series.spans_shown.map(moved)};
    });
    const {factor, after} = choices.unit(quantity);
    this.#charts.forEach(({chart, figure, axis}, of) => {
      const words = is_error ? "measured less truth" : quantity.has_truth ? "measured" : quantity.words;
      figure.title(`${is_error ? "Error of " : ""}${is_error ? quantity.name.toLowerCase() : quantity.name} ${axis}`.trim() + `${after}: ${words}`);
      draw_lines(chart, all.map(({series}, i) => (
        points(series.plotted(begin_s - moves_s[i], end_s - moves_s[i]), (row) => row.time_s + moves_s[i], (row) => {
          const value = sent_values(row, quantity)?.[of], truth = row.truths[quantity.key]?.[of];
          if (value === undefined || (is_error && truth === undefined)) return undefined;
          return factor * (is_error ? value - truth : value);
        }))), begin_s, end_s, groups);
    });
  }

  pictures() { return this.#charts.map(({figure: {text, canvas}}) => ({text, canvas})); }
  table_shown() {
    const {quantity, is_error} = this.#chosen(), all = this.#all(), moves_s = this.#moves_s(all);
    if (!quantity) return [];
    const {factor, column} = choices.unit(quantity), name = `${is_error ? "error_of_" : ""}${quantity.key.replace(/_c$/, "")}`;
    const rows = [["imu", `time_of_${all[0].name}_s`, ...quantity.axes.map((axis) => `${axis ? `${name}_${axis}` : name}_${column}`)]];
    all.forEach(({name: imu, series}, i) => {
      for (const row of series.within(this.#newest_s - this.view.oldest_s - moves_s[i], this.#newest_s - this.view.newest_s - moves_s[i])) {
        const value = sent_values(row, quantity), truth = row.truths[quantity.key];
        rows.push([imu, +(row.time_s + moves_s[i]).toFixed(9),
          ...quantity.axes.map((_, axis) => (!value || (is_error && !truth) ? "" : factor * (is_error ? value[axis] - truth[axis] : value[axis])))]);
      }
    });
    return rows;
  }
}
