// Samples of slots.  A card that wants a slot says so; the wishes of one rate make one subscription.  What came is drawn
// in the next animation frame, from the newest value: never in the handler of the message.

import { connection } from "./connection.js";

const CHANGE_MS = 60; // wishes that come together make one subscription

class Stream {
  constructor(hz) {
    this.hz = hz;
    this.wishes = new Map(); // slot -> set of functions called with each sample
    this.number = null;
    this.names = [];
    this.timer = null;
  }

  change() {
    if (this.timer === null) {
      this.timer = setTimeout(() => {
        this.timer = null;
        this.begin();
      }, CHANGE_MS);
    }
  }

  async begin() {
    if (!connection.isOpen) return;
    const old = this.number;
    const slots = [...this.wishes.keys()];
    this.number = null;
    if (old !== null) {
      streams.delete(old);
      connection.send("unsubscribe", { sub: old });
    }
    if (!slots.length) return;
    try {
      const told = await connection.ask("subscribe", { slots, hz: this.hz });
      if (this.number !== null) streams.delete(this.number);
      this.number = told.sub;
      this.names = told.names;
      streams.set(told.sub, this);
    } catch {
      // The robot is not there yet, or the interpreter is held: try again.
      setTimeout(() => this.change(), 1000);
    }
  }

  receive(sample) {
    for (let index = 0; index < this.names.length; index++) {
      const wishes = this.wishes.get(this.names[index]);
      if (wishes) for (const heard of wishes) heard(sample.v[index], sample.t);
    }
  }
}

const streams = new Map(); // number of a subscription -> its stream
const byRate = new Map();
const newest = new Map(); // slot -> its newest value
const drawers = new Map(); // slot -> functions that draw it
const dirty = new Set();
let frame = null;

/** Call a function with each sample of a slot; returns what ends that. */
export function hearSamples(slot, hz, heard) {
  if (!byRate.has(hz)) byRate.set(hz, new Stream(hz));
  const stream = byRate.get(hz);
  if (!stream.wishes.has(slot)) {
    stream.wishes.set(slot, new Set());
    stream.change();
  }
  stream.wishes.get(slot).add(heard);
  return () => {
    const wishes = stream.wishes.get(slot);
    if (!wishes) return;
    wishes.delete(heard);
    if (!wishes.size) {
      stream.wishes.delete(slot);
      stream.change();
    }
  };
}

/** Call a function with the newest value of a slot in an animation frame, when it came; returns what ends that. */
export function drawSlot(slot, draw, hz = 10) {
  if (!drawers.has(slot)) drawers.set(slot, new Set());
  drawers.get(slot).add(draw);
  if (newest.has(slot)) draw(newest.get(slot));
  const end = hearSamples(slot, hz, (value) => {
    newest.set(slot, value);
    dirty.add(slot);
    if (frame === null) frame = requestAnimationFrame(drawDirty);
  });
  return () => {
    drawers.get(slot).delete(draw);
    if (!drawers.get(slot).size) {
      drawers.delete(slot);
      newest.delete(slot);
    }
    end();
  };
}

function drawDirty() {
  frame = null;
  for (const slot of dirty) for (const draw of drawers.get(slot) || []) draw(newest.get(slot));
  dirty.clear();
}

connection.on("samples", (sample) => streams.get(sample.sub)?.receive(sample));
connection.on("open", () => {
  streams.clear();
  for (const stream of byRate.values()) {
    stream.number = null;
    stream.begin();
  }
});
connection.on("tree", () => byRate.forEach((stream) => stream.change()));
