// The robot drawn: its measured pose, where it is to go, what its joints do; a joint can be chosen and dragged.
// three.js is loaded when the picture is shown; without WebGL it is an SVG.

import { html, useEffect, useMemo, useRef, useState } from "../vendor/htm-preact.js";
import { connection } from "../js/connection.js";
import { drawSlot, hearSamples } from "../js/samples.js";
import { ask, mayDrive, notify, showToast, store, useTopics } from "../js/store.js";
import { rangeOf } from "../js/tree.js";
import { Card, makeSender, textOfSlot } from "../js/ui.js";
import { Figure, readingOf, travelOf } from "../figure/model.js";
import { beginTrail, pointsOf, trail } from "./base.js";
import { JointRow, PER_RAD } from "./joints.js";

const DRAG_PX = 5;
const HOT_C = 60;
/** Wishes for the picture are small: a hand of samples of each joint. */
const POSE_HZ = 20;
const STATE_HZ = 4;
const HIDDEN = "urbihw.figure.hidden";

/** What a joint does: its word, its colour in the style sheet, and how to know it by its slots; the first one counts. */
const STATES = [
  ["lost", "bad", (slots) => slots.stale === true || slots.state === "lost"],
  ["alarm", "bad", (slots) => Boolean(slots.alarm || slots.fault)],
  ["hot", "hot", (slots) => slots.temperature >= HOT_C],
  ["blocked", "warning", (slots) => Boolean(slots.limitedBy)],
  ["slack", "soft", (slots) => slots.load === 0],
  ["moving", "accent", (slots) => slots.isMoving],
];
/** How far a reading goes within STILL_MS in a joint that moves, and not by the noise of its sensor. */
const MOVED = 0.02;
const STILL_MS = 400;
const WATCHED = ["state", "stale", "alarm", "fault", "temperature", "limitedBy", "load"];

function hasWebGL() {
  try {
    return Boolean(document.createElement("canvas").getContext("webgl2"));
  } catch {
    return false;
  }
}

/** A joint that has a number in the tree is called by the link that it moves: "left hand". */
function nameJoints(figure) {
  const named = figure?.links.filter((link) => link.joint?.device && link.name !== `${link.joint.device}_link`) || [];
  const numbered = named.filter((link) => /\d$/.test(store.model?.parts.find((part) => part.path === link.joint.device)?.words || ""));
  store.partWords = new Map(numbered.map((link) => [link.joint.device, link.name.replace(/_/g, " ")]));
  notify("tree");
}

/** The figure as the gateway tells it, asked for again when the robot has changed; null until it came. */
function useFigure() {
  const [figure, setFigure] = useState(null);
  useEffect(() => {
    let isOver = false;
    let text = "";
    let timer = null;
    const look = async () => {
      clearTimeout(timer);
      try {
        const { figure: table } = await connection.ask("figure");
        if (isOver || JSON.stringify(table) === text) return;
        text = JSON.stringify(table);
        const made = table ? new Figure(table) : null;
        nameJoints(made);
        setFigure(made);
      } catch {
        // The interpreter is held, or the robot is not there yet.
        if (!isOver) timer = setTimeout(look, 2000);
      }
    };
    const ends = [connection.on("tree", look), connection.on("open", look)];
    look();
    return () => {
      isOver = true;
      clearTimeout(timer);
      ends.forEach((end) => end());
    };
  }, []);
  return figure;
}

/** Feed a view with what the joints measure, want and are; tells the states in words by `tell`. */
function followJoints(view, figure, tell) {
  const ends = [];
  const told = new Map();
  for (const device of figure.devices) {
    const part = store.model.parts.find((each) => each.path === device);
    if (!part) continue;
    const slots = { isMoving: false };
    const { joint } = figure.links.find((link) => link.joint?.device === device);
    let [from, since] = [null, 0];
    const feel = (value) => {
      const now = performance.now();
      const has = typeof value === "number" && typeof from === "number" && Math.abs(travelOf(joint, value) - travelOf(joint, from)) > MOVED;
      if (has || from === null) [from, since] = [value, now];
      slots.isMoving = now - since < STILL_MS && (has || slots.isMoving);
    };
    const judge = () => {
      const found = STATES.find(([, , test]) => test(slots));
      view.setState(device, found ? found[1] : "");
      if (told.get(device) === (found ? found[0] : "")) return;
      told.set(device, found ? found[0] : "");
      tell(new Map(told));
    };
    // A slack joint goes nowhere, whatever was asked of it.
    const aim = () => view.setGoal(device, slots.load === 0 ? null : slots.requested);
    ends.push(drawSlot(part.slotPath("val"), (value) => {
      feel(value);
      view.setReading(device, value);
      judge();
    }, POSE_HZ));
    if (part.slot("requested")) {
      ends.push(drawSlot(part.slotPath("requested"), (value) => {
        slots.requested = value;
        aim();
      }, STATE_HZ));
    }
    for (const name of WATCHED.filter((each) => part.slot(each)?.readable)) {
      ends.push(drawSlot(part.slotPath(name), (value) => {
        slots[name] = value;
        judge();
        if (name === "load") aim();
      }, STATE_HZ));
    }
  }
  return ends;
}

