// The studio: asks the server how the render stands, shows its pictures, and sends nothing but
// choices of a fixed list. Names are text, never markup.
import { drawSections, drawSpectrum, shortNumber } from "./plot.js";

const $ = (id) => document.getElementById(id);
const canvas = $("picture");
const context = canvas.getContext("2d");

let state = null; // as the server told it last
let shown = { image: null, key: "" }; // picture on the canvas
let held = { image: null, key: "" }; // the snapshot, developed alike
let place = null; // { scale, x, y }: where the picture lies, CSS pixels; null: fitted
let pixel = null; // the pixel looked at
let pinned = false;
let busy = false;
let stale = false; // asked for again while busy

async function ask(path, options) {
  const response = await fetch(path, { credentials: "same-origin", ...options });
  if (!response.ok) {
    throw Object.assign(new Error((await response.text()).trim()), { status: response.status });
  }
  return response;
}

const post = (path, body) => ask(path, { method: "POST", body });

function problem(text) {
  $("problem").textContent = text || "";
  $("problem").hidden = !text;
}

// What a click has come to, for a few seconds.
let said = { text: "", until: 0 };

function say(text) {
  said = { text, until: Date.now() + 6000 };
  problem(text);
}

// ---- how things stand

function seconds(s) {
  if (s < 60) return `${s < 10 ? s.toFixed(1) : Math.round(s)} s`;
  if (s < 3600) return `${Math.floor(s / 60)} min ${Math.round(s % 60)} s`;
  return `${Math.floor(s / 3600)} h ${Math.round((s % 3600) / 60)} min`;
}

const percent = (share) => `${(100 * share).toPrecision(2)} %`;

function showStatus() {
  const parts = [];
  const { phase } = state;
  if (phase === "rendering" || phase === "done") {
    parts.push(state.all ? `${state.passes} of ${state.all} passes` : `${state.passes} passes`);
    if (state.error !== null) parts.push(`error ${percent(state.error)}`);
    parts.push(`${seconds(state.elapsed)} gone`);
    if (phase === "done") {
      parts.push("done");
    } else if (state.passes > 0 && state.all) {
      const left = (state.elapsed / state.passes) * (state.all - state.passes);
      parts.push(`about ${seconds(left)} left`);
    }
    if (state.forecast) {
      parts.push(`${percent(state.forecast.error)} takes about ${seconds(state.forecast.seconds)}`);
    }
  } else if (phase === "image" && state.stage) {
    parts.push(`${state.stage.width} × ${state.stage.height} pixels`);
    if (state.passes > 0) parts.push(`${state.passes}${state.all ? ` of ${state.all}` : ""} passes`);
  } else {
    parts.push(phase);
  }
  $("status").textContent = parts.join(" · ");
  $("progress").value = state.all ? state.passes / state.all : phase === "image" ? 1 : 0;
  problem(state.problem || (Date.now() < said.until ? said.text : ""));
  const saves = phase === "image" || state.passes > 0;
  for (const id of ["save-exr", "save-png"]) $(id).setAttribute("aria-disabled", String(!saves));
  $("snap").disabled = !saves;
}

// a restarted render may lack a layer for a moment: what was chosen comes back with its name
const wanted = new Map();
document.addEventListener("change", (event) => wanted.delete(event.target));

function fill(select, names, keep) {
  const old = [...select.options].slice(keep).map((o) => o.value);
  if (old.join() === names.join()) return;
  const chosen = wanted.get(select) ?? select.value;
  while (select.options.length > keep) select.remove(keep);
  for (const name of names) {
    const option = document.createElement("option");
    option.value = option.textContent = name;
    select.append(option);
  }
  if ([...select.options].some((o) => o.value === chosen)) {
    select.value = chosen;
    wanted.delete(select);
  } else {
    wanted.set(select, chosen);
  }
}

let version = null;

function showStage() {
  const { stage } = state;
  if (!stage) return;
  $("name").textContent = stage.name;
  document.title = `${stage.name} · abbe`;
  // strategies come as they are met
  fill($("layer"), stage.layers, 1);
  if (stage.version === version) return;
  version = stage.version;
  fill($("tone"), stage.tones, 1);
  $("detector").hidden = !stage.detector;
  $("quantity").textContent = stage.detector ? "illuminance" : "luminance";
  $("rendering").hidden = !stage.renders;
  if (stage.renders) {
    for (const key of ["integrator", "regularize", "aim", "lanes"]) {
      fill($(key), stage.choices[key].map(String), 0);
      $(key).value = String(stage.settings[key]);
    }
    for (const key of ["strategies", "shares"]) $(key).checked = stage.settings[key];
    if (document.activeElement !== $("epsilon")) $("epsilon").value = stage.settings.epsilon ?? "";
  }
  if (pixel && (pixel.x >= stage.width || pixel.y >= stage.height)) pixel = null;
}

