// The faults of one imu: buttons that begin usual ones, a form that begins any, and the active ones with a button to
// end each.
const usual_s = 5;
const usual = [
  {text: "Gyro stuck", target: "gyro", kind: "stuck"},
  {text: "Gyro bias 0.1 rad/s", target: "gyro.x", kind: "bias", value: 0.1},
  {text: "Accelerometer dead", target: "accelerometer", kind: "dead"},
  {text: "Messages missing", target: "message", kind: "missing"},
  {text: "Supply off", target: "power", kind: "off"},
];
// Returns "rad/s" of "rad_per_s", as keys spell it.
const symbols = {t: "T", pa: "Pa", c: "°C"};
const unit_text = (key = "") => key.split("_per_").map((one) => symbols[one] ?? one.replace("2", "²")).join("/");
const element = (tag, properties = {}, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};

export class FaultForm {
  #kinds = [];
  #kind;
  #target;
  #fields;

  constructor(form, active, imu, command) {
    Object.assign(this, {form, active, imu, command});
    form.addEventListener("submit", (event) => {
      event.preventDefault();
      this.#begin();
    });
  }

  // `kinds`: of the method `list`: [{name, summary, seam, targets, has_axes, is_event, parameters: [{key, meaning,
  // initial, units: by target}]}]; a parameter without `initial` must be given.
  set_kinds(kinds) {
    this.#kinds = kinds;
    this.form.hidden = kinds.length === 0;
    this.form.replaceChildren();
    if (kinds.length === 0) return;
    this.#kind = element("select", {ariaLabel: `fault of ${this.imu}`});
    for (const seam of new Set(kinds.map((kind) => kind.seam))) {
      const group = element("optgroup", {label: seam});
      kinds.forEach((kind, i) => kind.seam === seam && group.append(element("option", {value: i, textContent: kind.name, title: kind.summary})));
      this.#kind.append(group);
    }
    this.#target = element("select", {ariaLabel: "its target"});
    this.#fields = element("span", {className: "buttons"});
    this.#kind.addEventListener("change", () => this.#show());
    this.#target.addEventListener("change", () => this.#show_units());
    const buttons = element("div", {className: "buttons", role: "group", ariaLabel: `usual faults, for ${usual_s} s each`});
    buttons.append(`For ${usual_s} s: `, ...usual.filter(({target, kind}) => (
      kinds.some(({name, targets}) => name === kind && targets.includes(target.split(".")[0])))).map(({text, ...params}) => (
      element("button", {type: "button", textContent: text,
        onclick: () => this.command("fault.begin", {imu: this.imu, for_s: usual_s, ...params})}))));
    this.form.append(buttons, element("label", {}, "Fault ", this.#kind), element("label", {}, "of ", this.#target), this.#fields,
      element("button", {textContent: "Begin fault"}),
      element("button", {type: "button", textContent: "End all faults", onclick: () => this.command("fault.clear", {imu: this.imu})}));
    this.#show();
  }

  #show() {
    const kind = this.#kinds[this.#kind.value];
    this.#kind.title = kind.summary;
    const targets = kind.targets.flatMap((target) => (kind.has_axes ? ["", ".x", ".y", ".z"].map((axis) => target + axis) : [target]));
    this.#target.replaceChildren(...targets.map((text) => element("option", {textContent: text})));
    const field = (name, title, value, required, units) => element("label", {title}, `${name} `,
      element("input", {type: "number", step: "any", name, value, required, $units: units, $title: `${name}: ${title}`}), element("span"));
    this.#fields.replaceChildren(
      ...(kind.parameters ?? []).map(({key, meaning, initial, units}) => field(key, meaning, initial ?? "", initial == null, units)),
      ...(kind.is_event ? [] : [field("for_s", "duration; empty: until it is ended", 5, false)]));
    this.#show_units();
  }

  // The unit of a value is that of the target; the other keys name their own.
  #show_units() {
    const target = this.#target.value.split(".")[0];
    for (const input of this.#fields.querySelectorAll("input")) {
      const unit = unit_text(input.$units?.[target]);
      input.nextElementSibling.textContent = unit;
      input.ariaLabel = input.$title + (unit && `, ${unit}`);
    }
  }

  #begin() {
    const params = {imu: this.imu, kind: this.#kinds[this.#kind.value].name, target: this.#target.value};
    for (const input of this.#fields.querySelectorAll("input"))
      if (input.value !== "") params[input.name] = input.valueAsNumber;
    return this.command("fault.begin", params);
  }

  // Shows the spans that have no end yet; those of faults have a button to end them.
  show_active(spans) {
    this.active.replaceChildren(...spans.filter((span) => span.end_s === undefined).map(({name, fault}) => (
      element("li", {}, `${name} `, ...(fault === undefined ? [] : [element("button",
        {type: "button", textContent: `End ${name}`, onclick: () => this.command("fault.end", {name: fault})})])))));
  }
}