/** Feed a view with where a base is, what its laser and its distance sensors see, its trail and its path. */
function followBase(view, figure) {
  const { model } = store;
  const ends = [];
  if (model.isMobile) {
    beginTrail();
    ends.push(hearSamples("robot.position", 10, (pose) => {
      if (typeof pose?.x !== "number") return;
      view.setPose(pose.x, pose.y, pose.theta || 0);
      view.setLine("trail", [...trail, [pose.x, pose.y]]);
    }));
    if (model.robot.slot("planner")) ends.push(hearSamples("robot.planner.path", 2, (path) => view.setLine("path", Array.isArray(path) && path.every(Array.isArray) ? path : [])));
  }
  const echoes = new Map();
  for (const link of figure.sensors) {
    const part = model.parts.find((each) => each.path === link.device);
    if (part?.kind === "laser") ends.push(...followLaser(view, link, part));
    if (part?.kind !== "distance") continue;
    const perMetre = part.slot("val").unit === "cm" ? 0.01 : 1;
    const most = (part.slot("val").max ?? Infinity) * perMetre;
    ends.push(hearSamples(part.slotPath("val"), 4, (value) => {
      const far = value * perMetre;
      if (typeof value === "number" && far > 0 && far < Math.min(most, 4.99)) echoes.set(link.name, [link, far]);
      else echoes.delete(link.name);
      view.setEchoes([...echoes.values()]);
    }));
  }
  return ends;
}

function followLaser(view, link, part) {
  const known = {};
  const draw = () => {
    const isOn = known.state === undefined || known.state === "on";
    // The first reading of a scan is that on its right.
    view.setScan(link, isOn ? pointsOf(known.val, known.angleMax, known.angleMin).map(([x, y]) => [x, y, 0]) : []);
  };
  return ["state", "angleMin", "angleMax", "val"].filter((name) => part.slot(name)).map((name) => hearSamples(part.slotPath(name), name === "val" ? 10 : 2, (value) => {
    known[name] = value;
    if (name === "val" || name === "state") draw();
  }));
}

/** The picture: a canvas with the scene, or an svg. */
function Picture({ figure, speed, choose, tell, wantsGo, endGo }) {
  const box = useRef(null);
  const view = useRef(null);
  const now = useRef({});
  now.current = { wantsGo, endGo };
  const senders = useMemo(() => new Map(), [figure]);
  const [isReady, setReady] = useState(false);
  const [withWebGL, setWithWebGL] = useState(hasWebGL);
  useEffect(() => {
    let ends = [];
    let isOver = false;
    const begin = (made) => {
      view.current = made;
      box.current.figureView = made;
      setReady(true);
      ends = [...followJoints(made, figure, tell), ...followBase(made, figure)];
    };
    const fail = (error) => {
      if (isOver) return;
      showToast(`The robot cannot be drawn${withWebGL ? " in 3D" : ""}: ${error.message}`);
      setWithWebGL(false);
    };
    // It may be over before a module has come.
    if (withWebGL) import("../figure/scene.js").then(({ FigureScene }) => isOver || begin(new FigureScene(box.current, figure))).catch(fail);
    else import("../figure/side.js").then(({ SideView }) => isOver || begin(new SideView(box.current, figure, (link) => choose(figure.jointOf(link))))).catch(fail);
    return () => {
      isOver = true;
      ends.forEach((end) => end());
      view.current?.close();
      view.current = null;
    };
  }, [figure, withWebGL]);
  const send = (part, value) => {
    if (!senders.has(part.path)) {
      const slot = part.slotPath(part.goal.name);
      senders.set(part.path, makeSender((goal) => ask("set", { slot, value: goal, speed: speed.current * (PER_RAD[part.goal.unit] ?? 1) })));
    }
    senders.get(part.path)(value);
  };
  const drag = useRef(null);
  const pressed = useRef(null); // where a pointer came down, and whether it has gone from there: a look around
  const press = (event) => {
    pressed.current = { x: event.clientX, y: event.clientY, isGone: false };
    if (!withWebGL || !view.current || event.button) return;
    if (now.current.wantsGo) return;
    const hit = view.current.pick(event);
    const link = hit && figure.jointOf(hit.link);
    if (!link) return;
    const part = store.model.of("joint").find((each) => each.path === link.joint.device);
    event.target.setPointerCapture(event.pointerId);
    view.current.controls.enabled = false;
    drag.current = { link, part, travelOf: null, point: hit.point };
  };
  const slide = (event) => {
    const down = pressed.current;
    if (down && Math.hypot(event.clientX - down.x, event.clientY - down.y) >= DRAG_PX) down.isGone = true;
    const held = drag.current;
    if (!held || !mayDrive() || !held.part) return;
    if (!held.travelOf) {
      if (!down.isGone) return;
      held.travelOf = view.current.beginDrag(held.link, held.point);
    }
    const [least, most] = rangeOf(held.part.goal);
    const goal = Math.min(most, Math.max(least, readingOf(held.link.joint, held.travelOf(event))));
    view.current.setGoal(held.part.path, goal);
    send(held.part, goal);
  };
  const lift = () => {
    const held = drag.current;
    if (!held) return;
    drag.current = null;
    view.current.controls.enabled = true;
    if (!held.travelOf) choose(held.link);
  };
  const click = async (event) => {
    if (!now.current.wantsGo || !view.current?.floor || pressed.current?.isGone) return;
    const place = view.current.floor(event);
    if (!place) return;
    now.current.endGo();
    await ask("go", { x: place[0], y: place[1] });
  };
  const name = "the robot as its joints are measured; the sliders below move the same joints";
  const kind = `figure-view ${wantsGo ? "aim" : ""} ${isReady ? "ready" : ""}`;
  return withWebGL
    ? html`<canvas id="figure" class=${kind} role="img" aria-label=${name} ref=${box} onPointerDownCapture=${press} onPointerMove=${slide} onPointerUp=${lift} onPointerCancel=${lift} onClick=${click}></canvas>`
    : html`<svg id="figure" class=${kind} role="img" aria-label=${name} ref=${box}></svg>`;
}

