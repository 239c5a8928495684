// Images on canvases: axes, colour bar, crosshair, zoom, range of the colours.

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
    list.push([i * step, minus(text)]);
  }
  return list;
}

// A canvas that is sharp on any screen; its context draws in CSS pixels.
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
  context.strokeStyle = context.fillStyle = colour("ink");
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
  context.fillText(labels[0], area.left + area.width / 2, area.top + area.height + 22);
  context.textAlign = "right";
  context.textBaseline = "middle";
  for (const [v, text] of ticks(Math.min(...y), Math.max(...y), Math.max(2, area.height / 45))) {
    context.moveTo(area.left - 4, down(v));
    context.lineTo(area.left, down(v));
    context.fillText(text, area.left - 7, down(v));
    widest = Math.max(widest, context.measureText(text).width);
  }
  context.stroke();
  upwards(context, labels[1], Math.max(8, area.left - 7 - widest - 10), area.top + area.height / 2);
}

function upwards(context, text, x, y) {
  context.save();
  context.translate(x, y);
  context.rotate(-Math.PI / 2);
  context.textAlign = "center";
  context.textBaseline = "middle";
  context.fillStyle = colour("ink");
  context.fillText(text, 0, 0);
  context.restore();
}

const panels = [];
const LEFT = 54, TOP = 8, BAR = 92, BELOW = 42;

// Size of the part of a panel that shows pixels, in the room that there is.
function fit(panel) {
  const room = Math.min(panel.widest, panel.box.parentElement.clientWidth || panel.widest);
  const width = Math.max(90, room - LEFT - BAR);
  const ratio = rows * meta.pitch[1] / (columns * meta.pitch[0]);
  const height = Math.min(520, Math.max(46, width * ratio));
  panel.area = { left: LEFT, top: TOP, height, width: ratio > 1 ? Math.max(60, Math.min(width, height / ratio)) : width };
}

