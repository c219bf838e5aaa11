// The quantities of a sample, the units in which the page shows them, and what the browser remembers of its choices.
const xyz = ["x", "y", "z"];
const degrees = 180 / Math.PI, g0 = 9.80665, semi_major_m = 6378137, eccentricity2 = 6.69437999014e-3;  // WGS 84

const one_of = (value) => (value == null ? undefined : [value]);

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

const aids = ["gnss_position", "gnss_velocity", "magnetic_heading", "antennas_heading", "pressure", "zero_velocity", "gravity"];
const ned = ["north", "east", "down"], filter_words = "solution less truth";
const parts = ["attitude", "velocity", "position"];

// Returns the mean of the nine squared errors of a solution, each in units of its variance: about 1 if the unit is right about
// itself. Undefined while it reports no place, or the truth has none.
function normalized_square(params, i) {
  const squares = parts.flatMap((part) => params[`${part}_error`]?.[i]?.map((error, axis) => (error / params[`${part}_sigma`][i][axis]) ** 2));
  const has_all = parts.every((part) => params[`${part}_error`]?.[i]?.every((error) => error !== null));
  return has_all ? [squares.reduce((sum, one) => sum + one, 0) / squares.length] : undefined;
}
// Returns for each aid whether it was used when it was due last, 1, or rejected, -1, or missing, 0.
function aids_of({aids_used, aids_rejected}, i) {
  return aids_used?.[i] && aids.map((name) => (aids_used[i].includes(name) ? 1 : aids_rejected[i].includes(name) ? -1 : 0));
}

// `si` and `other`: the unit as it is shown, as it is in names of columns, and by how much the value in SI is multiplied.
// `read`: returns the values of the axes of a notification `samples`, of its element i; default: what it has under the key.
// `is_computed`: the notification has no such key. `words`: what is shown. `band`: the notification's key of standard deviations, which are drawn about 0. Quantities of more than
// three axes are not among the numbers for those who do not see the plots.
export const quantities = [
  {key: "rate", name: "Rate", axes: xyz, has_truth: true, words: "measured, and truth dashed", si: ["rad/s", "rad_per_s", 1], other: ["deg/s", "deg_per_s", degrees]},
  {key: "specific_force", name: "Specific force", axes: xyz, has_truth: true, words: "measured, and truth dashed", si: ["m/s²", "m_per_s2", 1], other: ["g", "g", 1 / g0]},
  {key: "magnetic_field", name: "Magnetic field", axes: xyz, words: "measured", si: ["µT", "uT", 1e6]},
  {key: "pressure", name: "Pressure", axes: [""], words: "measured", si: ["hPa", "hPa", 1e-2], read: ({pressure}, i) => one_of(pressure?.[i])},
  {key: "inclination", name: "Inclination", axes: xyz, words: "specific force by the inclinometers", si: ["m/s²", "m_per_s2", 1], other: ["g", "g", 1 / g0]},
  {key: "attitude", name: "Attitude", axes: ["roll", "pitch", "yaw"], words: "as the unit reports it", si: ["rad", "rad", 1], other: ["deg", "deg", degrees],
    read: ({attitude}, i) => attitude?.[i] && euler(attitude[i])},
  {key: "position", name: "Position", axes: ["north", "east", "up"], words: "measured", si: ["m", "m", 1]},  // from the first one that is shown
  {key: "temperature_c", name: "Temperature", axes: [""], words: "measured", si: ["°C", "deg_c", 1], read: ({temperature_c}, i) => one_of(temperature_c?.[i])},
  // Of a unit that computes its own solution:
  {key: "attitude_error", name: "Error of attitude", axes: ned, words: `${filter_words}, about these axes`, band: "attitude_sigma",
    si: ["rad", "rad", 1], other: ["deg", "deg", degrees]},
  {key: "velocity_error", name: "Error of velocity", axes: ned, words: filter_words, band: "velocity_sigma", si: ["m/s", "m_per_s", 1]},
  {key: "position_error", name: "Error of position", axes: ned, words: filter_words, band: "position_sigma", si: ["m", "m", 1]},
  {is_computed: true, key: "normalized_square", name: "Error² / σ²", axes: [""], words: "mean of the nine; about 1 if σ is right", si: ["", "ratio", 1], read: normalized_square, is_logarithmic: true},
  {key: "aids_used", name: "Aids", axes: aids, words: "1 used, −1 rejected, 0 missing", si: ["", "use", 1], read: aids_of},
];
export const lateness = "lateness";
// Returns what a sample has sent of a quantity: undefined if it was not sent.
export const sent_values = (row, {key}) => (row.is_sent ? row.values[key] : undefined);

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
  #hidden = new Set([recall("hidden", quantities.slice(2).map(({key}) => key))].flat());

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
  // Returns the unit of a quantity: {text, after: the text after a name, column, factor}.
  unit(quantity) {
    const [text, column, factor] = (this.#other_units && quantity.other) || quantity.si;
    return {text, after: text && `, ${text}`, column, factor};
  }
}
export const choices = new Choices();
