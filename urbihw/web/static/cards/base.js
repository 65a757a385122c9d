// A base: the pad under dead man, speeds, pose, sonar fan, laser, and a map with trail and click-to-go.

import nipplejs from "../vendor/nipplejs.js";
import { html, useEffect, useRef, useState } from "../vendor/htm-preact.js";
import { connection } from "../js/connection.js";
import { hearSamples } from "../js/samples.js";
import { ask, isFull, mayDrive, showToast, store, useTopics } from "../js/store.js";
import { directionsOf } from "../js/tree.js";
import { Card, Live, PartName, Switch, colour, degrees, fixed, useCanvas } from "../js/ui.js";
import { stopRobot } from "./bar.js";

const ORDER_MS = 100;
const KEYS = { w: [1, 0], arrowup: [1, 0], s: [-1, 0], arrowdown: [-1, 0], a: [0, 1], arrowleft: [0, 1], d: [0, -1], arrowright: [0, -1] };
const TRAIL = 600;

/** Sends speeds ten times in a second while something is held, and zero once when it is let go. */
class Driver {
  constructor(scale) {
    this.scale = scale;
    this.held = new Map(); // source -> [x, yaw], -1 to 1
    this.timer = null;
    this.isAsking = false;
  }

  hold(source, direction) {
    this.held.set(source, direction);
    if (this.timer === null) {
      this.timer = setInterval(() => this.order(), ORDER_MS);
      this.order();
    }
  }

  letGo(source) {
    if (!this.held.delete(source) || this.held.size) return;
    this.end();
  }

  end() {
    if (this.timer === null) return;
    clearInterval(this.timer);
    this.timer = null;
    this.held.clear();
    connection.ask("drive", { x: 0, yaw: 0 }).catch(() => {});
  }

  async order() {
    // One order at a time: with a slow server they must not queue up.
    if (this.isAsking) return;
    this.isAsking = true;
    let [x, yaw] = [0, 0];
    for (const [ahead, left] of this.held.values()) [x, yaw] = [x + ahead, yaw + left];
    const most = this.scale();
    try {
      const told = await connection.ask("drive", { x: Math.max(-1, Math.min(1, x)) * most.x, yaw: Math.max(-1, Math.min(1, yaw)) * most.yaw, at: performance.now() / 1000 });
      if (told.late) showToast("The order came too late: the connection is too slow to drive.", "bad");
      else if (told.deferred && store.state && !store.state.link) showToast("There is no link to the robot: the order did not reach it, and it may still be moving.", "bad");
      else if (told.deferred) showToast("The robot stands: it refused, was stopped, or somebody else moved it. Let go, then hold again.", "bad");
    } catch (error) {
      const takeOver = error.code === "lease" ? ["Take over", () => ask("lease", { take: true })] : null;
      showToast(error.message, "bad", takeOver);
      this.end();
    } finally {
      this.isAsking = false;
    }
  }
}

/** A gamepad drives by its left stick while a shoulder button is held; its start button stops. */
function useGamepad(driver) {
  useEffect(() => {
    let wasStop = false;
    const timer = setInterval(() => {
      const pad = [...(navigator.getGamepads?.() || [])].find((each) => each && each.connected);
      if (!pad) {
        driver.letGo("gamepad");
        return;
      }
      const isHeld = [4, 5, 6, 7].some((index) => pad.buttons[index]?.pressed);
      if (isHeld) driver.hold("gamepad", [-pad.axes[1], -pad.axes[0]]);
      else driver.letGo("gamepad");
      const isStop = Boolean(pad.buttons[9]?.pressed);
      if (isStop && !wasStop) stopRobot("stop");
      wasStop = isStop;
    }, 50);
    return () => clearInterval(timer);
  }, []);
}