function addImage(parent, name, title, widest) {
  const image = images[name];
  const line = make("p", { id: "value-" + name });
  const canvas = make("canvas", { id: "image-" + name, tabIndex: 0 });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-describedby", line.id);
  const ends = [0, 1].map((end) => {
    const field = make("input", { type: "number", step: "any", id: `range-${name}-${end ? "high" : "low"}` });
    field.setAttribute("aria-label", `${title}: ${end ? "upper" : "lower"} end of the colours`);
    field.addEventListener("change", () => setRange(panel, end, Number(field.value)));
    return field;
  });
  const tools = make("div", { className: "tools" }, "range ", ends[0], " to ", ends[1], image.unit ? ` ${image.unit} ` : " ",
    button("reset", `Reset the range of ${title}`, () => { image.scale = [...image.whole]; redraw(panel); }),
    button("PNG", `Save ${title} as PNG`, () => saveCanvas(`${name}.png`, canvas)),
    button("CSV", `Save ${title} as CSV`, () => saveText(`${name}.csv`, csvOf(name))));
  const box = make("div", { className: "image" }, make("h3", { textContent: title }), canvas, line, tools);
  parent.append(box);
  const pixels = make("canvas", { width: columns, height: rows });
  const panel = { name, title, box, canvas, line, pixels, ends, widest, shown: -1 };
  panels.push(panel);
  const find = (event) => {
    const box = canvas.getBoundingClientRect(), { area } = panel, { sight } = at;
    const column = sight.column + Math.floor((event.clientX - box.left - area.left) / area.width * sight.columns);
    const row = sight.row + Math.floor((event.clientY - box.top - area.top) / area.height * sight.rows);
    const inside = column >= sight.column && column < sight.column + sight.columns
      && row >= sight.row && row < sight.row + sight.rows;
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
  canvas.addEventListener("keydown", onKey);
}

function setRange(panel, end, value) {
  const { scale } = images[panel.name];
  const next = [...scale];
  next[end] = value;
  if (Number.isFinite(value) && next[0] < next[1]) images[panel.name].scale = next;
  redraw(panel);
}

function redraw(panel) {
  colours(images[panel.name]);
  panel.shown = -1;
  drawImage(panel);
  sinograms.filter((one) => one.name === panel.name).forEach(drawSinogram);
  if (panel.name === "flat" || panel.name === "sample") return;
  drawHistogram(panel.name);
}

function csvOf(name) {
  const first = frame(name);
  const { label, unit } = images[name];
  const head = [`# ${label}${unit ? ` [${unit}]` : ""}, rows from the top, ${columns} columns`];
  const line = (_, row) => Array.from({ length: columns }, (_, column) => {
    const value = valueAt(name, first, row * columns + column);
    return Number.isFinite(value) ? value.toPrecision(6) : "nan";
  }).join(",");
  return head.concat(Array.from({ length: rows }, line));
}

function drawImage(panel) {
  const { name, canvas, pixels, title } = panel;
  const image = images[name], { sight } = at;
  const number = frame(name);
  fit(panel);
  const { area } = panel;
  if (panel.shown !== number) {
    const context = pixels.getContext("2d");
    const picture = context.createImageData(columns, rows);
    const words = new Uint32Array(picture.data.buffer);
    const first = number * rows * columns;
    for (let i = 0; i < words.length; i++) words[i] = image.colours[image.words[first + i]];
    context.putImageData(picture, 0, 0);
    panel.shown = number;
  }
  const context = fresh(canvas, area.left + area.width + BAR, area.top + area.height + BELOW);
  context.imageSmoothingEnabled = sight.columns > 2 * area.width;
  context.drawImage(pixels, sight.column, sight.row, sight.columns, sight.rows, area.left, area.top, area.width, area.height);
  const x = [xOf(sight.column - .5), xOf(sight.column + sight.columns - .5)];
  const z = [zOf(sight.row + sight.rows - .5), zOf(sight.row - .5)];
  axes(context, area, x, z, [ACROSS, UP]);
  if (at.crosshair) drawCrosshair(context, area, sight, at.row);
  drawBar(context, image, { left: area.left + area.width + 12, top: area.top, width: 12, height: area.height });
  const sigma = images[name + "_sigma"] ? now(name + "_sigma") : NaN;
  panel.line.textContent = measured(valueAt(name, number, pixelOf()), sigma, image.unit);
  canvas.setAttribute("aria-label",
    `${title}, column ${at.column * bin}, row ${at.row * bin}: ${panel.line.textContent}. Arrow keys move the pixel.`);
  panel.ends.forEach((field, end) => { field.value = Number(image.scale[end].toPrecision(4)); });
}

// Lines through the pixel, open at it; `row`: of what is in sight.
function drawCrosshair(context, area, sight, row) {
  const wide = area.width / sight.columns, high = area.height / sight.rows;
  const x = area.left + (at.column - sight.column + .5) * wide, y = area.top + (row - sight.row + .5) * high;
  const open = Math.max(5, wide, high);
  context.save();
  context.beginPath();
  context.rect(area.left, area.top, area.width, area.height);
  context.clip();
  for (const [ink, width] of [["#fff", 3], ["#111", 1]]) {
    context.strokeStyle = ink;
    context.lineWidth = width;
    context.beginPath();
    context.moveTo(area.left, y); context.lineTo(Math.max(area.left, x - open), y);
    context.moveTo(Math.min(area.left + area.width, x + open), y); context.lineTo(area.left + area.width, y);
    context.moveTo(x, area.top); context.lineTo(x, Math.max(area.top, y - open));
    context.moveTo(x, Math.min(area.top + area.height, y + open)); context.lineTo(x, area.top + area.height);
    context.stroke();
  }
  context.restore();
}

function drawBar(context, image, area) {
  const [low, high] = image.scale;
  for (let i = 0; i < 256; i++) {
    const index = place(image, low + (high - low) * i / 255);
    const [r, g, b] = image.table.subarray(index, index + 3);
    context.fillStyle = `rgb(${r}, ${g}, ${b})`;
    context.fillRect(area.left, area.top + area.height * (255 - i) / 256, area.width, area.height / 256 + .6);
  }
  context.strokeStyle = context.fillStyle = colour("ink");
  context.strokeRect(area.left + .5, area.top + .5, area.width, area.height);
  context.textAlign = "left";
  context.textBaseline = "middle";
  for (const [v, text] of ticks(low, high, Math.max(1, Math.min(5, area.height / 30)))) {
    const y = area.top + area.height * (1 - (v - low) / (high - low));
    context.fillRect(area.left + area.width, y - .5, 4, 1);
    context.fillText(text, area.left + area.width + 7, y);
  }
  if (image.unit) upwards(context, image.unit, area.left + area.width + 62, area.top + area.height / 2);
}

// The part in sight, made smaller or larger about the pixel; `factor` 0 shows all.
function zoom(factor) {
  const size = (all, seen) => factor ? Math.min(all, Math.max(Math.min(4, all), Math.round(seen * factor))) : all;
  const wide = size(columns, at.sight.columns), high = size(rows, at.sight.rows);
  const from = (pixel, seen, all) => Math.min(all - seen, Math.max(0, pixel - Math.floor(seen / 2)));
  at.sight = { columns: wide, rows: high, column: from(at.column, wide, columns), row: from(at.row, high, rows) };
  show();
}
