// All imus in one view: a plot for each axis of a quantity, with a curve for each imu, on the time of the simulation.
import {add_figure, draw_lines, line_chart, recolor} from "./charts.js";
import {choices, quantities} from "./quantities.js";
import {points} from "./series.js";
import {zoom_by_pointer} from "./view.js";

const most_colors = 8;  // --imu0 and so on; further imus are dashed

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
      const chart = line_chart(figure.canvas, all.map(({name}, i) => ({label: name, color: `imu${i % most_colors}`, is_dashed: i >= most_colors})),
        () => choices.unit(quantity).text);
      zoom_by_pointer(chart, this.view, () => this.#newest_s);
      recolor(chart);
      return {chart, figure, axis};
    });
  }

  recolor() {
    for (const {chart} of this.#charts) recolor(chart);
  }

  draw() {
    const all = this.imus().filter(({series}) => series.newest_shown_s !== undefined);
    this.#offer(all);
    const {quantity, is_error} = this.#chosen();
    if (!quantity) return;
    const made_of = JSON.stringify([quantity.key, all.map(({name}) => name)]);
    if (made_of !== this.#made_of) this.#make(quantity, all);
    this.#made_of = made_of;
    // An imu's clock may have begun with its supply: curves are drawn on the time of the simulation.
    this.#newest_s = Math.max(...all.map(({series}) => series.newest_shown_s - series.offset_shown_s));
    const begin_s = this.#newest_s - this.view.oldest_s, end_s = this.#newest_s - this.view.newest_s;
    const {factor, text} = choices.unit(quantity);
    this.#charts.forEach(({chart, figure, axis}, of) => {
      figure.title(`${is_error ? "Error of " : ""}${is_error ? quantity.name.toLowerCase() : quantity.name} ${axis}, ${text}`.replace(" ,", ","));
      draw_lines(chart, all.map(({series}) => {
        const offset_s = series.offset_shown_s;
        return points(series.plotted(begin_s + offset_s, end_s + offset_s), (row) => row.time_s - offset_s, (row) => {
          const value = row.values[quantity.key]?.[of], truth = row.truths[quantity.key]?.[of];
          if (value === undefined || (is_error && truth === undefined)) return undefined;
          return factor * (is_error ? value - truth : value);
        });
      }), begin_s, end_s);
    });
  }

  pictures() { return this.#charts.map(({figure: {text, canvas}}) => ({text, canvas})); }
  table_shown() {
    const {quantity, is_error} = this.#chosen();
    if (!quantity) return [];
    const {factor, column} = choices.unit(quantity), name = `${is_error ? "error_of_" : ""}${quantity.key.replace(/_c$/, "")}`;
    const rows = [["imu", "truth_time_s", ...quantity.axes.map((axis) => `${axis ? `${name}_${axis}` : name}_${column}`)]];
    for (const {name: imu, series} of this.imus()) {
      const offset_s = series.offset_shown_s;
      for (const row of series.within(this.#newest_s - this.view.oldest_s + offset_s, this.#newest_s - this.view.newest_s + offset_s)) {
        const value = row.values[quantity.key], truth = row.truths[quantity.key];
        rows.push([imu, +(row.time_s - offset_s).toFixed(9),
          ...quantity.axes.map((_, i) => (!value || (is_error && !truth) ? "" : factor * (is_error ? value[i] - truth[i] : value[i])))]);
      }
    }
    return rows;
  }
}
