// Small pieces of all cards: numbers as text, a value that follows its slot, a card, buttons.

import { html, useEffect, useRef, useState } from "../vendor/htm-preact.js";
import { drawSlot, hearSamples } from "./samples.js";
import { ask, store } from "./store.js";

/** A number with so many digits, and no sign before zero. */
export const fixed = (value, digits) => value.toFixed(digits).replace(/^-(0(\.0*)?)$/, "$1");

/** A value as text: numbers with as many digits as a person reads. */
export function textOf(value, unit = "") {
  if (value === null || value === undefined) return "–";
  if (typeof value === "number") {
    if (unit === "ratio") return `${(100 * value).toFixed(0)} %`;
    const size = Math.abs(value);
    const digits = size >= 1000 || Number.isInteger(value) ? 0 : size >= 100 ? 1 : size >= 10 ? 2 : 3;
    const shown = fixed(value, digits);
    return unit && unit !== "1" ? `${shown} ${unit === "degC" ? "°C" : unit}` : shown;
  }
  if (typeof value === "boolean") return value ? "yes" : "no";
  if (typeof value === "string") return value;
  if (Array.isArray(value)) return value.length > 12 ? `${value.length} values` : `[${value.map((each) => textOf(each)).join(", ")}]`;
  if (value.bytes !== undefined && value.keywords !== undefined) return `${value.bytes} bytes, ${value.keywords}`;
  return Object.entries(value).map(([key, each]) => `${key} ${textOf(each)}`).join(", ");
}

export const degrees = (value) => (typeof value === "number" ? `${fixed((value * 180) / Math.PI, 1)}°` : "–");

/** The text of an angle, in degrees for rad; of other values as they are. */
export const textOfSlot = (value, unit) => (unit === "rad" ? degrees(value) : textOf(value, unit));

/** Call `draw(element, value)` whenever the value of a slot came. */
export function useSlot(slot, draw, hz = 10) {
  const element = useRef(null);
  useEffect(() => {
    if (!slot) return undefined;
    return drawSlot(slot, (value) => element.current && draw(element.current, value), hz);
  }, [slot, hz]);
  return element;
}

/** The value of a slot, as text that follows it. */
export function Live({ slot, unit = "", hz = 10 }) {
  const element = useSlot(slot, (span, value) => (span.textContent = textOfSlot(value, unit)), hz);
  // Without children: its text is written here, and not by preact.
  return html`<span class="live" ref=${element}></span>`;
}

/** A bar from `min` to `max`; `warn` and `bad` are the values from which it is yellow and red. */
export function LiveBar({ slot, min, max, warn = Infinity, bad = Infinity, label, hz = 10 }) {
  const element = useSlot(slot, (meter, value) => {
    const share = typeof value === "number" ? (Math.min(max, Math.max(min, value)) - min) / (max - min) : 0;
    const size = Math.abs(value);
    meter.firstChild.style.width = `${100 * share}%`;
    meter.className = `meter ${size >= bad ? "bad" : size >= warn ? "warning" : ""}`;
    meter.setAttribute("aria-valuenow", typeof value === "number" ? value.toFixed(3) : min);
    meter.setAttribute("aria-valuetext", textOf(value));
  }, hz);
  return html`<div class="meter" ref=${element} role="meter" aria-label=${label} aria-valuemin=${min} aria-valuemax=${max}
    aria-valuenow=${min}><span></span></div>`;
}

/** A section with a heading; `tools` stand beside the heading. */
export function Card({ title, name, tools = null, children, wide = false }) {
  const id = `card-${name}`;
  return html`<section class=${`card ${wide ? "wide" : ""}`} id=${id} aria-labelledby=${`${id}-title`}>
    <header><h2 id=${`${id}-title`}>${title}</h2><div class="tools">${tools}</div></header>${children}</section>`;
}

