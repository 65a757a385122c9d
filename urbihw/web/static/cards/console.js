// The console: urbiscript in, lines out, with history, completion, tags that can be stopped, and files.

import { html, useEffect, useLayoutEffect, useRef, useState } from "../vendor/htm-preact.js";
import { ask, notify, store, useTopics } from "../js/store.js";
import { Card } from "../js/ui.js";

const MAX_HISTORY = 200;
const tags = new Set(); // tags under which something was run from here
let history = [];
try {
  history = JSON.parse(localStorage.getItem("urbihw-history") || "[]").slice(-MAX_HISTORY);
} catch {
  // A browser without storage: the history ends with the page.
}

/** Short programs for this robot: of its own joints, sensors and events. */
function examples() {
  const { model } = store;
  const joint = model.of("joint")[0];
  const sensor = model.of("distance", "touch", "sensor").find((part) => part.slot("val")?.kind === "number");
  const list = [["What the robot has", "robot.flatDump;"], ["Help for a slot", joint ? `System.documentation(${joint.path}, "val");` : "System.version;"]];
  if (joint) {
    const size = joint.goal.unit === "deg" ? 20 : 0.3;
    list.push(["Swing a joint", `${joint.path}.val = 0 sin:2s ampli:${size},`], ["Move smoothly", `${joint.path}.val = ${size} time:1s;\n${joint.path}.val = 0 time:1s;`]);
  }
  if (model.isMobile) list.push(["Drive a square", "for (var i : 4)\n{\n  robot.go(0.3);\n  robot.turn(90deg);\n};"]);
  if (sensor) list.push(["React to a sensor", `at (${sensor.path}.val > 0.5)\n  echo("high")\nonleave\n  echo("low");`], ["Show a value each second", `every (1s) echo(${sensor.path}.val),`]);
  return list;
}

/** Three of the examples, that move and that react where the robot can. */
const firstExamples = () => {
  const all = examples();
  return [all[0], ...all.slice(2), all[1]].slice(0, 3);
};

function say(kind, text) {
  store.output.push({ kind, text, stamp: null });
  notify("output");
}

