// The bar that is always in view: stop and emergency stop, who drives, link, rate, battery, health in words.

import { html, useEffect, useState } from "../vendor/htm-preact.js";
import { connection } from "../js/connection.js";
import { doing } from "../js/doing.js";
import { ask, isFull, mayDrive, notify, store, useTopics } from "../js/store.js";

const CONFIRM_MS = 500;
const HOLD_MS = 1000;
const NO_LINK = "there is no link to the robot";
const HEALTH = { ok: "healthy", warning: "warning", bad: "faulty" };

const SHOWN_MS = 10000;

/** What came of the last stop: [class, words]. */
let told = ["", ""];
let turn = 0;
let wasHeld = false;
let wasLinked = true;
let fading = null;

/** Show what came of a stop; what is well is of interest for some seconds. */
function tellStop(level, text) {
  keepTold(level, text);
  notify("stop");
}

function keepTold(level, text) {
  clearTimeout(fading);
  told = [level, text];
  if (level === "ok") fadeTold();
}

function fadeTold() {
  clearTimeout(fading);
  fading = setTimeout(() => tellStop("", ""), SHOWN_MS);
}

/** Stop (or `estop`) by the bus worker, and tell whether it was confirmed. */
export async function stopRobot(verb) {
  const mine = ++turn;
  const word = verb === "estop" ? "Emergency stop" : "Stop";
  tellStop("sent", `${word} sent`);
  const late = setTimeout(() => mine === turn && tellStop("bad", `${word} NOT CONFIRMED`), CONFIRM_MS);
  try {
    const answer = await connection.ask(verb, {}, 5000);
    if (mine !== turn) return;
    const by = answer.by === "daemon" ? ", by the server" : "";
    if (answer.link === false) tellStop("bad", `${word} NOT CONFIRMED: ${NO_LINK}, which may still be moving. It stops when the link is back`);
    else if (answer.unkept) tellStop("bad", `Held, but ${answer.unkept}`);
    else tellStop("ok", `${verb === "estop" ? "Held" : "Stopped"} after ${Math.round(answer.ms)} ms${by}`);
  } catch (error) {
    if (mine === turn) tellStop("bad", `${word} NOT CONFIRMED: ${error.message.replace(/^NOT CONFIRMED: /, "")}`);
  } finally {
    clearTimeout(late);
  }
}

const isTyping = (element) => element.isContentEditable || /^(INPUT|TEXTAREA|SELECT)$/.test(element.tagName)
  && !/^(range|button|color|file)$/.test(element.type);

/** Esc stops; the space bar is the emergency stop, but where text is typed. */
function hearKey(event) {
  if (event.key === "Escape" && !event.repeat) {
    event.preventDefault();
    stopRobot("stop");
  } else if (event.key === " " && !isTyping(event.target)) {
    event.preventDefault();
    event.stopPropagation();
    if (event.type === "keydown" && !event.repeat) stopRobot("estop");
  }
}

document.addEventListener("keydown", hearKey, true);
document.addEventListener("keyup", (event) => event.key === " " && !isTyping(event.target) && event.preventDefault(), true);

/** A button that acts when it was held for a second. */
function HoldButton({ children, act }) {
  const [held, setHeld] = useState(false);
  useEffect(() => {
    if (!held) return undefined;
    const timer = setTimeout(() => {
      setHeld(false);
      act();
    }, HOLD_MS);
    return () => clearTimeout(timer);
  }, [held]);
  const keyDown = (event) => event.key === "Enter" && !event.repeat && setHeld(true);
  const end = () => setHeld(false);
  return html`<button class=${`hold ${held ? "held" : ""}`} id="release" onPointerDown=${() => setHeld(true)}
    onPointerUp=${end} onPointerLeave=${end} onPointerCancel=${end} onKeyDown=${keyDown} onKeyUp=${end} onBlur=${end}
    >${children}</button>`;
}

function Lamp({ name, level, text }) {
  return html`<span class=${`lamp ${level}`} id=${`lamp-${name}`}><i aria-hidden="true"></i><span class="what">${name}</span>
    ${text ? html`<b>${text}</b>` : null}<span class="hidden">${level === "ok" ? "" : level}</span></span>`;
}

