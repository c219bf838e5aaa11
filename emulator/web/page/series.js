// The samples of one imu: what the plots show is read here.
import {quantities} from "./quantities.js";

export const window_s = 20;
// What marks the time up to a sample, if any sample since the one before it was so; the last that applies. `silent`: not
// sent for want of truth.
export const marks = ["extrapolated", "held", "silent"];
// Returns what shades such a time: `unsent`, whatever the cause, is of the sample itself, too.
const shade_of = ({mark, is_sent}) => (!is_sent || mark === "silent" ? "unsent" : mark);

// Returns the number of the first element of a sorted list that is not before the time.
function first_at(rows, time_s) {
  let low = 0, high = rows.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (rows[middle].time_s < time_s) low = middle + 1;
    else high = middle;
  }
  return low;
}

export class Series {
  // {time_s, k, is_first, mark, is_sent, offset_s, values, truths, solution}: `is_first` after a time without samples; `is_sent` is
  // false if nothing of the sample has left imud; `offset_s`: of the imu's clock from the simulation's time, as long as that
  // goes on; `values` and `truths` by quantity, SI.
  rows = [];
  spans = [];     // {key, begin_s, end_s, name, shade}: of faults and commands; without end_s it goes on
  first_s;        // the time of the first sample of the run that the page got
  #frozen = null;
  #last = null;   // {k, counts} of the last row
  #decimate = 0;  // of so many samples one is sent; 0: not known
  rate_hz = Infinity;   // of the imu

  // `decimate`: of the answer to `subscribe`.
  expect(decimate) { this.#decimate = decimate; }

  get newest() { return this.rows.at(-1); }

  // Takes the parameters of a notification `samples`.
  add(params) {
    params.time_s.forEach((time_s, i) => {
      if (time_s < this.newest?.time_s) this.clear();  // a new run
      this.rows.push(this.#row(params, time_s, i));
      this.first_s ??= time_s;
    });
    const old = first_at(this.rows, this.newest?.time_s - window_s) - 1;  // one before the window, for the line into it
    if (old > 0) this.rows.splice(0, old);
    this.spans = this.spans.filter(({end_s}) => !(end_s < this.rows[0]?.time_s));
  }

  #row(params, time_s, i) {
    const values = {}, truths = {}, k = params.k[i], last = this.newest;
    for (const {key, read, has_truth, band} of quantities) {
      const value = read ? read(params, i) : params[key]?.[i], truth = params[`true_${key}`]?.[i];
      if (value && value[0] !== null) values[key] = value;  // null: not known
      if (values[key] && band) values[band] = params[band][i];
      if (has_truth && truth && truth[0] !== null) truths[key] = truth;  // null: its truth has never come
    }
    const counts = marks.map((mark) => params[mark]?.[i] ?? 0);
    const is_first = !last || (this.#decimate > 0 && k - this.#last.k !== this.#decimate) ||
      (this.rate_hz < Infinity && time_s - last.time_s > (1.5 * this.#decimate) / this.rate_hz);
    // Of the samples since the last one the counts tell; of a first sample, its own status (bits 6 and 7).
    const status = params.status?.[i] ?? 0;
    const mark = is_first ? (status & 128 ? "held" : status & 64 ? "extrapolated" : undefined)
      : marks.findLast((_, of) => counts[of] > this.#last.counts[of]);
    this.#last = {k, counts};
    const truth_time_s = params.truth_time_s?.[i];  // stands still while motion is held
    const has_offset = truth_time_s != null && (!last || !(status & 128));
    return {time_s, k, is_first, mark, is_sent: params.sent?.[i] ?? true, values, truths, solution: params.solution?.[i],
      offset_s: has_offset ? time_s - truth_time_s : last?.offset_s ?? 0};
  }

  // Forgets the samples. Pause and supply, unlike faults, outlast a run of the truth.
  clear() {
    this.rows = [];
    this.spans = this.spans.filter(({fault, end_s}) => fault === undefined && end_s === undefined).map((span) => ({...span, begin_s: -Infinity}));
    this.#last = null;
    this.first_s = undefined;
  }

  freeze(on) {
    this.#frozen = on ? {rows: [...this.rows], spans: this.spans.map((span) => ({...span, end_s: span.end_s ?? this.newest?.time_s}))} : null;
  }
  get is_frozen() { return this.#frozen !== null; }
  get #shown() { return this.#frozen ?? this; }
  // The time of the newest sample that is shown; undefined if there is none.
  get newest_shown_s() { return this.#shown.rows.at(-1)?.time_s; }
  get newest_row_shown() { return this.#shown.rows.at(-1); }
  get offset_shown_s() { return this.#shown.rows.at(-1)?.offset_s ?? 0; }
  get spans_shown() { return this.#shown.spans; }
  // Returns why a sample was not sent.
  why_unsent({mark, time_s}) {
    const of = (key) => this.spans_shown.some((span) => span.key === key && span.begin_s <= time_s && !(span.end_s <= time_s));
    return of("power") ? "power off" : of("pause") ? "output paused" : mark === "silent" ? "no truth" : "power off, or too late";
  }

  // Returns the rows that a plot of this time needs: those in it, and one on either side.
  plotted(begin_s, end_s) {
    const {rows} = this.#shown;
    return rows.slice(Math.max(0, first_at(rows, begin_s) - 1), first_at(rows, end_s) + 1);
  }
  within(begin_s, end_s) {
    return this.#shown.rows.filter(({time_s}) => time_s >= begin_s && time_s <= end_s);
  }
  // Returns the spans of time, [{begin_s, end_s, mark: a shade}], in which motion was not known, or nothing was sent.
  marked(begin_s, end_s) {
    const spans = [];
    let before;
    for (const row of this.plotted(begin_s, end_s)) {
      const last = spans.at(-1), mark = before && (!before.is_sent ? "unsent" : shade_of(row));
      if (mark && !row.is_first) {
        if (last?.mark === mark && last.end_s === before.time_s) last.end_s = row.time_s;
        else spans.push({begin_s: before.time_s, end_s: row.time_s, mark});
      }
      before = row;
    }
    return spans;
  }
}

// Returns the points of a curve, whose line is broken where there are no samples: `value` of a row is undefined where it
// has none.
export function points(rows, x, value) {
  const list = [];
  for (const row of rows) {
    if (row.is_first && list.length > 0) list.push({x: (list.at(-1).x + x(row)) / 2, y: null});
    list.push({x: x(row), y: value(row) ?? null});
  }
  return list;
}