export function Console() {
  useTopics("output", "state");
  const output = useRef(null);
  const input = useRef(null);
  const follows = useRef(true);
  const place = useRef(history.length);
  const [tag, setTag] = useState("");
  const [words, setWords] = useState([]);
  useLayoutEffect(() => {
    if (follows.current) output.current.scrollTop = output.current.scrollHeight;
  });
  useEffect(() => input.current.focus(), []);
  const run = async () => {
    const text = input.current.value;
    if (!text.trim()) return;
    if (history[history.length - 1] !== text) history.push(text);
    history = history.slice(-MAX_HISTORY);
    place.current = history.length;
    try {
      localStorage.setItem("urbihw-history", JSON.stringify(history));
    } catch {
      // As above.
    }
    say("input", text);
    follows.current = true;
    setWords([]);
    input.current.value = "";
    const isGoodTag = /^[A-Za-z_]\w{0,60}$/.test(tag);
    if (await ask("run", { text: /[;,]\s*$/.test(text) ? text : `${text};`, ...(isGoodTag ? { tag } : {}) })) if (isGoodTag) tags.add(tag);
    notify("output");
  };
  const complete = async () => {
    const { value, selectionStart: at } = input.current;
    const told = await ask("complete", { text: value, at });
    if (!told) return;
    const typed = value.slice(0, at).match(/[\w.\[\]]*$/)[0];
    const stem = typed.split(".").pop();
    const own = new Set([...store.model.parts.map((part) => part.path), "robot", store.model.platform?.name, ...store.model.groups.map(({ name }) => name)]);
    const found = told.words.filter((word) => word.startsWith(stem)).sort((one, other) => own.has(other) - own.has(one));
    const common = found.reduce((start, word) => {
      let length = 0;
      while (length < start.length && start[length] === word[length]) length++;
      return start.slice(0, length);
    }, found[0] || "");
    if (common.length > stem.length) insert(common.slice(stem.length));
    setWords(found.length > 1 ? found.slice(0, 60) : []);
  };
  const insert = (text) => {
    const area = input.current;
    area.setRangeText(text, area.selectionStart, area.selectionEnd, "end");
    area.focus();
  };
  const recall = (step) => {
    place.current = Math.max(0, Math.min(history.length, place.current + step));
    input.current.value = history[place.current] || "";
  };
  const key = (event) => {
    const area = input.current;
    const before = area.value.slice(0, area.selectionStart);
    if (event.key === "Enter" && !event.shiftKey) {
      event.preventDefault();
      run();
    } else if (event.key === "Tab" && !event.shiftKey && /[\w.]$/.test(before)) {
      event.preventDefault();
      complete();
    } else if (event.key === "ArrowUp" && !before.includes("\n")) {
      event.preventDefault();
      recall(-1);
    } else if (event.key === "ArrowDown" && !area.value.slice(area.selectionEnd).includes("\n")) {
      event.preventDefault();
      recall(1);
    }
  };
  const openFile = async (event) => {
    const [file] = event.target.files;
    if (file && file.size < 60000) input.current.value = await file.text();
    else if (file) say("error", `${file.name} is larger than 60 kB: let the server load it`);
    event.target.value = "";
    input.current.focus();
  };
  const scrolled = () => {
    const { scrollTop, scrollHeight, clientHeight } = output.current;
    follows.current = scrollTop + clientHeight > scrollHeight - 20;
  };
  const tools = html`<label>Example <select id="example" onChange=${(event) => {
    const found = examples()[Number(event.target.value)];
    if (found) input.current.value = found[1];
    event.target.value = "";
    input.current.focus();
  }}><option value="">choose ...</option>${examples().map(([title], index) => html`<option value=${index}>${title}</option>`)}</select></label>
    <label class="button small">Open file <input type="file" class="hidden" accept=".u,.txt,text/plain" onChange=${openFile} /></label>
    <button class="small" onClick=${() => {
      store.output = [];
      notify("output");
    }}>Clear</button>`;
  return html`<${Card} title="Console" name="console" tools=${tools} wide=${true}>
    <div class="output" id="output" ref=${output} onScroll=${scrolled} role="log" aria-label="output of the server" tabindex="0">${store.output.slice(-500).map((line) => html`<div class=${`line ${line.kind}`}>
      ${line.stamp !== null && line.stamp !== undefined && html`<span class="stamp">${(line.stamp / 1000).toFixed(3)}${line.channel ? ` ${line.channel}` : ""}</span>`}<span>${line.text}</span></div>`)}
      ${store.output.length === 0 && html`<div class="empty" id="first-examples"><p class="hint">Nothing has run yet. Try one:</p>${firstExamples().map(([title, text]) => html`<button class="small" key=${title} onClick=${() => {
        input.current.value = text;
        input.current.focus();
      }}>${title}</button>`)}</div>`}</div>
    ${words.length > 0 && html`<div class="words" id="words">${words.map((word) => html`<button class="small" onClick=${() => {
      const stem = input.current.value.slice(0, input.current.selectionStart).match(/\w*$/)[0];
      insert(word.slice(stem.length));
      setWords([]);
    }}>${word}</button>`)}</div>`}
    <div class="entry"><textarea id="input" ref=${input} rows="3" spellcheck="false" autocapitalize="off" aria-label="urbiscript; Enter runs it" placeholder="urbiscript: Enter runs, Shift+Enter a new line, Tab completes, up and down recall" onKeyDown=${key}></textarea>
      <div class="side"><label>Tag <input id="tag" value=${tag} size="8" placeholder="none" onInput=${(event) => setTag(event.target.value)} /></label><button id="run" onClick=${run}>Run</button></div></div>
    ${tags.size > 0 && html`<ul class="chips">${[...tags].map((each) => html`<li><span class="what">${each}</span> <button class="small" id=${`stop-${each}`} onClick=${() => ask("tag", { tag: each, action: "stop" })} aria-label=${`stop the tag ${each}`}>Stop</button></li>`)}</ul>`}<//>`;
}
