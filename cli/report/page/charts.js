// Charts by uPlot: curves of the pixel, what fits leave, profiles, histograms.

const charts = {};

// A chart in a box of its own, with its buttons; `series` and `options` are uPlot's.
function addChart(parent, id, title, widest, height, series, options) {
  const line = make("p", { className: "told", id: "told-" + id });
  const place = make("div", { tabIndex: 0 });
  place.setAttribute("role", "img");
  place.setAttribute("aria-label", `${title}. Keys + and − zoom, 0 shows all of it.`);
  const chart = { id, title, place, line, widest, height, series, options, zoomed: false, plot: null };
  const tools = make("div", { className: "tools" },
    button("PNG", `Save ${title} as PNG`, () => saveCanvas(`${id}.png`, place.querySelector("canvas"))),
    button("CSV", `Save ${title} as CSV`, () => saveText(`${id}.csv`, csvOfChart(chart))),
    button("all", `Show all of ${title}`, () => whole(chart)));
  const heading = make("h3", {}, title, ...(options.legend || []).flatMap(([kind, name]) =>
    [make("span", { className: "swatch " + kind }), name]));
  chart.box = make("div", { className: "chart" }, heading, place, line, tools);
  parent.append(chart.box);
  place.addEventListener("keydown", (event) => {
    const factor = { "+": .5, "=": .5, "-": 2 }[event.key];
    if (event.key === "0") whole(chart);
    else if (factor) narrow(chart, factor);
    else return;
    event.preventDefault();
  });
  charts[id] = chart;
  return chart;
}

// Range of y: values of flagged places do not set it, unless all in sight are flagged.
function reach(chart, plot, low, high) {
  if (low === null) return [null, null];
  const { unset } = chart;
  const [from, to] = plot.series[0].idxs || [0, 0];
  let [least, most] = [Infinity, -Infinity];
  for (let i = from; unset && i <= to; i++) {
    if (unset[i]) continue;
    for (const values of plot.data.slice(1)) {
      if (!Number.isFinite(values[i])) continue;
      least = Math.min(least, values[i]);
      most = Math.max(most, values[i]);
    }
  }
  return uPlot.rangeNum(...(least <= most ? [least, most] : [low, high]), .1, true);
}

function whole(chart) {
  chart.zoomed = false;
  chart.plot.setData(chart.plot.data, true);
}

function narrow(chart, factor) {
  const { min, max } = chart.plot.scales.x;
  const middle = (min + max) / 2, half = (max - min) / 2 * factor;
  chart.zoomed = true;
  chart.plot.setScale("x", { min: middle - half, max: middle + half });
}

function csvOfChart(chart) {
  const names = chart.series.map((one) => one.label);
  const cell = (value) => value === null || value === undefined || !Number.isFinite(value) ? "" : value.toPrecision(6);
  const lines = chart.plot.data[0].map((_, i) => chart.plot.data.map((values) => cell(values[i])).join(","));
  return [names.map((name) => `"${name}"`).join(",")].concat(lines);
}

function axis(label, side) {
  return { label, side, stroke: colour("ink"), grid: { stroke: colour("line"), width: 1 }, ticks: { stroke: colour("line"), width: 1 },
    font: FONT, labelFont: FONT, size: side === 3 ? 62 : 36, labelSize: 20, labelGap: 0,
    values: (_, splits) => splits.map((v) => v === null ? "" : minus(Math.abs(v) >= 1e5 || (v !== 0 && Math.abs(v) < 1e-3)
      ? v.toExponential(1) : String(Number(v.toPrecision(6))))) };
}

