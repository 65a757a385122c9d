// What the robot does now, in a few words for the bar.

import { connection } from "./connection.js";
import { hearSamples } from "./samples.js";
import { notify, store } from "./store.js";

const TURNS = 0.05; // rad/s or m/s from which a device moves
const MOVED = 0.01; // m or rad within LOOK_MS
const LOOK_MS = 700;
const STOPPED_S = 20;

let endPose = null;
let seen = null; // the last place of the base: {x, y, theta, at}
let droveAt = -Infinity;

function lookAtBase() {
  endPose?.();
  endPose = null;
  if (!store.model?.isMobile) return;
  endPose = hearSamples("robot.position", 4, (pose) => {
    if (typeof pose?.x !== "number") return;
    const now = performance.now();
    const far = seen ? Math.hypot(pose.x - seen.x, pose.y - seen.y, (pose.theta || 0) - (seen.theta || 0)) : 0;
    if (far > MOVED) droveAt = now;
    if (!seen || far > MOVED || now - seen.at > LOOK_MS) seen = { ...pose, at: now };
    notify("doing");
  });
}

connection.on("tree", () => setTimeout(lookAtBase));

/** A name without the address of its connection; a program that has none is "a program". */
const plain = (who) => who.replace(/ \(.*\)$/, "").replace(/^Lobby_\d+$/, "a program");

/** In a few words: [class, words]. */
export function doing() {
  const { state, devices, isOpen } = store;
  if (!state || !isOpen) return ["bad", "not known"];
  if (state.estop) return ["bad", "held by an emergency stop"];
  if (!state.link) return ["bad", "not connected"];
  const movers = devices.filter((row) => Math.abs(row.values?.speed) > TURNS);
  const drives = performance.now() - droveAt < LOOK_MS;
  const stop = state.stopped;
  if (movers.length || drives) {
    const names = [...new Set((movers.length ? movers : devices).map((row) => row.who).filter(Boolean).map(plain))];
    return ["accent", `${drives && !movers.length ? "driving" : "moving"}${names.length ? `: by ${names.slice(0, 2).join(" and ")}` : ""}`];
  }
  if (stop?.reason && stop.age < STOPPED_S) return ["", `stopped: ${stop.reason}`];
  return ["", "standing"];
}
