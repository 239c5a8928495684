// The page of a reconstruction: slices across three axes through one voxel, its values, profiles
// and histograms. State is in `at`; `show()` draws it.

const { size, bin, whole: sides, voxel, origin, names, volumes, residuals } = meta;
names.forEach((name) => decode(name, volumes[name]));
const AXES = ["x", "y", "z"];
// Axes of a slice: the one it is across, the one to the right, the one up.
const CUTS = [{ across: 2, right: 0, up: 1 }, { across: 1, right: 0, up: 2 }, { across: 0, right: 1, up: 2 }];

// What is shown: the volume, the voxel by its numbers in this page, and the first voxel and the number
// of voxels in sight along each axis.
const at = { name: names[0], voxel: size.map((side) => Math.floor(side / 2)), crosshair: true,
  sight: size.map((side) => [0, side]) };

// Place of a voxel along an axis, mm, and its numbers in the files.
const placeOf = (axis, number) => origin[axis] + number * voxel[axis];
const numberIn = (axis) => Math.min(sides[axis] - 1, at.voxel[axis] * bin[axis]);
const placeTold = (axis) => `${numberIn(axis)}: ${minus(placeOf(axis, at.voxel[axis]).toFixed(3))} mm`;
const indexOf = ([x, y, z]) => (z * size[1] + y) * size[0] + x;
const valueIn = (name, where) => valueOf(volumes[name], volumes[name].words[indexOf(where)]);
const shown = () => volumes[at.name];
const moved = (axis, number) => Math.min(size[axis] - 1, Math.max(0, number));

const panels = [];

function addSlice(cut) {
  const axis = AXES[cut.across];
  const heading = make("h3", {}), line = make("p", { id: "value-" + axis });
  const canvas = make("canvas", { id: "slice-" + axis, tabIndex: 0 });
  canvas.setAttribute("role", "img");
  canvas.setAttribute("aria-describedby", line.id);
  const tools = make("div", { className: "tools" },
    button("PNG", `Save the slice across ${axis} as PNG`, () => saveCanvas(`${at.name}_${axis}.png`, canvas)),
    button("CSV", `Save the slice across ${axis} as CSV`, () => saveText(`${at.name}_${axis}.csv`, csvOfSlice(cut))));
  const box = make("div", { className: "image" }, heading, canvas, line, tools);
  element("slices").append(box);
  const panel = { ...cut, axis, heading, line, canvas, box, area: null, pixels: make("canvas", { width: size[cut.right], height: size[cut.up] }) };
  panels.push(panel);
  const find = (event) => {
    const box = canvas.getBoundingClientRect(), { area } = panel;
    const [first, count] = at.sight[cut.right], [low, high] = at.sight[cut.up];
    const right = first + Math.floor((event.clientX - box.left - area.left) / area.width * count);
    const up = low + high - 1 - Math.floor((event.clientY - box.top - area.top) / area.height * high);
    return right >= first && right < first + count && up >= low && up < low + high ? [right, up] : null;
  };
  const go = (event) => {
    const found = find(event);
    if (found) { [at.voxel[cut.right], at.voxel[cut.up]] = found; show(); }
  };
  canvas.addEventListener("pointerdown", go);
  canvas.addEventListener("pointermove", (event) => { if (event.buttons) go(event); else hover(panel, find(event)); });
  canvas.addEventListener("keydown", (event) => onKey(event, cut));
}

// The value under a pointer that is not pressed.
function hover(panel, found) {
  if (!found) return;
  const where = [...at.voxel];
  [where[panel.right], where[panel.up]] = found;
  panel.line.textContent = `${valueTold(where)} at ${AXES.map((axis, i) => `${axis} ${minus(placeOf(i, where[i]).toFixed(3))}`).join(", ")} mm`;
}

// A value of a volume in words; the object of a label.
const inWords = (image, value) => (image.objects && image.objects[Math.round(value)]) || told(value, image.unit);
const valueTold = (where) => inWords(shown(), valueIn(at.name, where));

