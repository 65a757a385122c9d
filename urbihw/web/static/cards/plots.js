// Plots: slots over time, a chart for each unit.  Drag a slot in or choose it; pause, zoom, CSV.

import { html, useEffect, useRef, useState } from "../vendor/htm-preact.js";
import { connection } from "../js/connection.js";
import { hearSamples } from "../js/samples.js";
import { showToast, store, useTopics } from "../js/store.js";
import { Card, colour, saveText } from "../js/ui.js";

const KEPT_S = 600;
const MAX_SERIES = 60;
const MAX_POINTS = 1500; // of a curve on the screen
const WINDOWS = [10, 60, 600];
const COLOURS = ["#2f7fd1", "#d1552f", "#2f9e58", "#9a57c9", "#c29a1c", "#2aa5a5", "#d14a8b", "#7a8796"];

/** Unit -> the unit in which a chart shows it, as the cards do, and how many of it one is. */
const SHOWN = { rad: ["°", 180 / Math.PI], degC: ["°C", 1], ratio: ["%", 100] };

/** The samples of a slot: two arrays of fixed length, written round and round. */
class Series {
  constructor(slot, unit, hz) {
    this.slot = slot;
    this.unit = unit;
    this.size = KEPT_S * hz;
    this.times = new Float64Array(this.size);
    this.values = new Float64Array(this.size);
    this.count = 0;
  }

  add(value, time) {
    const at = this.count++ % this.size;
    this.times[at] = time;
    this.values[at] = value === true ? 1 : value === false ? 0 : typeof value === "number" ? value : NaN;
  }

  /** The index of the first sample from a time on. */
  first(from) {
    let low = Math.max(0, this.count - this.size);
    let high = this.count;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (this.times[middle % this.size] < from) low = middle + 1;
      else high = middle;
    }
    return low;
  }
}

/** What is plotted; it goes on while another page is shown.  A paused plot shows `range`, and ends at `pausedAt`. */
export const plot = { hz: 50, series: new Map(), ends: new Map(), isPaused: false, pausedAt: 0, window: 10, range: null };
let deviceHz = 0;

function unitOf(path) {
  if (path.startsWith("@")) return { position: "rad", speed: "rad/s", torque: "N m", current: "A", voltage: "V", temperature: "degC" }[path.split(".").pop()] || "";
  return store.model.find(path)?.unit || "";
}

/** Values of devices come from the worker, also while the interpreter is held. */
function askDevices() {
  const wanted = [...plot.series.keys()].some((path) => path.startsWith("@")) ? plot.hz : 0;
  if (wanted !== deviceHz) connection.send("values", { hz: (deviceHz = wanted) });
}

connection.on("open", () => {
  deviceHz = 0;
  askDevices();
});
connection.on("values", (told) => {
  for (const [path, series] of plot.series) {
    if (path.startsWith("@")) {
      const cut = path.lastIndexOf(".");
      series.add(told.values?.[path.slice(1, cut)]?.[path.slice(cut + 1)], told.time);
    }
  }
});

/** Plot a slot from now on. */
export function addSeries(path) {
  if (plot.series.has(path) || plot.series.size >= MAX_SERIES) return;
  const series = new Series(path, unitOf(path), plot.hz);
  plot.series.set(path, series);
  if (path.startsWith("@")) askDevices();
  else plot.ends.set(path, hearSamples(path, plot.hz, (value, time) => series.add(value, time)));
}

export function dropSeries(path) {
  plot.series.delete(path);
  plot.ends.get(path)?.();
  plot.ends.delete(path);
  askDevices();
}

/** The series with the most samples: its times are those of its chart. */
const leaderOf = (list) => list.reduce((most, each) => (!most || each.count > most.count ? each : most), null);

/** The window of time that ends now: [from, to]; null without samples. */
function windowNow(list) {
  const leader = leaderOf(list);
  if (!leader || !leader.count) return null;
  const newest = leader.times[(leader.count - 1) % leader.size];
  return [newest - plot.window, newest];
}

/** The columns of a chart in a range of time: its times and a column for each series, no more points than shown. */
function columnsOf(list, range) {
  if (!range) return null;
  const leader = leaderOf(list);
  const [from, to] = range;
  const begin = leader.first(from);
  const end = Math.min(leader.count, leader.first(to) + 1);
  const stride = Math.max(1, Math.ceil((end - begin) / MAX_POINTS));
  const times = [];
  for (let index = begin - (begin % stride) + stride; index < end; index += stride) times.push(leader.times[index % leader.size]);
  const columns = list.map((series) => {
    let at = series.first(times[0] ?? 0);
    return times.map((time) => {
      while (at < series.count - 1 && series.times[(at + 1) % series.size] <= time) at++;
      const value = at < series.count && Math.abs(series.times[at % series.size] - time) < 1 ? series.values[at % series.size] : NaN;
      return Number.isNaN(value) ? null : value * (SHOWN[series.unit]?.[1] ?? 1);
    });
  });
  return [times, ...columns];
}

