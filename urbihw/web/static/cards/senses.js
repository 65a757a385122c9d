// Camera, sound, lights and sensors.

import { html, useEffect, useRef, useState } from "../vendor/htm-preact.js";
import { connection } from "../js/connection.js";
import { drawSlot, hearSamples } from "../js/samples.js";
import { ask, isFull, mayDrive, showToast, store, useTopics } from "../js/store.js";
import { rangeOf } from "../js/tree.js";
import { Card, Live, LiveBar, PartName, SlotName, Switch, makeSender, useSlot } from "../js/ui.js";

/** Ask for the binary values of a slot, newest only; `take(header, data)` may be async: the next one comes after it. */
function useBinary(slot, hz, take) {
  useEffect(() => {
    let number = null;
    let hasEnded = false;
    let pause = null;
    const begin = async () => {
      try {
        const told = await connection.ask("picture", { slot, hz });
        if (hasEnded) connection.send("unsubscribe", { sub: told.sub });
        else number = told.sub;
      } catch {
        if (!hasEnded) pause = setTimeout(begin, 2000);
      }
    };
    const ends = [
      connection.on("open", () => begin()),
      connection.on("binary", async (buffer) => {
        const length = new DataView(buffer).getUint32(0, true);
        const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
        if (header.sub !== number || hasEnded) return;
        try {
          if (buffer.byteLength > 4 + length) await take(header, new Uint8Array(buffer, 4 + length));
        } catch {
          // Not whole, or of a format that browsers do not know: the next one may be.
        } finally {
          connection.send("ack", { sub: number });
        }
      }),
    ];
    if (connection.isOpen) begin();
    return () => {
      hasEnded = true;
      clearTimeout(pause);
      ends.forEach((end) => end());
      if (number !== null) connection.send("unsubscribe", { sub: number });
    };
  }, [slot, hz]);
}

/** Draw raw pixels of three bytes each. */
function drawPixels(canvas, header, data) {
  const { width, height } = header;
  if (!width || !height || data.length < 3 * width * height) return false;
  canvas.width = width;
  canvas.height = height;
  const image = new ImageData(width, height);
  for (let from = 0, to = 0; to < image.data.length; from += 3, to += 4) {
    image.data.set([data[from], data[from + 1], data[from + 2], 255], to);
  }
  canvas.getContext("2d").putImageData(image, 0, 0);
  return true;
}

