"use strict";
// Draws the images of a run and follows the cursor. State is in `at`; `show()` draws it.

const meta = JSON.parse(document.getElementById("meta").textContent);
const { rows, columns, offsets, angles, images, contrasts, fitted, bin } = meta;
const COLOURS = ["#0072b2", "#d55e00"];
const INK = "#222228", GREY = "#6c6c76", LINE = "#dcdce2";
const FONT = '12px "DejaVu Sans", Verdana, sans-serif';
const element = (id) => document.getElementById(id);

function bytesOf(text) {
  const letters = atob(text.trim());
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

// Values of an image: 16-bit numbers between `low` and `high`; the last stands for nothing.
const NOTHING = 65535;
for (const [name, image] of Object.entries(images)) {
  const bytes = bytesOf(element("data-" + name).textContent);
  image.words = new Uint16Array(bytes.length / 2);
  for (let i = 0; i < image.words.length; i++) image.words[i] = bytes[2 * i] | (bytes[2 * i + 1] << 8);
  const table = bytesOf(meta.maps[image.map]);
  // Colour of every 16-bit number, worked out once.
  const [low, high] = image.scale;
  image.colours = new Uint32Array(NOTHING + 1);
  for (let word = 0; word < NOTHING; word++) {
    const share = (image.low + (image.high - image.low) * word / (NOTHING - 1) - low) / (high - low);
    const index = 3 * Math.round(255 * Math.min(1, Math.max(0, share)));
    image.colours[word] = 0xff000000 | (table[index + 2] << 16) | (table[index + 1] << 8) | table[index];
  }
  image.colours[NOTHING] = 0xffd246be;
  image.table = table;
}

// Flags of every pixel, as places in meta.flags.
const flags = element("data-flags") && bytesOf(element("data-flags").textContent);
function flagsAt(pixel) {
  const place = 2 * (at.view * rows * columns + pixel);
  return flags ? meta.flags[flags[place] | (flags[place + 1] << 8)] : "";
}

function valueAt(name, frame, pixel) {
  const image = images[name];
  const word = image.words[frame * rows * columns + pixel];
  return word === NOTHING ? NaN : image.low + (image.high - image.low) * word / (NOTHING - 1);
}

// What is shown: view and step by number in this page, the pixel, and whether a click holds it.
const at = { view: 0, step: 0, row: meta.start[1], column: meta.start[0], held: false };
const pixelOf = () => at.row * columns + at.column;
const frameOf = {
  flat: () => at.step,
  sample: () => at.view * offsets.length + at.step,
};
const frame = (name) => (frameOf[name] || (name.startsWith("flat_") ? () => 0 : () => at.view))();

function told(value, unit) {
  if (!Number.isFinite(value)) return "no value";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e6)
    ? value.toExponential(3)
    : value.toFixed(size >= 1000 ? 1 : size >= 100 ? 2 : size >= 10 ? 3 : size >= 1 ? 4 : 5);
  return text.replace("-", "−") + (unit ? " " + unit : "");
}

function ticks(low, high, count) {
  const rough = (high - low) / count;
  const power = 10 ** Math.floor(Math.log10(rough));
  const part = rough / power;
  const step = power * (part < 1.5 ? 1 : part < 3.5 ? 2 : part < 7.5 ? 5 : 10);
  const decimals = Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  const exponent = step < 1e-4 || Math.max(Math.abs(low), Math.abs(high)) >= 1e6;
  const list = [];
  for (let i = Math.ceil(low / step - 1e-9); i <= Math.floor(high / step + 1e-9); i++) {
    const text = i === 0 ? "0" : exponent ? (i * step).toExponential(1) : (i * step).toFixed(decimals);
    list.push([i * step, text.replace("-", "−")]);
  }
  return list;
}

// A canvas that is sharp on any screen; `draw` gets its context in CSS pixels.
function fresh(canvas, width, height) {
  const dense = window.devicePixelRatio || 1;
  canvas.width = Math.round(width * dense);
  canvas.height = Math.round(height * dense);
  canvas.style.width = width + "px";
  canvas.style.height = height + "px";
  const context = canvas.getContext("2d");
  context.setTransform(dense, 0, 0, dense, 0, 0);
  context.font = FONT;
  context.lineWidth = 1;
  return context;
}

