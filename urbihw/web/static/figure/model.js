// The figure of the robot as the page draws it: links, each behind the one that carries it, and their joints.

const PER_UNIT = { rad: 1, deg: Math.PI / 180, turn: 2 * Math.PI, m: 1 };
const SIZES = {
  box: ([x, y, z]) => [x, y, z],
  cylinder: ([radius, length]) => [2 * radius, 2 * radius, length],
  capsule: ([radius, length]) => [2 * radius, 2 * radius, length + 2 * radius],
  sphere: (radius) => [2 * radius, 2 * radius, 2 * radius],
  ellipsoid: ([x, y, z]) => [2 * x, 2 * y, 2 * z],
};

/** Kind and sizes of a shape. */
export function kindOf(shape) {
  const kind = Object.keys(SIZES).find((each) => shape[each] !== undefined);
  return [kind, shape[kind]];
}

/** The edges of the box around a shape. */
export function sizeOf(shape) {
  const [kind, sizes] = kindOf(shape);
  return SIZES[kind](sizes);
}

/** What the gateway told of the figure (docs/gateway.md, `figure`). */
export class Figure {
  constructor(table) {
    this.links = table.links;
    this.byName = new Map(this.links.map((link) => [link.name, link]));
  }

  /** Links with a joint that is measured, by the device that measures it; two links may follow one device. */
  get devices() {
    return [...new Set(this.links.map((link) => link.joint?.device).filter(Boolean))];
  }

  /** Where the sensors sit: links with a device and no joint. */
  get sensors() {
    return this.links.filter((link) => link.device);
  }

  /** The links from one to the first. */
  chain(link) {
    const found = [];
    for (let each = link; each; each = this.byName.get(each.on)) found.push(each);
    return found;
  }

  /** The joint that moves a link: its own, or the next one towards the first link; null for none. */
  jointOf(link) {
    return this.chain(link).find((each) => each.joint?.device) || null;
  }
}

/** How far a joint is from the drawn pose by its reading, rad or m. */
export function travelOf(joint, reading) {
  return (reading - (joint.zero || 0)) * PER_UNIT[joint.unit || "rad"];
}

/** The reading of a joint at this travel. */
export function readingOf(joint, travel) {
  return travel / PER_UNIT[joint.unit || "rad"] + (joint.zero || 0);
}
