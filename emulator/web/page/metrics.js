// The figures of /metrics (OpenMetrics).
const unescape = (text) => text.replace(/\\(.)/g, (_, c) => (c === "n" ? "\n" : c));

// Returns the samples, [{name, labels, value}], and the help of each family by its name.
export function parse(text) {
  const samples = [], help = new Map();
  for (const line of text.split("\n")) {
    const words = line.match(/^# HELP (\S+) (.*)$/);
    if (words) help.set(words[1], unescape(words[2]));
    const sample = line.match(/^(\w+)(?:\{(.*)\})? (\S+)$/);
    if (!sample) continue;
    const labels = {};
    for (const [, name, value] of (sample[2] ?? "").matchAll(/(\w+)="((?:[^"\\]|\\.)*)"/g)) labels[name] = unescape(value);
    samples.push({name: sample[1], labels, value: Number(sample[3])});
  }
  return {samples, help};
}

// Returns [{from_s, up_to_s, count}] of a histogram of an imu: the number in each class, without empty ones at either end.
export function buckets({samples}, name, imu) {
  let below = 0, from = 0;
  const all = samples.filter((s) => s.name === `${name}_bucket` && s.labels.imu === imu).map(({labels, value}) => {
    const count = value - below;
    below = value;
    const from_s = from;
    from = labels.le === "+Inf" ? Infinity : Number(labels.le);
    return {from_s, up_to_s: from, count};
  });
  const first = all.findIndex((b) => b.count > 0), last = all.findLastIndex((b) => b.count > 0);
  return first < 0 ? [] : all.slice(first, last + 1);
}

const units = [[1e-6, "µs"], [1e-3, "ms"], [1, "s"]];
const unit_of = (seconds) => (seconds < 1e-3 ? units[0] : seconds < 1 ? units[1] : units[2]);
export function duration(seconds) {
  if (seconds === undefined) return "–";
  const [unit, text] = unit_of(seconds);
  return `${+(seconds / unit).toPrecision(3)} ${text}`;
}
// Returns the text of a class of durations: "20–50 µs".
export function durations(from_s, up_to_s) {
  if (up_to_s === Infinity) return `> ${duration(from_s)}`;
  const [unit] = unit_of(up_to_s);
  return from_s === 0 ? `< ${duration(up_to_s)}` : `${+(from_s / unit).toPrecision(3)}–${duration(up_to_s)}`;
}
