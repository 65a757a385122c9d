// The WebSocket to the gateway: requests with answers, pushes, and a new connection after a loss.

const FIRST_PAUSE_MS = 250;
const MAX_PAUSE_MS = 3000;
const ANSWER_MS = 10000;

/** An answer that is no success: `code` is one of those of the protocol (docs/gateway.md). */
export class Refusal extends Error {
  constructor(text, code) {
    super(text);
    this.code = code;
  }
}

/** The connection of this page.
 *
 * `on(event, heard)` hears a push; the events `open` and `close` are of the connection itself, `binary` is a picture.
 */
export class Connection {
  constructor(url) {
    this.url = url;
    this.isOpen = false;
    this.lastHeard = 0;
    this.heard = new Map();
    this.waiting = new Map();
    this.nextId = 1;
    this.pause = FIRST_PAUSE_MS;
  }

  on(event, heard) {
    if (!this.heard.has(event)) this.heard.set(event, new Set());
    this.heard.get(event).add(heard);
    return () => this.heard.get(event).delete(heard);
  }

  tell(event, message) {
    for (const heard of this.heard.get(event) || []) heard(message);
  }

  open() {
    const socket = new WebSocket(this.url);
    socket.binaryType = "arraybuffer";
    this.socket = socket;
    socket.onopen = () => {
      this.isOpen = true;
      this.pause = FIRST_PAUSE_MS;
      this.lastHeard = performance.now();
      this.tell("open");
    };
    socket.onmessage = (event) => {
      this.lastHeard = performance.now();
      if (typeof event.data === "string") this.receive(JSON.parse(event.data));
      else this.tell("binary", event.data);
    };
    socket.onclose = (event) => {
      const wasOpen = this.isOpen;
      this.isOpen = false;
      for (const { reject, timer } of this.waiting.values()) {
        clearTimeout(timer);
        reject(new Refusal("the connection to the robot's machine is lost", "gone"));
      }
      this.waiting.clear();
      if (wasOpen) this.tell("close", event.reason);
      setTimeout(() => this.open(), this.pause);
      this.pause = Math.min(2 * this.pause, MAX_PAUSE_MS);
    };
  }

  receive(message) {
    if (message.event !== undefined) {
      this.tell(message.event, message);
      return;
    }
    const request = this.waiting.get(message.id);
    if (!request) return;
    this.waiting.delete(message.id);
    clearTimeout(request.timer);
    if (message.ok) request.resolve(message);
    else request.reject(new Refusal(message.error, message.code));
  }

  /** Ask without waiting for an answer. */
  send(verb, fields = {}) {
    if (this.isOpen) this.socket.send(JSON.stringify({ id: this.nextId++, do: verb, ...fields }));
  }

  /** The answer to a request; throws Refusal. */
  ask(verb, fields = {}, timeout = ANSWER_MS) {
    return new Promise((resolve, reject) => {
      if (!this.isOpen) {
        reject(new Refusal("there is no connection to the robot's machine", "gone"));
        return;
      }
      const id = this.nextId++;
      const timer = setTimeout(() => {
        this.waiting.delete(id);
        reject(new Refusal(`no answer for ${timeout / 1000} s`, "gone"));
      }, timeout);
      this.waiting.set(id, { resolve, reject, timer });
      this.socket.send(JSON.stringify({ id, do: verb, ...fields }));
    });
  }
}

const scheme = location.protocol === "https:" ? "wss" : "ws";
export const connection = new Connection(`${scheme}://${location.host}/ws`);
