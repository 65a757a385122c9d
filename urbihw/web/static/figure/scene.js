// The figure in 3D, by three.js.  The measured pose is solid, a goal elsewhere is a ghost.  x is ahead, y to the left, z up.
// It is drawn when something has changed, at most 30 times in a second.

import {
  AmbientLight, Box3, BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, Color, CylinderGeometry, DirectionalLight,
  Group, HemisphereLight, Line, LineBasicMaterial, LineSegments, Mesh, MeshLambertMaterial, OrbitControls,
  PerspectiveCamera, Plane, Points, PointsMaterial, Raycaster, Scene, SphereGeometry, Vector2, Vector3, WebGLRenderer,
} from "../vendor/three.js";
import { colour } from "../js/ui.js";
import { kindOf, travelOf } from "./model.js";

const PERIOD_MS = 33;
const SAME = 0.02; // rad or m: a goal so near is where the joint is
const TINT = 0.65;
const GHOST = 0.28;
const CELLS = 14; // squares of the floor to each side
const MIN_PIXELS = 6; // pixels a rad below which a drag does not tell what is meant

const GEOMETRIES = {
  box: ([x, y, z]) => new BoxGeometry(x, y, z),
  cylinder: ([radius, length]) => new CylinderGeometry(radius, radius, length, 28).rotateX(Math.PI / 2),
  capsule: ([radius, length]) => new CapsuleGeometry(radius, length, 6, 18).rotateX(Math.PI / 2),
  sphere: (radius) => new SphereGeometry(radius, 24, 16),
  ellipsoid: ([x, y, z]) => new SphereGeometry(1, 24, 16).scale(x, y, z),
};

function put(object, { at = [0, 0, 0], turn = [0, 0, 0] }) {
  object.position.set(...at);
  object.rotation.set(...turn, "ZYX");
}

/** The links as groups in groups; `move` turns a joint. */
class Body {
  constructor(figure, isGhost) {
    this.root = new Group();
    this.joints = new Map(); // name of a link -> the group that its joint moves
    this.meshes = [];
    const groups = new Map();
    for (const link of figure.links) {
      const fixed = new Group();
      put(fixed, link);
      const moving = new Group();
      fixed.add(moving);
      (groups.get(link.on) || this.root).add(fixed);
      groups.set(link.name, moving);
      this.joints.set(link.name, moving);
      for (const shape of link.shapes || []) {
        const [kind, sizes] = kindOf(shape);
        const material = new MeshLambertMaterial({ color: shape.colour, transparent: isGhost, opacity: isGhost ? GHOST : 1, depthWrite: !isGhost });
        const mesh = new Mesh(GEOMETRIES[kind](sizes), material);
        put(mesh, shape);
        mesh.userData = { link, colour: new Color(shape.colour) };
        moving.add(mesh);
        this.meshes.push(mesh);
      }
    }
  }

  move(link, travel) {
    const group = this.joints.get(link.name);
    const axis = new Vector3(...link.joint.axis);
    if (link.joint.unit === "m") group.position.copy(axis.multiplyScalar(travel));
    else group.setRotationFromAxisAngle(axis, travel);
  }
}

/** A line or points whose places change. */
function makeCloud(Kind, material) {
  const cloud = new Kind(new BufferGeometry(), material);
  cloud.frustumCulled = false;
  return cloud;
}

function setPlaces(cloud, places) {
  cloud.geometry.setAttribute("position", new BufferAttribute(new Float32Array(places.flat()), 3));
  cloud.visible = places.length > 0;
}

/** A round of squares on the floor, each of its own lines: some renderers leave out a line that passes the camera. */
function gridOf(cell) {
  const ends = [];
  for (let x = -CELLS; x <= CELLS; x++) {
    for (let y = -CELLS; y <= CELLS; y++) {
      if (Math.hypot(x, y) > CELLS) continue;
      ends.push([x * cell, y * cell, 0], [(x + 1) * cell, y * cell, 0], [x * cell, y * cell, 0], [x * cell, (y + 1) * cell, 0]);
    }
  }
  return ends;
}

