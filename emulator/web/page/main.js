// The page: figures by /metrics, samples, events and commands by the control protocol.
import {Link} from "./link.js";
import {buckets, duration, parse, percentile} from "./metrics.js";
import {Plots, fill_table} from "./plots.js";
import {FaultForm} from "./faults.js";

const $ = (selector, root = document) => root.querySelector(selector);
const link = new Link();
const imus = new Map();   // by name: {root, plots, faults}
const sample_rate_hz = 25, draw_ms = 200, metrics_ms = 1000, log_lines = 200;
let fault_kinds = [];

function report(error) {
  const failure = $("#failure");
  failure.textContent = error ? error.message : "";
  failure.hidden = !error;
}
const command = (method, params) => link.call(method, params).then((result) => (report(), result), report);

function log(text) {
  const line = document.createElement("li");
  line.textContent = `${new Date().toLocaleTimeString()}  ${text}`;
  $("#log").prepend(line);
  while ($("#log").childElementCount > log_lines) $("#log").lastElementChild.remove();
}

// The samples of an imu are sent while its part of the page is open.
function watch(name) {
  const imu = imus.get(name), on = imu.root.open;
  if (imu.is_watched === on) return;
  imu.is_watched = on;
  command(on ? "subscribe" : "unsubscribe", {what: "samples", imu: name, ...(on && {rate_hz: sample_rate_hz})});
}

function add_imu(name) {
  const root = $("#imu").content.cloneNode(true).firstElementChild;
  root.dataset.imu = name;
  root.open = imus.size === 0;
  $("h2", root).textContent = name;
  $("#imus").append(root);
  const imu = {root, faults: new FaultForm($(".faults", root), $(".active", root), name, command),
    plots: new Plots($(".plots", root), $(".values", root), name)};
  imu.faults.set_kinds(fault_kinds);
  root.addEventListener("toggle", () => imus.get(name)?.root === root && watch(name));
  for (const button of root.querySelectorAll("[data-method]"))
    button.addEventListener("click", () => press(button, name));
  imus.set(name, imu);
}

// A button that switches something is pressed while it is off, and has the opposite effect then.
const opposite = {pause: ["resume", {}], power: ["power", {state: "on"}]};
function press(button, imu) {
  const {method, state} = button.dataset, pressed = button.getAttribute("aria-pressed") === "true";
  const [action, params] = pressed ? opposite[method] : [method, state ? {state} : {}];
  return command(action, {imu, ...params});
}
function set_pressed(imu, method, pressed) {
  $(`[data-method=${method}][aria-pressed]`, imu.root).setAttribute("aria-pressed", pressed);
}

// Begins or ends a span of an imu's plots. `key` is what ends with it: "pause", or the name of a fault.
function set_span(imu, key, name, on, time_s, fault) {
  const list = imu.plots.spans, open = list.find((span) => span.key === key && span.end_s === undefined);
  if (on && !open) list.push({key, name, fault, begin_s: time_s});
  if (!on && open) open.end_s = time_s;
  imu.faults.show_active(list);
}

function receive_event(event) {
  const {event: kind, ...rest} = event;
  const text = (value) => (typeof value === "object" ? JSON.stringify(value) : value);
  log([kind, ...Object.entries(rest).filter(([key]) => key !== "applied").map(([key, value]) => `${key} ${text(value)}`),
    ...(event.applied ?? []).map(({imu, sample}) => `${imu} from sample ${sample}`)].join(", "));
  // An event of one imu has the sample itself; one of a command has those of all imus that it applies to.
  for (const {imu: name, time_ns} of event.applied ?? [event]) {
    const imu = imus.get(name), time_s = time_ns == null ? imu?.plots.newest_s : time_ns / 1e9;
    if (!imu) continue;
    if (kind === "pause" || kind === "resume") {
      set_pressed(imu, "pause", kind === "pause");
      set_span(imu, "pause", "output paused", kind === "pause", time_s);
    }
    if (kind === "power" && event.state !== "cycle") {
      set_pressed(imu, "power", event.state === "off");
      set_span(imu, "power", "power off", event.state === "off", time_s);
    }
    if (kind === "fault.begin" || kind === "fault.end")
      set_span(imu, `fault ${event.name}`, `${event.target} ${event.kind}`, kind === "fault.begin", time_s, event.name);
  }
}

