// Charts by uPlot in boxes with their buttons.

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

const finite = (value) => Number.isFinite(value) ? value : null;