function drawSlice(panel) {
  const { across, right, up, axis, canvas, pixels, heading, line } = panel;
  const image = shown();
  const context = pixels.getContext("2d");
  const picture = context.createImageData(size[right], size[up]);
  const words = new Uint32Array(picture.data.buffer);
  const where = [0, 0, 0];
  where[across] = at.voxel[across];
  for (let row = 0; row < size[up]; row++) {
    where[up] = size[up] - 1 - row;
    for (let column = 0; column < size[right]; column++) {
      where[right] = column;
      words[row * size[right] + column] = image.colours[image.words[indexOf(where)]];
    }
  }
  context.putImageData(picture, 0, 0);
  const [first, count] = at.sight[right], [low, high] = at.sight[up];
  const room = Math.min(406, panel.box.parentElement.clientWidth || 406);
  const width = Math.max(90, room - LEFT - BAR);
  const ratio = high * voxel[up] / (count * voxel[right]);
  const height = Math.min(420, Math.max(46, width * ratio));
  const area = { left: LEFT, top: TOP, height, width: ratio > 1 ? Math.max(60, Math.min(width, height / ratio)) : width };
  panel.area = area;
  const paper = fresh(canvas, area.left + area.width + BAR, area.top + area.height + BELOW);
  paper.imageSmoothingEnabled = count > 2 * area.width;
  paper.drawImage(pixels, first, size[up] - low - high, count, high, area.left, area.top, area.width, area.height);
  const x = [placeOf(right, first - .5), placeOf(right, first + count - .5)];
  const y = [placeOf(up, low - .5), placeOf(up, low + high - .5)];
  axes(paper, area, x, y, [`${AXES[right]} [mm]`, `${AXES[up]} [mm]`]);
  const to = ([a, b]) => [area.left + (a - x[0]) / (x[1] - x[0]) * area.width, area.top + area.height - (b - y[0]) / (y[1] - y[0]) * area.height];
  paper.save();
  paper.beginPath();
  paper.rect(area.left, area.top, area.width, area.height);
  paper.clip();
  if (at.crosshair) {
    const [a, b] = to([placeOf(right, at.voxel[right]), placeOf(up, at.voxel[up])]);
    stroked(paper, () => {
      paper.moveTo(area.left, b); paper.lineTo(a - 6, b);
      paper.moveTo(a + 6, b); paper.lineTo(area.left + area.width, b);
      paper.moveTo(a, area.top); paper.lineTo(a, b - 6);
      paper.moveTo(a, b + 6); paper.lineTo(a, area.top + area.height);
    });
  }
  paper.restore();
  drawBar(paper, image, { left: area.left + area.width + 12, top: area.top, width: 12, height: area.height });
  heading.textContent = `across ${axis}, slice ${placeTold(across)}`;
  line.textContent = valueTold(at.voxel);
  canvas.setAttribute("aria-label", `${image.label}, ${heading.textContent}, voxel ${AXES.map((_, i) => numberIn(i)).join(", ")}: ${line.textContent}. Arrow keys move the voxel, Page Up and Page Down the slice.`);
}

// A line that is seen on light and dark.
function stroked(paper, path) {
  for (const [ink, width] of [["#fff", 3], ["#111", 1]]) {
    paper.strokeStyle = ink;
    paper.lineWidth = width;
    paper.beginPath();
    path();
    paper.stroke();
  }
}

function csvOfSlice({ across, right, up }) {
  const { label, unit } = shown();
  const head = [`# ${label}${unit ? ` [${unit}]` : ""}, ${AXES[across]} = ${placeOf(across, at.voxel[across])} mm, lines along ${AXES[up]} ascending, columns along ${AXES[right]} ascending`];
  const where = [...at.voxel];
  return head.concat(Array.from({ length: size[up] }, (_, row) => Array.from({ length: size[right] }, (_, column) => {
    [where[up], where[right]] = [row, column];
    const value = valueIn(at.name, where);
    return Number.isFinite(value) ? value.toPrecision(6) : "nan";
  }).join(",")));
}

// ---- The voxel ----

const cells = {};

function addTable() {
  const lines = [["number", "voxel x, y, z"], ["where", "x, y, z"]]
    .concat(names.map((name) => [name, volumes[name].label]));
  for (const [key, title] of lines) {
    const head = make("th", { textContent: title });
    head.setAttribute("scope", "row");
    cells[key] = make("td", {});
    element("voxel").append(make("tr", { className: key }, head, cells[key]));
  }
}

