// What the pages of a status have in common: they read it again and again, as JSON.
export const often_ms = 2000;

export const $ = (selector) => document.querySelector(selector);

export function element(name, {text, ...attributes} = {}, ...children) {
  const one = Object.assign(document.createElement(name), attributes);
  if (text !== undefined) one.textContent = text;
  one.append(...children);
  return one;
}

// Writes a text only where it has changed, so that a selection stays.
export function show(selector, text) {
  if ($(selector).textContent !== text) $(selector).textContent = text;
}

// Replaces the children if they have other texts than those that are there.
const made_of = new WeakMap();
export function fill(root, key, make) {
  const text = JSON.stringify(key);
  if (made_of.get(root) === text) return;
  made_of.set(root, text);
  root.replaceChildren(...make());
}

export const count = (number) => number.toLocaleString("en");
export const several = (number, one, more) => `${number === 1 ? "one" : count(number)} ${number === 1 ? one : more}`;

// Calls `shown` with each status; it returns after how many milliseconds the next one is read.
export async function follow(shown) {
  let pause_ms = often_ms;
  try {
    const answer = await fetch("status", {cache: "no-store"});
    if (!answer.ok) throw new Error(await answer.text());
    const status = await answer.json();
    $("#failure").hidden = true;
    $("#connection").classList.add("open");
    show("#connection", "connected");
    pause_ms = shown(status);
  } catch (error) {
    $("#connection").classList.remove("open");
    show("#connection", "not connected; the page shows what it read last");
    $("#failure").hidden = error instanceof TypeError;  // there is no server
    show("#failure", error.message);
  }
  setTimeout(() => follow(shown), pause_ms);
}
