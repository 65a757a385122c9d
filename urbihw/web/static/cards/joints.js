// Joints: a row each with goal and measured value on one slider, torque, load, temperature, voltage, state.

import { html, useEffect, useMemo, useRef, useState } from "../vendor/htm-preact.js";
import { drawSlot } from "../js/samples.js";
import { ask, isFull, mayDrive, showToast, store, useTopics } from "../js/store.js";
import { rangeOf } from "../js/tree.js";
import { Card, Live, PartName, SureButton, makeSender, textOfSlot } from "../js/ui.js";

const DETAILS = ["torque", "load", "current", "temperature", "voltage"];
/** rad in a unit of an angle: a speed in rad/s is sent in the unit of the slot. */
export const PER_RAD = { deg: 180 / Math.PI, turn: 1 / (2 * Math.PI) };
/** Pixels along the track after which a finger means the slider: less may become a swipe that scrolls the page. */
const MEANT_PX = 8;
const LEVELS = { temperature: [60, 70] };

/** A number beside a joint, yellow and red where it is too high. */
function Detail({ part, name }) {
  const slot = part.slot(name);
  const element = useRef(null);
  useEffect(() => drawSlot(part.slotPath(name), (value) => {
    if (!element.current) return;
    const [warn, bad] = LEVELS[name] || [Infinity, Infinity];
    element.current.lastChild.textContent = textOfSlot(value, slot.unit);
    element.current.className = `detail ${value >= bad ? "bad" : value >= warn ? "warning" : ""}`;
  }, 4), []);
  return html`<span class="detail" ref=${element} title=${slot.meaning}><span class="what">${name}</span> <b class="live"></b></span>`;
}

/** A switch for the torque of a joint; it is absent until its state is known. */
function Power({ part }) {
  const [isOn, setOn] = useState(null);
  useEffect(() => drawSlot(part.slotPath("load"), (value) => setOn(typeof value === "number" ? value > 0 : null), 4), []);
  return html`<button class="small power" aria-pressed=${isOn === null ? "mixed" : String(isOn)} disabled=${!isFull() || isOn === null} title=${part.slot("load").meaning}
    onClick=${() => ask("set", { slot: part.slotPath("load"), value: isOn ? 0 : 1 })}>${isOn === null ? "–" : isOn ? "is on" : "is off"}</button>`;
}

/** What keeps a joint from its goal, and its state when it is not ok. */
function Notes({ part }) {
  const [notes, setNotes] = useState({});
  useEffect(() => {
    const ends = ["state", "alarm", "limitedBy", "fault"].filter((name) => part.slot(name)).map((name) =>
      drawSlot(part.slotPath(name), (value) => setNotes((old) => (old[name] === value ? old : { ...old, [name]: value })), 4));
    return () => ends.forEach((end) => end());
  }, []);
  const { state, alarm, limitedBy, fault } = notes;
  const isBad = state !== undefined && state !== null && !["ok", "back"].includes(state);
  const texts = [isBad && state, alarm, fault, limitedBy && `limited: ${limitedBy}`].filter(Boolean);
  return html`<span class=${`notes ${isBad ? "bad" : texts.length ? "warning" : ""}`}>${texts.join(", ")}</span>`;
}

