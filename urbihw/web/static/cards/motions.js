// Poses and motions: record by hand, name, play (docs/teach.md).

import { html, useEffect, useState } from "../vendor/htm-preact.js";
import { ask, isFull, mayDrive, store, useTopics } from "../js/store.js";
import { connection } from "../js/connection.js";
import { Card, SureButton } from "../js/ui.js";

const quoted = (text) => `"${text.replace(/[\\"]/g, "\\$&")}"`;

/** What was typed as a name: another page of the panel must not lose it. */
let typed = "";

export function Motions() {
  useTopics("state", "happened");
  const [lists, setLists] = useState({ motions: [], poses: [], playing: [], teaching: undefined });
  const [name, setShownName] = useState(typed);
  const setName = (text) => setShownName((typed = text));
  const [speed, setSpeed] = useState(1);
  const look = async () => {
    // What is not answered stays as it was: another browser drives, or the interpreter is held, as the bar shows.
    const names = ["motions", "poses", "playing", "teaching"];
    const answers = await Promise.allSettled(names.map((each) => connection.ask("call", { slot: `robot.${each}`, args: [] })));
    const known = answers.flatMap(({ value }, at) => (value && "value" in value ? [[names[at], value.value ?? (names[at] === "teaching" ? null : [])]] : []));
    setLists((before) => ({ ...before, ...Object.fromEntries(known) }));
  };
  useEffect(() => {
    if (!mayDrive()) return undefined;
    look();
    const timer = setInterval(look, 2000);
    return () => clearInterval(timer);
  }, [store.hello.role]);
  const act = async (verb, fields) => {
    // Until the robot has told it, nothing is known of a recording: it may run, so it can be ended.
    setLists((known) => ({ ...known, teaching: undefined }));
    await ask(verb, fields);
    await look();
  };
  const call = (slot, ...args) => act("call", { slot: `robot.${slot}`, args });
  const isUnknown = lists.teaching === undefined;
  const isRecording = lists.teaching !== null;
  const record = () => act("run", { text: `robot.teach(${quoted(name)}),` });
  const goodName = /^[\w.: -]{1,60}$/.test(name);
  const why = !mayDrive() ? "this role only looks" : name === "" ? "type a name first" : goodName ? "" : "a name has letters, digits, spaces and . : _ -, at most 60";
  const row = (each, kind) => html`<li><span>${each} <span class="what">${kind}</span></span><span>
    <button class="small" disabled=${!mayDrive()} onClick=${() => (kind === "motion" ? call("play", each, speed) : call("pose", each, speed))}>${kind === "motion" ? "Play" : "Go"}</button></span></li>`;
  return html`<${Card} title="Poses and motions" name="motions" tools=${html`<label>Speed <input type="range" min="0.1" max=${isFull() ? 2 : 1} step="0.1" value=${speed}
      onInput=${(event) => setSpeed(Number(event.target.value))} /> ${speed.toFixed(1)}x</label>`}>
    <div class="caller"><label>Name <input id="motion-name" value=${name} onInput=${(event) => setName(event.target.value)} /></label>
      <button class="small" id="save-pose" disabled=${!goodName || !mayDrive()} title=${why} onClick=${() => call("savePose", name)}>Keep pose</button>
      ${isFull() && html`<${SureButton} id="record" disabled=${!goodName || isRecording} act=${record} sure="Hold the robot: all joints slack?" title=${why || (isUnknown ? "not known yet whether the robot records" : isRecording ? "end the recording first" : "switches the joints off: hold the robot")}>Record by hand<//>`}
      ${isFull() && isRecording && html`<button class="small warning" id="end-record" onClick=${() => call("endTeaching")}>End recording</button>
      <button class="small" onClick=${() => call("keyPose")}>Take pose</button>`}
      ${lists.playing.length > 0 && html`<button class="small warning" onClick=${() => call("endPlaying")}>End ${lists.playing.join(", ")}</button>`}</div>
    <ul class="list">${lists.poses.map((each) => row(each, "pose"))}${lists.motions.map((each) => row(each, "motion"))}</ul>
    ${isFull() && isUnknown && html`<p class="hint" id="record-unknown">Not known yet whether the robot records: asking.</p>`}
    ${isFull() && html`<p class="hint">Recording switches all joints off: hold the robot, move it, end the recording.</p>`}<//>`;
}