function fillTable() {
  const places = at.voxel.map((number, axis) => placeOf(axis, number));
  cells.number.textContent = AXES.map((_, axis) => numberIn(axis)).join(", ");
  cells.where.textContent = minus(places.map((place) => place.toFixed(3)).join(", ") + " mm");
  for (const name of names) {
    cells[name].textContent = inWords(volumes[name], valueIn(name, at.voxel));
  }
}

// ---- Charts ----

const line = (label) => [{ label: "place" }, { label, ink: "flat", width: 1.5, points: { show: false } }];

function addCharts() {
  AXES.forEach((axis, i) => {
    addChart(element("profiles"), "profile-" + axis, `Along ${axis}`, 406, 190, line("value"),
      { where: () => placeOf(i, at.voxel[i]), across: () => `${axis} [mm]`, down: "value" });
  });
  const bars = { label: "log₁₀ of voxels", ink: "flat", fill: colour("band"), paths: uPlot.paths.bars({ size: [1, 100] }), points: { show: false } };
  addChart(element("histograms"), "histogram", "Voxels by their value", 640, 220, [{ label: "value" }, bars],
    { across: () => words(shown()), down: "log₁₀ of voxels", where: () => valueIn(at.name, at.voxel) });
  for (const [name, values] of Object.entries(residuals)) {
    addChart(element("residuals"), "residual-" + name, `Residuals of ${name}`, 406, 190, [{ label: "iteration" },
      { label: "log₁₀ of the rms residual", ink: "flat", width: 1.5, points: { show: true, size: 5 } }],
    { across: () => "iteration", down: "log₁₀ of rms", where: () => values.best });
    element("residual-section").hidden = false;
  }
}

const words = ({ label, unit }) => label + (unit ? ` [${unit}]` : "");

// Charts whose labels are those of another volume are made anew.
function renew(...ids) {
  for (const id of ids) {
    const chart = charts[id];
    if (chart.plot) chart.plot.destroy();
    chart.plot = null;
    chart.zoomed = false;
  }
}

function drawProfiles() {
  AXES.forEach((axis, i) => {
    const where = [...at.voxel];
    const values = Array.from({ length: size[i] }, (_, number) => { where[i] = number; return finite(valueIn(at.name, where)); });
    draw(charts["profile-" + axis], [values.map((_, number) => placeOf(i, number)), values]);
  });
}

// Whether a voxel belongs to the part of the volume that the histogram is of.
function part() {
  const chosen = element("part").value;
  const axis = AXES.indexOf(chosen);
  if (axis >= 0) return (where) => where[axis] === at.voxel[axis];
  return () => true;
}

function drawHistogram() {
  const belongs = part(), [low, high] = shown().scale;
  const bins = new Array(120).fill(0);
  let [count, sum, squares, least, most] = [0, 0, 0, Infinity, -Infinity];
  const where = [0, 0, 0];
  for (let z = 0; z < size[2]; z++) for (let y = 0; y < size[1]; y++) for (let x = 0; x < size[0]; x++) {
    [where[0], where[1], where[2]] = [x, y, z];
    if (!belongs(where)) continue;
    const value = valueIn(at.name, where);
    if (!Number.isFinite(value)) continue;
    count += 1; sum += value; squares += value * value;
    least = Math.min(least, value); most = Math.max(most, value);
    const place = Math.floor((value - low) / (high - low) * bins.length);
    bins[Math.min(bins.length - 1, Math.max(0, place))] += 1;
  }
  const mean = sum / count, unit = shown().unit;
  element("part-told").textContent = count === 0 ? "no voxel" : `${count} voxels${bin.some((n) => n > 1) ? " of this page" : ""}: mean ${told(mean, unit)}, standard deviation ${
    told(Math.sqrt(Math.max(0, squares / count - mean * mean)), unit)}, from ${told(least, unit)} to ${told(most, unit)}`;
  const middle = bins.map((_, i) => low + (i + .5) / bins.length * (high - low));
  // Values beyond the range of the colours are in the outermost bars; 1 voxel is a tenth.
  draw(charts.histogram, [middle, bins.map((n) => n ? Math.max(.1, Math.log10(n)) : null)]);
}

function drawResiduals() {
  for (const [name, { values }] of Object.entries(residuals)) {
    draw(charts["residual-" + name], [values.map((_, n) => n), values.map((value) => finite(Math.log10(value)))]);
  }
}

// ---- Controls ----