function showSnapshot() {
  const there = state.snapshot !== null;
  $("divide").disabled = !there;
  if (there) $("snapshot").textContent = state.snapshot;
  for (const id of ["split", "tag-left", "tag-right"]) $(id).hidden = !(there && held.image);
  $("tag-left").textContent = state.snapshot?.startsWith("reference: ") ? "reference" : "snapshot";
}

// ---- pictures

function query(more) {
  const values = new URLSearchParams();
  if (!$("auto").checked) values.set("exposure", $("exposure").value);
  if ($("tone").value) values.set("tone", $("tone").value);
  if ($("white").value) values.set("white", $("white").value);
  for (const [name, value] of Object.entries(more)) if (value) values.set(name, value);
  return values.toString();
}

// A flux as attributes of images tell it: value, unit and, where it is known, standard error.
function fluxText(told) {
  const [, value, unit, error] = told?.match(/^(\S+) (\w+)(?:, standard error (\S+))?/) ?? [];
  if (!value) return "\u2013";
  const spread = error ? ` \u00b1 ${shortNumber(Number(error))}` : "";
  return `${shortNumber(Number(value))}${spread} ${unit}`;
}

async function load(path) {
  const response = await ask(path);
  if (response.status === 204) return null;
  const image = await createImageBitmap(await response.blob());
  const told = (name) => response.headers.get(name);
  return { image, stops: told("X-Stops"), clipped: told("X-Clipped"), flux: told("X-Flux") };
}

async function refresh() {
  stale = busy;
  if (busy || !state?.stage) return;
  busy = true;
  try {
    const wanted = query({ layer: $("layer").value });
    const key = `${version} ${state.passes} ${wanted}`;
    if (key !== shown.key) {
      const loaded = await load(`picture.png?${wanted}`);
      // the picture before stays until there is one
      if (!loaded) return;
      shown = { ...loaded, key };
      const clipped = Number(loaded.clipped) > 0.05 ? `, ${percent(Number(loaded.clipped))} clipped` : "";
      const sign = Number(loaded.stops) >= 0 ? "+" : "";
      $("stops").textContent = `${sign}${Number(loaded.stops).toFixed(2)} EV${clipped}`;
      $("flux").textContent = fluxText(loaded.flux);
      if ($("auto").checked) $("exposure").value = loaded.stops;
      $("save-png").href = `save.png?${query({})}`;
      draw();
      look(true);
    }
    const before = `${state.snapshot} ${query({})}`;
    if (state.snapshot !== null && before !== held.key) {
      const loaded = await load(`picture.png?${query({ of: "snapshot" })}`);
      if (loaded) held = { ...loaded, key: before };
      showSnapshot();
      draw();
    }
  } catch (error) {
    say(error.message);
  } finally {
    busy = false;
    if (stale) refresh();
  }
}

function fitted() {
  const { width, height } = state.stage;
  const scale = Math.min(canvas.clientWidth / width, canvas.clientHeight / height) * 0.96;
  return {
    scale,
    x: (canvas.clientWidth - width * scale) / 2,
    y: (canvas.clientHeight - height * scale) / 2,
  };
}

const where = () => place ?? fitted();

function draw() {
  const ratio = window.devicePixelRatio || 1;
  const [w, h] = [canvas.clientWidth, canvas.clientHeight];
  if (canvas.width !== Math.round(w * ratio) || canvas.height !== Math.round(h * ratio)) {
    canvas.width = Math.round(w * ratio);
    canvas.height = Math.round(h * ratio);
  }
  context.setTransform(ratio, 0, 0, ratio, 0, 0);
  context.clearRect(0, 0, w, h);
  if (!state?.stage || !shown.image) return;
  const { scale, x, y } = where();
  const [width, height] = [state.stage.width * scale, state.stage.height * scale];
  context.imageSmoothingEnabled = scale * ratio < 1;
  context.imageSmoothingQuality = "high";
  context.drawImage(shown.image, x, y, width, height);
  if (state.snapshot !== null && held.image) {
    const edge = (Number($("divide").value) / 100) * w;
    context.save();
    context.beginPath();
    context.rect(0, 0, edge, h);
    context.clip();
    context.clearRect(0, 0, edge, h);
    context.drawImage(held.image, x, y, width, height);
    context.restore();
    $("split").style.left = `${edge - 1}px`;
  }
  if (pixel && scale >= 4) {
    context.strokeStyle = "#e8b64c";
    context.lineWidth = 1;
    context.strokeRect(x + pixel.x * scale - 0.5, y + pixel.y * scale - 0.5, scale + 1, scale + 1);
  }
  $("zoom").textContent = `${Math.round(100 * scale)} %`;
  drawBar(scale);
}

