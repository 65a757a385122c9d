// The panel.  Made from the robot's tree: js/tree.js says what a part is, and here each kind has its card.

import { html, render, useEffect, useErrorBoundary, useState } from "./vendor/htm-preact.js";
import { connection } from "./js/connection.js";
import { dropToast, store, useTopics } from "./js/store.js";
import { Bar } from "./cards/bar.js";
import { Base, Chart, Distances } from "./cards/base.js";
import { Console } from "./cards/console.js";
import { RobotFigure } from "./cards/figure.js";
import { Joints, Speeds } from "./cards/joints.js";
import { Devices, Events, Faults, Jobs, Log, Slots } from "./cards/lists.js";
import { Motions } from "./cards/motions.js";
import { Plots } from "./cards/plots.js";
import { Camera, Lights, Sensors, Sound } from "./cards/senses.js";

function Control() {
  useTopics("tree");
  const { model } = store;
  const has = (...kinds) => model.of(...kinds).length > 0;
  return html`<${RobotFigure} />${model.isMobile && html`<${Base} /><${Chart} />`}
    ${model.of("camera").map((part) => html`<${Camera} key=${part.path} part=${part} />`)}
    ${has("distance") && html`<${Distances} />`}
    ${has("joint") && html`<${Joints} />`}
    ${has("speed") && html`<${Speeds} />`}
    ${model.hasFunction("teach") && html`<${Motions} />`}
    ${has("sensor", "touch", "laser") && html`<${Sensors} />`}
    ${has("light") && html`<${Lights} />`}
    ${has("sound") && html`<${Sound} />`}
    ${model.parts.length === 0 && html`<p class="hint">The robot has no parts yet.</p>`}`;
}

const PAGES = [
  ["control", "Control", Control, () => true],
  ["plots", "Plots", () => html`<${Plots} /><${Slots} />`, () => true],
  ["console", "Console", Console, () => store.hello.role === "full"],
  ["jobs", "Jobs", () => html`<${Jobs} /><${Events} />`, () => true],
  ["devices", "Devices", Devices, () => true],
  ["log", "Log", Log, () => true],
  ["faults", "Faults", Faults, () => store.hello.fake && store.hello.role === "full"],
];

/** A fault of one card must not take the bar away. */
function Guarded({ children }) {
  const [error, reset] = useErrorBoundary();
  if (error) return html`<p class="bad" role="alert">This page failed: ${error.message} <button class="small" onClick=${reset}>Try again</button></p>`;
  return children;
}

function Toasts() {
  useTopics("toasts");
  return html`<div class="toasts" id="toasts" role="status" aria-live="polite">${store.toasts.map(({ id, text, level, action }) => html`<div class=${`toast ${level}`} key=${id}><span>${text}</span>
    ${action && html`<button class="small" onClick=${() => {
      action[1]();
      dropToast(id);
    }}>${action[0]}</button>`}<button class="small" aria-label="close" onClick=${() => dropToast(id)}>×</button></div>`)}</div>`;
}

function Panel() {
  useTopics("tree", "state");
  const [page, setPage] = useState(location.hash.slice(1) || "control");
  useEffect(() => {
    const change = () => setPage(location.hash.slice(1) || "control");
    window.addEventListener("hashchange", change);
    return () => window.removeEventListener("hashchange", change);
  }, []);
  const pages = PAGES.filter(([, , , isThere]) => isThere());
  const [name, title, Page] = pages.find(([each]) => each === page) || pages[0];
  const key = (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    const at = pages.findIndex(([each]) => each === name);
    const next = pages[(at + step + pages.length) % pages.length][0];
    location.hash = next;
    document.getElementById(`tab-${next}`)?.focus();
  };
  return html`<${Bar} />
    <nav class="tabs" role="tablist" aria-label="pages" onKeyDown=${key}>${pages.map(([each, word]) => html`<button role="tab" id=${`tab-${each}`} key=${each}
      aria-selected=${each === name ? "true" : "false"} aria-controls="page" tabindex=${each === name ? 0 : -1} onClick=${() => (location.hash = each)}>${word}</button>`)}</nav>
    <main id="page" role="tabpanel" aria-label=${title} class=${name}>${store.model ? html`<${Guarded} key=${name}><${Page} /><//>` : html`<p class="hint" id="waiting">Waiting for the robot. Stop works all the same.</p>`}</main>
    <${Toasts} />`;
}

document.getElementById("panel").textContent = "";
render(html`<${Panel} />`, document.getElementById("panel"));
connection.open();
