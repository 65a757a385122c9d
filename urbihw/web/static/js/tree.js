// What a robot has, from its tree: which parts are joints, cameras, lights ...  By interfaces, units and flags only, so
// that no platform needs a line here.

const MOTORS = ["Motor", "RotationalMotor", "LinearMotor", "RotationalSpeedMotor", "LinearSpeedMotor"];
const RANGES = { rad: Math.PI, deg: 180, turn: 1, "%": 100, "rad/s": 1, "m/s": 0.5 };
const KINDS = [
  ["camera", (part) => part.has("VideoIn")],
  ["laser", (part) => part.has("Laser")],
  ["distance", (part) => part.has("DistanceSensor")],
  ["sound", (part) => part.has("AudioOut") || part.has("AudioIn") || part.has("TextToSpeech")],
  ["light", (part) => (part.has("Led") || part.has("RGBLed")) && part.effectors.length > 0],
  ["joint", (part) => part.isMotor && part.goal && !part.isSpeed],
  ["speed", (part) => part.isMotor && part.goal && part.isSpeed],
  ["touch", (part) => part.has("TouchSensor")],
  ["sensor", (part) => part.interfaces.length > 0],
];

/** A device: its names, its slots by name, and what it is (`kind`). */
export class Part {
  constructor(node, places) {
    this.node = node;
    this.path = node.global || node.path;
    this.place = places;
    this.title = node.global || node.path.replace(/^robot\.(body\.)?/, "");
    this.interfaces = node.interfaces;
    this.slots = new Map(node.slots.map((slot) => [slot.name, slot]));
    this.effectors = node.slots.filter((slot) => slot.effector);
    this.isMotor = node.interfaces.some((name) => MOTORS.includes(name));
    this.goal = this.effectors.find((slot) => slot.name === "val") || null;
    this.isSpeed = this.goal !== null && /%|\/s/.test(this.goal.unit);
    const found = KINDS.find(([, test]) => test(this));
    this.kind = found ? found[0] : "";
  }

  /** What people call it, by its place in the tree: "left arm shoulder pitch", "back-right-back sonar", "joint 6"; a name
   * of several words, such as shoulder_pan, was given by people. */
  get words() {
    if (this.title.includes("_")) return this.title;
    const steps = this.node.path.replace(/^robot\.(body\.)?/, "").split(".");
    return steps.map((step) => {
      const name = step.replace(/\[.*$/, "").replace(/([a-z])([A-Z])/g, "$1 $2").toLowerCase();
      const places = [...step.matchAll(/\["?([^\]"]*)"?\]/g)].map(([, place]) => place);
      const words = places.join("-");
      return /^\d/.test(words) ? `${name} ${words}` : words ? `${words} ${name}` : name;
    }).join(" ");
  }

  has(name) {
    return this.interfaces.includes(name);
  }

  slot(name) {
    return this.slots.get(name) || null;
  }

  slotPath(name) {
    return `${this.path}.${name}`;
  }

  /** Numbers and truths with a unit or a meaning that a person looks at. */
  get readings() {
    return [...this.slots.values()].filter((slot) => slot.readable && ["number", "truth", "text"].includes(slot.kind));
  }
}

/** Least and greatest value of a slot for a slider. */
export function rangeOf(slot) {
  const most = RANGES[slot.unit] ?? 1;
  return [slot.min ?? -most, slot.max ?? most];
}

/** The robot as cards want it. */
export class Model {
  constructor(tree) {
    this.tree = tree;
    this.parts = [];
    this.walk(tree.robot, []);
    this.robot = new Part(tree.robot, []);
    this.platform = tree.platform;
    this.byNodePath = new Map(this.parts.map((part) => [part.node.path, part]));
    this.groups = tree.groups
      .map((group) => ({ name: group.name, members: group.members.map((path) => this.byNodePath.get(path)) }))
      .filter((group) => group.members.every(Boolean));
  }

  walk(node, places) {
    for (const inner of node.parts) {
      const path = inner.place === null ? [] : [...places, inner.place];
      if (inner.slots && inner.interfaces.length) this.parts.push(new Part(inner, path));
      this.walk(inner, path);
    }
  }

  of(...kinds) {
    return this.parts.filter((part) => kinds.includes(part.kind));
  }

  get isMobile() {
    return this.robot.has("Mobile");
  }

  hasFunction(name) {
    return this.robot.slot(name)?.kind === "function";
  }

  /** All owners of slots: the robot, its platform and its devices, each with title, path and slots. */
  get owners() {
    const platform = this.platform;
    return [
      ...(this.robot.slots.size ? [{ title: "robot", path: "robot", slots: this.tree.robot.slots }] : []),
      ...(platform ? [{ title: platform.name, path: platform.path, slots: platform.slots }] : []),
      ...this.parts.map((part) => ({ title: part.title, path: part.path, slots: part.node.slots })),
    ];
  }

  /** The paths of all events. */
  get events() {
    return this.owners.flatMap(({ path, slots }) =>
      slots.filter((slot) => slot.kind === "event").map((slot) => `${path}.${slot.name}`));
  }

  /** A slot by its path; null if there is none. */
  find(path) {
    const cut = path.lastIndexOf(".");
    const owner = this.owners.find((each) => each.path === path.slice(0, cut));
    return owner?.slots.find((slot) => slot.name === path.slice(cut + 1)) || null;
  }
}

const AXES = { front: [1, 0], back: [-1, 0], left: [0, 1], right: [0, -1] };

/** Directions of sensors by their places (left, front ...), rad to the left.  Eight or more stand around the robot. */
export function directionsOf(parts) {
  const angles = parts.map((part) => {
    let [x, y, weight] = [0, 0, 1];
    for (const place of part.place) {
      const axis = AXES[place];
      if (!axis) continue;
      x += axis[0] * weight;
      y += axis[1] * weight;
      weight /= 3;
    }
    return x || y ? Math.atan2(y, x) : 0;
  });
  if (parts.length < 8) return angles;
  const order = angles.map((_, index) => index).sort((a, b) => angles[b] - angles[a]);
  const spread = [];
  order.forEach((index, rank) => (spread[index] = Math.PI - ((rank + 0.5) * 2 * Math.PI) / parts.length));
  return spread;
}