/** One uPlot of all series of a unit. */
function Chart({ unit, paths, zoom }) {
  const box = useRef(null);
  useEffect(() => {
    const axis = { stroke: colour("text"), grid: { stroke: colour("grid") }, ticks: { stroke: colour("grid") } };
    const series = paths.map((path, index) => ({ label: path, stroke: COLOURS[index % COLOURS.length], width: 1.5, spanGaps: false }));
    const newest = (chart) => chart.data[0][chart.data[0].length - 1] || 0;
    // Round times before the newest sample.
    const splits = (chart, index, least, most, step) => {
      const found = [];
      if (!(step > 0)) return found; // nothing is shown yet
      for (let at = newest(chart) - step * Math.floor((newest(chart) - least) / step); at <= most; at += step) found.push(at);
      return found;
    };
    const time = { ...axis, splits, values: (chart, splits) => splits.map((each) => `${Number((each - newest(chart)).toFixed(1)) || 0}`) };
    const chart = new window.uPlot({
      width: box.current.clientWidth, height: 240, cursor: { sync: { key: "panel" }, drag: { x: true, y: false, setScale: false }, bind: { dblclick: () => () => zoom(null) } },
      hooks: { setSelect: [(drawn) => {
        const { left, width } = drawn.select;
        if (width < 5) return;
        const range = [drawn.posToVal(left, "x"), drawn.posToVal(left + width, "x")];
        drawn.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
        zoom(range);
      }] },
      scales: { x: { time: false } }, axes: [time, { ...axis, label: unit === "1" ? "" : SHOWN[unit]?.[0] ?? unit, size: 60 }], legend: { live: true },
      series: [{ label: "s" , value: (self, value) => (value === null ? "–" : value.toFixed(2)) }, ...series],
    }, [[], ...paths.map(() => [])], box.current);
    let frame = null;
    let next = 0;
    let shown = null; // the range that a paused plot shows
    const draw = (now) => {
      frame = requestAnimationFrame(draw);
      if (now < next || (plot.isPaused && plot.range === shown)) return;
      shown = plot.isPaused ? plot.range : null;
      const list = paths.map((path) => plot.series.get(path)).filter(Boolean);
      const columns = columnsOf(list, shown || windowNow(list));
      if (!columns || columns.length !== paths.length + 1) return;
      chart.setData(columns);
      const [times] = columns;
      if (box.current) box.current.dataset.span = times.length ? (times[times.length - 1] - times[0]).toFixed(2) : "0";
      // A drawing that takes long leaves most of the time to the rest of the page.
      next = now + Math.max(50, 5 * (performance.now() - now));
    };
    frame = requestAnimationFrame(draw);
    const fit = new ResizeObserver(() => chart.setSize({ width: box.current?.clientWidth || 300, height: 240 }));
    fit.observe(box.current);
    return () => {
      cancelAnimationFrame(frame);
      fit.disconnect();
      chart.destroy();
    };
  }, [paths.join(), unit]);
  return html`<div class="chart" ref=${box} role="img" aria-label=${`plot of ${paths.join(", ")}`}></div>`;
}

function saveCsv() {
  const list = [...plot.series.values()];
  const leader = leaderOf(list);
  const rows = [`time,${list.map(({ slot, unit }) => `"${slot}${unit ? ` [${unit}]` : ""}"`).join(",")}`];
  for (let index = Math.max(0, leader.count - leader.size); index < leader.count; index++) {
    const time = leader.times[index % leader.size];
    rows.push([time.toFixed(3), ...list.map((series) => {
      const at = Math.max(0, Math.min(series.count - 1, series.first(time)));
      const isNear = series.count > 0 && Math.abs(series.times[at % series.size] - time) < 1;
      const value = isNear ? series.values[at % series.size] : NaN;
      return Number.isNaN(value) ? "" : value;
    })].join(","));
  }
  saveText("plot.csv", `${rows.join("\n")}\n`);
}

/** All slots that can be plotted: numbers and truths, and the values of devices from the worker. */
function choices() {
  const slots = store.model.owners.flatMap(({ path, slots: rows }) =>
    rows.filter((slot) => slot.readable && (slot.kind === "number" || slot.kind === "truth")).map((slot) => `${path}.${slot.name}`));
  const devices = store.devices.flatMap((row) => Object.keys(row.values || {}).map((name) => `@${row.device}.${name}`));
  return [...slots, ...devices];
}

/** The most telling slots, drawn when the page is shown for the first time: joints, or how a base drives, or sensors. */
function telling() {
  const { model } = store;
  const joints = model.of("joint").filter((part) => part.goal.unit === "rad").slice(0, 4).map((part) => part.slotPath("val"));
  const base = ["xSpeed", "yawSpeed"].filter((name) => model.robot.slot(name)?.readable).map((name) => `robot.${name}`);
  const sensors = model.of("distance", "sensor").filter((part) => part.slot("val")?.kind === "number").slice(0, 3).map((part) => part.slotPath("val"));
  return joints.length ? joints : base.length ? base : sensors;
}

