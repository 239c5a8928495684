// Charts of a run: curves of the pixel, what fits leave, profiles, histograms.

// ---- Curves ----

const order = offsets.map((_, step) => step).sort((a, b) => offsets[a] - offsets[b]);
const sorted = order.map((step) => offsets[step]);
const span = (sorted[sorted.length - 1] - sorted[0]) || 1;
const fine = fitted ? Array.from({ length: 161 }, (_, i) => sorted[0] - .06 * span + 1.12 * span * i / 160) : [];
const across = [...new Set([...sorted, ...fine])].sort((a, b) => a - b);
const fitOf = (of) => fitted && ["amplitude", "centre", "width", "background"].map((part) => now(`${of}_${part}`));
const masks = meta.curve;
// A Gaussian, or the curve of the masks as a Fourier series behind a blur.
const seriesAt = ({ period, mean, orders }, x, variance) => orders.reduce((sum, [even, odd], k) => {
  const turn = 2 * Math.PI * (k + 1) / period;
  return sum + Math.exp(-.5 * turn * turn * variance) * (even * Math.cos(turn * x) + odd * Math.sin(turn * x));
}, mean);
const shapeAt = (x, width) => {
  if (!masks) return Math.exp(-(x * x) / (2 * width * width));
  const variance = Math.max(width * width - masks.variance, 4e-4 * masks.variance);
  return seriesAt(masks, x, variance) / seriesAt(masks, 0, variance);
};
const fitAt = ([a, centre, width, b], x) => a * shapeAt(x - centre, width) + b;
const curveOf = (name) => offsets.map((_, step) =>
  valueAt(name, (name === "flat" ? 0 : at.view * offsets.length) + step, pixelOf()));
const dots = (label, ink) => ({ label, ink, paths: fitted ? () => null : undefined, width: 1.5, points: { show: true, size: 7 } });

function addCurves() {
  const legend = [["flat", "flat"], ["sample", "with the sample"]];
  const where = () => offsets[at.step], label = () => "mask offset [µm]";
  const series = [{ label: "offset" }, dots("flat", "flat"), dots("sample", "sample")];
  const fits = ["flat", "sample"].map((name) => ({ label: name + " fit", ink: name, width: 1.6, spanGaps: true, points: { show: false } }));
  const title = fitted ? "Values (dots) and fitted curves (lines)" : "Values of the mask steps";
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
  const lines = (name) => across.map((f) => finite(fitAt(fits[name], f)));
  draw(charts.curve, fitted ? [across, points("flat"), points("sample"), lines("flat"), lines("sample")]
    : [across, points("flat"), points("sample")]);
  if (!fitted) return;
  const left = (name) => order.map((step) => finite(values[name][step] - fitAt(fits[name], offsets[step])));
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