export class FigureScene {
  /** Draw a figure on a canvas. */
  constructor(canvas, figure) {
    this.figure = figure;
    this.canvas = canvas;
    this.readings = new Map();
    this.goals = new Map();
    this.states = new Map(); // device -> name of a colour of the style sheet; none as drawn
    this.pose = [0, 0, 0];
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "low-power" });
    this.renderer.setPixelRatio(Math.min(2, window.devicePixelRatio || 1));
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(35, 1, 0.01, 100);
    this.camera.up.set(0, 0, 1);
    this.body = new Body(figure, false);
    this.ghost = new Body(figure, true);
    this.base = new Group();
    this.base.add(this.body.root, this.ghost.root);
    this.laser = makeCloud(Points, new PointsMaterial({ size: 3, sizeAttenuation: false }));
    this.echoes = makeCloud(LineSegments, new LineBasicMaterial());
    this.trail = makeCloud(Line, new LineBasicMaterial());
    this.path = makeCloud(Line, new LineBasicMaterial());
    this.base.add(this.laser, this.echoes);
    const sky = new HemisphereLight(0xffffff, 0x8899aa, 1.9);
    this.scene.add(this.base, this.trail, this.path, sky, new AmbientLight(0xffffff, 0.5));
    sky.position.set(0, 0, 1);
    const sun = new DirectionalLight(0xffffff, 1.6);
    sun.position.set(2, -1.5, 3);
    this.scene.add(sun);
    this.look();
    this.controls = new OrbitControls(this.camera, canvas);
    this.controls.enablePan = false;
    this.controls.maxPolarAngle = Math.PI * 0.495;
    this.controls.addEventListener("change", () => this.change());
    this.aim();
    const paint = () => this.paint();
    this.darkness = matchMedia("(prefers-color-scheme: dark)");
    this.darkness.addEventListener("change", paint);
    this.ends = [() => this.darkness.removeEventListener("change", paint)];
    const size = new ResizeObserver(() => this.change());
    size.observe(canvas);
    this.ends.push(() => size.disconnect());
    this.drawn = 0;
    this.isDirty = true;
    const step = (now) => {
      this.frame = requestAnimationFrame(step);
      if (this.isDirty && now - this.drawn >= PERIOD_MS && canvas.clientWidth && !document.hidden) this.draw(now);
    };
    this.frame = requestAnimationFrame(step);
  }

  /** Whether it stands on parts that move: then the lowest one is on the floor. */
  look() {
    const box = new Box3();
    this.scene.updateMatrixWorld(true);
    let lowest = null;
    for (const mesh of this.body.meshes) {
      box.setFromObject(mesh);
      if (lowest === null || box.min.z < lowest.z) lowest = { z: box.min.z, link: mesh.userData.link };
    }
    this.walks = Boolean(lowest && this.figure.jointOf(lowest.link));
    this.box = new Box3().setFromObject(this.body.root);
    const most = this.box.getSize(new Vector3()).length();
    this.cell = [0.05, 0.1, 0.25, 0.5, 1].find((each) => each * 6 > most) || 2;
    this.grid = makeCloud(LineSegments, new LineBasicMaterial({ transparent: true, opacity: 0.7 }));
    setPlaces(this.grid, gridOf(this.cell));
    this.scene.add(this.grid);
    this.paint();
  }

  /** Look at the robot from ahead and aside. */
  aim() {
    const middle = this.box.getCenter(new Vector3());
    const size = this.box.getSize(new Vector3()).length();
    this.controls.target.copy(middle);
    // What stands on wheels is seen with the room around it.
    const far = this.figure.devices.length ? 1 : 2;
    this.camera.position.copy(middle).add(new Vector3(0.8, -1.1, 0.5).multiplyScalar(far * Math.max(0.2, size)));
    this.controls.minDistance = size * 0.4;
    this.controls.maxDistance = size * 12;
    this.controls.update();
  }

  /** Take the colours of the page, light or dark. */
  paint() {
    this.scene.background = new Color(colour("back"));
    this.grid.material.color.set(colour("line"));
    this.laser.material.color.set(colour("bad"));
    this.echoes.material.color.set(colour("warning"));
    this.trail.material.color.set(colour("soft"));
    this.path.material.color.set(colour("ok"));
    this.change();
  }

  change() {
    this.isDirty = true;
  }

  /** What a device measures; null for nothing. */
  setReading(device, value) {
    this.keep(this.readings, device, value);
  }

  /** Where a joint is to go; null for nowhere else. */
  setGoal(device, value) {
    this.keep(this.goals, device, value);
  }

  /** A colour of the style sheet for the links of a joint; "" as drawn. */
  setState(device, name) {
    this.keep(this.states, device, name);
  }

  keep(map, key, value) {
    if (map.get(key) === value) return;
    map.set(key, value);
    this.change();
  }

  /** Where a base stands: x, y in m, heading in rad. */
  setPose(x, y, theta) {
    const [x0, y0] = this.pose;
    this.pose = [x, y, theta];
    const moved = new Vector3(x - x0, y - y0, 0);
    this.camera.position.add(moved);
    this.controls.target.add(moved);
    this.grid.position.set(Math.round(x / this.cell) * this.cell, Math.round(y / this.cell) * this.cell, 0);
    this.change();
  }

  /** What a laser sees, from the link where it sits: places in its own frame. */
  setScan(link, places) {
    setPlaces(this.laser, this.inBase(link, places));
    this.change();
  }

  /** The echo of each distance sensor: [link, m]. */
  setEchoes(rows) {
    setPlaces(this.echoes, rows.flatMap(([link, far]) => this.inBase(link, [[0, 0, 0], [far, 0, 0]])));
    this.change();
  }

  /** The trail, or the path of a base, [x, y] in m on the floor. */
  setLine(which, places) {
    setPlaces(this[which], places.map(([x, y]) => [x, y, 0.004]));
    this.change();
  }

  inBase(link, places) {
    const group = this.body.joints.get(link.name);
    return places.map((place) => this.base.worldToLocal(group.localToWorld(new Vector3(...place))).toArray());
  }

  /** The travel of each measured joint as it is drawn, by the device: rad or m. */
  travels() {
    return Object.fromEntries(this.figure.links.filter((link) => link.joint?.device).map((link) => {
      const group = this.body.joints.get(link.name);
      const { x, y, z, w } = group.quaternion;
      const [ax, ay, az] = link.joint.axis;
      if (link.joint.unit === "m") return [link.joint.device, group.position.dot(new Vector3(ax, ay, az))];
      return [link.joint.device, 2 * Math.atan2(x * ax + y * ay + z * az, w)];
    }));
  }

  /** Where a link is drawn in the frame of the robot, m. */
  placeOf(name) {
    this.scene.updateMatrixWorld(true);
    return this.body.root.worldToLocal(this.body.joints.get(name).getWorldPosition(new Vector3())).toArray();
  }

  /** Where the origin of a link, or a point in it, is on the canvas, in pixels. */
  pixelOf(name, place = [0, 0, 0]) {
    this.scene.updateMatrixWorld(true);
    return this.project(this.body.joints.get(name).localToWorld(new Vector3(...place))).toArray();
  }

  project(point) {
    const seen = point.clone().project(this.camera);
    return new Vector2(((seen.x + 1) / 2) * this.canvas.clientWidth, ((1 - seen.y) / 2) * this.canvas.clientHeight);
  }

  ray(event) {
    const box = this.canvas.getBoundingClientRect();
    const caster = new Raycaster();
    caster.setFromCamera(new Vector2(((event.clientX - box.left) / box.width) * 2 - 1, 1 - ((event.clientY - box.top) / box.height) * 2), this.camera);
    return caster;
  }

  /** The link under the pointer, and the place where it is hit: {link, point}; null for none. */
  pick(event) {
    const hit = this.ray(event).intersectObjects(this.body.meshes, false)[0];
    return hit ? { link: hit.object.userData.link, point: hit.point } : null;
  }

  /** The place on the floor under the pointer, [x, y] in m; null for the sky. */
  floor(event) {
    const place = this.ray(event).ray.intersectPlane(new Plane(new Vector3(0, 0, 1), 0), new Vector3());
    return place ? [place.x, place.y] : null;
  }

  /** A drag of a joint by a point of a link: a function of the pointer that tells the travel under it. */
  beginDrag(link, point) {
    const group = this.body.joints.get(link.name);
    const above = group.parent;
    const axis = new Vector3(...link.joint.axis);
    const local = group.worldToLocal(point.clone());
    const isSlide = link.joint.unit === "m";
    let travel = this.travels()[link.joint.device];
    const placeAt = (value) => {
      const moved = isSlide ? local.clone().addScaledVector(axis, value) : local.clone().applyAxisAngle(axis, value);
      return this.project(above.localToWorld(moved));
    };
    return (event) => {
      const box = this.canvas.getBoundingClientRect();
      const wanted = new Vector2(event.clientX - box.left, event.clientY - box.top);
      for (let turn = 0; turn < 4; turn++) {
        const here = placeAt(travel);
        const way = placeAt(travel + 0.01).sub(here).multiplyScalar(100);
        if (way.length() < MIN_PIXELS) break;
        const step = wanted.clone().sub(here).dot(way) / way.lengthSq();
        travel += Math.max(-0.3, Math.min(0.3, step));
      }
      return travel;
    };
  }

  pulls(link) {
    const { joint } = link;
    const [is, goal] = [this.readings.get(joint.device), this.goals.get(joint.device)];
    return typeof is === "number" && typeof goal === "number" && Math.abs(travelOf(joint, goal) - travelOf(joint, is)) > SAME;
  }

  draw(now) {
    this.drawn = now;
    this.isDirty = false;
    const moved = new Set(); // links whose ghost is elsewhere
    for (const link of this.figure.links) {
      if (moved.has(link.on)) moved.add(link.name);
      const device = link.joint?.device;
      const is = this.readings.get(device);
      if (!device || typeof is !== "number") continue;
      this.body.move(link, travelOf(link.joint, is));
      const goal = this.goals.get(device);
      this.ghost.move(link, travelOf(link.joint, typeof goal === "number" ? goal : is));
      if (this.pulls(link)) moved.add(link.name);
    }
    for (const mesh of this.ghost.meshes) mesh.visible = moved.has(mesh.userData.link.name);
    for (const { material, userData } of this.body.meshes) {
      const state = this.states.get(this.figure.jointOf(userData.link)?.joint.device);
      material.color.copy(userData.colour);
      if (state) material.color.lerp(new Color(colour(state)), TINT);
    }
    this.stand();
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / height;
    this.camera.updateProjectionMatrix();
    this.renderer.render(this.scene, this.camera);
  }

  /** Put the base where it is, and one that walks on its lowest part. */
  stand() {
    const [x, y, theta] = this.pose;
    this.base.position.set(x, y, 0);
    this.base.rotation.set(0, 0, theta);
    if (!this.walks) return;
    this.body.root.position.z = 0;
    this.base.updateMatrixWorld(true);
    const height = -new Box3().setFromObject(this.body.root).min.z;
    this.body.root.position.z = height;
    this.ghost.root.position.z = height;
  }

  close() {
    cancelAnimationFrame(this.frame);
    for (const end of this.ends) end();
    this.controls.dispose();
    for (const { geometry, material } of [...this.body.meshes, ...this.ghost.meshes]) {
      geometry.dispose();
      material.dispose();
    }
    this.renderer.dispose();
  }
}