/** Goal (a slider) and measured value (a mark) on one track.  A speed goes back to zero when it is let go. */
export function GoalSlider({ part, speed = null, springs = false }) {
  const slot = part.goal;
  const path = part.slotPath(slot.name);
  const [least, most] = rangeOf(slot);
  // A motor without a range may turn on and on: the track then shows the turn in which it is.
  const turn = slot.min === null && slot.max === null && !springs ? most - least : 0;
  const [turns, setTurns] = useState(0);
  const [min, max] = [least + turns * turn, most + turns * turn];
  const range = useRef(null);
  range.current = [min, max];
  const middle = min <= 0 && max >= 0 ? 0 : (min + max) / 2;
  const input = useRef(null);
  const mark = useRef(null);
  const held = useRef(false);
  const waits = useRef(0); // until this time the slider stays where the user has put it
  const aim = useRef(null); // where the user has put it, and how far the set-point was from there
  const measured = useRef(null);
  const send = useMemo(() => makeSender((value) =>
    ask("set", springs || speed === null ? { slot: path, value } : { slot: path, value, speed: speed.current * (PER_RAD[slot.unit] ?? 1) })), []);
  const place = (value) => {
    if (input.current && !held.current && typeof value === "number") input.current.value = value;
  };
  useEffect(() => {
    input.current.value = middle;
    const end = drawSlot(path, (value) => {
      measured.current = value;
      const [min, max] = range.current;
      if (turn && !held.current && typeof value === "number") setTurns(Math.round(value / turn));
      if (mark.current && typeof value === "number") {
        mark.current.style.left = `${(100 * (Math.min(max, Math.max(min, value)) - min)) / (max - min)}%`;
      }
      if (input.current) input.current.setAttribute("aria-valuetext", `measured ${textOfSlot(value, slot.unit)}`);
    }, 20);
    const endGoal = part.slot("requested")
      ? drawSlot(part.slotPath("requested"), (value) => {
        if (springs) return;
        const left = aim.current === null || typeof value !== "number" ? Infinity : Math.abs(value - aim.current.value);
        if (left < aim.current?.left) {
          // A slow set-point is on its way to where the user has put the slider.
          aim.current.left = left;
          waits.current = Math.max(waits.current, performance.now() + 700);
        }
        if (performance.now() > waits.current) {
          aim.current = null;
          place(value ?? measured.current);
        }
      }, 4)
      : () => {};
    return () => {
      end();
      endGoal();
    };
  }, []);
  const move = (value) => {
    waits.current = performance.now() + 700;
    aim.current = { value, left: Infinity };
    send(Math.min(max, Math.max(min, value)));
  };
  // A finger that has not said yet whether it means the slider: where it began, and the value that waits.
  const finger = useRef(null);
  const isKeyed = useRef(false); // whether a key has moved it: Tab only comes by
  const press = (event) => {
    held.current = true;
    finger.current = event.pointerType === "touch" ? { x: event.clientX, value: null } : null;
  };
  const decide = () => {
    const value = finger.current?.value ?? null;
    finger.current = null;
    if (value !== null) move(value);
  };
  const slide = (event) => {
    if (finger.current && Math.abs(event.clientX - finger.current.x) > MEANT_PX) decide();
  };
  const change = (event) => {
    const value = Number(event.target.value);
    if (finger.current) {
      finger.current.value = value;
      return;
    }
    isKeyed.current = !held.current;
    move(value);
  };
  const endKey = () => {
    if (isKeyed.current && springs) spring();
    isKeyed.current = false;
  };
  const cancel = () => {
    if (!finger.current) {
      letGo();
      return;
    }
    // It scrolls.  What still comes from it counts for nothing.
    finger.current.value = null;
    held.current = false;
    place(springs ? 0 : measured.current);
  };
  const lift = () => {
    if (finger.current && springs) {
      cancel(); // a tap
      return;
    }
    decide();
    letGo();
  };
  const letGo = () => {
    if (!held.current) return;
    held.current = false;
    waits.current = performance.now() + 700;
    if (springs) spring();
  };
  const spring = () => {
    input.current.value = 0;
    move(0);
  };
  const centre = () => {
    input.current.value = middle;
    move(middle);
  };
  return html`<div class="track"><span class="measured" ref=${mark} aria-hidden="true"></span>
    <input type="range" ref=${input} min=${min} max=${max} step=${(max - min) / 200} disabled=${!mayDrive()}
      aria-label=${`goal of ${part.title} in ${slot.unit}`} title="double click: the middle"
      onPointerDown=${press} onPointerMove=${slide} onPointerUp=${lift} onPointerCancel=${cancel} onLostPointerCapture=${letGo}
      onKeyDown=${() => (finger.current = null)}
      onKeyUp=${endKey} onBlur=${endKey} onDblClick=${centre} onInput=${change} /></div>`;
}