/** What carries the robot, each in words with what to do if it is not well; the server's own words come first. */
function rowsOf(state, health) {
  const isOpen = store.isOpen;
  const rows = [["server", isOpen && state.daemon, "", "The program that runs your statements answers.",
    "It does not answer: a program holds it, or it has ended. Stop the robot; on its machine, urbihw doctor tells more."]];
  if (!state.remote) {
    rows.push(["worker", isOpen && state.worker, "", "The process that owns the wire, and stops the robot, answers.",
      "It does not answer. Cut the robot's power if it moves."]);
  }
  const rate = !isOpen ? "unknown" : !state.link ? "down" : state.remote ? "up" : `${Math.round(state.rate)} Hz`;
  rows.push(["link", isOpen && state.link, rate, state.remote ? "The robot answers." : `All of the robot is read ${Math.round(state.rate)} times in a second; its wire is busy for ${Math.round(100 * state.load)} % of the time.`,
    "The robot does not answer: look at its power, its cable and its adapter."]);
  return [...rows.map(([name, isWell, text, well, ill]) => ({ name, level: isWell ? "ok" : "bad", text, words: isWell ? well : ill })),
    ...health.reasons.map((words) => ({ name: "", level: "", text: "", words }))];
}

/** One lamp for all that carries the robot; opened, a line for each. */
function Carriers({ state }) {
  const rows = rowsOf(state, state.health);
  const ill = rows.filter(({ level }) => level === "bad");
  return html`<details class="carriers" id="carriers"><summary><${Lamp} name="connection" level=${ill.length ? "bad" : "ok"} text=${ill.length ? `${ill[0].name} ${ill[0].text || "silent"}` : "well"} /></summary>
    <ul>${rows.map((row) => html`<li key=${row.name || row.words}>${row.name && html`<${Lamp} name=${row.name} level=${row.level} text=${row.text} />`}<span>${row.words}</span></li>`)}
    ${state.remote && html`<li id="remote">The robot's bus worker is on another machine: the server stops the robot, unless a program holds it.</li>`}</ul></details>`;
}

/** The name of the robot, and what it does. */
function Name({ hello }) {
  useTopics("doing", "devices", "state");
  const [level, words] = doing();
  const about = [hello.robot !== hello.platform && hello.platform, hello.fake && "simulated", hello.you && `you are ${hello.you}: ${hello.role}`];
  return html`<div class="name"><h1>${hello.robot || hello.platform || "robot"}</h1><span class="sub">${about.filter(Boolean).join(" · ")}</span>
    <span class=${`doing ${level}`} id="doing" title=${words}>${words}</span></div>`;
}

function Driver({ state }) {
  const you = store.hello.you;
  const isMine = state.drives;
  const other = state.driver === you ? `${you}, in another window` : state.driver || "no one";
  const button = !mayDrive() ? null : isMine
    ? html`<button class="small" onClick=${() => ask("lease", { take: false })}>Let go</button>`
    : html`<button class="small" onClick=${() => ask("lease", { take: true })}>${state.driver ? "Take over" : "Drive"}</button>`;
  return html`<span class="driver" id="driver"><span class="what">drives</span> <b>${isMine ? `you (${you})` : other}</b>
    ${button}</span>`;
}

/** The button that releases the own stop, or, after a question, those of others, whose names were shown. */
function Release({ state }) {
  const [shown, setShown] = useState(null);
  const names = state.holders.join(" and ");
  useEffect(() => setShown(null), [names]);
  if (!mayDrive()) return null;
  if (state.holds) return html`<${HoldButton} act=${() => ask("release")}>Hold for 1 s to release<//>`;
  if (!isFull()) return html`<span id="not-yours">Who has pressed it releases it, or a browser of role full.</span>`;
  if (shown === null) return html`<button class="small" id="override" onClick=${() => setShown(state.holders)}>Release it for ${names}</button>`;
  return html`<span>It is not yours: ask ${names}.</span>
    <${HoldButton} act=${() => ask("release", { of: shown })}>Hold for 1 s to release it for ${names}<//>`;
}