// Gives a chart its data; one that is zoomed keeps its range.
function draw(chart, data) {
  const width = Math.max(220, Math.min(chart.widest, chart.box.parentElement.clientWidth || chart.widest));
  if (chart.plot && chart.width !== width) { chart.plot.destroy(); chart.plot = null; }
  if (chart.plot) { chart.plot.setData(data, !chart.zoomed); return; }
  chart.width = width;
  const paint = (one) => ({ ...one, stroke: one.ink && colour(one.ink), points: one.points && { ...one.points, fill: colour(one.ink), stroke: colour(one.ink) } });
  chart.plot = new uPlot({
    width, height: chart.height, padding: [8, 14, 0, 0],
    series: chart.series.map(paint),
    bands: (chart.options.bands || []).map((series) => ({ series, fill: colour("band") })),
    scales: { x: { time: false, ...chart.options.x }, y: { range: (plot, low, high) => reach(chart, plot, low, high) } },
    axes: [axis(chart.options.across(), 2), axis(chart.options.down, 3)],
    legend: { show: false },
    cursor: { y: false, drag: { x: true, y: true, uni: 30 } },
    hooks: {
      setSelect: [(plot) => { if (plot.select.width > 0) chart.zoomed = true; }],
      setCursor: [(plot) => tell(chart, plot)],
      draw: [(plot) => mark(chart, plot)],
    },
  }, data, chart.place);
  chart.plot.over.addEventListener("dblclick", () => { chart.zoomed = false; });
}

// What stands under the cursor of a chart.
function tell(chart, plot) {
  const i = plot.cursor.idx;
  const known = i === null || i === undefined ? [] : plot.data.map((values, s) => [chart.series[s], values[i]])
    .filter(([one, value]) => !one.quiet && Number.isFinite(value));
  chart.line.textContent = known.map(([one, value]) => `${one.label} ${told(value)}`).join(" · ");
}

// A line where the step or the pixel stands, and marks at flagged places.
function mark(chart, plot) {
  const where = chart.options.where && chart.options.where();
  const { ctx, bbox } = plot;
  ctx.save();
  if (Number.isFinite(where)) {
    const x = plot.valToPos(where, "x", true);
    if (x >= bbox.left && x <= bbox.left + bbox.width) {
      ctx.strokeStyle = colour("grey");
      ctx.setLineDash([4, 4]);
      ctx.beginPath();
      ctx.moveTo(x, bbox.top);
      ctx.lineTo(x, bbox.top + bbox.height);
      ctx.stroke();
    }
  }
  ctx.fillStyle = colour("flag");
  for (const place of chart.flagged || []) {
    const x = plot.valToPos(place, "x", true);
    if (x >= bbox.left && x <= bbox.left + bbox.width) ctx.fillRect(x - 2, bbox.top + bbox.height - 8, 4, 8);
  }
  ctx.restore();
}

// ---- Curves ----

const order = offsets.map((_, step) => step).sort((a, b) => offsets[a] - offsets[b]);
const sorted = order.map((step) => offsets[step]);
const span = (sorted[sorted.length - 1] - sorted[0]) || 1;
const fine = fitted ? Array.from({ length: 161 }, (_, i) => sorted[0] - .06 * span + 1.12 * span * i / 160) : [];
const across = [...new Set([...sorted, ...fine])].sort((a, b) => a - b);
const fitOf = (of) => fitted && ["amplitude", "centre", "width", "background"].map((part) => now(`${of}_${part}`));
const gauss = ([a, centre, width, b], x) => a * Math.exp(-((x - centre) ** 2) / (2 * width * width)) + b;
const curveOf = (name) => offsets.map((_, step) =>
  valueAt(name, (name === "flat" ? 0 : at.view * offsets.length) + step, pixelOf()));
const finite = (value) => Number.isFinite(value) ? value : null;
const dots = (label, ink) => ({ label, ink, paths: fitted ? () => null : undefined, width: 1.5, points: { show: true, size: 7 } });

function addCurves() {
  const legend = [["flat", "flat"], ["sample", "with the sample"]];
  const where = () => offsets[at.step], label = () => "mask offset [µm]";
  const series = [{ label: "offset" }, dots("flat", "flat"), dots("sample", "sample")];
  const fits = ["flat", "sample"].map((name) => ({ label: name + " fit", ink: name, width: 1.6, spanGaps: true, points: { show: false } }));
  const title = fitted ? "Values (dots) and fitted Gaussians (lines)" : "Values of the mask steps";
  addChart(element("curve"), "curve", title, 640, 300, fitted ? series.concat(fits) : series,
    { legend, where, across: label, down: images.flat.label });
  if (!fitted) return;
  const left = ["flat", "sample"].map((name) => ({ label: name + " − fit", ink: name, width: 1, points: { show: true, size: 5 } }));
  addChart(element("residuals"), "residuals", "Residual: data − fit", 640, 150, [{ label: "offset" }, ...left],
    { legend, where, across: label, down: "residual" });
}

