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

// Returns [{up_to_s, count}] of a histogram of an imu: the number in each bucket, without empty ones at either end.
export function buckets({samples}, name, imu) {
  let below = 0;
  const all = samples.filter((s) => s.name === `${name}_bucket` && s.labels.imu === imu).map(({labels, value}) => {
    const count = value - below;
    below = value;
    return {up_to_s: labels.le === "+Inf" ? Infinity : Number(labels.le), count};
  });
  const first = all.findIndex((b) => b.count > 0), last = all.findLastIndex((b) => b.count > 0);
  return first < 0 ? [] : all.slice(first, last + 1);
}

export function duration(seconds) {
  if (seconds === undefined) return "–";
  if (seconds === Infinity) return "> 10 s";
  return seconds < 1e-3 ? `${+(1e6 * seconds).toPrecision(3)} µs` : seconds < 1 ? `${+(1e3 * seconds).toPrecision(3)} ms` : `${seconds} s`;
}
