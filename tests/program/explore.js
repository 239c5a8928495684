"use strict";
// Works the page as a reader does, by events of the DOM, and writes down what came of it.
// tests/program/report.rs puts it at the end of a copy of the page and reads the verdict.
(() => {
  const verdict = { checks: {}, errors: window.pageErrors };
  const check = (name, holds, detail) => { verdict.checks[name] = holds ? "ok" : `FAILED: ${detail}`; };
  const text = (id) => document.getElementById(id).textContent;
  const canvas = (id) => document.getElementById(id).toDataURL();
  const names = ["flat", "sample", "transmission", "refraction", "dark_field"];
  const all = () => Object.fromEntries(
    [...names.map((name) => "image-" + name), "curve", ...names.slice(2).map((name) => "histogram-" + name)]
      .map((id) => [id, canvas(id)]));
  const changed = (before) => {
    const now = all();
    return Object.keys(now).filter((id) => now[id] !== before[id]).join(" ");
  };
  const slide = (id, value) => {
    const slider = document.getElementById(id);
    slider.value = value;
    slider.dispatchEvent(new Event("input", { bubbles: true }));
  };
  // A pointer event in the middle of a pixel; the image lies 54 and 8 CSS pixels inside.
  const point = (kind, name, column, row) => {
    const target = document.getElementById("image-" + name);
    const box = target.getBoundingClientRect();
    const wide = (box.width - 54 - 100) / 16, high = (box.height - 8 - 42) / 4;
    const place = { clientX: box.left + 54 + (column + .5) * wide, clientY: box.top + 8 + (row + .5) * high };
    target.dispatchEvent(new PointerEvent(kind, { bubbles: true, ...place }));
  };
  try {
    let before = all();
    slide("step", 0);
    check("step slider changes frames and curve", changed(before) === "image-flat image-sample curve", changed(before));
    check("step is told", text("step-told") === "0: −20 µm", text("step-told"));

    point("pointermove", "transmission", 3, 1);
    before = all();
    slide("view", 1);
    check("view slider changes sample, contrasts, curve and histograms",
      changed(before) === "image-sample image-transmission image-refraction image-dark_field curve "
        + "histogram-transmission histogram-refraction histogram-dark_field", changed(before));
    check("angle is told", text("view-told") === "1: 90°", text("view-told"));
    slide("view", 0);

    before = all();
    point("pointermove", "refraction", 0, 0);
    check("cursor is linked over all images, and the curve follows",
      changed(before) === "image-flat image-sample image-transmission image-refraction image-dark_field curve",
      changed(before));
    check("value under the cursor, +", text("value-refraction") === "2.0000 µrad", text("value-refraction"));
    check("value under the linked cursor", text("value-transmission") === "0.50000", text("value-transmission"));
    check("fit is told", text("pixel").includes("12.000 µm"), text("pixel"));
    point("pointermove", "flat", 15, 3);
    check("value under the cursor, −", text("value-refraction") === "−2.0000 µrad", text("value-refraction"));
    check("pixel is told", text("cursor-told") === "pixel 15, 3", text("cursor-told"));

    point("click", "sample", 4, 1);
    point("pointermove", "sample", 9, 2);
    check("a click holds the pixel", text("cursor-told") === "pixel 4, 1 (held)", text("cursor-told"));
    document.body.dispatchEvent(new KeyboardEvent("keydown", { key: "ArrowRight", bubbles: true }));
    check("arrow keys move it", text("cursor-told") === "pixel 5, 1 (held)", text("cursor-told"));
    check("flags are told", text("pixel").includes("flat dead: on purpose; flat other"), text("pixel"));
    point("click", "sample", 4, 1);
    check("where there are some", !text("pixel").includes("flags"), text("pixel"));
    point("pointermove", "sample", 9, 2);
    check("another click lets it go", text("cursor-told") === "pixel 9, 2", text("cursor-told"));

    for (const [what, words] of [["set-up", "Set-up from above"], ["scene", "[detector]"], ["tally", "not finite"],
      ["provenance", "driver"], ["retrieval", "gaussian"]]) {
      check(what + " is in the page", document.querySelector("main").textContent.includes(words), words);
    }
  } catch (error) {
    verdict.errors.push(String(error));
  }
  const out = document.createElement("pre");
  out.id = "verdict";
  out.textContent = JSON.stringify(verdict);
  document.body.append(out);
})();