export function JointRow({ part, speed }) {
  const state = part.slot("stale");
  const row = useRef(null);
  useEffect(() => (state ? drawSlot(part.slotPath("stale"), (value) => row.current?.classList.toggle("lost", value === true), 4) : undefined), []);
  return html`<li class="joint" ref=${row} data-part=${part.path}>
    <div class="head"><${PartName} part=${part} slot=${part.slotPath(part.goal.name)} />
      <${Live} slot=${part.slotPath(part.goal.name)} unit=${part.goal.unit} />
      <${Notes} part=${part} />${part.slot("load")?.writable && html`<${Power} part=${part} />`}</div>
    <${GoalSlider} part=${part} speed=${speed} />
    <div class="details">${DETAILS.filter((name) => part.slot(name) && !(name === "load" && part.slot("load").writable))
      .map((name) => html`<${Detail} part=${part} name=${name} />`)}</div></li>`;
}

/** All joints; a group can be chosen. */
export function Joints() {
  useTopics("state");
  const joints = store.model.of("joint");
  const [group, setGroup] = useState("");
  const most = store.hello.limits.speed || 6;
  const speed = useRef(1);
  const [shownSpeed, setShownSpeed] = useState(Math.min(1, most));
  const groups = store.model.groups.filter(({ members }) => members.every((part) => joints.includes(part)) && members.length < joints.length);
  const shown = group ? groups.find(({ name }) => name === group)?.members || joints : joints;
  const switchAll = (value) => shown.filter((part) => part.slot("load")?.writable)
    .forEach((part) => ask("set", { slot: part.slotPath("load"), value }));
  const copy = async () => {
    const writes = [];
    for (const part of shown) {
      const told = await ask("get", { slot: part.slotPath(part.goal.name) });
      if (told && typeof told.value === "number") writes.push(`${part.path}.${part.goal.name} = ${told.value.toFixed(4)}`);
    }
    const text = `${writes.join(" & ")};`;
    try {
      await navigator.clipboard.writeText(text);
      showToast("The pose is in the clipboard.", "ok");
    } catch {
      showToast(text, "ok");
    }
  };
  const tools = html`${groups.length > 0 && html`<label>Group <select onChange=${(event) => setGroup(event.target.value)}>
      <option value="">all</option>${groups.map(({ name }) => html`<option value=${name}>${name}</option>`)}</select></label>`}
    <label>Speed <input type="range" min="0.1" max=${most} step="0.1" value=${shownSpeed} aria-label="speed to goals in rad/s"
      onInput=${(event) => setShownSpeed((speed.current = Number(event.target.value)))} /> ${shownSpeed.toFixed(1)} rad/s</label>
    ${isFull() && shown.some((part) => part.slot("load")?.writable) && html`<button class="small" onClick=${() => switchAll(1)}>Switch all on</button>
    <${SureButton} id="all-off" act=${() => switchAll(0)} sure="Hold the robot: slack?">Switch all off<//>`}
    <button class="small" onClick=${copy}>Copy pose</button>`;
  return html`<${Card} title=${`Joints (${shown.length})`} name="joints" tools=${tools} wide=${true}>
    <ul class="joints">${shown.map((part) => html`<${JointRow} key=${part.path} part=${part} speed=${speed} />`)}</ul><//>`;
}

/** Motors that turn: sliders that go back to zero. */
export function Speeds() {
  useTopics("state");
  const parts = store.model.of("speed");
  return html`<${Card} title="Speeds" name="speeds"><ul class="joints one">${parts.map((part) => html`<li class="joint" key=${part.path} data-part=${part.path}>
    <div class="head"><${PartName} part=${part} slot=${part.slotPath(part.goal.name)} />
      <${Live} slot=${part.slotPath(part.goal.name)} unit=${part.goal.unit} /><${Notes} part=${part} /></div>
    <${GoalSlider} part=${part} springs=${true} /></li>`)}</ul><//>`;
}
