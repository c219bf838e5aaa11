// The time that all plots show: live or frozen, and how much of it; and the pointer's ways to change that.
import {window_s} from "./series.js";

const shortest_s = 0.05;

// Times are ages: seconds before the newest sample that an imu shows. Dispatches "change".
export class View extends EventTarget {
  is_frozen = false;
  oldest_s = window_s;
  newest_s = 0;

  get is_zoomed() { return this.oldest_s < window_s || this.newest_s > 0; }
  freeze(on) {
    this.is_frozen = on;
    if (!on) this.#set(this.oldest_s - this.newest_s, 0);
    else this.#changed();
  }
  // Shows the ages from `a` to `b`. Only a live view must end at the newest sample: others are frozen.
  select(a, b) {
    if (Math.abs(a - b) < shortest_s) return;
    this.is_frozen = true;
    this.#set(Math.max(a, b), Math.min(a, b));
  }
  // Shows `factor` times as long a time, where the age `at` keeps its place. A live view stays at the newest sample.
  zoom(factor, at = (this.oldest_s + this.newest_s) / 2) {
    const center = this.is_frozen ? at : 0;
    const length = Math.max(shortest_s, Math.min(window_s, factor * (this.oldest_s - this.newest_s)));
    const share = (center - this.newest_s) / (this.oldest_s - this.newest_s);
    const newest = Math.max(0, Math.min(window_s - length, center - share * length));
    this.#set(newest + length, newest);
  }
  reset() { this.#set(window_s, 0); }

  #set(oldest_s, newest_s) {
    this.oldest_s = Math.min(window_s, oldest_s);
    this.newest_s = Math.max(0, newest_s);
    this.#changed();
  }
  #changed() { this.dispatchEvent(new Event("change")); }
}

// Returns the begin and the end of what a view shows on a clock whose newest time is `newest_s`. No time before 0 is shown,
// unless the first sample is earlier: the clock had not begun.
export function range_of(view, newest_s, first_s) {
  const end_s = newest_s - view.newest_s, begin_s = newest_s - view.oldest_s;
  return [Math.max(begin_s, Math.min(0, first_s, end_s - shortest_s)), end_s];
}

// Lets the pointer zoom a chart: a drag selects a time, the wheel on the time axis (or anywhere with Ctrl) changes its
// length, a double click shows the whole again. `newest_s()`: the time of age 0 on its time axis.
export function zoom_by_pointer(chart, view, newest_s) {
  const {canvas} = chart;
  const age = (x) => newest_s() - chart.scales.x.getValueForPixel(Math.max(chart.chartArea.left, Math.min(chart.chartArea.right, x)));
  canvas.addEventListener("wheel", (event) => {
    if (!event.ctrlKey && event.offsetY < chart.chartArea.bottom) return;  // the page scrolls
    event.preventDefault();
    view.zoom(event.deltaY > 0 ? 1.25 : 0.8, age(event.offsetX));
  }, {passive: false});
  canvas.addEventListener("dblclick", () => view.reset());
  let from = null;
  const show = (to) => {
    chart.$selection = from === null ? null : [from, to];
    chart.render();
  };
  const end = () => {
    from = null;
    show();
  };
  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || newest_s() === undefined) return;
    canvas.setPointerCapture(event.pointerId);
    from = event.offsetX;
  });
  canvas.addEventListener("pointermove", (event) => from !== null && show(event.offsetX));
  canvas.addEventListener("pointercancel", end);
  canvas.addEventListener("pointerup", (event) => {
    if (from !== null && Math.abs(event.offsetX - from) > 8) view.select(age(from), age(event.offsetX));
    end();
  });
}