async function read_metrics() {
  const metrics = parse(await (await fetch("metrics", {cache: "no-store", headers: {Accept: "application/openmetrics-text"}})).text());
  const value = (name) => metrics.samples.find((s) => s.name === name)?.value;
  const names = [...new Set(metrics.samples.filter((s) => s.labels.imu !== undefined).map((s) => s.labels.imu))];
  for (const name of names) if (!imus.has(name)) add_imu(name);
  $("#truth").textContent = `${value("imud_run_seconds")?.toFixed(0)} s, truth ${value("imud_truth_rate_hertz")?.toFixed(1)} Hz, ` +
    `${value("imud_truth_accepted_total")} accepted` +
    (value("imud_truth_delay_seconds") === undefined ? "" : `, sampled ${duration(value("imud_truth_delay_seconds"))} later`);
  const seconds = value("imud_run_seconds");
  for (const [name, imu] of imus) {
    const of = (key) => metrics.samples.find((s) => s.name === key && s.labels.imu === name)?.value;
    const lateness = buckets(metrics, "imud_imu_lateness_seconds", name), samples = of("imud_imu_samples_total");
    const rate = imu.seconds < seconds ? (samples - imu.samples) / (seconds - imu.seconds) : 0;
    Object.assign(imu, {seconds, samples});
    const load = of("imud_imu_line_load_ratio");
    $(".figures", imu.root).textContent = `${rate.toFixed(1)} Hz, late p50 ${duration(percentile(lateness, 0.5))}, ` +
      `p99 ${duration(percentile(lateness, 0.99))}` + (load === undefined ? "" : `, line load ${(100 * load).toFixed(1)} %`);
    if (imu.root.open && lateness.length) imu.plots.set_lateness(lateness);
    if (imu.root.open) imu.plots.describe();
  }
  const rows = new Map();
  for (const {name, labels, value} of metrics.samples) {
    if (!name.endsWith("_total") || value === 0) continue;
    const family = name.replace(/_total$/, ""), column = labels.imu ?? family.match(/^imud_(record|control)/)?.[1] ?? "truth";
    const words = labels.cause ? `refused: ${labels.cause}` : metrics.help.get(family) ?? family;
    if (!rows.has(words)) rows.set(words, {});
    rows.get(words)[column] = value;
  }
  const columns = ["truth", ...names, "record", "control"].filter((c) => [...rows.values()].some((row) => c in row));
  fill_table($("#counters"), ["", ...columns], [...rows].map(([words, row]) => [words, ...columns.map((c) => row[c] ?? "")]));
}

async function begin() {
  $("#imus").replaceChildren();
  imus.clear();
  report();
  await read_metrics();
  const [{faults = []}, status] = await Promise.all([link.call("list"), link.call("status")]);
  fault_kinds = faults;
  for (const imu of imus.values()) imu.faults.set_kinds(faults);
  for (const {name, power, paused} of status.imus) {
    set_pressed(imus.get(name), "power", power === "off");
    set_pressed(imus.get(name), "pause", paused);
  }
  await link.call("subscribe", {what: "events"});
  for (const name of imus.keys()) watch(name);
}

link.addEventListener("open", () => {
  $("#connection").textContent = "connected";
  $("#connection").classList.add("open");
  log("connected");
  begin().catch(report);
});
link.addEventListener("lost", ({detail: pause_ms}) => {
  if ($("#connection").classList.contains("open")) log("the connection is lost");
  $("#connection").classList.remove("open");
  $("#connection").textContent = `not connected, next attempt in ${pause_ms / 1000} s`;
});
link.addEventListener("samples", ({detail}) => imus.get(detail.imu)?.plots.add(detail));
link.addEventListener("event", ({detail}) => receive_event(detail));
$("#mark").addEventListener("submit", async (submit) => {
  submit.preventDefault();
  const form = submit.target;
  if (await command("mark", {text: form.text.value})) form.reset();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const {plots} of imus.values()) plots.recolor();
});
setInterval(() => {
  if (!document.hidden) for (const {root, plots} of imus.values()) if (root.open) plots.draw();
}, draw_ms);
setInterval(() => {
  if (!document.hidden && $("#connection").classList.contains("open")) read_metrics().catch(report);
}, metrics_ms);
link.open();
