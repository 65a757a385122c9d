// The figure without WebGL: an SVG, seen along the shorter of its two sides.  It can be clicked, not dragged.

import { colour } from "../js/ui.js";
import { sizeOf, travelOf } from "./model.js";

const CORNERS = [-0.5, 0.5].flatMap((x) => [-0.5, 0.5].flatMap((y) => [-0.5, 0.5].map((z) => [x, y, z])));
const SVG = "http://www.w3.org/2000/svg";

/** A frame: rows of the rotation, and the place. */
const START = { rows: [[1, 0, 0], [0, 1, 0], [0, 0, 1]], at: [0, 0, 0] };

const dot = (one, other) => one[0] * other[0] + one[1] * other[1] + one[2] * other[2];

function pointIn(frame, point) {
  return frame.at.map((own, index) => own + dot(frame.rows[index], point));
}

function compose(outer, inner) {
  const columns = [0, 1, 2].map((index) => inner.rows.map((row) => row[index]));
  return { at: pointIn(outer, inner.at), rows: outer.rows.map((row) => columns.map((column) => dot(row, column))) };
}

function placed({ at = [0, 0, 0], turn = [0, 0, 0] }) {
  const [[sr, cr], [sp, cp], [sy, cy]] = turn.map((angle) => [Math.sin(angle), Math.cos(angle)]);
  return { at, rows: [[cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr], [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr], [-sp, cp * sr, cp * cr]] };
}

function moved(joint, travel) {
  if (joint.unit === "m") return { ...START, at: joint.axis.map((share) => share * travel) };
  const [x, y, z] = joint.axis;
  const [s, c] = [Math.sin(travel), Math.cos(travel)];
  const r = 1 - c;
  return { at: [0, 0, 0], rows: [[c + x * x * r, x * y * r - z * s, x * z * r + y * s], [y * x * r + z * s, c + y * y * r, y * z * r - x * s], [z * x * r - y * s, z * y * r + x * s, c + z * z * r]] };
}

/** The frames of all links, by name. */
export function framesOf(figure, readings) {
  const frames = new Map();
  for (const link of figure.links) {
    let frame = compose(frames.get(link.on) || START, placed(link));
    const reading = readings.get(link.joint?.device);
    if (typeof reading === "number") frame = compose(frame, moved(link.joint, travelOf(link.joint, reading)));
    frames.set(link.name, frame);
  }
  return frames;
}

/** The outline of points on a plane. */
function hull(points) {
  const sorted = [...points].sort((a, b) => a[0] - b[0] || a[1] - b[1]);
  const half = (row) => {
    const kept = [];
    for (const point of row) {
      while (kept.length > 1) {
        const [a, b] = kept.slice(-2);
        if ((b[0] - a[0]) * (point[1] - a[1]) - (b[1] - a[1]) * (point[0] - a[0]) > 0) break;
        kept.pop();
      }
      kept.push(point);
    }
    return kept.slice(0, -1);
  };
  return [...half(sorted), ...half(sorted.reverse())];
}

export class SideView {
  /** Draw a figure into an svg element; `choose(link)` is called for a click on a link. */
  constructor(svg, figure, choose) {
    this.svg = svg;
    this.figure = figure;
    this.readings = new Map();
    this.states = new Map();
    this.shapes = figure.links.flatMap((link) => (link.shapes || []).map((shape) => {
      const polygon = document.createElementNS(SVG, "polygon");
      polygon.addEventListener("click", () => choose(link));
      svg.append(polygon);
      return { link, shape, polygon };
    }));
    const all = this.corners().flatMap(({ corners }) => corners);
    const spread = (axis) => Math.max(...all.map((point) => point[axis])) - Math.min(...all.map((point) => point[axis]));
    this.across = spread(0) >= spread(1) ? 0 : 1;
    this.timer = null;
    this.draw();
  }

  corners() {
    const frames = framesOf(this.figure, this.readings);
    return this.shapes.map(({ link, shape, polygon }) => {
      const frame = compose(frames.get(link.name), placed(shape));
      const size = sizeOf(shape);
      return { link, shape, polygon, corners: CORNERS.map((corner) => pointIn(frame, corner.map((share, axis) => share * size[axis]))) };
    });
  }

  setReading(device, value) {
    this.readings.set(device, value);
    this.change();
  }

  setState(device, name) {
    this.states.set(device, name);
    this.change();
  }

  setGoal() {}

  setPose() {}

  setScan() {}

  setEchoes() {}

  setLine() {}

  change() {
    this.timer ??= setTimeout(() => {
      this.timer = null;
      this.draw();
    }, 100);
  }

  draw() {
    const rows = this.corners();
    const sign = this.across ? -1 : 1; // seen from behind, its left is to the left
    const flat = (point) => [sign * point[this.across], -point[2]];
    const all = rows.flatMap(({ corners }) => corners.map(flat));
    const [left, top] = [0, 1].map((axis) => Math.min(...all.map((point) => point[axis])));
    const [right, bottom] = [0, 1].map((axis) => Math.max(...all.map((point) => point[axis])));
    const rim = 0.08 * Math.max(right - left, bottom - top);
    this.svg.setAttribute("viewBox", `${left - rim} ${top - rim} ${right - left + 2 * rim} ${bottom - top + 2 * rim}`);
    for (const { link, shape, polygon, corners } of rows) {
      polygon.setAttribute("points", hull(corners.map(flat)).map((point) => point.map((each) => each.toFixed(4)).join(",")).join(" "));
      const state = this.states.get(this.figure.jointOf(link)?.joint.device);
      polygon.setAttribute("fill", state ? colour(state) : shape.colour);
    }
  }

  close() {
    clearTimeout(this.timer);
    this.svg.replaceChildren();
  }
}
