// The page of a rack: its hosts and their runs.
import {$, count, element, fill, follow, often_ms, several, show} from "./elements.js";

const asked_seldom_s = 10;  // a status that is older than this is shown with its age

function duration(s) {
  const whole = Math.floor(s), two = (number) => String(number).padStart(2, "0");
  return `${Math.floor(whole / 3600)}:${two(Math.floor(whole / 60) % 60)}:${two(whole % 60)}`;
}

function clock_text(clock) {
  if (clock === null) return "no common clock";
  const steps = clock.steps ? `, set ${several(clock.steps, "time", "times")}` : "";
  if (clock.synchronised) return `clock ${clock.epoch}, error ${count(clock.error_us)} us${steps}`;
  return `clock ${clock.epoch}${clock.synchronised === undefined ? "" : ", not known to be synchronised"}${steps}`;
}

// The columns of an imu: head, its text, and whether a phone shows it.
const columns = [
  ["Hz", (imu) => imu.measured_hz.toFixed(1), true],
  ["samples", (imu) => count(imu.samples), true],
  ["missed", (imu) => count(imu.missed), true],
  ["late p99 us", (imu) => imu.late_p99_us.toFixed(1), true],
  ["max us", (imu) => imu.late_max_us.toFixed(1), false],
  ["first k", (imu) => (imu.first_k === null ? "" : String(imu.first_k)), false],
];
const cell = (name, text, is_always, attributes = {}) => element(name, {text, className: is_always ? "" : "wide-only", ...attributes});

function imu_table({imus}) {
  const heads = [["imu", null, true], ...columns].map(([head, , is_always]) => cell("th", head, is_always, {scope: "col"}));
  const rows = imus.map((imu) => element("tr", {}, element("th", {text: imu.name, scope: "row"}),
    ...columns.map(([, text, is_always]) => cell("td", text(imu), is_always))));
  return element("div", {className: "wide"}, element("table", {}, element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows)));
}

function run_elements(run) {
  const runs = run.state === "running";
  const head = element("h3", {text: run.name, className: runs ? "good" : ""});
  if (!runs) return [head, element("p", {className: "active", text: `imud@${run.name} ${run.why}`})];
  const faults = run.faults ? `; ${several(run.faults, "fault acts", "faults act")}` : "";
  return [head, element("p", {className: "note", text: `for ${duration(run.duration_s)}, version ${run.version}, truth ${run.truth_hz.toFixed(1)} Hz, ${clock_text(run.clock)}${faults}`}),
    imu_table(run)];
}

function host_section(host, number) {
  const id = `host${number}`;
  const title = element("h2", {id, text: host.ssh && host.ssh !== host.name ? `${host.name} (${host.ssh})` : host.name});
  const section = element("section", {}, title, ...(host.why ? [element("p", {className: "active", text: host.why})] : host.runs.flatMap(run_elements)));
  section.setAttribute("aria-labelledby", id);
  return section;
}

function state_text(status, runs, running) {
  const all = runs.length === 1 ? "The run is running." : `All ${count(runs.length)} runs on ${several(status.hosts.length, "host", "hosts")} are running.`;
  const state = status.good ? all
    : `${count(running)} of ${several(runs.length, "run", "runs")} ${running === 1 ? "is" : "are"} running.`;
  return status.age_s > asked_seldom_s ? `${state} The hosts were asked ${Math.round(status.age_s)} s ago.` : state;
}

follow((status) => {
  if (status === null) return 200;  // the first answers are on their way
  const runs = status.hosts.flatMap((host) => host.runs);
  const running = runs.filter((run) => run.state === "running").length;
  document.title = `${running}/${runs.length} imud rack`;
  show("#rack", status.rack);
  show("#state", state_text(status, runs, running));
  fill($("#remarks"), status.remarks, () => status.remarks.map((text) => element("li", {text})));
  fill($("#hosts"), status.hosts, () => status.hosts.map(host_section));
  return often_ms;
});
