// The words of the header, and of the line of each imu, about what the run does now.
import {duration} from "./metrics.js";

const stopped_s = 0.5, stopped_steps = 5;  // a truth that comes later than both has stopped
const shortest_s = 0.5;  // of the time over which a rate is counted

// Returns the value of a figure of /metrics; undefined if there is none.
const value_of = (metrics, name, imu) => metrics.samples.find((s) => s.name === name && s.labels.imu === imu)?.value;

// What has been counted from one reading of the figures to the next.
export class Counted {
  #last;   // {seconds, counts} of the reading before
  #rates;  // by key

  // `seconds`: of the run; `counts`: by key. A reading too soon after the one before does not count.
  add(seconds, counts) {
    const last = this.#last;
    if (last && seconds >= last.seconds && seconds - last.seconds < shortest_s) return;
    this.#last = {seconds, counts};
    if (last && seconds > last.seconds) this.#rates = Object.fromEntries(Object.entries(counts).map(([key, count]) => (
      [key, (count - (last.counts[key] ?? 0)) / (seconds - last.seconds)])));
  }
  // So many a second; undefined before the second reading.
  rate(key) { return this.#rates?.[key]; }
}

// Returns {state, text}: `state` is empty while truth comes. `counted`: of the truth; `clock`: of the grids, by the method `status`.
export function truth_words(metrics, counted, clock) {
  const of = (name) => value_of(metrics, `imud_${name}`);
  const seconds = of("run_seconds"), accepted = of("truth_accepted_total"), since_s = of("truth_since_newest_seconds");
  counted.add(seconds, {accepted});
  const usual_hz = of("truth_rate_hertz"), rate_hz = counted.rate("accepted") ?? usual_hz, delay_s = of("truth_delay_seconds");
  const has_stopped = since_s > stopped_s && since_s * usual_hz > stopped_steps;
  const state = accepted === 0 ? "no truth yet" : has_stopped ? `truth stopped ${since(since_s)}` : "";
  return {state, text: [`run ${seconds?.toFixed(0)} s`, ...(state ? [] : [`truth ${rate_hz?.toFixed(1)} Hz`]), `${accepted} accepted`,
    ...(delay_s === undefined ? [] : [`sampled ${duration(delay_s)} later`]), ...clock_words(clock)].join(", ")};
}
function clock_words(clock) {
  if (!clock) return [];
  const {epoch, synchronised, error_us, steps} = clock;
  const error = synchronised ? [`clock error ${duration(error_us / 1e6)}`]
    : synchronised === undefined ? [] : [error_us === undefined ? "clock error not known" : "clock not synchronised"];
  return [`grids on ${epoch}`, ...error, `${steps} steps`];
}
function since(seconds) {
  const at = new Date(Date.now() - 1000 * seconds).toLocaleTimeString();
  return `${seconds < 10 ? seconds.toFixed(1) : seconds.toFixed(0)} s ago, at ${at} by this browser's clock`;
}

// Returns {state, text} of an imu. `status`: of the method `status`, with its counters; `faults`: the names of those that act.
export function imu_words(metrics, name, counted, status, faults) {
  const of = (key) => value_of(metrics, `imud_imu_${key}`, name);
  const counts = Object.fromEntries(["samples", "silent", "held", "extrapolated", "at_rest"].map((key) => [key, of(`${key}_total`)]));
  counted.add(value_of(metrics, "imud_run_seconds"), counts);
  const rate = (key) => counted.rate(key) ?? 0, samples = rate("samples"), late_us = status?.lateness_us, load = of("line_load_ratio");
  const unsent = status?.power === "off" ? "power off" : status?.paused ? "output paused"
    : counts.samples === 0 ? "no truth yet" : rate("silent") > 0.5 * samples ? "no truth" : "";
  const motion = rate("held") > 0 ? "motion held: no truth" : rate("at_rest") > 0 ? "at rest: no truth yet" : "";
  const extrapolated = Math.round((100 * rate("extrapolated")) / samples);
  return {
    state: [...(unsent ? [`nothing sent: ${unsent}`] : motion ? [motion] : []), ...(faults.length ? [`fault: ${faults.join(", ")}`] : [])].join("; "),
    text: [...(unsent || counted.rate("samples") === undefined ? [] : [`${(samples - rate("silent")).toFixed(1)} samples/s`]),
      ...(unsent || motion || !(extrapolated > 0) ? [] : [`${extrapolated} % extrapolated beyond the truth`]),
      ...(late_us ? [`late p50 ${duration(late_us.p50 / 1e6)}, p99 ${duration(late_us.p99 / 1e6)}, max ${duration(late_us.max / 1e6)}`] : []),
      ...(load === undefined ? [] : [`line load ${(100 * load).toFixed(1)} %`])].join(", "),
  };
}

// Returns the head and the rows of the table of all counters that are not 0, with a column for each owner.
export function counter_rows(metrics, names) {
  const rows = new Map();
  for (const {name, labels, value} of metrics.samples) {
    if (!name.endsWith("_total") || value === 0) continue;
    const family = name.replace(/_total$/, ""), column = labels.imu ?? family.match(/^imud_(record|control)/)?.[1] ?? "truth";
    const words = labels.cause ? `refused: ${labels.cause}` : metrics.help.get(family) ?? family;
    if (!rows.has(words)) rows.set(words, {});
    rows.get(words)[column] = value;
  }
  const columns = ["truth", ...names, "record", "control"].filter((c) => [...rows.values()].some((row) => c in row));
  return [["", ...columns], [...rows].map(([words, row]) => [words, ...columns.map((c) => row[c] ?? "")])];
}
