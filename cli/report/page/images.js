// Images on canvases: axes, colour bar, crosshair, zoom, range of the colours.

const panels = [];

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

// The part in sight, made smaller or larger about the pixel; `factor` 0 shows all.
function zoom(factor) {
  const size = (all, seen) => factor ? Math.min(all, Math.max(Math.min(4, all), Math.round(seen * factor))) : all;
  const wide = size(columns, at.sight.columns), high = size(rows, at.sight.rows);
  const from = (pixel, seen, all) => Math.min(all - seen, Math.max(0, pixel - Math.floor(seen / 2)));
  at.sight = { columns: wide, rows: high, column: from(at.column, wide, columns), row: from(at.row, high, rows) };
  show();
}