export function Pad() {
  useTopics("state");
  const zone = useRef(null);
  const limits = store.hello.limits;
  const [x, setX] = useState(Math.min(0.2, limits.x || 0.2));
  const [yaw, setYaw] = useState(Math.min(0.5, limits.yaw || 0.5));
  const scale = useRef({ x, yaw });
  scale.current = { x, yaw };
  const driver = useRef(null);
  if (driver.current === null) driver.current = new Driver(() => scale.current);
  useGamepad(driver.current);
  useEffect(() => {
    const stick = nipplejs.create({ zone: zone.current, mode: "static", position: { left: "50%", top: "50%" }, size: 150, color: { front: colour("accent"), back: colour("soft") }, restOpacity: 0.8 });
    const at = (event) => event.data || event;
    stick.on("move", (event, data) => {
      const vector = (data || at(event)).vector;
      if (vector && mayDrive()) driver.current.hold("stick", [vector.y, -vector.x]);
    });
    stick.on("end", () => driver.current.letGo("stick"));
    // A window that is left is not told that a key was let go.
    const leave = () => driver.current.end();
    document.addEventListener("visibilitychange", leave);
    window.addEventListener("blur", leave);
    return () => {
      document.removeEventListener("visibilitychange", leave);
      window.removeEventListener("blur", leave);
      driver.current.end();
      stick.destroy();
    };
  }, []);
  const key = (event) => {
    const direction = KEYS[event.key.toLowerCase()];
    if (!direction || !mayDrive()) return;
    event.preventDefault();
    if (event.type === "keydown") driver.current.hold(event.key.toLowerCase(), direction);
    else driver.current.letGo(event.key.toLowerCase());
  };
  return html`<div class="pad-box">
    <div class=${`pad ${mayDrive() ? "" : "disabled"}`} id="pad" ref=${zone} tabindex="0" role="application" onKeyDown=${key} onKeyUp=${key} onBlur=${() => driver.current.end()}
      aria-label="drive: hold W A S D or the arrow keys"></div>
    <label>Forward <input type="range" min="0.05" max=${limits.x || 1} step="0.05" value=${x} onInput=${(event) => setX(Number(event.target.value))} /> ${x.toFixed(2)} m/s</label>
    <label>Turn <input type="range" min="0.1" max=${limits.yaw || 2} step="0.1" value=${yaw} onInput=${(event) => setYaw(Number(event.target.value))} /> ${yaw.toFixed(1)} rad/s</label>
    <p class="hint">Hold the pad, or W A S D here; a gamepad with a shoulder button held.</p></div>`;
}

export function Base() {
  useTopics("state");
  const robot = store.model.robot;
  const rows = [["xSpeed", "m/s"], ["yawSpeed", "rad/s"]].filter(([name]) => robot.slot(name));
  // `load` is the manual's word for switched on: motorsLoad, laserLoad.
  const { platform } = store.model;
  const switches = (platform && isFull() ? platform.slots : []).filter((slot) => slot.writable && slot.kind === "number" && slot.name.endsWith("Load")
    // What has a card of its own has its switch there.
    && !store.model.parts.some((part) => part.slot("load")?.writable && `${part.node.name}Load` === slot.name));
  const tools = switches.map(({ name }) => html`<${Switch} key=${name} slot=${`${platform.path}.${name}`} title=${name[0].toUpperCase() + name.slice(1, -4)} />`);
  const ofPlatform = (name) => platform?.slots.find((slot) => slot.name === name);
  const motors = ofPlatform("motorsLoad");
  const dock = ofPlatform("onDock");
  // What a base does as a whole, where it can: switch on, get up, and go to its dock.
  const calls = [robot.slot("switchOn") && ["Switch on", "robot.switchOn"], robot.slot("wakeUp") && ["Wake up", "robot.wakeUp"], robot.slot("rest") && ["Rest", "robot.rest"],
    dock && robot.slot("goToChargingStation") && ["Go to the dock", "robot.goToChargingStation"],
    ofPlatform("chargeStop") && ["Leave the dock", `${platform.path}.chargeStop`]].filter(Boolean);
  return html`<${Card} title="Drive" name="base" tools=${tools}>${motors && html`<${MotorsHint} slot=${`${platform.path}.${motors.name}`} />`}<${Pad} />
    <dl class="values">${rows.map(([name, unit]) => html`<dt>${name}</dt><dd><${Live} slot=${`robot.${name}`} unit=${unit} /></dd>`)}
    ${robot.slot("moving") && html`<dt>moving</dt><dd id="moving"><${Live} slot="robot.moving" /></dd>`}
    ${dock && html`<dt>on its dock</dt><dd id="on-dock"><${Live} slot=${`${platform.path}.${dock.name}`} /></dd>`}</dl>
    ${isFull() && calls.length > 0 && html`<p class="tools">${calls.map(([title, path]) => html`<button class="small" key=${path} onClick=${() => ask("call", { slot: path, args: [] })}>${title}</button>`)}</p>`}<//>`;
}

