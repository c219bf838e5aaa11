// The page: figures by /metrics, samples, events and commands by the control protocol.
import {Link} from "./link.js";
import {buckets, duration, parse} from "./metrics.js";
import {Plots, fill_table} from "./plots.js";
import {choices, lateness, quantities} from "./quantities.js";
import {FaultForm} from "./faults.js";
import {save_picture, save_table} from "./save.js";
import {Series} from "./series.js";
import {list_shades, shades} from "./shades.js";
import {Together} from "./together.js";
import {View} from "./view.js";

const $ = (selector, root = document) => root.querySelector(selector);
const link = new Link();
const imus = new Map();   // by name: {root, series, plots, faults}
const view = new View();
const together = new Together($("#together"), () => [...imus].map(([name, {series}]) => ({name, series})), view);
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

// The samples of an imu are sent while its part of the page, or the view of all imus, is open.
async function watch(name) {
  const imu = imus.get(name), on = imu.root.open || (together.root.open && !together.root.hidden);
  if (imu.is_watched === on) return;
  imu.is_watched = on;
  const result = await command(on ? "subscribe" : "unsubscribe", {what: "samples", imu: name, ...(on && {rate_hz: sample_rate_hz})});
  if (on && result) imu.series.expect(result.subscribed[0].decimate);
}