function axes(context, area, x, y, labels) {
  const across = (v) => area.left + (v - x[0]) / (x[1] - x[0]) * area.width;
  const down = (v) => area.top + area.height - (v - y[0]) / (y[1] - y[0]) * area.height;
  context.strokeStyle = context.fillStyle = INK;
  context.strokeRect(area.left + .5, area.top + .5, area.width, area.height);
  context.textAlign = "center";
  context.textBaseline = "top";
  let widest = 0;
  context.beginPath();
  for (const [v, text] of ticks(x[0], x[1], Math.max(2, area.width / 70))) {
    context.moveTo(across(v), area.top + area.height);
    context.lineTo(across(v), area.top + area.height + 4);
    context.fillText(text, across(v), area.top + area.height + 6);
  }
  if (labels[0]) context.fillText(labels[0], area.left + area.width / 2, area.top + area.height + 22);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const [v, text] of ticks(y[0], y[1], Math.max(2, area.height / 45))) {
    context.moveTo(area.left - 4, down(v));
    context.lineTo(area.left, down(v));
    context.fillText(text, area.left - 7, down(v));
    widest = Math.max(widest, context.measureText(text).width);
  }
  context.stroke();
  upwards(context, labels[1], area.left - 7 - widest - 10, area.top + area.height / 2);
  return { across, down };
}

function upwards(context, text, x, y) {
  context.save();
  context.translate(x, y);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = INK;
  context.fillText(text, 0, 0);
  context.restore();
}

// ---- Images ----

const half = [0, 1].map((axis) => meta.detector[axis] * meta.pitch[axis] / 2);
// Binned images may reach beyond the detector by part of a bin.
const reach = [columns * bin * meta.pitch[0] - half[0], half[1] - rows * bin * meta.pitch[1]];
const panels = [];

function addImage(parent, name, title, width) {
  const ratio = rows * meta.pitch[1] / (columns * meta.pitch[0]);
  const height = Math.min(520, Math.max(46, width * ratio));
  const wide = ratio > 1 ? Math.max(60, Math.min(width, height / ratio)) : width;
  const box = document.createElement("div");
  box.className = "image";
  const canvas = document.createElement("canvas");
  canvas.id = "image-" + name;
  const heading = document.createElement("h3");
  heading.textContent = title;
  const line = document.createElement("p");
  line.id = "value-" + name;
  box.append(heading, canvas, line);
  parent.append(box);
  const pixels = document.createElement("canvas");
  pixels.width = columns;
  pixels.height = rows;
  const area = { left: 54, top: 8, width: wide, height };
  const panel = { name, canvas, area, line, pixels, shown: -1 };
  panels.push(panel);
  const find = (event) => {
    const box = canvas.getBoundingClientRect();
    const column = Math.floor((event.clientX - box.left - area.left) / area.width * columns);
    const row = Math.floor((event.clientY - box.top - area.top) / area.height * rows);
    const inside = column >= 0 && column < columns && row >= 0 && row < rows;
    return inside ? { column, row } : null;
  };
  canvas.addEventListener("pointermove", (event) => {
    const pixel = find(event);
    if (pixel && !at.held) { Object.assign(at, pixel); show(); }
  });
  canvas.addEventListener("click", (event) => {
    const pixel = find(event);
    if (pixel) { at.held = !at.held; Object.assign(at, pixel); show(); }
  });
}

function drawImage(panel) {
  const { name, canvas, area, pixels } = panel;
  const image = images[name];
  const number = frame(name);
  if (panel.shown !== number) {
    const context = pixels.getContext("2d");
    const picture = context.createImageData(columns, rows);
    const words = new Uint32Array(picture.data.buffer);
    const first = number * rows * columns;
    for (let i = 0; i < words.length; i++) words[i] = image.colours[image.words[first + i]];
    context.putImageData(picture, 0, 0);
    panel.shown = number;
  }
  const context = fresh(canvas, area.left + area.width + 100, area.top + area.height + 42);
  context.imageSmoothingEnabled = columns > 2 * area.width;
  context.drawImage(pixels, area.left, area.top, area.width, area.height);
  axes(context, area, [-half[0], reach[0]], [reach[1], half[1]], ["x [mm]", "z [mm]"]);
  // The cursor: lines through the pixel, open at it.
  const wide = area.width / columns, high = area.height / rows;
  const x = area.left + (at.column + .5) * wide, y = area.top + (at.row + .5) * high;
  const open = Math.max(5, wide, high);
  for (const [colour, width] of [["#fff", 3], ["#111", 1]]) {
    context.strokeStyle = colour;
    context.lineWidth = width;
    context.beginPath();
    context.moveTo(area.left, y); context.lineTo(Math.max(area.left, x - open), y);
    context.moveTo(Math.min(area.left + area.width, x + open), y); context.lineTo(area.left + area.width, y);
    context.moveTo(x, area.top); context.lineTo(x, Math.max(area.top, y - open));
    context.moveTo(x, Math.min(area.top + area.height, y + open)); context.lineTo(x, area.top + area.height);
    context.stroke();
  }
  context.lineWidth = 1;
  drawBar(context, image, { left: area.left + area.width + 12, top: area.top, width: 12, height: area.height });
  panel.line.textContent = told(valueAt(name, number, pixelOf()), image.unit);
}

