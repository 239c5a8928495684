"use strict";
// Works the page of a reconstruction as a reader does, by events of the DOM, and writes down what came
// of it. tests/program/volume_report.rs puts it at the end of a copy of the page and reads the verdict.
// Its volume mu holds x + 20 y + 400 z, by the numbers of the voxels.
(async () => {
  const verdict = { checks: {}, errors: window.pageErrors };
  const check = (name, holds, detail) => { verdict.checks[name] = holds ? "ok" : `FAILED: ${detail}`; };
  const by = (id) => document.getElementById(id);
  const text = (id) => by(id).textContent;
  const slices = ["slice-x", "slice-y", "slice-z"];
  const profiles = ["profile-x", "profile-y", "profile-z"];
  const shown = slices.concat(profiles, "histogram");
  const canvas = (id) => (charts[id] ? charts[id].place.querySelector("canvas") : by(id)).toDataURL();
  const all = () => Object.fromEntries(shown.map((id) => [id, canvas(id)]));
  const changed = (before) => {
    const now = all();
    return Object.keys(now).filter((id) => now[id] !== before[id]).sort().join(" ");
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
  // A pointer event in the middle of a voxel of a slice.
  const point = (kind, axis, right, up) => {
    const target = by("slice-" + axis), box = target.getBoundingClientRect();
    const panel = panels.find((one) => one.axis === axis), { area } = panel;
    const [first, count] = at.sight[panel.right], [low, high] = at.sight[panel.up];
    return fire(target, new PointerEvent(kind, { bubbles: true, buttons: kind === "pointerdown" ? 1 : 0,
      clientX: box.left + area.left + (right - first + .5) / count * area.width,
      clientY: box.top + area.top + area.height - (up - low + .5) / high * area.height }));
  };
  const same = (found, ...lists) => found === lists.flat().sort().join(" ");
  try {
    await settle();
    check("the first volume is mu", at.name === "mu" && by("volume").value === "mu", at.name);
    let before = all();
    await put("z", 0);
    let found = changed(before);
    check("a slider moves the slice and the crosshair", ["slice-z", "slice-x", "slice-y", "profile-x", "profile-y"].every((id) => found.split(" ").includes(id)), found);
    check("the slice is told", text("z-told") === "0: −0.100 mm", text("z-told"));
    check("and to screen readers", by("z").getAttribute("aria-valuetext") === "z 0: −0.100 mm", by("z").getAttribute("aria-valuetext"));
    await point("pointerdown", "z", 4, 7);
    check("a click chooses the voxel", at.voxel.join() === "4,7,0", at.voxel.join());
    check("its value is told", Math.abs(parseFloat(text("cursor-told")) - 144) < .02 && text("cursor-told").endsWith("1/m"), text("cursor-told"));
    await point("pointermove", "z", 5, 7);
    check("a pointer that is not pressed moves nothing and tells its value", at.voxel.join() === "4,7,0"
      && Math.abs(parseFloat(text("value-z")) - 145) < .02, text("value-z"));
    await point("pointerdown", "y", 10, 2);
    check("a click in another slice moves the other two", at.voxel.join() === "10,7,2", at.voxel.join());
    await point("pointerdown", "x", 3, 1);
    check("and in the third", at.voxel.join() === "10,3,1", at.voxel.join());
    await press(by("slice-z"), "ArrowUp");
    check("the larger coordinate is up", at.voxel.join() === "10,4,1", at.voxel.join());
    await press(by("slice-x"), "ArrowRight");
    await press(by("slice-x"), "PageDown");
    check("keys move in the plane of a slice and across it", at.voxel.join() === "9,5,1", at.voxel.join());
    let data = charts["profile-y"].plot.data;
    check("profiles are lines of voxels", data[0].length === 16 && Math.abs(data[1][6] - (9 + 120 + 400)) < .02, data[1].join());
    check("at their places", Math.abs(data[0][0] + .75) < 1e-6 && Math.abs(data[0][15] - .75) < 1e-6, data[0].join());

    // The rod is about x = 0.2 mm, y = 0.
    await point("pointerdown", "z", 9, 8);
    const row = (name) => document.querySelector(`#voxel .${name} td`).textContent;
    check("all volumes are told at the voxel", row("labels") === "rod (plastic)" && row("mu_truth").startsWith("50.") && row("mu").endsWith("1/m"), text("voxel"));
    check("and its numbers", row("number") === "9, 8, 1", row("number"));
    await point("pointerdown", "z", 0, 0);
    check("and of the surroundings", row("labels").startsWith("surroundings"), row("labels"));

    await point("pointerdown", "z", 9, 8);
    before = all();
    await click(by("crosshair"));
    found = changed(before);
    check("the crosshair can be hidden", same(found, slices), found);
    await press(by("slice-y"), "h");
    check("by a key, too", by("crosshair").checked && changed(before) === "", changed(before));

    check("the histogram is of the whole volume", text("part-told").startsWith("768 voxels"), text("part-told"));
    await put("part", "z", "change");
    check("or of a slice", text("part-told").startsWith("256 voxels"), text("part-told"));
    await put("part", "volume", "change");
    const bars = charts.histogram.plot.data[1].map((n) => n === null ? 0 : n === .1 ? 1 : 10 ** n);
    check("its bars have all voxels", Math.abs(bars.reduce((a, b) => a + b) - 768) < 1e-6, bars.join());

    before = all();
    await put("range-high", "300", "change");
    found = changed(before);
    check("a range changes colours and histogram", same(found, slices, "histogram"), found);
    await click(document.querySelector('[aria-label="Reset the range of the colours"]'));
    check("and can be reset", changed(before) === "", changed(before));

    await point("pointerdown", "z", 12, 3);
    await click(by("zoom-in"));
    check("slices zoom about the voxel", JSON.stringify(at.sight) === "[[8,8],[0,8],[0,3]]", JSON.stringify(at.sight));
    await point("pointerdown", "z", 15, 7);
    check("and know their voxels then", at.voxel.join() === "15,7,1", at.voxel.join());
    await press(by("slice-z"), "0");
    check("and show the whole again", at.sight[0][1] === 16, JSON.stringify(at.sight));

    before = all();
    await put("volume", "mu_truth", "change");
    found = changed(before);
    check("another volume is shown", slices.concat("histogram").every((id) => found.split(" ").includes(id)), found);
    check("with its label", by("slice-z").getAttribute("aria-label").includes("truth"), by("slice-z").getAttribute("aria-label"));
    await put("volume", "labels", "change");
    const [around, rod] = [volumes.labels.palette[0], volumes.labels.palette[1]];
    const word = volumes.labels.words[(16 + 8) * 16 + 9], ink = volumes.labels.colours[word];
    check("labels have the colours of objects", around.join() === "255,255,255" && rod.join() !== around.join()
      && [ink & 255, ink >> 8 & 255, ink >> 16 & 255].join() === rod.join(), `${rod} ${ink}`);
    await put("volume", "mu", "change");
    check("and the first again", changed(before) === "", changed(before));

    data = charts["residual-mu"].plot.data;
    check("residuals of iterations are drawn", !by("residual-section").hidden && data[0].length === 4 && data[1][3] < data[1][0], JSON.stringify(data));

    // What is saved, without the waits of files, which a browser with virtual time does not make.
    const saved = [];
    window.Blob = class { constructor(parts, { type }) { Object.assign(this, { text: parts.join(""), type }); } };
    HTMLCanvasElement.prototype.toBlob = function (done) { done({ type: "image/png", size: this.toDataURL().length }); };
    URL.createObjectURL = (blob) => { saved.push(blob); return "blob:none"; };
    HTMLAnchorElement.prototype.click = function () { saved.push(this.download); };
    await click(document.querySelector('[aria-label="Save the slice across z as CSV"]'));
    const lines = saved[0].text.trim().split("\n");
    check("a slice is saved as CSV", saved[1] === "mu_z.csv" && lines.length === 17 && Math.abs(Number(lines[3].split(",")[5]) - 445) < .02, lines[3]);
    await click(document.querySelector('[aria-label="Save the slice across x as PNG"]'));
    check("and as PNG", saved[2] && saved[2].type === "image/png" && saved[2].size > 500 && saved[3] === "mu_x.png", saved.length);

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
    const deaf = slices.filter((id) => by(id).tabIndex !== 0 || !by(id).getAttribute("aria-label").includes("voxel 15, 7, 1"));
    check("slices can be reached by keys, and tell their voxel", deaf.length === 0, deaf.join());
    const wide = document.documentElement.scrollWidth;
    check("the page is no wider than the window", wide <= innerWidth, `${wide} in ${innerWidth}`);
    const page = document.querySelector("body").textContent;
    for (const [what, words] of [["method", "cgls"], ["errors", "error_percent"],
      ["provenance", "SHA-256"], ["command line", "beamlet report volume"], ["date", " UTC"]]) {
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
