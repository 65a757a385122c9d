// Jobs and tags, events, the log, devices, all slots, and the faults of a simulated robot.

import { html, useEffect, useState } from "../vendor/htm-preact.js";
import { connection } from "../js/connection.js";
import { ask, isFull, showToast, store, useTopics } from "../js/store.js";
import { Card, Live, SlotName, textOf, textOfSlot } from "../js/ui.js";
import { addSeries } from "./plots.js";

const clock = (date) => date.toTimeString().slice(0, 8);

export function Jobs() {
  const [told, setTold] = useState({ jobs: [], tags: [] });
  const [trouble, setTrouble] = useState("");
  useEffect(() => {
    const look = async () => {
      try {
        setTold(await connection.ask("jobs", {}, 3000));
        setTrouble("");
      } catch (error) {
        setTrouble(error.message);
      }
    };
    look();
    const timer = setInterval(look, 1000);
    return () => clearInterval(timer);
  }, []);
  const columns = ["name", "lobby", "state", "in", "line", "tags"];
  const cell = (job, column) => (Array.isArray(job[column]) ? job[column].join(" ") : column === "state" && job.frozen ? `${job.state}, frozen` : textOf(job[column] ?? ""));
  const tags = told.tags.filter((tag) => tag.jobs || tag.handlers || tag.frozen || tag.blocked);
  const button = ({ id, name }, action) => html`<button class="small" disabled=${!isFull()} onClick=${() => ask("tag", { tag: name, uid: id, action })} aria-label=${`${action} the tag ${name}`}>${action}</button>`;
  return html`<${Card} title=${`Jobs (${told.jobs.length})`} name="jobs" wide=${true}>${trouble && html`<p class="bad">${trouble}</p>`}
    <ul class="chips" id="tags">${tags.map((tag) => html`<li key=${tag.id} data-tag=${tag.name}><b>${tag.name}</b> <span class="what">${tag.frozen ? "frozen" : `${tag.jobs} jobs`}</span> ${button(tag, "stop")} ${button(tag, tag.frozen ? "unfreeze" : "freeze")}</li>`)}</ul>
    <div class="scroll" tabindex="0" role="region" aria-label="table of jobs"><table><thead><tr>${columns.map((column) => html`<th scope="col">${column}</th>`)}</tr></thead>
    <tbody>${told.jobs.slice(0, 200).map((job) => html`<tr>${columns.map((column) => html`<td>${cell(job, column)}</td>`)}</tr>`)}</tbody></table></div>
    ${told.jobs.length === 0 && !trouble && html`<p class="hint">No program runs. What you start in the console with a comma, or an at, is here until it ends.</p>`}<//>`;
}

export function Events() {
  useTopics("happened");
  return html`<${Card} title="Events" name="events" wide=${true}><div class="output" role="log" aria-label="events" tabindex="0">${store.happened.slice(-200).reverse().map((row) => html`<div class="line">
    <span class="stamp">${clock(row.at)}</span><span><b>${row.slot}</b> ${(row.args || []).map((each) => textOf(each)).join(", ")}</span></div>`)}
    ${store.happened.length === 0 && html`<p class="hint">None yet. The events of the robot and its platform are watched, and those of the first devices.</p>`}</div><//>`;
}

const LEVELS = ["debug", "info", "warning", "error", "critical"];

export function Log() {
  useTopics("log");
  const [least, setLeast] = useState(1);
  const [text, setText] = useState("");
  const levelOf = (row) => Math.max(0, LEVELS.indexOf(String(row.level).toLowerCase()));
  const shown = store.log.filter((row) => levelOf(row) >= least && row.text.toLowerCase().includes(text.toLowerCase())).slice(-300).reverse();
  const tools = html`<label>From <select onChange=${(event) => setLeast(Number(event.target.value))}>${LEVELS.slice(0, 4).map((level, index) => html`<option value=${index} selected=${index === least}>${level}</option>`)}</select></label>
    <label>Text <input value=${text} onInput=${(event) => setText(event.target.value)} size="10" /></label>`;
  return html`<${Card} title="Log" name="log" tools=${tools} wide=${true}><div class="output" role="log" aria-label="log of the server" tabindex="0">${shown.map((row) => html`<div class=${`line ${["", "", "warning", "error", "error"][levelOf(row)]}`}>
    <span class="stamp">${typeof row.date === "number" ? clock(new Date(1000 * row.date)) : textOf(row.time)} ${row.level}</span><span>${row.text}</span></div>`)}
    ${shown.length === 0 && html`<p class="hint">Nothing.</p>`}</div><//>`;
}

