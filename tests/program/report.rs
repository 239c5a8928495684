//! `beamlet report`: one file that needs nothing else, explored in headless Chromium.
//!
//! With `BEAMLET_COMPLETE` Chromium has to be there (`.ci/setup --tests` installs Debian's); elsewhere
//! what needs it is left out with a message. `BEAMLET_CHROMIUM` names another program.

use crate::support::program::{beamlet, copy_of, done, done_without_driver, run};
use crate::support::{complete, everything, sample};
use beamlet::retrieve::Record;
use ndarray::Array3;
use ndarray_npy::write_npy;
use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::OnceLock;
use tempfile::TempDir;

const SCENE: &str = concat!(
    include_str!("../support/paper.toml"),
    r#"pixels = [16, 4]
[sampling]
tolerance = 1e-2
angle_tolerance = "1 urad"
[scan]
mask_offsets = { from = "-20 um", to = "20 um", count = 5 }
angles = ["0 deg", "90 deg"]

[[object]]
name = "block"
shape = { box = { size = ["0.9 mm", "0.2 mm", "1 mm"] } }
material = "water"
"#
);

/// Collects errors from the first line of the page on.
const EARS: &str = "<script>window.pageErrors = [];\
    addEventListener('error', (event) => pageErrors.push(event.message));\
    for (const kind of ['error', 'warn']) { const old = console[kind];\
    console[kind] = (...words) => { pageErrors.push(words.join(' ')); old(...words); }; }</script>";

#[derive(Debug, serde::Deserialize)]
pub(super) struct Verdict {
    pub(super) checks: BTreeMap<String, String>,
    errors: Vec<String>,
}

impl Verdict {
    pub(super) fn failed(&self) -> Vec<String> {
        let failed = self.checks.iter().filter(|(_, outcome)| *outcome != "ok");
        failed
            .map(|(name, outcome)| format!("{name}: {outcome}"))
            .chain(self.errors.clone())
            .collect()
    }
}

/// A run of counts with retrieved images that the test knows.
fn run_with_maps() -> TempDir {
    run_with_maps_of(true)
}

/// A run, with or without counts, with retrieved images that the test knows.
pub(super) fn run_with_maps_of(counts: bool) -> TempDir {
    static MADE: [OnceLock<TempDir>; 2] = [OnceLock::new(), OnceLock::new()];
    copy_of(MADE[usize::from(counts)].get_or_init(|| made_with_maps_of(counts)).path())
}

fn made_with_maps_of(counts: bool) -> TempDir {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("scene.toml"), SCENE).unwrap();
    let photons = if counts { " --set detector.photons=20000" } else { "" };
    done(place.path(), &format!("simulate scene.toml -o run --format npy -q{photons}"));
    let retrieved = place.path().join("run/retrieved");
    fs::create_dir(&retrieved).unwrap();
    let write = |name: &str, of: &dyn Fn(usize, usize, usize) -> f32| {
        let map = Array3::from_shape_fn((2, 4, 16), |(view, row, column)| of(view, row, column));
        write_npy(retrieved.join(format!("{name}.npy")), &map).unwrap();
    };
    write("transmission", &|view, _, column| 0.5 + (column + 3 * view) as f32 / 40.0);
    write("refraction", &|view, row, column| match (view, row, column) {
        (0, 0, 0) => 2e-6,
        (0, 3, 15) => -2e-6,
        (0, ..) => 0.0,
        _ => 1e-6,
    });
    write("flags", &|_, row, column| if (row, column) == (1, 5) { 3.0 } else { 0.0 });
    // The flagged pixel is a spike.
    let spike = |row, column| if (row, column) == (1, 5) { 500.0 } else { 0.0 };
    write("dark_field", &|view, row, column| ((row + view) as f32 + spike(row, column)) * 1e-12);
    if counts {
        write("transmission_sigma", &|_, _, _| 0.01);
        write("refraction_sigma", &|_, _, _| 5e-8);
        write("dark_field_sigma", &|_, _, _| 4e-13);
    }
    for of in ["flat", "sample"] {
        write(&format!("{of}_amplitude"), &|_, _, _| 0.16);
        write(&format!("{of}_centre"), &|_, _, _| 0.0);
        let wide = if of == "flat" { 10e-6 } else { 12e-6 };
        write(&format!("{of}_width"), &|_, _, _| wide);
        write(&format!("{of}_background"), &|_, _, _| 0.0);
        let left = if of == "flat" { 0.002 } else { 0.003 };
        write(&format!("residual_{of}"), &|_, _, _| left);
    }
    let flags = BTreeMap::from([(1, "flat dead: on purpose".into()), (2, "flat other".into())]);
    let mut record = Record::default();
    record.method = "gaussian".into();
    record.counts = counts;
    record.shape = [2, 4, 16];
    record.flags = flags;
    let text = serde_json::to_string(&record).unwrap();
    fs::write(retrieved.join("retrieved.json"), text).unwrap();
    place
}