/** Says that nothing can drive, and why. */
function MotorsHint({ slot }) {
  const [isOff, setOff] = useState(false);
  useEffect(() => hearSamples(slot, 4, (value) => setOff(value === 0)), [slot]);
  return isOff ? html`<p class="bad" id="motors-off" role="status">The motors are off${isFull() ? ": switch them on above, at Motors." : "."}</p>` : null;
}

/** Keep the newest value of a slot for a canvas. */
function useNewest(slots, hz = 10) {
  const values = useRef(new Map());
  useEffect(() => {
    const ends = slots.map((slot) => hearSamples(slot, hz, (value) => values.current.set(slot, value)));
    return () => ends.forEach((end) => end());
  }, [slots.join()]);
  return values.current;
}

/** Points of a scan in the frame of the robot: [x, y] in m. */
export function pointsOf(ranges, from, to) {
  if (!Array.isArray(ranges) || typeof from !== "number" || typeof to !== "number" || ranges.length < 2) return [];
  const step = (to - from) / (ranges.length - 1);
  return ranges.flatMap((range, index) => (typeof range === "number" && Number.isFinite(range)
    ? [[range * Math.cos(from + index * step), range * Math.sin(from + index * step)]] : []));
}

function drawGrid(context, width, height, scale, x0, y0) {
  context.strokeStyle = colour("grid");
  context.lineWidth = 1;
  const step = [0.1, 0.25, 0.5, 1, 2, 5, 10, 25, 50].find((size) => size * scale >= 28) || 100;
  context.beginPath();
  for (let x = Math.ceil((x0 - width / 2 / scale) / step) * step; (x - x0) * scale < width / 2; x += step) {
    context.moveTo(width / 2 + (x - x0) * scale, 0);
    context.lineTo(width / 2 + (x - x0) * scale, height);
  }
  for (let y = Math.ceil((y0 - height / 2 / scale) / step) * step; (y - y0) * scale < height / 2; y += step) {
    context.moveTo(0, height / 2 - (y - y0) * scale);
    context.lineTo(width, height / 2 - (y - y0) * scale);
  }
  context.stroke();
  context.fillStyle = colour("soft");
  context.font = "12px sans-serif";
  context.fillText(`${step} m`, 8, height - 8);
}

function drawLine(context, points, style, width = 2) {
  context.strokeStyle = colour(style);
  context.lineWidth = width;
  context.beginPath();
  points.forEach(([x, y], index) => (index ? context.lineTo(x, y) : context.moveTo(x, y)));
  context.stroke();
}

function drawRobot(context, x, y, angle) {
  context.save();
  context.translate(x, y);
  context.rotate(-angle);
  context.fillStyle = colour("accent");
  context.beginPath();
  context.moveTo(13, 0);
  context.lineTo(-9, 8);
  context.lineTo(-5, 0);
  context.lineTo(-9, -8);
  context.fill();
  context.restore();
}

const WALLS_MS = 1000;

/** The walls of the loaded map, boxes in m: asked for once for each map, as they are many. */
function useWalls(planner) {
  const walls = useRef([]);
  useEffect(() => {
    if (!planner) return undefined;
    let [map, asked] = ["", 0];
    const look = async (name) => {
      if (name !== map) [map, asked, walls.current] = [name, 0, []];
      if (!map || walls.current.length || performance.now() - asked < WALLS_MS) return;
      asked = performance.now();
      try {
        const { value } = await connection.ask("get", { slot: `${planner}.walls` });
        if (name === map && Array.isArray(value)) walls.current = value.filter((box) => Array.isArray(box) && box.length === 4);
      } catch {
        // The interpreter is held: the next sample asks again.
      }
    };
    return hearSamples(`${planner}.mapFileName`, 2, (name) => look(typeof name === "string" ? name : ""));
  }, [planner]);
  return walls;
}

