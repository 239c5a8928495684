"use strict";
// Works the page as a reader does, by events of the DOM, and writes down what came of it.
// tests/program/report.rs puts it at the end of a copy of the page, says in `ofCounts` whether values
// have errors, and reads the verdict.
(async () => {
  const verdict = { checks: {}, errors: window.pageErrors };
  const check = (name, holds, detail) => { verdict.checks[name] = holds ? "ok" : `FAILED: ${detail}`; };
  const by = (id) => document.getElementById(id);
  const text = (id) => by(id).textContent;
  const names = ["flat", "sample", "transmission", "refraction", "dark_field"];
  const shown = names.map((name) => "image-" + name).concat("curve", "residuals",
    ...names.slice(2).map((name) => ["profile-" + name, "histogram-" + name]));
  const canvas = (id) => (charts[id] ? charts[id].place.querySelector("canvas") : by(id)).toDataURL();
  const all = () => Object.fromEntries(shown.map((id) => [id, canvas(id)]));
  const changed = (before) => {
    const now = all();
    return Object.keys(now).filter((id) => now[id] !== before[id]).join(" ");
  };
  // Charts paint after the event that changes them.
  const settle = () => new Promise((done) => setTimeout(done, 40));
  const fire = async (target, event) => { target.dispatchEvent(event); await settle(); };
  const put = (id, value, kind = "input") => {
    by(id).value = value;
    return fire(by(id), new Event(kind, { bubbles: true }));
  };
  const press = (target, key) => fire(target, new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  const click = async (target) => { target.click(); await settle(); };
  // A pointer event in the middle of a pixel of what is in sight.
  const point = (kind, name, column, row) => {
    const target = by("image-" + name);
    const box = target.getBoundingClientRect();
    const { area } = panels.find((panel) => panel.name === name);
    const wide = area.width / at.sight.columns, high = area.height / at.sight.rows;
    const place = { clientX: box.left + area.left + (column - at.sight.column + .5) * wide,
      clientY: box.top + area.top + (row - at.sight.row + .5) * high };
    return fire(target, new PointerEvent(kind, { bubbles: true, ...place }));
  };
  const images = names.map((name) => "image-" + name);
  const contrasts = names.slice(2);
  const profiles = contrasts.map((name) => "profile-" + name);
  const histograms = contrasts.map((name) => "histogram-" + name);
  const set = (...lists) => lists.flat().sort().join(" ");
  const same = (found, ...lists) => found.split(" ").sort().join(" ") === set(...lists);
  try {
    await settle();
    let before = all();
    await put("step", 0);
    let found = changed(before);
    check("step slider changes frames and curves", same(found, "image-flat", "image-sample", "curve", "residuals"), found);
    check("step is told", text("step-told") === "0: −20 µm", text("step-told"));
    check("step is told to screen readers", by("step").getAttribute("aria-valuetext") === "mask step 0: −20 µm",
      by("step").getAttribute("aria-valuetext"));

    await point("pointermove", "transmission", 3, 1);
    before = all();
    await put("view", 1);
    found = changed(before);
    check("view slider changes sample, contrasts, curves, profiles and histograms",
      same(found, images.slice(1), "curve", "residuals", profiles, histograms), found);
    check("angle is told", text("view-told") === "1: 90°", text("view-told"));
    await put("view", 0);

    before = all();
    await point("pointermove", "refraction", 0, 0);
    found = changed(before);
    check("cursor is linked over all images, and curves and profiles follow",
      images.concat("curve", profiles).every((id) => found.split(" ").includes(id)), found);
    const told = (withError, alone) => ofCounts ? withError : alone;
    check("value under the cursor with its error, if it has one, +",
      text("value-refraction") === told("(2.000 ± 0.050) µrad", "2.0000 µrad"), text("value-refraction"));
    check("value under the linked cursor, with its error", text("value-transmission") === told("0.500 ± 0.010", "0.50000"), text("value-transmission"));
    check("errors are told where there are some", /\d ± \d/.test(text("pixel")) === ofCounts, text("pixel"));
    check("fit is told", text("pixel").includes("12.000 µm"), text("pixel"));
    check("residual is told", text("pixel").includes("0.00300"), text("pixel"));
    await point("pointermove", "flat", 15, 3);
    check("value under the cursor, −", text("value-refraction") === told("(−2.000 ± 0.050) µrad", "−2.0000 µrad"), text("value-refraction"));
    check("pixel is told", text("cursor-told") === "pixel 15, 3", text("cursor-told"));

    // The charts hold what the images hold.
    const residual = charts.residuals.plot.data;
    const curve = curveOf("sample"), fit = fitOf("sample");
    const less = residual[0].map((offset, i) => residual[2][i] - (curve[order[i]] - fitAt(fit, offset)));
    check("residuals are values less the fit", residual[0].length === 5 && less.every((v) => Math.abs(v) < 1e-9), less.join());
    let data = charts["profile-transmission"].plot.data;
    const expected = valueAt("transmission", 0, 3 * 16 + 4), close = (value, to) => Math.abs(value - to) < 1e-4;
    check("a profile runs along the row, with the band of its errors", data[0].length === 16 && close(data[1][4], expected)
      && (ofCounts ? close(data[2]?.[4], expected + .01) && close(data[3]?.[4], expected - .01) : data.length === 2),
      JSON.stringify([data.length, data.map((line) => line[4]), expected]));
    await put("along", "column", "change");
    data = charts["profile-transmission"].plot.data;
    check("or along the column", data[0].length === 4 && data[0][0] < data[0][3], String(data[0]));
    await put("along", "row", "change");

    // Nothing moves while the cursor does: a pixel with flags, one without, one without a value.
    const places = () => [...document.querySelectorAll("section, h2, canvas, table, tr, p")]
      .map((one) => { const box = one.getBoundingClientRect(); return [box.left, box.top, box.width, box.height].map(Math.round).join(); }).join(" ");
    await point("pointermove", "flat", 4, 1);
    const still = places();
    let moved = false;
    for (const [column, row] of [[5, 1], [0, 0], [15, 3], [9, 2]]) {
      await point("pointermove", "flat", column, row);
      moved = moved || places() !== still;
    }
    check("the layout does not jump", !moved, "something moved under the cursor");

    await point("click", "sample", 4, 1);
    await point("pointermove", "sample", 9, 2);
    check("a click holds the pixel", text("cursor-told") === "pixel 4, 1 (held)", text("cursor-told"));
    await press(by("image-flat"), "ArrowRight");
    check("arrow keys move it", text("cursor-told") === "pixel 5, 1 (held)", text("cursor-told"));
    check("flags are told", text("pixel").includes("flat dead: on purpose; flat other"), text("pixel"));
    check("flagged places are marked in profiles", charts["profile-refraction"].flagged.length === 1, charts["profile-refraction"].flagged);
    await point("click", "sample", 4, 1);
    check("where there are some", text("pixel").includes("flagsnone"), text("pixel"));
    await point("pointermove", "sample", 9, 2);
    check("another click lets it go", text("cursor-told") === "pixel 9, 2", text("cursor-told"));

    before = all();
    await click(by("crosshair"));
    found = changed(before);
    check("the crosshair can be hidden", same(found, images), found);
    await press(by("image-flat"), "h");
    check("and shown by a key", by("crosshair").checked && changed(before) === "", changed(before));

    await click(by("zoom-in"));
    check("images zoom about the pixel", at.sight.columns === 8 && at.sight.rows === 4 && at.sight.column === 5, JSON.stringify(at.sight));
    await point("pointermove", "sample", 12, 2);
    check("and know their pixels then", text("cursor-told") === "pixel 12, 2", text("cursor-told"));
    await press(by("image-sample"), "0");
    check("and show the whole again", at.sight.columns === 16, JSON.stringify(at.sight));

    before = all();
    await put("range-transmission-high", "0.7", "change");
    found = changed(before);
    check("a range changes an image and its histogram", same(found, "image-transmission", "histogram-transmission"), found);
    await click(document.querySelector('[aria-label="Reset the range of Transmission"]'));
    check("and can be reset", changed(before) === "", changed(before));

    const x = () => charts.curve.plot.scales.x.max - charts.curve.plot.scales.x.min;
    const span = x();
    await press(charts.curve.place, "+");
    check("charts zoom by keys", Math.abs(x() / span - .5) < 1e-6, x() / span);
    await point("pointermove", "sample", 3, 2);
    check("and keep their range under the cursor", Math.abs(x() / span - .5) < 1e-6, x() / span);
    await press(charts.curve.place, "0");
    check("and show all again", Math.abs(x() / span - 1) < 1e-6, x() / span);
    const over = charts.curve.plot.over, box = over.getBoundingClientRect();
    const mouse = (target, kind, share) => fire(target, new MouseEvent(kind, { bubbles: true, button: 0, movementX: 1,
      clientX: box.left + share * box.width, clientY: box.top + box.height / 2 }));
    await mouse(over, "mousemove", .25);
    await mouse(over, "mousedown", .25);
    await mouse(over, "mousemove", .75);
    await mouse(document, "mouseup", .75);
    check("charts zoom by dragging", Math.abs(x() / span - .5) < .03, x() / span);
    await press(charts.curve.place, "0");

    const { area } = sinograms[0], turned = by("sinogram-transmission").getBoundingClientRect();
    await fire(by("sinogram-transmission"), new PointerEvent("click", { bubbles: true,
      clientX: turned.left + area.left + 7.5 * area.width / 16, clientY: turned.top + area.top + .75 * area.height }));
    check("a click in a sinogram chooses column and view", text("cursor-told") === "pixel 7, 2" && text("view-told") === "1: 90°",
      text("cursor-told") + text("view-told"));
    await press(by("sinogram-transmission"), "ArrowUp");
    check("arrow keys move its view", text("view-told") === "0: 0°", text("view-told"));
    await point("pointermove", "sample", 3, 1);
    const { min, max } = charts["profile-dark_field"].plot.scales.y;
    check("a flagged spike does not set the range of a profile", min > -2 && max < 4
      && charts["profile-dark_field"].plot.data[1][5] > 400, [min, max].join());
    await point("pointermove", "sample", 3, 2);

    // What is saved, without the waits of files, which a browser with virtual time does not make.
    const saved = [];
    window.Blob = class { constructor(parts, { type }) { Object.assign(this, { text: parts.join(""), type }); } };
    HTMLCanvasElement.prototype.toBlob = function (done) { done({ type: "image/png", size: this.toDataURL().length }); };
    URL.createObjectURL = (blob) => { saved.push(blob); return "blob:none"; };
    HTMLAnchorElement.prototype.click = function () { saved.push(this.download); };
    await click(document.querySelector('[aria-label="Save Transmission as CSV"]'));
    const lines = saved[0].text.trim().split("\n");
    check("an image is saved as CSV", saved[1] === "transmission.csv" && lines.length === 5 && lines[1].split(",").length === 16
      && Math.abs(Number(lines[1].split(",")[4]) - .6) < 1e-4, lines.join(" | "));
    await click(document.querySelector('[aria-label="Save Transmission as PNG"]'));
    check("and as PNG", saved[2] && saved[2].type === "image/png" && saved[2].size > 500 && saved[3] === "transmission.png", saved.length);
    await click([...document.querySelectorAll("button")].find((one) => (one.getAttribute("aria-label") || "").endsWith("lines) as CSV")));
    const curves = saved[4] ? saved[4].text.trim().split("\n") : [];
    check("a curve is saved as CSV", curves[0] === '"offset","flat","sample","flat fit","sample fit"' && curves.length > 100, curves[0]);

    await click(document.querySelector('[aria-label="Save the sinogram of Transmission as CSV"]'));
    const rowsOfViews = saved[6] ? saved[6].text.trim().split("\n") : [];
    check("a sinogram is saved as CSV, a line per view", rowsOfViews.length === 3
      && Math.abs(Number(rowsOfViews[2].split(",")[4]) - .675) < 1e-4, rowsOfViews.join(" | "));

    const paper = () => getComputedStyle(document.body).backgroundColor;
    await put("theme", "light", "change");
    const light = paper();
    before = all();
    await put("theme", "dark", "change");
    found = changed(before);
    check("the page has a dark mode", light === "rgb(255, 255, 255)" && paper() === "rgb(21, 22, 26)" && same(found, shown), paper() + found);
    await put("theme", "light", "change");

    const named = (one) => one.getAttribute("aria-label") || (one.labels && one.labels.length) || one.textContent.trim();
    const unnamed = [...document.querySelectorAll("button, input, select, [tabindex] canvas, [role=img]")]
      .filter((one) => !(one.tagName === "CANVAS" && one.closest(".uplot")) && !named(one)).map((one) => one.outerHTML);
    check("every control and picture has a name", unnamed.length === 0, unnamed.join());
    const deaf = images.filter((id) => by(id).tabIndex !== 0 || !(by(id).getAttribute("aria-label") || "").includes("column 3, row 2"));
    check("images can be reached by keys, and tell their pixel", deaf.length === 0, deaf.join());

    const wide = document.documentElement.scrollWidth;
    check("the page is no wider than the window", wide <= innerWidth, `${wide} in ${innerWidth}`);
    const squeezed = images.filter((id) => by(id).getBoundingClientRect().right > innerWidth
      || panels.find((panel) => "image-" + panel.name === id).area.width < 150);
    check("images are whole and large enough", squeezed.length === 0, squeezed.join());

    const page = document.querySelector("body").textContent;
    for (const [what, words] of [["set-up", "Set-up from above"], ["sample", "triangles"], ["energy", "One photon energy, 30 keV"],
      ["scene", "[detector]"], ["tally", "not finite"], ["meaning of the tally", "totally reflected at least once"],
      ["provenance", "driver"], ["retrieval", "gaussian"], ["meaning of T", "share of the light"],
      ["meaning of 1", "light of an open pixel"], ["date", " UTC"], ["command line", "beamlet report run"]]) {
      check(what + " is in the page", page.includes(words), words);
    }
  } catch (error) {
    verdict.errors.push(String(error) + (error.stack || ""));
  }
  const out = document.createElement("pre");
  out.id = "verdict";
  out.textContent = JSON.stringify(verdict);
  (window.parent === window ? document : window.parent.document).body.append(out);
})();