function Registers({ part }) {
  const [rows, setRows] = useState(null);
  const read = async () => {
    const told = await ask("call", { slot: part.slotPath("registers"), args: [] });
    const names = Array.isArray(told?.value) ? told.value : [];
    const values = [];
    for (const name of names) {
      try {
        const answer = await connection.ask("call", { slot: part.slotPath("readRegister"), args: [name] });
        values.push([name, answer.value]);
      } catch (error) {
        values.push([name, error.message]);
      }
      setRows([...values]);
    }
  };
  return html`<div><button class="small" onClick=${read}>Read registers</button>
    ${rows && html`<dl class="values">${rows.map(([name, value]) => html`<dt>${name}</dt><dd>${textOf(value)}</dd>`)}</dl>`}</div>`;
}

/** The part of the tree that a device of the worker is: by its number, or by its name. */
function partOf(row) {
  const { parts } = store.model;
  return parts.find((part) => [part.path, part.node.path, part.title].includes(String(row.device)) || (row.name && part.title === row.name))
    || parts.find((part) => /\D/.test(part.title) && part.title.replace(/^\D+/, "") === String(row.device) && part.slot("registers"));
}

/** The rows of an opened device, each with its unit. */
const DETAILS = [["age", "s"], ["period", "s"], ["missed", ""], ["lost", ""], ["limits", ""], ["passed", ""], ["requested", ""], ["applied", ""]];

export function Devices() {
  useTopics("devices", "state", "tree");
  const [open, setOpen] = useState(null);
  const [problems, setProblems] = useState([]);
  useEffect(() => {
    connection.ask("get", { slot: "robot.problems" }).then((told) => setProblems(Array.isArray(told.value) ? told.value : [])).catch(() => {});
  }, [store.model]);
  const { health } = store.state || { health: { reasons: [] } };
  const quantities = [...new Set(store.devices.flatMap((row) => Object.keys(row.values || {})))];
  return html`<${Card} title=${`Devices (${store.devices.length})`} name="devices" wide=${true}>
    <ul class="advice" id="advice">${[...health.reasons, ...problems.map((each) => textOf(each))].map((each) => html`<li>${each}</li>`)}</ul>
    <div class="scroll" tabindex="0" role="region" aria-label="table of devices"><table><thead><tr><th scope="col">device</th><th scope="col">model</th><th scope="col">state</th>${quantities.map((name) => html`<th scope="col">${name}</th>`)}<th scope="col">who</th></tr></thead>
    <tbody>${store.devices.map((row) => html`<tr class=${row.state === "lost" || row.state === "no link" ? "lost" : ""} data-device=${row.device}>
      <th scope="row"><button class="link" aria-expanded=${open === row.device ? "true" : "false"} onClick=${() => setOpen(open === row.device ? null : row.device)}>${row.name ? `${row.device} ${row.name}` : row.device}</button></th>
      <td>${row.model}</td><td class=${row.state === "ok" ? "" : "bad"}>${row.state}${row.reason ? `: ${row.reason}` : ""}${row.alarm ? `, ${row.alarm}` : ""}</td>
      ${quantities.map((name) => html`<td class="number">${textOfSlot(row.values?.[name], row.units?.[name] || "")}</td>`)}<td>${row.who || ""}</td></tr>
      ${open === row.device && html`<tr><td colspan=${quantities.length + 4}><dl class="values">${DETAILS.filter(([name]) => textOf(row[name] ?? "") !== "" && !(Array.isArray(row[name]) && !row[name].length)).map(([name, unit]) => html`<dt>${name}</dt><dd>${textOf(row[name], unit)}</dd>`)}</dl>
        ${isFull() && partOf(row)?.slot("registers") && html`<${Registers} part=${partOf(row)} />`}</td></tr>`}`)}</tbody></table></div>
    ${store.devices.length === 0 && html`<p class="hint">The bus worker tells of none.</p>`}<//>`;
}