const ends = [0, 1].map((end) => {
  const field = make("input", { type: "number", step: "any", id: `range-${end ? "high" : "low"}` });
  field.setAttribute("aria-label", `${end ? "Upper" : "Lower"} end of the colours`);
  field.addEventListener("change", () => {
    const next = [...shown().scale];
    next[end] = Number(field.value);
    if (Number.isFinite(next[end]) && next[0] < next[1]) shown().scale = next;
    recolour();
  });
  return field;
});
const unitTold = make("span", {});
element("range").append("range ", ends[0], " to ", ends[1], " ", unitTold, " ",
  button("reset", "Reset the range of the colours", () => { shown().scale = [...shown().whole]; recolour(); }));

function recolour() {
  colours(shown());
  renew("histogram");
  showVolume();
}

function show() {
  AXES.forEach((axis, i) => {
    const slider = element(axis);
    slider.value = at.voxel[i];
    slider.setAttribute("aria-valuetext", `${axis} ${placeTold(i)}`);
    element(axis + "-told").textContent = placeTold(i);
  });
  element("cursor-told").textContent = valueTold(at.voxel);
  panels.forEach(drawSlice);
  drawProfiles();
  fillTable();
  if (AXES.includes(element("part").value)) drawHistogram();
  else if (charts.histogram.plot) charts.histogram.plot.redraw(false);
}

function showVolume() {
  ends.forEach((field, end) => { field.value = Number(shown().scale[end].toPrecision(4)); });
  unitTold.textContent = shown().unit;
  drawHistogram();
  show();
}

function onKey(event, { across, right, up }) {
  const move = { ArrowLeft: [right, -1], ArrowRight: [right, 1], ArrowUp: [up, 1], ArrowDown: [up, -1], PageUp: [across, 1], PageDown: [across, -1] }[event.key];
  const factor = { "+": .5, "=": .5, "-": 2, "0": 0 }[event.key];
  if (move) {
    at.voxel[move[0]] = moved(move[0], at.voxel[move[0]] + move[1]);
    show();
  } else if (factor !== undefined) {
    zoom(factor);
  } else if (event.key.toLowerCase() === "h") {
    element("crosshair").click();
  } else {
    return;
  }
  event.preventDefault();
}

// The part in sight, made smaller or larger about the voxel; `factor` 0 shows all.
function zoom(factor) {
  at.sight = at.sight.map(([, seen], axis) => {
    const all = size[axis];
    const count = factor ? Math.min(all, Math.max(Math.min(4, all), Math.round(seen * factor))) : all;
    return [Math.min(all - count, Math.max(0, at.voxel[axis] - Math.floor(count / 2))), count];
  });
  show();
}

const dark = matchMedia("(prefers-color-scheme: dark)");
function setTheme() {
  const chosen = element("theme").value;
  document.documentElement.dataset.theme = chosen === "auto" ? (dark.matches ? "dark" : "light") : chosen;
  renew(...Object.keys(charts));
}

function begin() {
  CUTS.forEach(addSlice);
  addTable();
  addCharts();
  setTheme();
  AXES.forEach((axis, i) => {
    const slider = element(axis);
    slider.max = size[i] - 1;
    slider.disabled = size[i] < 2;
    slider.addEventListener("input", () => { at.voxel[i] = moved(i, Number(slider.value)); show(); });
  });
  element("volume").addEventListener("change", (event) => {
    at.name = event.target.value;
    renew("histogram", ...AXES.map((axis) => "profile-" + axis));
    showVolume();
  });
  element("part").addEventListener("change", drawHistogram);
  element("crosshair").addEventListener("change", (event) => { at.crosshair = event.target.checked; show(); });
  element("zoom-in").addEventListener("click", () => zoom(.5));
  element("zoom-out").addEventListener("click", () => zoom(2));
  element("zoom-whole").addEventListener("click", () => zoom(0));
  const repaint = () => { setTheme(); showVolume(); drawResiduals(); };
  element("theme").addEventListener("change", repaint);
  dark.addEventListener("change", repaint);
  let width = innerWidth;
  addEventListener("resize", () => {
    // Phones report a resize when their bars come and go.
    if (innerWidth !== width) { width = innerWidth; showVolume(); drawResiduals(); }
  });
  showVolume();
  drawResiduals();
}

begin();