// The scale bar of a detector: the longest of 1, 2, 5, 10... that takes at most 140 CSS pixels.
function drawBar(scale) {
  const pitch = state.stage.pitch;
  $("bar").hidden = !pitch;
  if (!pitch) return;
  const most = (140 / scale) * pitch[0] * 1000;
  const power = 10 ** Math.floor(Math.log10(most));
  const length = power * [5, 2, 1].find((step) => step * power <= most);
  $("bar").style.width = `${((length / 1000 / pitch[0]) * scale).toFixed(1)}px`;
  $("bar").textContent = `${Number(length.toPrecision(1))} mm`;
}

// ---- the pixel under the pointer

let looking = false;
let again = false;

async function look(quiet) {
  if (!pixel || !state?.stage) return;
  if (looking) {
    again = true;
    return;
  }
  looking = true;
  try {
    const response = await ask(`pixel?x=${pixel.x}&y=${pixel.y}`);
    if (response.status === 204) return;
    const found = await response.json();
    $("at").textContent = `${found.x}, ${found.y}${pinned ? " (held)" : ""}`;
    $("xyz").textContent = found.xyz.map(shortNumber).join(", ");
    $("luminance").textContent = `${shortNumber(found.luminance)} ${found.unit}`;
    drawSpectrum($("spectrum"), found.spectrum);
    if (found.sections) drawSections($("sections"), found.sections, state.stage.pitch);
    $("spectrum-note").textContent = found.spectrum
      ? `over nm; per nm, W/${state.stage.detector ? "m²" : "(m² sr)"}`
      : "";
  } catch (error) {
    if (!quiet) say(error.message);
  } finally {
    looking = false;
    if (again) {
      again = false;
      look(quiet);
    }
  }
}

function pixelAt(event) {
  const box = canvas.getBoundingClientRect();
  const { scale, x, y } = where();
  const found = {
    x: Math.floor((event.clientX - box.left - x) / scale),
    y: Math.floor((event.clientY - box.top - y) / scale),
  };
  const inside = found.x >= 0 && found.y >= 0 && found.x < state.stage.width && found.y < state.stage.height;
  return inside ? found : null;
}

// ---- moving and zooming

function zoom(factor, cx, cy) {
  if (!state?.stage) return;
  const { scale, x, y } = where();
  const next = Math.min(64, Math.max(0.02, scale * factor));
  place = { scale: next, x: cx - ((cx - x) * next) / scale, y: cy - ((cy - y) * next) / scale };
  draw();
}

const zoomMiddle = (factor) => zoom(factor, canvas.clientWidth / 2, canvas.clientHeight / 2);

const pointers = new Map();
let moved = 0;

canvas.addEventListener("pointerdown", (event) => {
  if (!state?.stage) return;
  canvas.setPointerCapture(event.pointerId);
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  moved = 0;
});

canvas.addEventListener("pointermove", (event) => {
  if (!state?.stage) return;
  const last = pointers.get(event.pointerId);
  if (!last) {
    const found = pixelAt(event);
    if (!pinned && found && (found.x !== pixel?.x || found.y !== pixel?.y)) {
      pixel = found;
      look(true);
      if (where().scale >= 4) draw();
    }
    return;
  }
  const [dx, dy] = [event.clientX - last.x, event.clientY - last.y];
  moved += Math.hypot(dx, dy);
  if (pointers.size === 1) {
    if (moved > 3) {
      const { scale, x, y } = where();
      place = { scale, x: x + dx, y: y + dy };
    }
  } else {
    const other = [...pointers].find(([id]) => id !== event.pointerId)[1];
    const box = canvas.getBoundingClientRect();
    const before = Math.hypot(last.x - other.x, last.y - other.y);
    const after = Math.hypot(event.clientX - other.x, event.clientY - other.y);
    if (before > 0) zoom(after / before, other.x - box.left, other.y - box.top);
  }
  pointers.set(event.pointerId, { x: event.clientX, y: event.clientY });
  draw();
});