/** Where the robot was since the map was first shown, [x, y] in m. */
export const trail = [];
let isTrailing = false;

export function beginTrail() {
  if (isTrailing) return;
  isTrailing = true;
  hearSamples("robot.position", 10, (pose) => {
    if (typeof pose?.x !== "number" || typeof pose.y !== "number") return;
    const last = trail[trail.length - 1];
    if (last && Math.hypot(last[0] - pose.x, last[1] - pose.y) < 0.02) return;
    trail.push([pose.x, pose.y]);
    if (trail.length > TRAIL) trail.shift();
  });
}

export function Chart() {
  useTopics("state");
  const { model } = store;
  const laser = model.of("laser")[0];
  const planner = model.robot.slot("planner") ? "robot.planner" : "";
  const laserSlots = laser ? ["val", "angleMin", "angleMax"].map((name) => laser.slotPath(name)) : [];
  const laserState = laser?.slot("state") ? laser.slotPath("state") : "";
  const values = useNewest(["robot.position", ...laserSlots, ...(laserState ? [laserState] : [])]);
  const paths = useNewest(planner ? [`${planner}.path`] : [], 2);
  const walls = useWalls(planner);
  useEffect(beginTrail, []);
  const [scale, setScale] = useState(60);
  const [goal, setGoal] = useState(null);
  const [wantsGo, setWantsGo] = useState(false);
  const centre = useRef([0, 0]);
  const canvas = useCanvas((context, width, height) => {
    const pose = values.get("robot.position");
    const [x0, y0, theta] = pose ? [pose.x ?? 0, pose.y ?? 0, pose.theta ?? 0] : [0, 0, 0];
    centre.current = [x0, y0];
    const screen = ([x, y]) => [width / 2 + (x - x0) * scale, height / 2 - (y - y0) * scale];
    drawGrid(context, width, height, scale, x0, y0);
    context.fillStyle = colour("soft");
    for (const [left, bottom, right, top] of walls.current) {
      const [x, y] = screen([left, top]);
      context.fillRect(x, y, Math.max(1, (right - left) * scale), Math.max(1, (top - bottom) * scale));
    }
    canvas.current.dataset.walls = String(walls.current.length);
    canvas.current.dataset.trail = String(trail.length);
    drawLine(context, [...trail, [x0, y0]].map(screen), "soft");
    // The last scan of a laser that is off or lost is old.
    if (laser && ["on", undefined].includes(values.get(laserState))) {
      context.fillStyle = colour("bad");
      const [ranges, from, to] = laserSlots.map((slot) => values.get(slot));
      for (const [x, y] of pointsOf(ranges, to, from)) {
        const [sx, sy] = screen([x0 + x * Math.cos(theta) - y * Math.sin(theta), y0 + x * Math.sin(theta) + y * Math.cos(theta)]);
        context.fillRect(sx - 1, sy - 1, 3, 3);
      }
    }
    const path = paths.get(`${planner}.path`);
    if (Array.isArray(path) && path.length > 1 && path.every(Array.isArray)) drawLine(context, path.map(screen), "ok", 3);
    if (goal) {
      const [gx, gy] = screen(goal);
      drawLine(context, [[gx - 8, gy], [gx + 8, gy]], "ok", 3);
      drawLine(context, [[gx, gy - 8], [gx, gy + 8]], "ok", 3);
    }
    drawRobot(context, ...screen([x0, y0]), theta);
  });
  const click = async (event) => {
    if (!wantsGo) return;
    const box = event.target.getBoundingClientRect();
    const x = centre.current[0] + (event.clientX - box.left - box.width / 2) / scale;
    const y = centre.current[1] - (event.clientY - box.top - box.height / 2) / scale;
    setGoal([x, y]);
    if (!(await ask("go", { x, y }))) setGoal(null);
  };
  const tools = html`<button class="small" aria-pressed=${wantsGo ? "true" : "false"} id="click-to-go" disabled=${!mayDrive()} onClick=${() => setWantsGo(!wantsGo)}>Click to go</button>
    ${laser?.slot("load")?.writable && store.hello.role === "full" && html`<${Switch} slot=${laser.slotPath("load")} title="Laser" />`}
    <button class="small" aria-label="zoom in" onClick=${() => setScale(Math.min(400, scale * 1.4))}>+</button>
    <button class="small" aria-label="zoom out" onClick=${() => setScale(Math.max(4, scale / 1.4))}>−</button>
    <button class="small" onClick=${() => trail.splice(0)}>Clear trail</button>`;
  return html`<${Card} title="Map" name="map" tools=${tools}>
    <canvas class=${`map ${wantsGo ? "aim" : ""}`} id="map" ref=${canvas} role="img" aria-label="map around the robot, with its trail" onClick=${click}></canvas>
    <p class="hint"><${Pose} /></p>${planner && html`<${MapHint} planner=${planner} />`}<//>`;
}