function add_imu(name) {
  const root = $("#imu").content.cloneNode(true).firstElementChild;
  root.dataset.imu = name;
  root.open = imus.size === 0;
  $("h2", root).textContent = name;
  $("#imus").append(root);
  const series = new Series();
  const imu = {root, series, faults: new FaultForm($(".faults", root), $(".active", root), name, command),
    plots: new Plots($(".plots", root), $(".values", root), name, series, view)};
  imu.faults.set_kinds(fault_kinds);
  root.addEventListener("toggle", () => imus.get(name)?.root === root && (watch(name), draw()));
  for (const button of root.querySelectorAll("[data-method]"))
    button.addEventListener("click", () => press(button, name));
  save_by_buttons(root, name, () => imu.plots);
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

// Begins or ends a span of an imu's plots. `key` is what ends with it: "pause", or the name of a fault. In other spans than
// faults nothing is sent.
function set_span(imu, key, name, on, time_s, fault) {
  const list = imu.series.spans, open = list.find((span) => span.key === key && span.end_s === undefined);
  if (on && !open) list.push({key, name, fault, shade: fault === undefined ? "unsent" : "fault", begin_s: time_s});
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
    const imu = imus.get(name), time_s = time_ns == null ? imu?.series.newest?.time_s : time_ns / 1e9;
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
  const [text, status] = await Promise.all([
    fetch("metrics", {cache: "no-store", headers: {Accept: "application/openmetrics-text"}}).then((answer) => answer.text()), link.call("status")]);
  const metrics = parse(text), counters = status.counters.imus;
  const value = (name) => metrics.samples.find((s) => s.name === name)?.value;
  const names = [...new Set(metrics.samples.filter((s) => s.labels.imu !== undefined).map((s) => s.labels.imu))];
  for (const name of names) if (!imus.has(name)) add_imu(name);
  $("#truth").textContent = `${value("imud_run_seconds")?.toFixed(0)} s, truth ${value("imud_truth_rate_hertz")?.toFixed(1)} Hz, ` +
    `${value("imud_truth_accepted_total")} accepted` +
    (value("imud_truth_delay_seconds") === undefined ? "" : `, sampled ${duration(value("imud_truth_delay_seconds"))} later`);
  const seconds = value("imud_run_seconds");
  for (const [name, imu] of imus) {
    const of = (key) => metrics.samples.find((s) => s.name === key && s.labels.imu === name)?.value;
    const late = buckets(metrics, "imud_imu_lateness_seconds", name), samples = of("imud_imu_samples_total");
    const rate = imu.seconds < seconds ? (samples - imu.samples) / (seconds - imu.seconds) : 0;
    Object.assign(imu, {seconds, samples});
    const load = of("imud_imu_line_load_ratio");
    const late_us = counters?.find((one) => one.name === name)?.lateness_us;
    $(".figures", imu.root).textContent = `${rate.toFixed(1)} Hz` +
      (late_us ? `, late p50 ${duration(late_us.p50 / 1e6)}, p99 ${duration(late_us.p99 / 1e6)}, max ${duration(late_us.max / 1e6)}` : "") +
      (load === undefined ? "" : `, line load ${(100 * load).toFixed(1)} %`) + (imu.series.newest?.mark ? `, ${shades[imu.series.newest.mark]}` : "");
    if (imu.root.open && late.length) imu.plots.set_lateness(late);
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
  view.freeze(false);
  view.reset();
  await read_metrics();
  const [{faults = []}, status] = await Promise.all([link.call("list"), link.call("status")]);
  fault_kinds = faults;
  for (const imu of imus.values()) imu.faults.set_kinds(faults);
  for (const {name, power, paused, rate_hz} of status.imus) {
    imus.get(name).series.rate_hz = rate_hz;
    set_pressed(imus.get(name), "power", power === "off");
    set_pressed(imus.get(name), "pause", paused);
  }
  together.root.hidden = imus.size < 2;
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
link.addEventListener("samples", ({detail}) => imus.get(detail.imu)?.series.add(detail));
link.addEventListener("event", ({detail}) => receive_event(detail));
$("#mark").addEventListener("submit", async (submit) => {
  submit.preventDefault();
  const form = submit.target;
  if (await command("mark", {text: form.text.value})) form.reset();
});
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
  for (const {plots} of imus.values()) plots.recolor();
  together.recolor();
  list_shades($("#shades"));
});
together.root.addEventListener("toggle", () => {
  imus.forEach((_, name) => watch(name));
  draw();
});
save_by_buttons(together.root, "all", () => together);

// --- What the plots show ---
function save_by_buttons(root, name, what) {
  const title = () => `imud: ${name}, ${$("#connection").textContent}, ${new Date().toLocaleString()}`;
  $("[data-save=picture]", root).addEventListener("click", () => save_picture(`imud-${name}`, title(), what().pictures()).catch(report));
  $("[data-save=table]", root).addEventListener("click", () => save_table(`imud-${name}`, what().table_shown()));
}
function draw() {
  if (document.hidden) return;
  for (const {root, plots} of imus.values()) if (root.open) plots.draw();
  if (together.root.open) together.draw();
  for (const box of $("#shown").querySelectorAll("input"))
    box.parentElement.hidden = ![...imus.values()].some(({plots}) => plots.has(box.value));
}
const seconds = (s) => `${+s.toPrecision(3)} s`;
view.addEventListener("change", () => {
  for (const {series} of imus.values()) if (series.is_frozen !== view.is_frozen) series.freeze(view.is_frozen);
  $("#freeze").setAttribute("aria-pressed", view.is_frozen);
  $("#freeze").textContent = view.is_frozen ? "Live again" : "Freeze plots";
  $("#zoom-reset").disabled = !view.is_zoomed;
  $("#shown-time").textContent = (view.is_frozen ? "The plots are frozen" : "") +
    (view.is_zoomed ? `${view.is_frozen ? ", and show" : "The plots show"} ${seconds(view.oldest_s - view.newest_s)}` +
      (view.newest_s > 0 ? `, up to ${seconds(view.newest_s)} before the newest sample then` : "") : "") +
    (view.is_frozen || view.is_zoomed ? "." : "");
  draw();
  for (const {root, plots} of imus.values()) if (root.open) plots.describe();
});
$("#freeze").addEventListener("click", () => view.freeze(!view.is_frozen));
$("#zoom-in").addEventListener("click", () => view.zoom(0.5));
$("#zoom-out").addEventListener("click", () => view.zoom(2));
$("#zoom-reset").addEventListener("click", () => view.reset());
$("#units").checked = choices.other_units;
$("#units").addEventListener("change", () => (choices.other_units = $("#units").checked));
for (const {key, name} of [...quantities, {key: lateness, name: "Lateness"}]) {
  const box = Object.assign(document.createElement("input"), {type: "checkbox", value: key, checked: choices.is_shown(key)});
  const label = document.createElement("label");
  label.append(box, ` ${name}`);
  box.addEventListener("change", () => choices.show(key, box.checked));
  $("#shown").append(label);
}
choices.addEventListener("change", () => {
  draw();
  for (const {root, plots} of imus.values()) if (root.open) plots.describe();
});
list_shades($("#shades"));
setInterval(() => view.is_frozen || draw(), draw_ms);
setInterval(() => {
  if (!document.hidden && $("#connection").classList.contains("open")) read_metrics().catch(report);
}, metrics_ms);
link.open();