for (const end of ["pointerup", "pointercancel"]) {
  canvas.addEventListener(end, (event) => {
    const was = pointers.delete(event.pointerId);
    if (!was || end === "pointercancel" || moved > 3 || !state?.stage) return;
    // a click holds the pixel, another one lets it go
    const found = pixelAt(event);
    pinned = found !== null && !(pinned && pixel && found.x === pixel.x && found.y === pixel.y);
    if (found) pixel = found;
    look(true);
    draw();
  });
}

canvas.addEventListener(
  "wheel",
  (event) => {
    event.preventDefault();
    const box = canvas.getBoundingClientRect();
    zoom(Math.exp(-event.deltaY / 400), event.clientX - box.left, event.clientY - box.top);
  },
  { passive: false },
);

function fit() {
  place = null;
  draw();
}

function whole() {
  zoomMiddle(1 / where().scale);
}

canvas.addEventListener("keydown", (event) => {
  const steps = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] };
  const step = steps[event.key];
  if (!step || !state?.stage) return;
  event.preventDefault();
  const { width, height } = state.stage;
  const from = pixel ?? { x: width >> 1, y: height >> 1 };
  const keep = (v, end) => Math.min(end - 1, Math.max(0, v));
  pixel = { x: keep(from.x + step[0], width), y: keep(from.y + step[1], height) };
  pinned = true;
  look(true);
  draw();
});

window.addEventListener("keydown", (event) => {
  if (event.target.matches("input, select") || event.ctrlKey || event.metaKey) return;
  const keys = { f: fit, 1: whole, "+": () => zoomMiddle(1.25), "-": () => zoomMiddle(0.8) };
  if (state?.stage) keys[event.key]?.();
});

$("fit").addEventListener("click", fit);
$("whole").addEventListener("click", whole);
$("in").addEventListener("click", () => zoomMiddle(1.25));
$("out").addEventListener("click", () => zoomMiddle(0.8));
new ResizeObserver(draw).observe(canvas);
new ResizeObserver(() => look(true)).observe($("spectrum"));

// ---- choices

// before the first pass there is nothing to save
for (const link of [$("save-exr"), $("save-png")]) {
  link.addEventListener("click", (event) => {
    if (state?.phase !== "image" && !(state?.passes > 0)) event.preventDefault();
  });
}

$("exposure").addEventListener("input", () => {
  $("auto").checked = false;
  refresh();
});
for (const id of ["auto", "tone", "white", "layer"]) $(id).addEventListener("change", refresh);
$("divide").addEventListener("input", draw);

$("snap").addEventListener("click", async () => {
  try {
    await post("snapshot", "");
    held = { image: null, key: "" };
    await poll(false);
  } catch (error) {
    say(error.message);
  }
});

for (const control of document.querySelectorAll("[data-setting]")) {
  control.addEventListener("change", async () => {
    const epsilon = $("epsilon").value.trim();
    const number = epsilon === "" || epsilon === "auto" ? null : Number(epsilon);
    const wrong = number !== null && !(number > 0 && number <= Math.PI / 2);
    $("epsilon").classList.toggle("wrong", wrong);
    if (wrong) {
      say("Epsilon is an angle above 0, at most 1.57 radians, or auto.");
      return;
    }
    const settings = {
      integrator: $("integrator").value,
      regularize: $("regularize").value,
      aim: $("aim").value,
      lanes: Number($("lanes").value),
      epsilon: number,
      strategies: $("strategies").checked,
      shares: $("shares").checked,
    };
    try {
      await post("settings", JSON.stringify(settings));
    } catch (error) {
      say(error.message);
    }
  });
}

// ---- the loop

async function poll(goOn) {
  try {
    state = await (await ask("state")).json();
    showStatus();
    showStage();
    showSnapshot();
    await refresh();
  } catch (error) {
    $("status").textContent =
      error.status === 401
        ? "locked: open the address that abbe has printed"
        : "the server is gone: abbe has ended";
  }
  if (goOn) setTimeout(() => poll(true), state?.phase === "rendering" ? 400 : 700);
}

async function begin() {
  const token = location.hash.slice(1);
  if (token) {
    history.replaceState(null, "", location.pathname);
    try {
      await post("session", token);
    } catch {
      // the state tells
    }
  }
  poll(true);
}

begin();