function drawBar(context, image, area) {
  for (let i = 0; i < 256; i++) {
    const [r, g, b] = image.table.subarray(3 * i, 3 * i + 3);
    context.fillStyle = `rgb(${r}, ${g}, ${b})`;
    context.fillRect(area.left, area.top + area.height * (255 - i) / 256, area.width, area.height / 256 + .6);
  }
  context.strokeStyle = context.fillStyle = INK;
  context.strokeRect(area.left + .5, area.top + .5, area.width, area.height);
  context.textAlign = "left";
  context.textBaseline = "middle";
  const [low, high] = image.scale;
  for (const [v, text] of ticks(low, high, Math.max(1, Math.min(5, area.height / 30)))) {
    const y = area.top + area.height * (1 - (v - low) / (high - low));
    context.fillRect(area.left + area.width, y - .5, 4, 1);
    context.fillText(text, area.left + area.width + 7, y);
  }
  if (image.unit) upwards(context, image.unit, area.left + area.width + 62, area.top + area.height / 2);
}

// ---- Curve ----

const fitOf = (of) => fitted && ["amplitude", "centre", "width", "background"]
  .map((part) => valueAt(`${of}_${part}`, frame(`${of}_${part}`), pixelOf()));
const gauss = ([a, centre, width, b], x) => a * Math.exp(-((x - centre) ** 2) / (2 * width * width)) + b;
const flatFrame = (step) => step;
const sampleFrame = (step) => at.view * offsets.length + step;

function drawCurve() {
  const area = { left: 78, top: 12, width: 506, height: 290 };
  const context = fresh(element("curve"), area.left + area.width + 24, area.top + area.height + 46);
  const room = .06 * ((offsets[offsets.length - 1] - offsets[0]) || 1);
  const ends = [Math.min(...offsets), Math.max(...offsets)];
  const x = [ends[0] - room, ends[1] + room];
  const curves = [["flat", flatFrame], ["sample", sampleFrame]].map(([name, frameOf]) => ({
    name,
    values: offsets.map((_, step) => valueAt(name, frameOf(step), pixelOf())),
    fit: fitOf(name),
  }));
  const top = Math.max(...curves.flatMap((curve) => curve.values).filter(Number.isFinite));
  const low = Math.min(0, ...curves.flatMap((curve) => curve.values).filter(Number.isFinite));
  const y = [low - .08 * (top - low), top + .08 * (top - low) || 1];
  const paper = axes(context, area, x, y, ["mask offset [µm]", images.flat.label]);
  context.save();
  context.beginPath();
  context.rect(area.left, area.top, area.width, area.height);
  context.clip();
  // The step that the frames show.
  context.strokeStyle = LINE;
  context.lineWidth = 5;
  context.beginPath();
  context.moveTo(paper.across(offsets[at.step]), area.top);
  context.lineTo(paper.across(offsets[at.step]), area.top + area.height);
  context.stroke();
  curves.forEach((curve, index) => {
    context.strokeStyle = context.fillStyle = COLOURS[index];
    context.lineWidth = 1.6;
    context.beginPath();
    if (curve.fit && curve.fit.every(Number.isFinite)) {
      for (let i = 0; i <= 240; i++) {
        const f = x[0] + (x[1] - x[0]) * i / 240;
        context.lineTo(paper.across(f), paper.down(gauss(curve.fit, f)));
      }
    } else {
      curve.values.forEach((value, i) => context.lineTo(paper.across(offsets[i]), paper.down(value)));
    }
    context.stroke();
    curve.values.forEach((value, i) => {
      context.beginPath();
      context.arc(paper.across(offsets[i]), paper.down(value), 3.5, 0, 7);
      context.fill();
    });
  });
  context.restore();
  context.textBaseline = "middle";
  context.textAlign = "left";
  ["flat", "with the sample"].forEach((name, index) => {
    context.fillStyle = COLOURS[index];
    context.fillRect(area.left + 10, area.top + 12 + 18 * index, 12, 3);
    context.fillStyle = INK;
    context.fillText(name + (fitted ? ", fit" : ""), area.left + 28, area.top + 14 + 18 * index);
  });
}