let hasBegun = false;

export function Plots() {
  useTopics("tree", "devices");
  if (!hasBegun) {
    hasBegun = true;
    if (!plot.series.size) telling().forEach(addSeries);
  }
  const [, setTurn] = useState(0);
  const again = () => setTurn((turn) => turn + 1);
  const [wanted, setWanted] = useState("");
  const drop = (event) => {
    event.preventDefault();
    const path = event.dataTransfer.getData("text/plain");
    if (choices().includes(path)) addSeries(path);
    else showToast(`${path.slice(0, 60) || "this"} is no slot with a number`);
    again();
  };
  const add = (event) => {
    event.preventDefault();
    if (choices().includes(wanted)) {
      addSeries(wanted);
      setWanted("");
    } else if (wanted) showToast(`${wanted}: no slot with a number of this robot`);
    again();
  };
  const change = (name, value) => {
    plot[name] = value;
    again();
  };
  const pause = (isPaused) => {
    plot.range = isPaused ? windowNow([...plot.series.values()]) : null;
    plot.pausedAt = plot.range ? plot.range[1] : 0;
    change("isPaused", isPaused);
  };
  // A range that was dragged over is shown, standing; a double click shows all of the window again.
  const zoom = (range) => {
    if (!plot.isPaused && !range) return;
    if (!plot.isPaused) pause(true);
    change("range", range || [plot.pausedAt - plot.window, plot.pausedAt]);
  };
  const changeRate = (hz) => {
    const paths = [...plot.series.keys()];
    paths.forEach(dropSeries);
    plot.hz = hz;
    paths.forEach(addSeries);
    again();
  };
  const clear = () => {
    [...plot.series.keys()].forEach(dropSeries);
    again();
  };
  const units = new Map();
  for (const { slot, unit } of plot.series.values()) units.set(unit, [...(units.get(unit) || []), slot]);
  const pairs = store.model.of("joint", "speed").filter((part) => part.slot("requested"));
  const tools = html`<button class="small" id="pause" aria-pressed=${plot.isPaused ? "true" : "false"} onClick=${() => pause(!plot.isPaused)}>Pause</button>
    <label>Window <select onChange=${(event) => {
      plot.window = Number(event.target.value);
      change("range", plot.isPaused ? [plot.pausedAt - plot.window, plot.pausedAt] : null);
    }}>${WINDOWS.map((each) => html`<option value=${each} selected=${each === plot.window}>${each < 600 ? `${each} s` : "10 min"}</option>`)}</select></label>
    <label>Rate <select onChange=${(event) => changeRate(Number(event.target.value))}>${[10, 20, 50].map((each) => html`<option value=${each} selected=${each === plot.hz}>${each}/s</option>`)}</select></label>
    <button class="small" disabled=${!plot.series.size} onClick=${saveCsv}>CSV</button><button class="small" onClick=${clear}>Clear</button>`;
  return html`<${Card} title="Plots" name="plots" tools=${tools} wide=${true}>
    <form class="caller" onSubmit=${add}><label>Slot <input id="plot-slot" list="plot-slots" value=${wanted} onInput=${(event) => setWanted(event.target.value)} autocomplete="off" /></label>
      <datalist id="plot-slots">${choices().map((path) => html`<option value=${path}></option>`)}</datalist><button class="small">Add</button>
      ${pairs.length > 0 && html`<label>Goal and measured <select id="plot-pair" onChange=${(event) => {
        const part = pairs.find((each) => each.path === event.target.value);
        if (part) [part.slotPath(part.goal.name), part.slotPath("requested")].forEach(addSeries);
        event.target.value = "";
        again();
      }}><option value="">of ...</option>${pairs.map((part) => html`<option value=${part.path}>${part.title}</option>`)}</select></label>`}</form>
    <div class="drop" id="drop" onDragOver=${(event) => event.preventDefault()} onDrop=${drop}>
      ${units.size === 0 && html`<p class="hint">Choose a slot above, or drag one here from the list of slots. A slot that begins with @ is a device's value from the bus worker: it goes on when the interpreter is held. Drag over a chart to zoom, which pauses it; double click to see all.</p>`}
      ${[...units].map(([unit, paths]) => html`<${Chart} key=${`${unit}:${paths.join()}:${plot.hz}`} unit=${unit} paths=${paths} zoom=${zoom} />`)}</div>
    <ul class="chips">${[...plot.series.keys()].map((path) => html`<li><button class="small" aria-label=${`remove ${path} from the plots`} onClick=${() => {
      dropSeries(path);
      again();
    }}>${path} ×</button></li>`)}</ul><//>`;
}
