// What the page of a run holds and shows. State is in `at`; `show()` (controls.js) draws it.

const { rows, columns, offsets, angles, images, contrasts, fitted, bin } = meta;
Object.entries(images).forEach(([name, image]) => decode(name, image));

// Flags of every pixel, as places in meta.flags.
const flags = element("data-flags") && bytesOf(element("data-flags").textContent);
function flagsAt(pixel) {
  const place = 2 * (at.view * rows * columns + pixel);
  return flags ? meta.flags[flags[place] | (flags[place + 1] << 8)] : "";
}

function valueAt(name, frame, pixel) {
  const image = images[name];
  return valueOf(image, image.words[frame * rows * columns + pixel]);
}

// What is shown: view and step by number in this page, the pixel, whether a click holds it, whether
// the crosshair is drawn, and the part of the images in sight, in pixels.
const at = { view: 0, step: 0, row: meta.start[1], column: meta.start[0], held: false, crosshair: true,
  sight: { column: 0, row: 0, columns, rows } };
const pixelOf = () => at.row * columns + at.column;
const frameOf = {
  flat: () => at.step,
  sample: () => at.view * offsets.length + at.step,
};
const frame = (name) =>
  (frameOf[name] || (name.startsWith("flat_") || name === "residual_flat" ? () => 0 : () => at.view))();
const now = (name) => images[name] ? valueAt(name, frame(name), pixelOf()) : NaN;

// Corners of the detector, and the place of a pixel on it, mm (or pixels where no pitch is known).
const half = [0, 1].map((axis) => meta.detector[axis] * meta.pitch[axis] / 2);
const xOf = (column) => (column + .5) * bin * meta.pitch[0] - half[0];
const zOf = (row) => half[1] - (row + .5) * bin * meta.pitch[1];
const [ACROSS, UP] = meta.labels;

const offsetTold = (step) => offsets.length ? `${step}: ${trimmed(offsets[step])} µm` : "none";
const viewTold = () => `${meta.views[at.view]}${angles.length ? `: ${trimmed(angles[at.view])}°` : ""}`;

