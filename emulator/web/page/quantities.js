// The quantities of a sample, the units in which the page shows them, and what the browser remembers of its choices.
const xyz = ["x", "y", "z"];
const degrees = 180 / Math.PI, g0 = 9.80665, semi_major_m = 6378137, eccentricity2 = 6.69437999014e-3;  // WGS 84

// Returns roll, pitch and yaw, rad, of the unit quaternion of `attitude`.
function euler([w, x, y, z]) {
  return [Math.atan2(2 * (w * x + y * z), 1 - 2 * (x * x + y * y)),
    Math.asin(Math.max(-1, Math.min(1, 2 * (w * y - z * x)))), Math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))];
}

// Returns north, east and up, m, of a position from another one, both [latitude, longitude, height] in rad and m.
export function offset_m([latitude, longitude, height], [latitude0, longitude0, height0]) {
  const w2 = 1 - eccentricity2 * Math.sin(latitude0) ** 2, prime = semi_major_m / Math.sqrt(w2);
  const turns = Math.round((longitude - longitude0) / (2 * Math.PI));  // across the date line
  return [(latitude - latitude0) * ((prime * (1 - eccentricity2)) / w2 + height0),
    (longitude - longitude0 - 2 * Math.PI * turns) * (prime + height0) * Math.cos(latitude0), height - height0];
}

// `si` and `other`: the unit as it is shown, as it is in names of columns, and by how much the value in SI is multiplied.
// `take`: returns the values of the axes of what a notification `samples` has under the key. `words`: what is shown.
export const quantities = [
  {key: "rate", name: "Rate", axes: xyz, has_truth: true, words: "measured, and truth dashed", si: ["rad/s", "rad_per_s", 1], other: ["deg/s", "deg_per_s", degrees]},
  {key: "specific_force", name: "Specific force", axes: xyz, has_truth: true, words: "measured, and truth dashed", si: ["m/s²", "m_per_s2", 1], other: ["g", "g", 1 / g0]},
  {key: "magnetic_field", name: "Magnetic field", axes: xyz, words: "measured", si: ["µT", "uT", 1e6]},
  {key: "pressure", name: "Pressure", axes: [""], words: "measured", si: ["hPa", "hPa", 1e-2], take: (value) => [value]},
  {key: "attitude", name: "Attitude", axes: ["roll", "pitch", "yaw"], words: "true, not measured", si: ["rad", "rad", 1], other: ["deg", "deg", degrees], take: euler},
  {key: "position", name: "Position", axes: ["north", "east", "up"], words: "measured", si: ["m", "m", 1]},  // from the first one that is shown
  {key: "temperature_c", name: "Temperature", axes: [""], words: "measured", si: ["°C", "deg_c", 1], take: (value) => [value]},
];
export const lateness = "lateness";
// Returns what a sample has sent of a quantity: undefined if it was not sent. A true quantity does not depend on that.
export const sent_values = (row, {key, words}) => (row.is_sent || words.startsWith("true") ? row.values[key] : undefined);

const recall = (key, otherwise) => {
  try {
    return JSON.parse(localStorage.getItem(`imud.${key}`)) ?? otherwise;
  } catch {
    return otherwise;  // storage is switched off, or holds something else
  }
};
const remember = (key, value) => {
  try {
    localStorage.setItem(`imud.${key}`, JSON.stringify(value));
  } catch { /* storage is switched off: the choice holds until the page is left */ }
};

// What the viewer has chosen. Dispatches "change".
class Choices extends EventTarget {
  #other_units = recall("other_units", false) === true;
  #hidden = new Set([recall("hidden", ["magnetic_field", "pressure", "attitude", "position", "temperature_c"])].flat());

  get other_units() { return this.#other_units; }
  set other_units(on) {
    remember("other_units", (this.#other_units = on));
    this.dispatchEvent(new Event("change"));
  }
  is_shown(key) { return !this.#hidden.has(key); }
  show(key, on) {
    this.#hidden[on ? "delete" : "add"](key);
    remember("hidden", [...this.#hidden]);
    this.dispatchEvent(new Event("change"));
  }
  // Returns the unit of a quantity: {text, column, factor}.
  unit(quantity) {
    const [text, column, factor] = (this.#other_units && quantity.other) || quantity.si;
    return {text, column, factor};
  }
}
export const choices = new Choices();