function drawCurves() {
  const values = { flat: curveOf("flat"), sample: curveOf("sample") };
  const fits = { flat: fitOf("flat"), sample: fitOf("sample") };
  const step = new Map(offsets.map((offset, step) => [offset, step]));
  const points = (name) => across.map((f) => step.has(f) ? finite(values[name][step.get(f)]) : null);
  const lines = (name) => across.map((f) => finite(gauss(fits[name], f)));
  draw(charts.curve, fitted ? [across, points("flat"), points("sample"), lines("flat"), lines("sample")]
    : [across, points("flat"), points("sample")]);
  if (!fitted) return;
  const left = (name) => order.map((step) => finite(values[name][step] - gauss(fits[name], offsets[step])));
  draw(charts.residuals, [sorted, left("flat"), left("sample")]);
}

// ---- Profiles ----

function addProfile(name) {
  const { label, unit } = images[name];
  const banded = Boolean(images[name + "_sigma"]);
  const edge = (label) => ({ label, ink: "band", width: 0, quiet: true, points: { show: false } });
  const series = [{ label: "place" }, { label, ink: "flat", width: 1.5, points: { show: false } }];
  if (banded) series.push(edge("plus 1 sigma"), edge("less 1 sigma"));
  addChart(element("profiles"), "profile-" + name, label[0].toUpperCase() + label.slice(1), 406, 200, series, {
    bands: banded ? [[2, 3]] : [],
    where: () => along() === "row" ? xOf(at.column) : zOf(at.row),
    across: () => along() === "row" ? ACROSS : UP,
    down: label + (unit ? ` [${unit}]` : ""),
  });
}

const along = () => element("along").value;

function drawProfile(name) {
  const inRow = along() === "row";
  const places = Array.from({ length: inRow ? columns : rows }, (_, i) => i);
  // x grows: along a column that is from the lowest row up.
  if (!inRow) places.reverse();
  const pixel = (i) => inRow ? at.row * columns + i : i * columns + at.column;
  const x = places.map((i) => inRow ? xOf(i) : zOf(i));
  const values = places.map((i) => finite(valueAt(name, at.view, pixel(i))));
  const data = [x, values];
  if (images[name + "_sigma"]) {
    const sigma = places.map((i) => valueAt(name + "_sigma", at.view, pixel(i)));
    data.push(...[1, -1].map((sign) => values.map((value, i) => value === null ? null : finite(value + sign * sigma[i]))));
  }
  const chart = charts["profile-" + name];
  chart.unset = places.map((i) => Boolean(flagsAt(pixel(i))));
  chart.flagged = x.filter((_, i) => chart.unset[i]);
  draw(chart, data);
}

// ---- Histograms ----

function addHistogram(name) {
  const { label, unit } = images[name];
  const bars = { label: "log₁₀ of pixels", ink: "flat", fill: colour("band"), paths: uPlot.paths.bars({ size: [1, 100] }), points: { show: false } };
  addChart(element("histograms"), "histogram-" + name, label[0].toUpperCase() + label.slice(1), 406, 190,
    [{ label: "value" }, bars], { across: () => label + (unit ? ` [${unit}]` : ""), down: "log₁₀ of pixels", where: () => now(name) });
}

function drawHistogram(name) {
  const image = images[name];
  if (!charts["histogram-" + name]) return;
  const [low, high] = image.scale;
  const bins = new Array(80).fill(0);
  for (let i = 0; i < rows * columns; i++) {
    const value = valueAt(name, frame(name), i);
    const bin = Math.floor((value - low) / (high - low) * bins.length);
    if (Number.isFinite(bin)) bins[Math.min(bins.length - 1, Math.max(0, bin))] += 1;
  }
  // Most pixels lie beside the sample: the scale of counts is logarithmic; 1 pixel is a tenth.
  const middle = bins.map((_, i) => low + (i + .5) / bins.length * (high - low));
  draw(charts["histogram-" + name], [middle, bins.map((count) => count ? Math.max(.1, Math.log10(count)) : null)]);
}

// The value of the pixel moves in the histogram; its bars stay.
function remark(name) {
  const { plot } = charts["histogram-" + name];
  if (plot) plot.redraw(false);
}
