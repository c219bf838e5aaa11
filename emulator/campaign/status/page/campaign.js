// The page of a campaign: it reads the status of the folder again and again, as JSON.
import {$, count, element, fill, follow, often_ms, several, show} from "./elements.js";

const seldom_ms = 10000;
let status;

const percent = (share) => `${(100 * share).toFixed(2)} %`;
const share = ({runs, passes}) => (runs ? passes / runs : 0);
const name_of = (name) => (name === "cases" ? "whole cases" : name);

// --- Pass rates ---
const svg_space = "http://www.w3.org/2000/svg";
function drawn(name, attributes) {
  const one = document.createElementNS(svg_space, name);
  for (const [key, value] of Object.entries(attributes)) one.setAttribute(key, value);
  return one;
}
function bar({runs, passes, wilson_95: [low, high]}) {
  const picture = drawn("svg", {viewBox: "0 0 100 10", preserveAspectRatio: "none", "aria-hidden": "true"});
  picture.append(drawn("rect", {class: "share", x: 0, y: 1, height: 8, width: 100 * share({runs, passes})}),
    drawn("rect", {class: "all", x: 0, y: 1, height: 8, width: 100}));
  if (runs) picture.append(drawn("line", {class: "interval", x1: 100 * low, x2: 100 * high, y1: 5, y2: 5}));
  return picture;
}
function rate_row(name, rate) {
  const {runs, passes, wilson_95: [low, high]} = rate;
  const texts = runs ? [`${count(passes)} of ${count(runs)}`, percent(share(rate)), `${(100 * low).toFixed(2)} to ${percent(high)}`] : ["none has run", "", ""];
  const cell = element("td", {className: "bar"}, bar(rate));
  return element("tr", {}, element("th", {text: name, scope: "row"}), cell, ...texts.map((text) => element("td", {text})));
}
function rate_table(first, rows) {
  const heads = [first, "", "passed", "share", "95 % interval"].map((text) => element("th", {text, scope: "col"}));
  return [element("thead", {}, element("tr", {}, ...heads)), element("tbody", {}, ...rows)];
}
function show_axes() {
  const {axes, rates} = status;
  $("#by-axis").hidden = axes.length === 0;
  fill($("#rate"), rates.map(({name}) => name), () => rates.map(({name}, i) => element("option", {text: name_of(name), value: i, selected: i === 0})));
  const chosen = Number($("#rate").value);
  fill($("#axes"), [chosen, axes], () => axes.map(({name, is_divided, values}) => {
    if (!is_divided) return element("p", {className: "note", text: `${name} has too many values for a table.`});
    const caption = element("caption", {text: name});
    const rows = values.map(({value, rates}) => rate_row(value === "" ? "(none)" : value, rates[chosen]));
    return element("div", {className: "wide"}, element("table", {}, caption, ...rate_table("value", rows)));
  }));
}

// --- The rest ---
function state_text() {
  const {cases, cases_done, running, cases_per_s, left, shards_present, shards_read} = status;
  if (shards_read < shards_present) return `Reading the results: ${count(shards_read)} of ${count(shards_present)} files.`;
  if (cases_done === cases) return `All ${count(cases)} cases are done.`;
  const hosts = new Set(running.map(({host}) => host)).size, processes = new Set(running.map(({host, process}) => `${host} ${process}`)).size;
  const at_work = running.length ? `${several(processes, "process runs", "processes run")} on ${several(hosts, "host", "hosts")}` : "nothing runs";
  const rate = running.length && cases_per_s !== null ? `, ${cases_per_s.toPrecision(3)} cases per second` : "";
  const time_left = left === null ? "" : `, ${left} left`;
  return `${count(cases_done)} of ${count(cases)} cases are done; ${at_work}${rate}${time_left}.`;
}
function show_status() {
  const {cases, cases_done, failed, expectations_failed, incomplete, damaged, running, rates, failed_cases} = status;
  show("#plan", `${status.plan}, imud ${status.version}${status.build ? `, build ${status.build.slice(0, 12)}` : ""}`);
  document.title = `${Math.floor(100 * cases_done / cases)} % imud campaign`;
  $("#done").value = cases_done / cases;
  show("#state", state_text());
  show("#counts", `${count(failed)} could not be run, ${count(expectations_failed)} with failed expectations, ${count(incomplete)} otherwise incomplete; ` +
    `${count(status.shards_whole)} of ${count(status.shards)} files are whole.`);
  const faults = [...damaged, ...(status.difference_of_imud ? [`${status.difference_of_imud}: go on with that imud, or run the plan into another folder`] : [])];
  fill($("#faults"), faults, () => faults.map((text) => element("li", {text})));
  $("#resume").hidden = running.length > 0 || status.difference_of_imud !== "" || (cases_done === cases && damaged.length === 0);
  show("#resume code", status.resume);
  fill($("#rates"), rates, () => rate_table("", rates.map((rate) => rate_row(name_of(rate.name), rate))));
  show_axes();
  const all_failed = failed + expectations_failed + incomplete;
  show("#failed-note", all_failed === 0 ? "None." : (failed_cases.length < all_failed ? `The first ${failed_cases.length} of ${count(all_failed)}. ` : "") +
    "Each command runs its case alone, with a record.");
  fill($("#failed"), failed_cases, () => failed_cases.map((one) => element("li", {},
    element("strong", {text: `Case ${one.case}`}), ` seed ${one.seed}${one.axes ? `, ${one.axes}` : ""}: `,
    element("span", {className: "why", text: one.why}), element("code", {text: one.repeat}))));
}
$("#rate").addEventListener("change", show_axes);
follow((answer) => {
  status = answer;
  show_status();
  const {shards_read, shards_present, cases, cases_done} = status;
  return shards_read < shards_present ? 0 : cases_done === cases ? seldom_ms : often_ms;
});
