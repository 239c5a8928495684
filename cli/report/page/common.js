"use strict";
// What every page needs: its data, elements, numbers in words, files for the reader.

const meta = JSON.parse(document.getElementById("meta").textContent);
const element = (id) => document.getElementById(id);
const make = (tag, properties, ...children) => {
  const made = Object.assign(document.createElement(tag), properties);
  made.append(...children);
  return made;
};
const colour = (name) => getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
const FONT = '12px "DejaVu Sans", Verdana, sans-serif';

function bytesOf(text) {
  const letters = atob(text.trim());
  const bytes = new Uint8Array(letters.length);
  for (let i = 0; i < letters.length; i++) bytes[i] = letters.charCodeAt(i);
  return bytes;
}

// Values of an image: 16-bit numbers between `low` and `high`; the last stands for nothing.
const NOTHING = 65535;
function decode(name, image) {
  const bytes = bytesOf(element("data-" + name).textContent);
  image.words = new Uint16Array(bytes.length / 2);
  for (let i = 0; i < image.words.length; i++) image.words[i] = bytes[2 * i] | (bytes[2 * i + 1] << 8);
  image.table = bytesOf(meta.maps[image.map]);
  image.whole = [...image.scale];
  colours(image);
}
const valueOf = (image, word) => word === NOTHING ? NaN : image.low + (image.high - image.low) * word / (NOTHING - 1);

// Place of a value among the 256 colours of its map; white of the diverging map is zero.
function place(image, value) {
  const [low, high] = image.scale;
  const inside = Math.min(high, Math.max(low, value));
  const share = image.map === "Diverging"
    ? .5 + .5 * inside / Math.max(Math.abs(low), Math.abs(high)) : (inside - low) / (high - low);
  return 3 * Math.round(255 * Math.min(1, Math.max(0, share)));
}

// Colour of every 16-bit number, worked out once for a scale.
function colours(image) {
  image.colours = new Uint32Array(NOTHING + 1);
  for (let word = 0; word < NOTHING; word++) {
    const value = valueOf(image, word), index = image.palette ? 0 : place(image, value);
    const [r, g, b] = image.palette ? image.palette[Math.round(value)] || [] : image.table.subarray(index, index + 3);
    image.colours[word] = 0xff000000 | (b << 16) | (g << 8) | r;
  }
  image.colours[NOTHING] = 0xffd246be;
}

const minus = (text) => text.replaceAll("-", "−");
function told(value, unit) {
  if (!Number.isFinite(value)) return "no value";
  const size = Math.abs(value);
  const text = size !== 0 && (size < 1e-4 || size >= 1e6)
    ? value.toExponential(3)
    : value.toFixed(size >= 1000 ? 1 : size >= 100 ? 2 : size >= 10 ? 3 : size >= 1 ? 4 : 5);
  return minus(text) + (unit ? " " + unit : "");
}

// A value with its 1 sigma, to two digits of that.
function measured(value, sigma, unit) {
  if (!(Number.isFinite(value) && sigma > 0 && Number.isFinite(sigma))) return told(value, unit);
  const digits = Number(sigma.toExponential(1));
  const last = Math.floor(Math.log10(digits) + 1e-9) - 1;
  if (last < -6 || last >= 5) return minus(`${value.toExponential(2)} ± ${sigma.toExponential(1)}`) + (unit ? " " + unit : "");
  const step = 10 ** Math.max(last, 0);
  const text = (number) => (Math.round(number / step) * step).toFixed(0);
  const pair = last < 0 ? `${value.toFixed(-last)} ± ${digits.toFixed(-last)}` : `${text(value)} ± ${text(digits)}`;
  return minus(unit ? `(${pair}) ${unit}` : pair);
}

const trimmed = (value) => minus(value.toFixed(2).replace(/\.?0+$/, "") || "0");
// Gives the reader a file.
function save(name, blob) {
  const link = make("a", { download: name, href: URL.createObjectURL(blob) });
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}
const saveText = (name, lines) => save(name, new Blob([lines.join("\n") + "\n"], { type: "text/csv" }));
function saveCanvas(name, canvas) {
  const copy = make("canvas", { width: canvas.width, height: canvas.height });
  const context = copy.getContext("2d");
  context.fillStyle = colour("paper");
  context.fillRect(0, 0, copy.width, copy.height);
  context.drawImage(canvas, 0, 0);
  copy.toBlob((blob) => save(name, blob));
}
const button = (text, label, act) => {
  const made = make("button", { type: "button", textContent: text, onclick: act });
  made.setAttribute("aria-label", label);
  return made;
};