function fillTable() {
  const pixel = pixelOf();
  const lines = [["column, row", `${at.column * bin}, ${at.row * bin}`, ""]];
  const x = ((at.column + .5) * bin * meta.pitch[0] - half[0]).toFixed(3);
  const z = (half[1] - (at.row + .5) * bin * meta.pitch[1]).toFixed(3);
  lines.push(["x, z on the detector", `${x}, ${z} mm`.replaceAll("-", "−"), ""]);
  for (const name of contrasts) {
    const { label, unit } = images[name];
    lines.push([label, told(valueAt(name, frame(name), pixel), unit), ""]);
  }
  if (flagsAt(pixel)) lines.push(["flags", flagsAt(pixel), ""]);
  lines.push(["", "flat", "sample"]);
  lines.push(["value at the step", ...["flat", "sample"].map((name) => told(valueAt(name, frame(name), pixel)))]);
  if (fitted) {
    const fits = [fitOf("flat"), fitOf("sample")];
    [["amplitude A", ""], ["centre µ", "µm"], ["width σ", "µm"], ["background b", ""]].forEach(([what, unit], i) =>
      lines.push([what + " of the fit", ...fits.map((fit) => told(fit[i], unit))]));
  }
  const table = element("pixel");
  table.replaceChildren(...lines.map((line) => {
    const row = document.createElement("tr");
    line.forEach((text, i) => {
      const cell = document.createElement(i ? "td" : "th");
      cell.textContent = text;
      row.append(cell);
    });
    return row;
  }));
}

// ---- Histograms ----

function drawHistogram(name) {
  const image = images[name];
  const area = { left: 54, top: 8, width: 290, height: 130 };
  const context = fresh(element("histogram-" + name), area.left + area.width + 20, area.top + area.height + 44);
  const [low, high] = image.scale;
  const bins = new Array(80).fill(0);
  const first = frame(name) * rows * columns;
  for (let i = 0; i < rows * columns; i++) {
    const value = valueAt(name, frame(name), i);
    const bin = Math.floor((value - low) / (high - low) * bins.length);
    if (Number.isFinite(bin)) bins[Math.min(bins.length - 1, Math.max(0, bin))] += 1;
  }
  // Most pixels lie beside the sample: the scale of counts is logarithmic.
  const top = Math.max(1, Math.log10(Math.max(...bins)) * 1.05);
  const wide = area.width / bins.length;
  bins.forEach((count, i) => {
    if (count === 0) return;
    const [r, g, b] = image.table.subarray(3 * Math.round(255 * (i + .5) / bins.length));
    const tall = Math.max(1.5, Math.log10(count) / top * area.height);
    context.fillStyle = image.map === "Viridis" ? COLOURS[0] : `rgb(${r}, ${g}, ${b})`;
    context.fillRect(area.left + i * wide, area.top + area.height - tall, wide, tall);
    context.strokeStyle = GREY;
    context.lineWidth = .4;
    context.strokeRect(area.left + i * wide, area.top + area.height - tall, wide, tall);
  });
  context.lineWidth = 1;
  const label = image.label + (image.unit ? ` [${image.unit}]` : "");
  axes(context, area, [low, high], [0, top], [label, "log₁₀ of pixels"]);
}

// ---- Controls ----

function show() {
  const step = offsets[at.step].toFixed(2).replace(/\.?0+$/, "").replace("-", "−");
  element("step-told").textContent = `${at.step}: ${step} µm`;
  const angle = angles[at.view].toFixed(2).replace(/\.?0+$/, "").replace("-", "−");
  element("view-told").textContent = `${meta.views[at.view]}: ${angle}°`;
  element("cursor-told").textContent =
    `pixel ${at.column * bin}, ${at.row * bin}${at.held ? " (held)" : ""}`;
  panels.forEach(drawImage);
  drawCurve();
  fillTable();
}

function showView() {
  show();
  contrasts.forEach(drawHistogram);
}

function begin() {
  addImage(element("frames"), "flat", "Flat", 470);
  addImage(element("frames"), "sample", "With the sample", 470);
  for (const name of contrasts) {
    const { label } = images[name];
    addImage(element("contrasts"), name, label[0].toUpperCase() + label.slice(1), 268);
    const box = document.createElement("canvas");
    box.id = "histogram-" + name;
    element("histograms").append(box);
  }
  if (contrasts.length === 0) {
    element("retrieved").hidden = true;
    element("distributions").hidden = true;
  }
  const step = element("step"), view = element("view");
  step.max = offsets.length - 1;
  view.max = angles.length - 1;
  step.disabled = offsets.length < 2;
  view.disabled = angles.length < 2;
  // The brightest step of the flat shows most.
  const light = offsets.map((_, i) => valueAt("flat", i, pixelOf()));
  at.step = Math.max(0, light.indexOf(Math.max(...light)));
  step.value = at.step;
  step.addEventListener("input", () => { at.step = Number(step.value); show(); });
  view.addEventListener("input", () => { at.view = Number(view.value); showView(); });
  document.addEventListener("keydown", (event) => {
    if (event.target.tagName === "INPUT") return;
    const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!move) return;
    event.preventDefault();
    at.column = Math.min(columns - 1, Math.max(0, at.column + move[0]));
    at.row = Math.min(rows - 1, Math.max(0, at.row + move[1]));
    show();
  });
  showView();
}

begin();