/** Switches a slot on (1) and off (0), and shows what it is. */
export function Switch({ slot, title }) {
  const [isOn, setOn] = useState(null);
  useEffect(() => hearSamples(slot, 4, (value) => setOn(typeof value === "number" ? value > 0 : null)), [slot]);
  return html`<button class="small" aria-pressed=${isOn === null ? "mixed" : String(isOn)} disabled=${isOn === null} title=${isOn === null ? "not known yet" : `switch ${isOn ? "off" : "on"}`}
    onClick=${() => ask("set", { slot, value: isOn ? 0 : 1 })}>${title}: ${isOn === null ? "–" : isOn ? "on" : "off"}</button>`;
}

/** A name that can be dragged into a plot, and added there by its button. */
export function SlotName({ path, children }) {
  const drag = (event) => event.dataTransfer.setData("text/plain", path);
  return html`<span class="slot-name" draggable="true" onDragStart=${drag} title=${`${path}: drag it into a plot`}>
    ${children ?? path}</span>`;
}

/** What people call a part, and beside it the name by which programs call it. */
export function PartName({ part, slot }) {
  const words = store.partWords.get(part.path) || part.words;
  const isSame = words.replace(/\W/g, "").toLowerCase() === part.title.replace(/[\W_]/g, "").toLowerCase();
  return html`<${SlotName} path=${slot}>${isSame ? part.title : html`${words} <span class="code">${part.title}</span>`}<//>`;
}

/** Send values while a control moves: at most 20 in a second, the last one always. */
export function makeSender(send) {
  let timer = null;
  let waiting = null;
  const next = () => {
    timer = null;
    if (waiting !== null) {
      const value = waiting[0];
      waiting = null;
      timer = setTimeout(next, 50);
      send(value);
    }
  };
  return (value) => {
    waiting = [value];
    if (timer === null) next();
  };
}

/** Save a text as a file of the user. */
export function saveText(name, text) {
  const url = URL.createObjectURL(new Blob([text], { type: "text/plain" }));
  const link = document.createElement("a");
  link.href = url;
  link.download = name;
  link.click();
  setTimeout(() => URL.revokeObjectURL(url), 1000);
}

/** Draw on a canvas in animation frames, sharp on every screen: `draw(context, width, height)`; stops with its element. */
export function useCanvas(draw, period = 60) {
  const element = useRef(null);
  const latest = useRef(draw);
  latest.current = draw;
  useEffect(() => {
    let frame = null;
    let drawn = 0;
    const step = (now) => {
      frame = requestAnimationFrame(step);
      const canvas = element.current;
      if (!canvas || now - drawn < period || !canvas.clientWidth) return;
      drawn = now;
      const ratio = window.devicePixelRatio || 1;
      const [width, height] = [canvas.clientWidth, canvas.clientHeight];
      if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
        canvas.width = Math.round(width * ratio);
        canvas.height = Math.round(height * ratio);
      }
      const context = canvas.getContext("2d");
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.clearRect(0, 0, width, height);
      latest.current(context, width, height);
    };
    frame = requestAnimationFrame(step);
    return () => cancelAnimationFrame(frame);
  }, []);
  return element;
}

/** A colour of the style sheet. */
export const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();

const SURE_MS = 4000;

/** A button of what may make a robot fall: the first click asks by the words of `sure`, a second one soon after acts. */
export function SureButton({ act, sure, children, ...rest }) {
  const [isAsking, setAsking] = useState(false);
  useEffect(() => {
    if (!isAsking) return undefined;
    const timer = setTimeout(() => setAsking(false), SURE_MS);
    return () => clearTimeout(timer);
  }, [isAsking]);
  const click = () => {
    setAsking(!isAsking);
    if (isAsking) act();
  };
  return html`<button ...${rest} class=${`small ${isAsking ? "warning" : ""}`} onClick=${click} onBlur=${() => setAsking(false)}>${isAsking ? sure : children}</button>`;
}