function Held({ state }) {
  if (!state.estop) return null;
  // The button comes first: in a narrow window nothing may push it out of the line.
  return html`<div class="held-line" id="held" role="alert"><${Release} state=${state} />
    <span>Held by an emergency stop of ${state.estop}. ${state.link ? "Nothing moves." : "Nothing new moves, but there is no link to the robot: it may not have stopped."}</span></div>`;
}

/** What is known of the battery; "" for nothing. */
function batteryText({ battery, charge }) {
  const known = (value) => value !== null && value !== undefined;
  return [known(battery) && `${battery.toFixed(1)} V`, known(charge) && `${Math.round(100 * charge)} %`].filter(Boolean).join(", ");
}

/** What is wrong with the picture that the page shows; "" for nothing. */
function staleText(state, now) {
  if (!store.isOpen) {
    const seconds = ((now - store.closedAt) / 1000).toFixed(0);
    return `No connection to the robot's machine for ${seconds} s: what you see is old.${store.closedWhy ? ` (${store.closedWhy})` : ""}`;
  }
  if (!state) return "Waiting for the robot.";
  if (now - connection.lastHeard > 1500) return `Nothing heard for ${((now - connection.lastHeard) / 1000).toFixed(0)} s: what you see is old.`;
  if (!state.daemon) return `The interpreter has not answered for ${state.silent.toFixed(1)} s: its values are old. ${state.remote ? "It cannot stop the robot either." : "Stop and devices go by the bus worker."}`;
  if (!state.link && state.worker) return "No link to the robot: its values are old, and it may move.";
  return "";
}

/** Whether the page hears nothing, so that not even the lamps are up to date. */
const isCut = (now) => !store.isOpen || now - connection.lastHeard > 1500;

// What was told before is of another time.
connection.on("close", () => tellStop("", ""));
connection.on("open", fadeTold);

export function Bar() {
  useTopics("state", "stop", "tree");
  const [now, setNow] = useState(performance.now());
  useEffect(() => {
    const timer = setInterval(() => setNow(performance.now()), 500);
    return () => clearInterval(timer);
  }, []);
  const { hello, state } = store;
  // Any client may have released it: "Held" is over.
  if (state && !state.estop && wasHeld) keepTold("ok", "Released");
  wasHeld = Boolean(state && state.estop);
  // The worker stops the robot as soon as it is back.
  if (state && state.link && !wasLinked && told[1].includes(NO_LINK)) keepTold("", "");
  if (state) wasLinked = state.link;
  const stale = staleText(state, Math.max(now, performance.now()));
  document.body.classList.toggle("stale", stale !== "" || Boolean(state && !state.link));
  document.body.classList.toggle("looks", !mayDrive());
  document.body.classList.toggle("cut", isCut(Math.max(now, performance.now())));
  const health = state ? state.health : { verdict: "bad", reasons: [] };
  return html`<header class=${`bar ${state && state.estop ? "estopped" : ""}`} id="bar">
    <div class="row">
      <${Name} hello=${hello} />
      ${state && html`<div class="lamps">
        <${Carriers} state=${state} />
        ${batteryText(state) && html`<span class="lamp battery"><span class="what">battery</span><b>${batteryText(state)}</b></span>`}
        <${Driver} state=${state} />
      </div>`}
      <div class="stops">
        <button class="estop" id="estop" onClick=${() => stopRobot("estop")} title="Emergency stop: nothing moves until the release (space bar)">E-STOP</button>
        <button class="stop" id="stop" onClick=${() => stopRobot("stop")} title="Stop everything that moves (Esc)">STOP</button>
      </div>
    </div>
    <div class="lines">
      ${state && html`<${Held} state=${state} />`}
      ${told[1] && html`<p class=${`stop-line ${told[0]}`} id="stop-line" role="status">${told[1]}</p>`}
      ${stale && html`<p class="stale-line" id="stale" role="alert">${stale}</p>`}
      ${state && html`<p class=${`health ${health.verdict}`} id="health"><b>${HEALTH[health.verdict] || health.verdict}</b>${health.reasons.length
        ? `: ${health.reasons.slice(0, 3).join("; ")}${health.reasons.length > 3 ? ` and ${health.reasons.length - 3} more` : ""}` : ""}</p>`}
    </div>
  </header>`;
}