function SlotRow({ path, slot }) {
  const [text, setText] = useState("");
  const write = (event) => {
    event.preventDefault();
    const word = text.trim();
    const value = slot.kind === "text" ? text : slot.kind === "truth" ? /^(true|yes|1)$/i.test(word) : Number(word);
    if (slot.kind === "number" && (word === "" || Number.isNaN(value))) showToast(`${word || "nothing"} is no number`);
    else ask("set", { slot: path, value });
  };
  const call = async () => {
    const told = await ask("call", { slot: path, args: [] });
    if (told) showToast(`${path}: ${told.running ? "still running" : told.value === null ? "done" : textOf(told.value)}`, "ok");
  };
  const isPlain = ["number", "truth", "text"].includes(slot.kind);
  return html`<li><${SlotName} path=${path}>${slot.name}<//>
    <span class="readings">${isPlain || slot.kind === "list" || slot.kind === "dictionary" ? html`<${Live} slot=${path} unit=${slot.unit} hz=${4} />` : html`<span class="what">${slot.kind}</span>`}
    ${isPlain && slot.kind !== "text" && html`<button class="small" onClick=${() => addSeries(path)} aria-label=${`plot ${path}`}>Plot</button>`}
    ${slot.kind === "function" && isFull() && html`<button class="small" onClick=${call}>Call</button>`}
    ${slot.writable && isPlain && (isFull() || slot.effector) && html`<form class="caller" onSubmit=${write}><input size="7" value=${text} aria-label=${`new value of ${path}`} onInput=${(event) => setText(event.target.value)} /><button class="small">Set</button></form>`}</span>
    <span class="hint">${slot.meaning}</span></li>`;
}

export function Slots() {
  useTopics("tree");
  const [owner, setOwner] = useState((store.model.parts[0] || store.model.robot).path);
  const [text, setText] = useState("");
  const found = store.model.owners.find((each) => each.path === owner) || store.model.owners[0];
  // Without what its interface promises and this device does not have.
  const there = found.slots.filter((slot) => slot.readable || slot.writable || ["function", "event"].includes(slot.kind));
  const shown = there.filter((slot) => `${slot.name} ${slot.meaning}`.toLowerCase().includes(text.toLowerCase()));
  const tools = html`<label>Of <select id="owner" onChange=${(event) => setOwner(event.target.value)}>${store.model.owners.map((each) => html`<option value=${each.path} selected=${each.path === owner}>${each.title}</option>`)}</select></label>
    <label>Find <input value=${text} size="10" onInput=${(event) => setText(event.target.value)} /></label>`;
  return html`<${Card} title="Slots" name="slots" tools=${tools} wide=${true}><ul class="slots">${shown.map((slot) => html`<${SlotRow} key=${`${found.path}.${slot.name}`} path=${`${found.path}.${slot.name}`} slot=${slot} />`)}</ul><//>`;
}

function Fault({ command, answer }) {
  const name = command.name || command[0];
  const parameters = command.parameters ?? command[1] ?? "";
  const meaning = command.meaning ?? command[2] ?? "";
  const wanted = Array.isArray(parameters) ? parameters.join(" ") : String(parameters);
  const [text, setText] = useState("");
  const tell = async (event) => {
    event.preventDefault();
    const line = `${name} ${text}`.trim();
    const told = await ask("fake", { tell: line });
    if (told) answer(`${line}: ${told.answer || "done"}`);
  };
  return html`<li><form class="fault" onSubmit=${tell}><button class="small" id=${`fault-${name}`}>${name}</button>
    ${wanted && html`<input value=${text} size=${Math.max(12, wanted.length)} placeholder=${wanted} aria-label=${`${name}: ${wanted}`} onInput=${(event) => setText(event.target.value)} />`}<span class="hint">${meaning}</span></form></li>`;
}

export function Faults() {
  const [commands, setCommands] = useState([]);
  const [answers, setAnswers] = useState([]);
  useEffect(() => {
    ask("fake").then((told) => told && setCommands(told.commands || []));
  }, []);
  const note = (line) => setAnswers((old) => [...old.slice(-50), line]);
  return html`<${Card} title="The simulated robot" name="faults" wide=${true}><p class="hint">What happens to its body: nothing here is a command of the robot.</p>
    <ul class="list faults">${commands.map((command) => html`<${Fault} key=${command.name || command[0]} command=${command} answer=${note} />`)}</ul>
    <div class="output short" role="log" aria-label="answers of the simulated robot" tabindex="0">${[...answers].reverse().map((line) => html`<div class="line">${line}</div>`)}</div><//>`;
}