/** What the joints are, in words, with their colours. */
function Legend({ states }) {
  const rows = STATES.map(([word, tone]) => [word, tone, [...states].filter(([, each]) => each === word).map(([device]) => device)])
    .filter(([, , devices]) => devices.length);
  return html`<p class="legend" id="figure-states">${rows.map(([word, tone, devices]) => html`<span key=${word}><i style=${`background: var(--${tone})`} aria-hidden="true"></i>${word}: ${devices.length > 3 ? `${devices.length} joints` : devices.join(", ")}</span>`)}</p>`;
}

export function RobotFigure() {
  useTopics("state", "tree");
  const figure = useFigure();
  const speed = useRef(1);
  speed.current = Math.min(1, store.hello.limits.speed || 1);
  const [chosen, setChosen] = useState(null);
  const [states, setStates] = useState(new Map());
  const [wantsGo, setWantsGo] = useState(false);
  const [isHidden, setHidden] = useState(localStorage.getItem(HIDDEN) === "1");
  const hide = () => {
    localStorage.setItem(HIDDEN, isHidden ? "0" : "1");
    setHidden(!isHidden);
  };
  if (!figure) return null;
  const part = chosen && store.model.of("joint").find((each) => each.path === chosen.joint.device);
  const mayGo = store.model.isMobile && mayDrive();
  const tools = html`${mayGo && !isHidden && html`<button class="small" id="figure-go" aria-pressed=${wantsGo ? "true" : "false"} onClick=${() => setWantsGo(!wantsGo)}>Go to a click</button>`}
    <button class="small" id="figure-hide" onClick=${hide}>${isHidden ? "Show" : "Hide"}</button>`;
  const canDrag = mayDrive() && store.model.of("joint").some((each) => figure.devices.includes(each.path));
  return html`<${Card} title="Robot" name="figure" tools=${tools}>${!isHidden && html`<div class="figure-box">
    <${Picture} key=${figure} figure=${figure} speed=${speed} choose=${setChosen} tell=${setStates} wantsGo=${wantsGo} endGo=${() => setWantsGo(false)} />
    ${part && html`<div class="chosen" id="chosen"><button class="small" aria-label="close" onClick=${() => setChosen(null)}>×</button>
      <ul class="joints one"><${JointRow} key=${part.path} part=${part} speed=${speed} /></ul></div>`}</div>
    <${Legend} states=${states} />
    <p class="hint">${wantsGo ? "Click the floor where the robot is to go." : canDrag ? "Drag a joint to move it, click it for its values, drag beside the robot to look around." : figure.devices.length ? "Drag to look around; click a joint for its values." : "Drag to look around."}</p>`}<//>`;
}