export function Camera({ part }) {
  useTopics("state");
  const canvas = useRef(null);
  const line = useRef(null);
  const [hz, setHz] = useState(10);
  const isOn = useRef(undefined);
  useEffect(() => (part.slot("load") ? hearSamples(part.slotPath("load"), 4, (value) => (isOn.current = value > 0)) : undefined), []);
  const came = useRef({ count: 0, at: 0, lost: 0, size: "", rate: 0 });
  useBinary(part.slotPath("val"), hz, async (header, data) => {
    if (!canvas.current) return;
    if (header.format === "rgb") drawPixels(canvas.current, header, data);
    else {
      const picture = await createImageBitmap(new Blob([data], { type: `image/${header.format || "jpeg"}` }));
      canvas.current.width = picture.width;
      canvas.current.height = picture.height;
      canvas.current.getContext("2d").drawImage(picture, 0, 0);
      picture.close();
    }
    const now = performance.now();
    const { at, count, rate } = came.current;
    const newRate = at ? 1000 / Math.max(1, now - at) : 0;
    came.current = { count: count + 1, at: now, lost: header.lost || 0, size: `${canvas.current.width} x ${canvas.current.height}`, rate: rate ? 0.8 * rate + 0.2 * newRate : newRate };
    canvas.current.dataset.frames = String(count + 1);
  });
  useEffect(() => {
    const timer = setInterval(() => {
      if (!line.current) return;
      const { at, count, lost, size, rate } = came.current;
      const age = (performance.now() - at) / 1000;
      const isOff = isOn.current === false;
      const none = isOff ? `switched off${isFull() ? ": switch it on above" : ""}` : isOn.current ? "switched on, but no picture has come: it may still start, or look at its address in the settings" : "no picture yet";
      line.current.textContent = !count ? none
        : `${size}, ${rate.toFixed(1)} pictures/s, ${age < 1 ? "now" : `${age.toFixed(0)} s old`}, ${lost} left out${isOff ? "; switched off" : ""}`;
      line.current.classList.toggle("bad", count > 0 && age > 2);
    }, 500);
    return () => clearInterval(timer);
  }, []);
  const save = () => !came.current.count ? showToast("there is no picture yet", "bad") : canvas.current.toBlob((blob) => {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(blob);
    link.download = `${part.title}.png`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  const tools = html`${part.slot("load")?.writable && isFull() && html`<${Switch} slot=${part.slotPath("load")} title="Camera" />`}
    <label>Rate <select value=${hz} onChange=${(event) => setHz(Number(event.target.value))}>${[2, 10, 30].map((each) => html`<option value=${each} selected=${each === hz}>${each}/s</option>`)}</select></label>
    <button class="small" onClick=${save}>Save picture</button>`;
  return html`<${Card} title=${/camera/i.test(part.title) ? part.title.replace(/^c/, "C") : `Camera ${part.title}`} name=${`camera-${part.title}`} tools=${tools}>
    <canvas class="picture" ref=${canvas} width="320" height="240" role="img" aria-label=${`picture of ${part.title}`}></canvas>
    <p class="hint" ref=${line}></p><//>`;
}

/** The loudness of a piece of sound, 0 to 1: root mean square of 16 bit samples. */
function levelOf(data) {
  const isWav = data.length > 44 && data[0] === 82 && data[1] === 73;
  const bytes = data.subarray(isWav ? 44 : 0);
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.length);
  let sum = 0;
  const count = Math.floor(bytes.length / 2);
  for (let index = 0; index < count; index++) sum += (view.getInt16(2 * index, true) / 32768) ** 2;
  return count ? Math.sqrt(sum / count) : 0;
}

function Microphone({ part }) {
  const meter = useRef(null);
  useBinary(part.slotPath("val"), 5, (header, data) => {
    const level = levelOf(data);
    if (!meter.current) return;
    meter.current.firstChild.style.width = `${Math.min(100, 100 * Math.sqrt(level))}%`;
    meter.current.setAttribute("aria-valuenow", level.toFixed(3));
  });
  return html`<li><span>${part.title} <span class="what">level</span></span><div class="meter" ref=${meter} role="meter" aria-label=${`level of ${part.title}`}
    aria-valuemin="0" aria-valuemax="1" aria-valuenow="0"><span></span></div></li>`;
}

/** A function of a device with its arguments in a field: say(text), playSound(3) ... */
function Caller({ part, name }) {
  const slot = part.slot(name);
  const [text, setText] = useState("");
  const call = (event) => {
    event.preventDefault();
    const words = text.trim() === "" ? [] : name === "say" ? [text] : text.split(",").map((word) => (Number.isNaN(Number(word)) ? word.trim() : Number(word)));
    ask("call", { slot: part.slotPath(name), args: words });
  };
  return html`<form class="caller" onSubmit=${call}><label>${name} <input value=${text} aria-label=${`${name} of ${part.title}`} placeholder=${slot.meaning}
    onInput=${(event) => setText(event.target.value)} /></label><button class="small" disabled=${!mayDrive()}>${name === "say" ? "Say" : "Do"}</button></form>`;
}

const SOUND_RATE = 16000;
const MAX_SOUND_S = 300;

/** The samples of a sound file that the browser can read: one channel, 16 bits, SOUND_RATE samples a second. */
async function samplesOf(file) {
  const made = await new OfflineAudioContext(1, 1, SOUND_RATE).decodeAudioData(await file.arrayBuffer());
  const channels = Array.from({ length: made.numberOfChannels }, (_, index) => made.getChannelData(index));
  const samples = new Int16Array(Math.min(made.length, MAX_SOUND_S * SOUND_RATE));
  for (let at = 0; at < samples.length; at++) {
    const mean = channels.reduce((sum, channel) => sum + channel[at], 0) / channels.length;
    samples[at] = Math.round(32767 * Math.max(-1, Math.min(1, mean)));
  }
  return samples;
}

/** Samples as base64, little endian as all browsers have them. */
function base64Of(samples) {
  const bytes = new Uint8Array(samples.buffer, samples.byteOffset, samples.byteLength);
  let text = "";
  for (let at = 0; at < bytes.length; at += 8192) text += String.fromCharCode(...bytes.subarray(at, at + 8192));
  return btoa(text);
}

/** Play a file of the user: a second of sound in each request, behind what the loudspeaker has. */
function SoundFile({ part }) {
  const turn = useRef(0);
  const [line, setLine] = useState("");
  useEffect(() => () => turn.current++, []);
  const play = async (event) => {
    const [file] = event.target.files;
    event.target.value = "";
    if (!file) return;
    const mine = ++turn.current;
    setLine(`reading ${file.name}`);
    let samples;
    try {
      samples = await samplesOf(file);
    } catch {
      if (mine === turn.current) setLine(`${file.name} is no sound that this browser can read`);
      return;
    }
    const keywords = `raw 1 ${SOUND_RATE} 16 1`;
    for (let at = 0; at < samples.length && mine === turn.current; at += SOUND_RATE) {
      setLine(`${file.name}: ${Math.round((100 * at) / samples.length)} % sent`);
      const data = base64Of(samples.subarray(at, at + SOUND_RATE));
      if (!(await ask("sound", { slot: part.slotPath("val"), keywords, data }))) {
        if (mine === turn.current) setLine(`${file.name}: not sent to its end`);
        return;
      }
    }
    if (mine === turn.current) setLine(`${file.name}: ${(samples.length / SOUND_RATE).toFixed(1)} s sent`);
  };
  const stop = () => {
    turn.current++;
    setLine("");
    ask("call", { slot: part.slotPath("stop"), args: [] });
  };
  return html`<div class="caller"><label class=${`button small ${mayDrive() ? "" : "disabled"}`}>Play a file <input type="file" class="hidden" accept="audio/*" disabled=${!mayDrive()}
      aria-label=${`play a file by ${part.title}`} onChange=${play} /></label>
    ${part.slot("stop") && html`<button class="small" disabled=${!mayDrive()} onClick=${stop} aria-label=${`stop ${part.title}`}>Silence</button>`}
    <span class="hint" role="status">${line}</span></div>`;
}

const SOUNDS = ["say", "play", "playSound", "playTone", "beep"];

export function Sound() {
  useTopics("state");
  const parts = store.model.of("sound");
  return html`<${Card} title="Sound" name="sound"><ul class="list">${parts.map((part) => html`
    ${part.has("AudioIn") && html`<${Microphone} part=${part} />`}
    ${SOUNDS.filter((name) => part.slot(name)?.kind === "function").map((name) => html`<li><span>${part.title}</span><${Caller} part=${part} name=${name} /></li>`)}
    ${part.slot("val")?.effector && part.slot("val").kind === "binary" && html`<li><span>${part.title}</span><${SoundFile} part=${part} /></li>`}
    ${part.slot("volume")?.readable && html`<li><span>${part.title} <span class="what">volume</span></span><${Live} slot=${part.slotPath("volume")} unit=${part.slot("volume").unit} hz=${4} /></li>`}
    ${part.slot("playing")?.readable && html`<li><span>${part.title} <span class="what">playing</span></span><${Live} slot=${part.slotPath("playing")} hz=${4} /></li>`}
  `)}</ul><//>`;
}

function Light({ part }) {
  const input = useRef(null);
  const isHeld = useRef(false);
  const send = useRef(makeSender((value) => ask("set", { slot: part.slotPath("val"), value })));
  const [min, max] = rangeOf(part.slot("val"));
  useEffect(() => drawSlot(part.slotPath("val"), (value) => {
    if (input.current && !isHeld.current && typeof value === "number") input.current.value = value;
  }, 4), []);
  return html`<li data-part=${part.path}><${PartName} part=${part} slot=${part.slotPath("val")} />
    <input type="range" ref=${input} min=${min} max=${max} step=${(max - min) / 100} disabled=${!mayDrive()} aria-label=${`brightness of ${part.title}`}
      onPointerDown=${() => (isHeld.current = true)} onPointerUp=${() => (isHeld.current = false)}
      onInput=${(event) => send.current(Number(event.target.value))} /></li>`;
}

const byteOf = (value) => Math.round(255 * Math.min(1, Math.max(0, value || 0))).toString(16).padStart(2, "0");

function ColourLight({ part }) {
  const input = useRef(null);
  const colours = useRef({ r: 0, g: 0, b: 0 });
  const send = useRef(makeSender((text) => ["r", "g", "b"].forEach((name, index) =>
    ask("set", { slot: part.slotPath(name), value: parseInt(text.slice(1 + 2 * index, 3 + 2 * index), 16) / 255 }))));
  useEffect(() => {
    const ends = ["r", "g", "b"].map((name) => drawSlot(part.slotPath(name), (value) => {
      colours.current[name] = value;
      if (input.current && document.activeElement !== input.current) {
        input.current.value = `#${byteOf(colours.current.r)}${byteOf(colours.current.g)}${byteOf(colours.current.b)}`;
      }
    }, 4));
    return () => ends.forEach((end) => end());
  }, []);
  return html`<li data-part=${part.path}><span>${part.title}</span><input type="color" ref=${input} disabled=${!mayDrive()} aria-label=${`colour of ${part.title}`}
    onInput=${(event) => send.current(event.target.value)} /></li>`;
}

export function Lights() {
  useTopics("state");
  const all = store.model.of("light");
  const [showsAll, setShowsAll] = useState(all.length <= 12);
  const shown = showsAll ? all : all.filter((part) => !/\d+$/.test(part.title)).slice(0, 12);
  return html`<${Card} title="Lights" name="lights" tools=${all.length > shown.length || all.length > 12 ? html`<button class="small" onClick=${() => setShowsAll(!showsAll)}>${showsAll ? "Fewer" : `All ${all.length}`}</button>` : null}>
    <ul class="list">${shown.map((part) => (part.slot("r")?.effector ? html`<${ColourLight} key=${part.path} part=${part} />` : html`<${Light} key=${part.path} part=${part} />`))}</ul><//>`;
}

function Touch({ part }) {
  const element = useSlot(part.slotPath("val"), (lamp, value) => {
    const isPressed = value > 0;
    lamp.className = `lamp ${isPressed ? "pressed" : ""}`;
    lamp.lastChild.textContent = isPressed ? "pressed" : "free";
  });
  return html`<li data-part=${part.path}><${PartName} part=${part} slot=${part.slotPath("val")} /><span class="lamp" ref=${element}><i aria-hidden="true"></i><b class="live"></b></span></li>`;
}

const SHOWN = ["val", "position", "x", "y", "z", "voltage", "current", "remain", "charging", "torque"];

function Sensor({ part }) {
  const named = SHOWN.map((name) => part.slot(name)).filter((slot) => slot && slot.readable && slot.kind !== "binary" && slot.kind !== "object");
  const shown = (named.length ? named : part.readings).slice(0, 3);
  return html`<li data-part=${part.path}><span><${PartName} part=${part} slot=${part.slotPath(shown[0]?.name ?? "val")} /></span><span class="readings">${shown.map((slot) => html`
    <${SlotName} path=${part.slotPath(slot.name)}><span class="what">${slot.name === "val" ? "" : slot.name}</span> <${Live} slot=${part.slotPath(slot.name)} unit=${slot.unit} /><//>
    ${slot.min !== null && slot.max !== null && html`<${LiveBar} slot=${part.slotPath(slot.name)} min=${slot.min} max=${slot.max} label=${`${part.title} ${slot.name}`} />`}`)}</span></li>`;
}

export function Sensors() {
  const parts = store.model.of("sensor", "touch", "laser").filter((part) => part.slots.size);
  return html`<${Card} title="Sensors" name="sensors"><ul class="list">${parts.map((part) => (part.kind === "touch"
    ? html`<${Touch} key=${part.path} part=${part} />` : part.kind === "laser" ? html`<${Laser} key=${part.path} part=${part} />`
      : html`<${Sensor} key=${part.path} part=${part} />`))}</ul><//>`;
}

function Laser({ part }) {
  return html`<li data-part=${part.path}><span>${part.title}</span><span class="readings">${["state", "rate"].filter((name) => part.slot(name)).map((name) => html`
    <span><span class="what">${name}</span> <${Live} slot=${part.slotPath(name)} unit=${part.slot(name).unit} hz=${4} /></span>`)}</span></li>`;
}