pub(super) fn chromium() -> Option<PathBuf> {
    if let Some(named) = std::env::var_os("BEAMLET_CHROMIUM") {
        return Some(named.into());
    }
    let path = std::env::var_os("PATH").unwrap_or_default();
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = std::env::split_paths(&path)
        .flat_map(|folder| names.map(|name| folder.join(name)))
        .find(|program| program.is_file());
    assert!(found.is_some() || !complete(), "no chromium, and BEAMLET_COMPLETE is set");
    found
}

/// Explores a page of a width in pixels and returns what came of it, with what the browser itself
/// complained of. Pages of counts show errors, others do not.
fn explore(program: &Path, folder: &Path, page: &str, width: u32, counts: bool) -> Verdict {
    let script = format!("const ofCounts = {counts};\n{}", include_str!("explore.js"));
    explore_with(program, folder, page, width, &script)
}

/// Explores a page of a width in pixels by a script that leaves its verdict.
pub(super) fn explore_with(
    program: &Path,
    folder: &Path,
    page: &str,
    width: u32,
    script: &str,
) -> Verdict {
    let page = page.replacen("<head>", &format!("<head>{EARS}"), 1);
    let (body, end) = page.rsplit_once("</body>").unwrap();
    let page = format!("{body}<script>{script}</script></body>{end}");
    // Windows are no narrower than 500 pixels; frames in them are.
    let text = serde_json::to_string(&page).unwrap().replace("</", "<\\/");
    let framed = format!(
        "<!DOCTYPE html><html><body><iframe style=\"width:{width}px;height:900px;border:0\">\
         </iframe><script>document.querySelector('iframe').srcdoc = {text};</script></body></html>"
    );
    let file = folder.join("explored.html");
    fs::write(&file, framed).unwrap();
    // The browser brings a Vulkan driver of its own, which the layer of the tests would listen to.
    let output = Command::new(program)
        .env_remove("VK_INSTANCE_LAYERS")
        .args(["--headless", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
        .args(["--enable-logging=stderr", "--window-size=1440,1000"])
        .arg(format!("--user-data-dir={}", folder.join("profile").display()))
        .args(["--virtual-time-budget=30000", "--dump-dom"])
        .arg(format!("file://{}", file.display()))
        // The browser's own use of Vulkan is not what the validation layer is to look at.
        .env_remove("VK_INSTANCE_LAYERS")
        .env_remove("VK_LAYER_SETTINGS_PATH")
        .output()
        .unwrap();
    let dom = String::from_utf8_lossy(&output.stdout).into_owned();
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    let verdict = dom
        .split_once("<pre id=\"verdict\">")
        .and_then(|(_, rest)| rest.split_once("</pre>"))
        .unwrap_or_else(|| panic!("no verdict: {said}"));
    let text = verdict.0.replace("&lt;", "<").replace("&gt;", ">").replace("&amp;", "&");
    let mut verdict: Verdict = serde_json::from_str(&text).unwrap();
    verdict.errors.extend(said.lines().filter(|line| line.contains("CONSOLE")).map(str::to_owned));
    verdict
}

/// The page of the run of counts.
fn page_of_counts() -> &'static str {
    static PAGE: OnceLock<String> = OnceLock::new();
    PAGE.get_or_init(|| {
        let place = run_with_maps();
        assert_eq!(done(place.path(), "report run"), "run/report.html\n");
        fs::read_to_string(place.path().join("run/report.html")).unwrap()
    })
}

/// At the width of a telephone; the page without noise is explored at the width of a screen.
#[test]
fn controls_of_the_page_work_at_two_widths_and_the_console_is_silent() {
    let place = tempfile::tempdir().unwrap();
    let page = page_of_counts();
    let Some(program) = chromium() else {
        println!("left out: there is no chromium");
        return;
    };
    for width in sample(vec![390, 1400], 2) {
        let verdict = explore(&program, place.path(), page, width, true);
        assert!(verdict.failed().is_empty(), "{width}: {:#?}", verdict.failed());
        assert_eq!(verdict.checks.len(), 58, "{width}: every check was made");
    }

    // The exploration is no proof unless it fails on a page that is broken. A page has two faults; with
    // `BEAMLET_ALL` each fault has a page of its own.
    let faults = [
        ("step.addEventListener(\"input\"", "step.addEventListener(\"other\"", "step slider"),
        (
            "panels.forEach(drawImage)",
            "panels.filter((one) => one.shown < 0 || one === panels[0]).forEach(drawImage)",
            "cursor is linked",
        ),
        (
            "put(\"flags\", flagsAt(pixelOf()) || \"none\");",
            "element(\"pixel\").querySelector(\".flags\").hidden = !flagsAt(pixelOf());",
            "layout does not jump",
        ),
        (
            "measured(now(name), now(name + \"_sigma\")",
            "measured(now(name), NaN",
            "errors are told",
        ),
        ("setTheme(); showView();", "showView();", "dark mode"),
        ("canvas.setAttribute(\"aria-label\",", "void (", "tell their pixel"),
        ("\nbegin();", "\nbegin();\nundefined_function();", "undefined_function"),
        ("\nbegin();", "\nbegin();\nconsole.error('on purpose');", "on purpose"),
    ];
    let pages: Vec<_> = match everything() {
        true => faults.iter().map(|fault| vec![*fault]).collect(),
        false => vec![vec![faults[0], faults[7]]],
    };
    for faults in pages {
        let mut wrong_page = page.to_owned();
        for (right, wrong, _) in &faults {
            assert!(wrong_page.contains(right), "{right}");
            wrong_page = wrong_page.replacen(right, wrong, 1);
        }
        let broken = explore(&program, place.path(), &wrong_page, 1400, true);
        let failed = broken.failed().join("\n");
        for (_, wrong, named) in faults {
            assert!(failed.contains(named), "{wrong} went unnoticed: {failed}");
        }
    }
}

#[test]
fn controls_of_a_noise_free_page_work_without_an_error() {
    let place = run_with_maps_of(false);
    done(place.path(), "report run");
    let page = fs::read_to_string(place.path().join("run/report.html")).unwrap();
    assert!(!page.contains("_sigma\":"), "no image of 1 sigma");
    let Some(program) = chromium() else {
        println!("left out: there is no chromium");
        return;
    };
    let verdict = explore(&program, place.path(), &page, 1400, false);
    assert!(verdict.failed().is_empty(), "{:#?}", verdict.failed());
    assert_eq!(verdict.checks.len(), 58, "every check was made");
    if everything() {
        // A page that shows errors does not pass as one that has none.
        let wrong = explore(&program, place.path(), &page, 1400, true).failed().join("\n");
        assert!(
            wrong.contains("with its error") && wrong.contains("band of its errors"),
            "{wrong}"
        );
    }
}

#[test]
fn the_page_asks_for_nothing_from_anywhere() {
    let page = page_of_counts();
    // Names, not addresses: the element of SVG, and where the charts come from.
    let names = page.replace("http://www.w3.org/2000/svg", "").replacen(
        "/*! https://github.com/leeoniya/uPlot (v1.6.32) */",
        "",
        1,
    );
    for word in ["http:", "https:", "src=", "@import", "url(http", "fetch(", "XMLHttpRequest"] {
        assert!(!names.contains(word), "{word}");
    }
    let links = names.match_indices("href=").map(|(at, _)| &names[at..at + 11]);
    assert!(links.clone().count() > 1 && links.clone().all(|link| link == "href=\"data:"));
    assert!(!page.contains("{{") && !page.contains("{%"), "every mark is filled");
}

#[test]
fn names_of_others_are_text_and_no_elements() {
    let place = run_with_maps();
    let name = "<img id=x onerror=alert(1)>&\"'";
    fs::rename(place.path().join("run"), place.path().join(name)).unwrap();
    let output = beamlet(place.path()).args(["report", name, "-o", "page.html"]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let page = fs::read_to_string(place.path().join("page.html")).unwrap();
    assert!(!page.contains("<img id=x") && page.contains("&lt;img id=x onerror=alert(1)&gt;"));
}

#[test]
fn a_page_with_a_limit_is_binned_and_says_so() {
    let place = run_with_maps();
    done_without_driver(place.path(), "report run -o small.html --most 1KiB");
    let (whole, small) =
        (page_of_counts(), fs::read_to_string(place.path().join("small.html")).unwrap());
    assert!(!whole.contains("class=\"note\">Pixels are binned"));
    assert!(small.contains("Pixels are binned 4 × 4") && small.contains("0.0 MiB"), "no note");
    let data = |page: &str| {
        let arrays = page.split("<script type=\"text/plain\"").skip(1);
        arrays.map(|part| part.split_once("</script>").unwrap().0.len()).sum::<usize>()
    };
    // Base64 makes a third more; names and paddings come on top, 19 arrays in all.
    assert!(data(&small) < 1024 * 4 / 3 + 19 * 60, "{}", data(&small));
    assert!(data(whole) > 4 * data(&small));
}

#[test]
fn a_run_that_is_not_retrieved_is_shown_with_a_note() {
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("scene.toml"), SCENE).unwrap();
    done(place.path(), "simulate scene.toml -o run -q");
    done(place.path(), "report run");
    let page = fs::read_to_string(place.path().join("run/report.html")).unwrap();
    assert!(page.contains("No retrieved images: `beamlet retrieve run` makes them"));
}

#[test]
fn what_cannot_be_reported_is_refused_and_nothing_is_written() {
    let place = run_with_maps();
    // Retrieved images of another run do not fit.
    let wrong = Array3::<f32>::zeros((2, 3, 16));
    let retrieved = place.path().join("run/retrieved");
    for file in fs::read_dir(&retrieved).unwrap() {
        let file = file.unwrap().path();
        if file.extension().is_some_and(|it| it == "npy") {
            write_npy(&file, &wrong).unwrap();
        }
    }
    let output = run(place.path(), "report run -o page.html");
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{message}");
    assert!(message.contains("16 x 3 pixels; the run has"), "{message}");
    assert!(!place.path().join("page.html").exists());
}

#[test]
fn the_page_tells_the_title_and_what_the_record_says_of_the_run() {
    let place = run_with_maps();
    let title = "Block <of> water & air";
    let set = format!("title=\"{title}\"");
    let words = ["simulate", "scene.toml", "-o", "named", "--format", "npy", "--set", &set];
    let output = beamlet(place.path()).args(words).output().unwrap();
    assert!(output.status.success(), "{output:?}");
    let closing = String::from_utf8(output.stdout).unwrap();
    assert!(closing.starts_with(&format!("title    {title}\n")), "{closing}");
    // Dates of the record and not of files, which a copy changes.
    let path = place.path().join("named/run.json");
    let mut record: serde_json::Value =
        serde_json::from_str(&fs::read_to_string(&path).unwrap()).unwrap();
    assert_eq!(record["title"], title);
    record["began"] = "2001-02-03T04:05:06Z".into();
    record["written"] = "2001-02-03T05:07:09Z".into();
    record["duration_s"] = 3723.4.into();
    record["commit"] = "0123abcd".into();
    record["commands"] =
        serde_json::json!(["beamlet simulate a.toml", "beamlet simulate --resume"]);
    fs::write(&path, record.to_string()).unwrap();
    done(place.path(), "report named");
    let page = fs::read_to_string(place.path().join("named/report.html")).unwrap();
    assert!(page.contains("<h1>Block &lt;of&gt; water &amp; air</h1>"), "the title");
    for (key, value) in [
        ("run", "2001-02-03 04:05:06 UTC to 2001-02-03 05:07:09 UTC"),
        ("duration", "1 h 02 min"),
        ("program", &format!("beamlet {}, commit 0123abcd", env!("CARGO_PKG_VERSION"))),
        ("command", "beamlet simulate a.toml"),
        ("command", "beamlet simulate --resume"),
        ("by", "beamlet report named"),
    ] {
        let line = format!("<dt>{key}</dt><dd>{value}</dd>");
        assert!(page.contains(&line), "{line} is not in the page");
    }
    // Nothing depends on the title: the run goes on with another one, and equals one without.
    let output = done(place.path(), "simulate scene.toml -o named --resume");
    assert_eq!(output, "named is complete already\n");
    for (wrong, allowed) in [("title=\"\"", "1 to 200"), ("title=7", "a line of text")] {
        let output = run(place.path(), &format!("check scene.toml --set {wrong}"));
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(!output.status.success() && message.contains(allowed), "{wrong}: {message}");
    }
}

#[test]
fn the_page_of_a_run_states_the_limits_of_ray_optics() {
    let plain = page_of_counts();
    for words in ["Limits of ray optics", "24.2 of the aperture", "flat faces have few slopes"] {
        assert!(plain.contains(words), "{words}");
    }
    let warning =
        "<tr class=\"marked\"><th scope=\"row\">warning</th><td>the set-up is outside ray optics";
    assert!(!plain.contains(warning), "the set-up of the paper");
    let place = tempfile::tempdir().unwrap();
    fs::write(place.path().join("scene.toml"), SCENE).unwrap();
    let sharp = "--set source.spot=3um --set sampling.tolerance=1e-2";
    done(place.path(), &format!("simulate scene.toml -o sharp --format npy -q {sharp}"));
    done_without_driver(place.path(), "report sharp");
    let page = fs::read_to_string(place.path().join("sharp/report.html")).unwrap();
    assert!(page.contains(warning), "a spot of 3 um");
}