/** Where a map comes from, while there is none. */
function MapHint({ planner }) {
  const [name, setName] = useState(null);
  useEffect(() => hearSamples(`${planner}.mapFileName`, 2, (value) => setName(typeof value === "string" ? value : null)), []);
  return name === "" ? html`<p class="hint" id="no-map">No map is loaded: <span class="code">${planner}.loadMap("file.map");</span> in the console, or drive around and save one (docs/navigation.md).</p>` : null;
}

function Pose() {
  const [pose, setPose] = useState(null);
  useEffect(() => hearSamples("robot.position", 4, setPose), []);
  if (!pose) return "pose unknown";
  return html`<span id="pose">x ${fixed(pose.x ?? 0, 2)} m, y ${fixed(pose.y ?? 0, 2)} m, heading ${degrees(pose.theta ?? 0)}</span>`;
}

/** Distances around the robot as a fan. */
export function Distances() {
  const parts = store.model.of("distance");
  const unit = (part) => part.slot("distance")?.unit || part.slot("val")?.unit || "m";
  const name = (part) => (part.slot("distance") ? "distance" : "val");
  const directions = directionsOf(parts);
  const slots = parts.map((part) => part.slotPath(name(part)));
  const values = useNewest(slots);
  const canvas = useCanvas((context, width, height) => {
    const most = 5;
    const radius = Math.min(width, height) / 2 - 12;
    const half = Math.min(0.3, Math.PI / Math.max(6, parts.length));
    context.strokeStyle = colour("grid");
    for (const share of [0.5, 1]) {
      context.beginPath();
      context.arc(width / 2, height / 2, radius * share, 0, 2 * Math.PI);
      context.stroke();
    }
    slots.forEach((slot, index) => {
      const value = values.get(slot);
      const metres = unit(parts[index]) === "cm" ? value / 100 : value;
      const reach = typeof metres === "number" ? Math.min(most, metres) / most : 1;
      const angle = -directions[index] - Math.PI / 2;
      context.fillStyle = colour(typeof metres !== "number" ? "grid" : metres < 0.3 ? "bad" : metres < 0.8 ? "warning" : "ok");
      context.globalAlpha = 0.6;
      context.beginPath();
      context.moveTo(width / 2, height / 2);
      context.arc(width / 2, height / 2, radius * reach, angle - half, angle + half);
      context.fill();
      context.globalAlpha = 1;
    });
    drawRobot(context, width / 2, height / 2, Math.PI / 2);
  });
  return html`<${Card} title="Distances" name="distances"><canvas class="fan" ref=${canvas} role="img" aria-label="distances around the robot, up to 5 m"></canvas>
    <dl class="values">${parts.map((part) => html`<dt><${PartName} part=${part} slot=${part.slotPath(name(part))} /></dt><dd><${Live} slot=${part.slotPath(name(part))} unit=${unit(part)} /></dd>`)}</dl><//>`;
}

