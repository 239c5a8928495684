// Canvases with axes and colour bars.

const LEFT = 54, TOP = 8, BAR = 92, BELOW = 42;

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

// Colours of objects with their names, down to the end of the canvas; the table of the voxel has all names.
function drawObjects(context, image, area) {
  const room = Math.floor((area.height + BELOW) / 18), width = BAR - 30;
  const cut = (name) => {
    let text = name.replace(/ \(.*\)$/, "");
    while (text && context.measureText(text).width > width) text = text.slice(0, -2).trimEnd() + "…";
    return text;
  };
  context.textAlign = "left";
  context.textBaseline = "middle";
  Object.entries(image.objects).slice(0, room).forEach(([label, name], i) => {
    const y = area.top + 18 * i, [r, g, b] = image.palette[label];
    context.fillStyle = `rgb(${r}, ${g}, ${b})`;
    context.fillRect(area.left, y, 12, 12);
    context.strokeStyle = context.fillStyle = colour("ink");
    context.strokeRect(area.left + .5, y + .5, 11, 11);
    context.fillText(cut(name), area.left + 17, y + 6);
  });
}

function drawBar(context, image, area) {
  if (image.palette) { drawObjects(context, image, area); return; }
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
