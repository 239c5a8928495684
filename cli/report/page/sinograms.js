// Sinograms: the row of the pixel over the views of this page.

const sinograms = [];
const views = meta.views.length;
// Angles that are evenly spaced have an axis; others are counted.
const turn = views > 1 && angles.length === views ? (angles[views - 1] - angles[0]) / (views - 1) : 0;
const even = turn > 0 && angles.every((angle, view) => Math.abs(angle - angles[0] - view * turn) < 1e-6);
const DOWN = even ? "angle [°]" : "view of this page";
// Outer edges of the last and of the first view, which is on top.
const ends = even ? [angles[views - 1] + turn / 2, angles[0] - turn / 2] : [views - .5, -.5];

function addSinogram(name, title) {
  const line = make("p", {});
  const canvas = make("canvas", { id: "sinogram-" + name, tabIndex: 0 });
  canvas.setAttribute("role", "img");
  const tools = make("div", { className: "tools" },
    button("PNG", `Save the sinogram of ${title} as PNG`, () => saveCanvas(`sinogram-${name}.png`, canvas)),
    button("CSV", `Save the sinogram of ${title} as CSV`, () => saveText(`sinogram-${name}.csv`, csvOfSinogram(name))));
  const box = make("div", { className: "image" }, make("h3", { textContent: title }), canvas, line, tools);
  element("sinograms").append(box);
  const sinogram = { name, title, box, canvas, line, pixels: make("canvas", { width: columns, height: views }), area: null };
  sinograms.push(sinogram);
  const find = (event) => {
    const box = canvas.getBoundingClientRect(), { area } = sinogram;
    const column = at.sight.column + Math.floor((event.clientX - box.left - area.left) / area.width * at.sight.columns);
    const view = Math.floor((event.clientY - box.top - area.top) / area.height * views);
    const inside = column >= at.sight.column && column < at.sight.column + at.sight.columns && view >= 0 && view < views;
    return inside ? { column, view } : null;
  };
  canvas.addEventListener("pointermove", (event) => {
    const found = find(event);
    if (found && !at.held) { at.column = found.column; show(); }
  });
  canvas.addEventListener("click", (event) => {
    const found = find(event);
    if (found) { at.column = found.column; toView(found.view); }
  });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowUp: -1, ArrowDown: 1 }[event.key];
    if (step === undefined) { onKey(event); return; }
    toView(Math.min(views - 1, Math.max(0, at.view + step)));
    event.preventDefault();
  });
}

function toView(view) {
  at.view = view;
  element("view").value = view;
  showView();
}

// Number of the frame of an image at a view.
const frameAt = (name, view) => name === "sample" ? view * offsets.length + at.step : view;

function drawSinogram(sinogram) {
  const { name, title, canvas, pixels } = sinogram;
  const image = images[name], { sight } = at;
  const room = Math.min(406, sinogram.box.parentElement.clientWidth || 406);
  const width = Math.max(90, room - LEFT - BAR);
  const area = { left: LEFT, top: TOP, width, height: Math.max(60, Math.min(300, .75 * width)) };
  sinogram.area = area;
  const context = pixels.getContext("2d");
  const picture = context.createImageData(columns, views);
  const words = new Uint32Array(picture.data.buffer);
  for (let view = 0; view < views; view++) {
    const first = (frameAt(name, view) * rows + at.row) * columns;
    for (let column = 0; column < columns; column++) words[view * columns + column] = image.colours[image.words[first + column]];
  }
  context.putImageData(picture, 0, 0);
  const paper = fresh(canvas, area.left + area.width + BAR, area.top + area.height + BELOW);
  paper.imageSmoothingEnabled = false;
  paper.drawImage(pixels, sight.column, 0, sight.columns, views, area.left, area.top, area.width, area.height);
  axes(paper, area, [xOf(sight.column - .5), xOf(sight.column + sight.columns - .5)], ends, [ACROSS, DOWN]);
  if (at.crosshair) drawCrosshair(paper, area, { columns: sight.columns, rows: views, column: sight.column, row: 0 }, at.view);
  drawBar(paper, image, { left: area.left + area.width + 12, top: area.top, width: 12, height: area.height });
  sinogram.line.textContent = `view ${viewTold()}: ${told(valueAt(name, frameAt(name, at.view), pixelOf()), image.unit)}`;
  canvas.setAttribute("aria-label",
    `Sinogram of ${title}, row ${at.row * bin}, column ${at.column * bin}, ${sinogram.line.textContent}. Arrow keys move column and view.`);
}

function csvOfSinogram(name) {
  const { label, unit } = images[name];
  const head = [`# ${label}${unit ? ` [${unit}]` : ""}, row ${at.row * bin}, a line per view, ${columns} columns`];
  const line = (_, view) => Array.from({ length: columns }, (_, column) => {
    const value = valueAt(name, frameAt(name, view), at.row * columns + column);
    return Number.isFinite(value) ? value.toPrecision(6) : "nan";
  }).join(",");
  return head.concat(Array.from({ length: views }, line));
}
