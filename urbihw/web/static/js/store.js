// What the gateway has told of the robot, for all cards.  Cards look again when `notify` is called.

import { useEffect, useState } from "../vendor/htm-preact.js";
import { connection } from "./connection.js";
import { Model } from "./tree.js";

const MAX_LINES = 1000;
/** Events that are watched: the robot's and its platform's come first.  A connection to the server has 64 at most. */
const MAX_EVENTS = 30;

/** A list that keeps its newest members only. */
function keep(list, row, most = MAX_LINES) {
  list.push(row);
  if (list.length > most) list.splice(0, list.length - most);
}

export const store = {
  isOpen: false,
  closedAt: performance.now(),
  closedWhy: "",
  hello: { robot: "", platform: "", role: "view", you: "", fake: false, limits: {} },
  state: null,
  devices: [],
  model: null,
  /** What people call parts, by their names for programs, where the figure tells it better than the tree. */
  partWords: new Map(),
  output: [],
  log: [],
  happened: [],
  toasts: [],
};

const watchers = new Map(); // topic -> functions

/** Let the cards of a topic look again, once in an animation frame. */
export function notify(topic) {
  for (const look of watchers.get(topic) || []) look();
}

/** Look again whenever one of these topics changes. */
export function useTopics(...topics) {
  const [, setTurn] = useState(0);
  useEffect(() => {
    let frame = null;
    const look = () => {
      if (frame === null) {
        frame = requestAnimationFrame(() => {
          frame = null;
          setTurn((turn) => turn + 1);
        });
      }
    };
    for (const topic of topics) {
      if (!watchers.has(topic)) watchers.set(topic, new Set());
      watchers.get(topic).add(look);
    }
    return () => {
      if (frame !== null) cancelAnimationFrame(frame);
      for (const topic of topics) watchers.get(topic).delete(look);
    };
  }, []);
}

let nextToast = 1;

/** Show a line for some seconds; `action` is [word, function]. */
export function showToast(text, level = "bad", action = null) {
  if (store.toasts.some((toast) => toast.text === text)) return;
  const toast = { id: nextToast++, text, level, action };
  keep(store.toasts, toast, 4);
  setTimeout(() => dropToast(toast.id), 8000);
  notify("toasts");
}

export function dropToast(id) {
  store.toasts = store.toasts.filter((toast) => toast.id !== id);
  notify("toasts");
}

/** Ask, and show the error if there is one; the answer, or null. */
export async function ask(verb, fields = {}) {
  try {
    return await connection.ask(verb, fields);
  } catch (error) {
    const takeOver = error.code === "lease" ? ["Take over", () => ask("lease", { take: true })] : null;
    showToast(error.message, "bad", takeOver);
    return null;
  }
}

export const isFull = () => store.hello.role === "full";
export const mayDrive = () => store.hello.role !== "view";

let treeText = "";

function takeTree(tree) {
  const text = JSON.stringify(tree);
  if (!tree || text === treeText) return;
  treeText = text;
  store.model = new Model(tree);
  watchEvents();
  notify("tree");
}

/** Ask until it is answered: just after a start the robot or its server may not be there yet. */
async function insist(verb, fields) {
  const socket = connection.socket;
  for (;;) {
    try {
      return await connection.ask(verb, fields);
    } catch (error) {
      if (error.code !== "gone") throw error;
      await new Promise((resolve) => setTimeout(resolve, 1000));
      if (!connection.isOpen || connection.socket !== socket) return null; // `open` asks again
    }
  }
}

let eventSub = null;

async function watchEvents() {
  if (!store.isOpen || !store.model) return;
  if (eventSub !== null) connection.send("unsubscribe", { sub: eventSub });
  eventSub = null;
  const slots = store.model.events.filter((path) => !/\.(answeredRegister|answered)$/.test(path)).slice(0, MAX_EVENTS);
  if (!slots.length) return;
  try {
    eventSub = (await insist("events", { slots }))?.sub ?? null;
  } catch (error) {
    keep(store.happened, { slot: "", t: null, args: [error.message], at: new Date() });
    notify("happened");
  }
}

let lastLogRow = 0;

connection.on("open", () => {
  store.isOpen = true;
  eventSub = null;
  watchEvents();
  insist("log", { since: lastLogRow }).catch(() => {});
  notify("state");
});
connection.on("close", (why) => {
  store.isOpen = false;
  store.closedAt = performance.now();
  store.closedWhy = why;
  notify("state");
});
connection.on("hello", (told) => {
  store.hello = told;
  document.title = `${told.robot || told.platform || "robot"} - urbihw`;
  notify("state");
});
connection.on("state", (told) => {
  store.state = told;
  notify("state");
});
connection.on("devices", (told) => {
  store.devices = told.devices;
  notify("devices");
});
connection.on("tree", (told) => takeTree(told.tree));
const PLACE = /^!!! (?:(?:[^\s:]+:)?\d+\.\d[\d.-]*: )?(?:warning: )?/;

connection.on("output", (line) => {
  keep(store.output, line);
  notify("output");
  // Errors and warnings of what the cards ask for would be out of sight in the console.
  if ((line.kind === "error" || line.channel === "warning") && !document.getElementById("output")) showToast(line.text.replace(PLACE, ""));
});
connection.on("log", (row) => {
  if (typeof row.n === "number") lastLogRow = Math.max(lastLogRow, row.n);
  keep(store.log, row);
  notify("log");
});
connection.on("happened", (row) => {
  keep(store.happened, { ...row, at: new Date() }, 300);
  notify("happened");
});
