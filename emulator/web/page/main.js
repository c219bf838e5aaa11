// The page: figures by /metrics, samples, events and commands by the control protocol.
import {Link} from "./link.js";
import {Counted, counter_rows, imu_words, truth_words} from "./figures.js";
import {buckets, parse} from "./metrics.js";
import {Plots, fill_table} from "./plots.js";
import {choices, lateness, quantities} from "./quantities.js";
import {FaultForm} from "./faults.js";
import {save_picture, save_table} from "./save.js";
import {Series} from "./series.js";
import {list_shades} from "./shades.js";
import {Together} from "./together.js";
import {View} from "./view.js";

const $ = (selector, root = document) => root.querySelector(selector);
const link = new Link();
const imus = new Map();   // by name: {root, series, counted, plots, faults}
let truth_counted = new Counted();
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
  const imu = {root, series, counted: new Counted(), faults: new FaultForm($(".faults", root), $(".active", root), name, command),
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

// Words about a sample: its time is that of the imu's plots.
const sample_words = ({imu, sample, time_ns}) => `${imu} from sample ${sample}` + (time_ns == null ? "" : ` at ${(time_ns / 1e9).toFixed(3)} s`);

function receive_event(event) {
  const {event: kind, applied = event.sample === undefined ? [] : [event], ...rest} = event;
  const text = (value) => (typeof value === "object" ? JSON.stringify(value) : value);
  const others = Object.entries(rest).filter(([key]) => !["imu", "sample", "time_ns"].includes(key) || applied[0] !== event);
  log([kind, ...others.map(([key, value]) => `${key} ${text(value)}`), ...applied.map(sample_words)].join(", "));
  // An event of one imu has the sample itself; one of a command has those of all imus that it applies to.
  for (const {imu: name, time_ns} of event.applied ?? [event]) {
    const imu = imus.get(name), time_s = time_ns == null ? imu?.series.newest?.time_s : time_ns / 1e9;
    if (!imu) continue;
    if (kind === "pause" || kind === "resume") set_state(name, "pause", kind === "pause", time_s);
    if (kind === "power" && event.state !== "cycle") set_state(name, "power", event.state === "off", time_s);
    if (kind === "fault.begin" || kind === "fault.end") set_fault({...event, imu: name}, kind === "fault.begin");
  }
}
// `key`: "pause" or "power", whose button is pressed as long as it lasts.
function set_state(name, key, on, time_s) {
  const imu = imus.get(name);
  set_pressed(imu, key, on);
  set_span(imu, key, key === "pause" ? "output paused" : "power off", on, time_s);
}
// `fault`: of its event, or of `status`.
function set_fault({imu: name, name: fault, target, kind, time_ns}, on) {
  const imu = imus.get(name);
  if (imu) set_span(imu, `fault ${fault}`, `${target} ${kind}`, on, time_ns / 1e9, fault);
}

async function read_metrics() {
  const [text, status] = await Promise.all([
    fetch("metrics", {cache: "no-store", headers: {Accept: "application/openmetrics-text"}}).then((answer) => answer.text()), link.call("status")]);
  const metrics = parse(text);
  const names = status.imus.map(({name}) => name);
  for (const name of names) if (!imus.has(name)) add_imu(name);
  show_words($("#truth"), truth_words(metrics, truth_counted, status.counters.clock), "span");
  status.imus.forEach((of_imu, i) => {
    const {name} = of_imu, {root, series, counted, plots} = imus.get(name), late = buckets(metrics, "imud_imu_lateness_seconds", name);
    const faults = series.spans.filter(({fault, end_s}) => fault !== undefined && end_s === undefined).map((span) => span.name);
    show_words(root, imu_words(metrics, name, counted, {...status.counters.imus[i], ...of_imu}, faults), ".figures");
    if (!root.open) return;
    if (late.length) plots.set_lateness(late);
    plots.describe();
  });
  fill_table($("#counters"), ...counter_rows(metrics, names));
}
function show_words(root, {state, text}, place) {
  $(".state", root).textContent = state;
  $(place, root).textContent = text;
}

async function begin() {
  $("#imus").replaceChildren();
  imus.clear();
  truth_counted = new Counted();
  report();
  view.freeze(false);
  view.reset();
  await read_metrics();
  const [{faults = []}, status] = await Promise.all([link.call("list"), link.call("status")]);
  fault_kinds = faults;
  for (const imu of imus.values()) imu.faults.set_kinds(faults);
  for (const {name, power, paused, rate_hz} of status.imus) {
    imus.get(name).series.rate_hz = rate_hz;
    set_state(name, "power", power === "off", -Infinity);
    set_state(name, "pause", paused, -Infinity);
  }
  for (const fault of status.faults) set_fault(fault, true);
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
