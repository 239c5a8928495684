// The controls, the table of the pixel, and what is drawn when.

// The table's rows: made once, so that nothing moves under the cursor.
const LINES = [["place", "column, row"], ["where", "x, z on the detector"]]
  .concat(contrasts.map((name) => [name, images[name].label + (images[name + "_sigma"] ? " ± 1σ" : "")]))
  .concat(flags ? [["flags", "flags"]] : [])
  .concat(meta.frames || fitted || images.residual_flat ? [["head", ""]] : [])
  .concat(meta.frames ? [["value", "value at the step"]] : [])
  .concat(fitted ? [["amplitude", "amplitude A of the fit"], ["centre", "centre µ of the fit"], ["width", "width σ of the fit"],
    ["background", "background b of the fit"]] : [])
  .concat(images.residual_flat ? [["residual", "rms residual of the fit"]] : []);
const PAIRED = ["head", "value", "amplitude", "centre", "width", "background", "residual"];
const cells = {};

function addTable() {
  for (const [key, title] of LINES) {
    const row = make("tr", { className: key });
    const head = make("th", { textContent: title, title });
    head.setAttribute("scope", "row");
    row.append(head);
    cells[key] = [0, 1].slice(0, PAIRED.includes(key) ? 2 : 1).map((_, i, all) => {
      const cell = make("td", { colSpan: 3 - all.length });
      row.append(cell);
      return key === "flags" ? cell.appendChild(make("div", { tabIndex: 0 })) : cell;
    });
    element("pixel").append(row);
  }
}

function fillTable() {
  const put = (key, ...texts) => cells[key] && texts.forEach((text, i) => {
    cells[key][i].textContent = text;
    cells[key][i].title = text;
  });
  put("place", `${at.column * bin}, ${at.row * bin}`);
  put("where", minus(`${xOf(at.column).toFixed(3)}, ${zOf(at.row).toFixed(3)} ${meta.length}`));
  for (const name of contrasts) put(name, measured(now(name), now(name + "_sigma"), images[name].unit));
  put("flags", flagsAt(pixelOf()) || "none");
  put("head", "flat", "sample");
  for (const [key, part, unit] of [["value", "", ""], ["amplitude", "_amplitude", ""], ["centre", "_centre", "µm"],
    ["width", "_width", "µm"], ["background", "_background", ""]]) {
    if (cells[key]) put(key, ...["flat", "sample"].map((of) => told(now(of + part), unit)));
  }
  if (cells.residual) put("residual", ...["flat", "sample"].map((of) => told(now("residual_" + of))));
}

function show() {
  const step = element("step"), view = element("view");
  element("step-told").textContent = offsetTold(at.step);
  element("view-told").textContent = viewTold();
  step.setAttribute("aria-valuetext", "mask step " + offsetTold(at.step));
  view.setAttribute("aria-valuetext", "view " + viewTold());
  element("cursor-told").textContent =
    `pixel ${at.column * bin}, ${at.row * bin}${at.held ? " (held)" : ""}`;
  panels.forEach(drawImage);
  sinograms.forEach(drawSinogram);
  if (charts.curve) drawCurves();
  contrasts.forEach(drawProfile);
  contrasts.forEach(remark);
  fillTable();
}

function showView() {
  show();
  contrasts.forEach(drawHistogram);
}

function onKey(event) {
  const move = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
  const factor = { "+": .5, "=": .5, "-": 2, "0": 0 }[event.key];
  if (move) {
    at.column = Math.min(columns - 1, Math.max(0, at.column + move[0]));
    at.row = Math.min(rows - 1, Math.max(0, at.row + move[1]));
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

// Colours of the page: those of the system, or chosen. Charts are made anew in theirs.
const dark = matchMedia("(prefers-color-scheme: dark)");
function setTheme() {
  const chosen = element("theme").value;
  document.documentElement.dataset.theme = chosen === "auto" ? (dark.matches ? "dark" : "light") : chosen;
  for (const chart of Object.values(charts)) {
    if (chart.plot) chart.plot.destroy();
    chart.plot = null;
  }
}

function begin() {
  setTheme();
  addTable();
  if (meta.frames) {
    addImage(element("frames"), "flat", "Flat", 616);
    addImage(element("frames"), "sample", "With the sample", 616);
    addCurves();
  } else {
    element("curve").textContent = "The frames of these images are missing.";
  }
  for (const name of contrasts) {
    const { label } = images[name];
    addImage(element("contrasts"), name, label[0].toUpperCase() + label.slice(1), 406);
    addProfile(name);
    addHistogram(name);
  }
  // Of images, or of the frames where there are none; one view has no sinogram.
  const turning = views < 2 ? [] : contrasts.length > 0 ? contrasts : meta.frames ? ["sample"] : [];
  turning.forEach((name) => addSinogram(name, images[name].label[0].toUpperCase() + images[name].label.slice(1)));
  element("sinogram-section").hidden = turning.length === 0;
  for (const id of ["retrieved", "distributions", "profile-section"]) element(id).hidden = contrasts.length === 0;
  const step = element("step"), view = element("view");
  step.max = Math.max(0, offsets.length - 1);
  view.max = meta.views.length - 1;
  step.disabled = offsets.length < 2 || !meta.frames;
  view.disabled = meta.views.length < 2;
  if (meta.frames) {
    // The brightest step of the flat shows most.
    const light = offsets.map((_, i) => valueAt("flat", i, pixelOf()));
    at.step = Math.max(0, light.indexOf(Math.max(...light)));
  }
  step.value = at.step;
  step.addEventListener("input", () => { at.step = Number(step.value); show(); });
  view.addEventListener("input", () => { at.view = Number(view.value); showView(); });
  element("crosshair").addEventListener("change", (event) => { at.crosshair = event.target.checked; show(); });
  element("along").addEventListener("change", () => {
    for (const name of contrasts) {
      const chart = charts["profile-" + name];
      chart.plot.destroy();
      chart.plot = null;
      chart.zoomed = false;
    }
    show();
  });
  element("zoom-in").addEventListener("click", () => zoom(.5));
  element("zoom-out").addEventListener("click", () => zoom(2));
  element("zoom-whole").addEventListener("click", () => zoom(0));
  const repaint = () => { setTheme(); showView(); };
  element("theme").addEventListener("change", repaint);
  dark.addEventListener("change", repaint);
  let width = innerWidth;
  addEventListener("resize", () => {
    // Phones report a resize when their bars come and go.
    if (innerWidth !== width) { width = innerWidth; showView(); }
  });
  showView();
}

begin();
