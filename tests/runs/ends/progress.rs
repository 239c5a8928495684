//! What is told while meshes are read and checked: on a terminal, in a log, and to a library's
//! callback.

use super::{code_and_stderr, workplace};
use crate::support::gate::{Gate, Held, reached, variables};
use crate::support::program::{Workplace, ended};
use beamlet::check::Check;
use beamlet::geometry::LoadStep;
use beamlet::scene::{Exposure, Scene};
use beamlet::stack::{ArraySink, Format, RunDirectory};
use beamlet::{Backend, Cancel, Control, Engine, EngineOptions, Error, Progress};
use std::fs;
use std::io::{Read, Write};
use std::process::{Command, Stdio};

/// Corners of the triangles of a box, by the bits of x, y and z.
pub(super) fn triangles() -> impl Iterator<Item = [u8; 3]> {
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    faces.into_iter().flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
}

/// Place of this corner of a box: they stand in rows of 200, 2.5 units apart.
pub(super) fn corner(part: u16, corner: u8) -> [f32; 3] {
    let [x, y] = [part % 200, part / 200].map(|n| 2.5 * f32::from(n));
    let [i, j, k] = [corner & 1, corner >> 1 & 1, corner >> 2].map(f32::from);
    [x + i, y + j, k]
}

/// A binary STL file of so many small boxes.
pub(super) fn boxes(count: u16) -> Vec<u8> {
    let mut file = vec![0_u8; 80];
    file.extend((12 * u32::from(count)).to_le_bytes());
    for part in 0..count {
        for triangle in triangles() {
            file.extend([0; 12]);
            file.extend(
                triangle.into_iter().flat_map(|it| corner(part, it)).flat_map(f32::to_le_bytes),
            );
            file.extend([0; 2]);
        }
    }
    file
}

/// Steps of a scene with one mesh, up to its first ray.
const STEPS: [LoadStep; 6] = [
    LoadStep::Reading,
    LoadStep::Joining,
    LoadStep::Checking,
    LoadStep::Nesting,
    LoadStep::Clearance,
    LoadStep::Building,
];

fn end_at(cancel: &Cancel, now: bool) {
    if now {
        cancel.cancel();
    }
}

/// The scene with a mesh of so many boxes for its object, and the `--set` for it.
fn with_boxes(count: u16) -> (Workplace, [&'static str; 4]) {
    let place = workplace();
    fs::write(place.path("many.stl"), boxes(count)).unwrap();
    let sets = ["--set", "object.part.mesh=many.stl", "--set", "object.part.unit=1 um"];
    (place, sets)
}

/// The program on a terminal.
fn on_a_terminal(place: &Workplace, words: &[&str]) -> Command {
    let words = words.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" ");
    let line = format!("stty cols 200; {} {words}", env!("CARGO_BIN_EXE_beamlet"));
    let mut command = Command::new("script");
    command.args(["--quiet", "--return", "--command", &line, "/dev/null"]);
    command.current_dir(place.path("")).env_remove("RUST_LOG");
    command
}

/// Runs the program on a terminal, holds it while it reads the mesh until the terminal shows what `until`
/// wants, presses these keys and waits for their answer. Its exit code, and what the terminal showed.
fn held_on_a_terminal(
    place: &Workplace,
    words: &[&str],
    until: impl Fn(&str) -> bool,
    [keys, answer]: [&str; 2],
) -> (Option<i32>, String) {
    let pipe = place.path("gate");
    let _ = fs::remove_file(&pipe);
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    let mut command = on_a_terminal(place, words);
    // Behind the head, which is read before to estimate the memory.
    command.envs(variables(Gate::Read("many.stl", 1000), &pipe));
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    let open = reached(&pipe, || child.try_wait().unwrap().is_some()).expect("a reader of meshes");
    let mut keyboard = child.stdin.take().unwrap();
    let mut shown = String::new();
    let mut terminal = child.stdout.take().unwrap();
    let mut show_until = |shown: &mut String, until: &dyn Fn(&str) -> bool| {
        let mut part = [0; 4096];
        while !until(shown) {
            let length = terminal.read(&mut part).unwrap_or(0);
            if length == 0 {
                break;
            }
            shown.push_str(&String::from_utf8_lossy(&part[..length]));
        }
    };
    show_until(&mut shown, &until);
    keyboard.write_all(keys.as_bytes()).unwrap();
    show_until(&mut shown, &|shown| shown.contains(answer));
    drop(open);
    show_until(&mut shown, &|_| false);
    (child.wait().unwrap().code(), shown)
}

#[test]
fn a_terminal_shows_what_is_read_and_a_pipe_does_not() {
    let (place, sets) = with_boxes(100);
    let run = ["simulate", "scene.toml", "-o", "run", "--backend", "bvh"];
    for words in [&["check", "scene.toml"][..], &run] {
        let is_shown = |shown: &str| shown.contains("reading \"part\"") && shown.contains(" %");
        let words = [words, &sets].concat();
        let (code, shown) = held_on_a_terminal(&place, &words, is_shown, [""; 2]);
        assert_eq!(code, Some(0), "{shown}");
        assert!(shown.contains("objects  ") || shown.contains("rays     "), "{shown}");
    }
    let quiet = on_a_terminal(&place, &[&["check", "-q", "scene.toml"][..], &sets].concat());
    let shown = { quiet }.output().unwrap().stdout;
    let shown = String::from_utf8_lossy(&shown);
    assert!(!shown.contains("reading \"part\"") && shown.contains("memory  "), "{shown}");
    let (code, message) =
        code_and_stderr(&place.beamlet(&[&["check", "scene.toml"][..], &sets].concat()));
    assert_eq!((code, message), (Some(0), String::new()), "lines come every 30 seconds");
}

fn scene(place: &Workplace, sets: &[&str]) -> Scene {
    let sets: Vec<String> =
        sets.iter().filter(|it| **it != "--set").map(ToString::to_string).collect();
    Scene::load_with(place.path("scene.toml"), &sets).unwrap()
}

#[test]
fn every_step_of_loading_is_told_before_the_first_view() {
    let (place, sets) = with_boxes(3000);
    let scene = scene(&place, &sets);
    let (mut steps, mut views, mut last) = (Vec::new(), 0, 0);
    let mut told = |progress: Progress| match progress {
        Progress::Loading(loading) => {
            assert_eq!(views, 0, "{loading:?}");
            assert!(loading.done <= loading.total && loading.objects <= 1, "{loading:?}");
            let of_all = matches!(
                loading.step,
                LoadStep::Nesting | LoadStep::Clearance | LoadStep::Building
            );
            assert_eq!(loading.object, if of_all { "" } else { "part" });
            if steps.last() == Some(&loading.step) {
                assert!(loading.done >= last, "{loading:?} after {last}");
            } else {
                assert_eq!(loading.done, 0, "{loading:?}");
                steps.push(loading.step);
            }
            last = loading.done;
        }
        Progress::Views(_) => views += 1,
        _ => {}
    };
    let options = EngineOptions::default().with_backend(Backend::Bvh);
    let engine = Engine::open(&options).unwrap();
    let control = Control::default().with_progress(&mut told);
    engine.run(&scene, &mut ArraySink::new(), control).unwrap();
    assert!(views > 0);
    assert_eq!(steps, STEPS);
    // `check` tells the same, and amounts to the same as without.
    let mut steps = Vec::new();
    let mut told = |progress: Progress| {
        let Progress::Loading(loading) = progress else { panic!("{progress:?}") };
        steps.push(loading.step);
    };
    let control = &mut Control::default().with_progress(&mut told);
    let report = Check::of(&scene).run_with(control).unwrap();
    assert_eq!(report, Check::of(&scene).run().unwrap());
    steps.dedup();
    assert_eq!(steps, STEPS[..5]);
}

#[test]
fn loading_can_be_cancelled() {
    let (place, sets) = with_boxes(3000);
    let scene = scene(&place, &sets);
    let engine = Engine::open(&EngineOptions::default()).unwrap();
    for at in STEPS {
        let cancel = Cancel::default();
        let mut told = |progress: Progress| match progress {
            Progress::Loading(loading) => end_at(&cancel, loading.step == at),
            other => panic!("{at:?}: {other:?}"),
        };
        let mut control = Control::default().with_progress(&mut told).with_cancel(cancel.clone());
        let ended = engine.prepare_with(&scene, &mut control);
        assert!(matches!(ended, Err(Error::Interrupted)), "{at:?}: {ended:?}");
    }
}

/// Two balls that overlap.
fn overlapping() -> Scene {
    let ball = |name: &str, place: &str| {
        format!(
            "[[object]]\nname = \"{name}\"\nmaterial = \"water\"\nposition = [\"{place}\", \"0 mm\", \
             \"0 mm\"]\nshape = {{ sphere = {{ radius = \"1 mm\", sides = 200 }} }}\n"
        )
    };
    let setup = "source = { distance = \"1 m\", spot = \"0 um\", energy = \"30 keV\" }\n\
                 detector = { distance = \"2 m\", pixels = [8, 8], pitch = \"1 mm\" }\n";
    Scene::from_toml(&[setup, &ball("a", "0 mm"), &ball("b", "0.7 mm")].concat(), ".").unwrap()
}

#[test]
fn cuts_are_told_and_end_where_they_are_cancelled() {
    let scene = overlapping();
    let engine = Engine::open(&EngineOptions::default()).unwrap();
    let mut steps = Vec::new();
    let mut told = |progress: Progress| {
        let Progress::Loading(loading) = progress else { panic!("{progress:?}") };
        steps.push(loading.step);
    };
    let mut control = Control::default().with_progress(&mut told);
    engine.prepare_with(&scene, &mut control).unwrap();
    assert!(steps.contains(&LoadStep::Cutting), "{steps:?}");
    let report = Check::of(&scene).run().unwrap();
    assert_eq!(report.objects[0].cut_by, ["b"]);
    assert!(report.to_string().contains("\"a\" overlaps \"b\": \"b\" wins"), "{report}");

    let cancel = Cancel::default();
    let mut told = |progress: Progress| {
        if let Progress::Loading(loading) = progress {
            end_at(&cancel, loading.step == LoadStep::Cutting);
        }
    };
    let mut control = Control::default().with_progress(&mut told).with_cancel(cancel.clone());
    let ended = engine.prepare_with(&scene, &mut control);
    assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
}

/// A scene whose packing takes any machine many seconds: a million spheres.
fn with_spheres() -> Workplace {
    packed(1_000_000, 2.4)
}

/// A scene with `count` packed spheres in a cube whose edge is `edge` mm long.
fn packed(count: u32, edge: f64) -> Workplace {
    let place = workplace();
    let text = fs::read_to_string(place.path("scene.toml")).unwrap();
    let (setup, _) = text.split_once("[[object]]").unwrap();
    let spheres = format!(
        "[[object]]\nname = \"powder\"\nmaterial = \"water\"\n\
         shape = {{ sphere = {{ radius = \"10 um\" }} }}\n\
         [object.instances]\npacking = \"spheres\"\ncount = {count}\n\
         region = {{ box = {{ size = [\"{edge} mm\", \"{edge} mm\", \"{edge} mm\"] }} }}\n"
    );
    fs::write(place.path("scene.toml"), [setup, &spheres].concat()).unwrap();
    place
}

#[test]
fn packings_tell_how_far_they_are() {
    let scene = Scene::load(packed(300_000, 1.64).path("scene.toml")).unwrap();
    let (mut shares, cancel) = (Vec::new(), Cancel::default());
    let mut told = |progress: Progress| {
        let Progress::Loading(it) = progress else { panic!("{progress:?}") };
        if it.step == LoadStep::Packing {
            assert!(it.total > 0, "{it:?}");
            shares.push(it.done as f64 / it.total as f64);
        }
        end_at(&cancel, !shares.is_empty() && it.step != LoadStep::Packing);
    };
    let control = &mut Control::default().with_progress(&mut told).with_cancel(cancel.clone());
    let ended = Check::of(&scene).run_with(control);
    assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
    assert!(shares[0] <= 0.0 && shares.is_sorted(), "{shares:?}");
    assert!((0.7..=1.0).contains(&shares[shares.len() - 1]), "{shares:?}");
    let jump = shares.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
    assert!(jump < 0.5, "{shares:?}");
}

/// The clocks that were shown beside a word, in seconds, in their order.
fn clocks(shown: &str, word: &str) -> Vec<u64> {
    let lines = shown.split(['\r', '\n']).filter(|line| line.contains(word));
    let clock = |line: &str| {
        let before = line.split(" gone").next()?;
        let parts = before.rsplit("  ").next()?.split(':').map(|part| part.parse::<u64>().ok());
        parts.collect::<Option<Vec<_>>>().map(|it| it.iter().fold(0, |sum, it| 60 * sum + it))
    };
    lines.filter_map(clock).collect()
}

#[test]
fn a_terminal_ticks_while_one_step_lasts_and_ctrl_c_ends_that() {
    let (place, sets) = with_boxes(100);
    let reading = |shown: &str| clocks(shown, "reading \"part\"");
    let has_ticked = |shown: &str| reading(shown).last().is_some_and(|last| *last >= 3);
    let words = [&["simulate", "scene.toml", "-o", "run"][..], &sets].concat();
    // The terminal makes a signal of this key.
    let keys = ["\x03", "stopping; press Ctrl-C again"];
    let (code, shown) = held_on_a_terminal(&place, &words, has_ticked, keys);
    let mut ticks = reading(&shown);
    ticks.dedup();
    assert!(ticks.is_sorted() && ticks.len() >= 3, "{ticks:?}: {shown}");
    assert_eq!(code, Some(130), "{shown}");
    assert!(shown.contains("interrupted") && !shown.contains("finding objects"), "{shown}");
    assert!(!place.path("run").exists(), "nothing was written");
}

#[test]
fn a_pipe_gets_lines_with_a_clock_that_runs() {
    let place = workplace();
    let mut command = super::beamlet(&place.path(""), &["simulate", "scene.toml", "-o", "run"]);
    command.args(["--set", "scan.angles={ from = \"0 deg\", to = \"180 deg\", count = 5 }"]);
    command.args(["--backend", "bvh"]).env("BEAMLET_PROGRESS_SECONDS", "0.02");
    let mut run = Held::at(Gate::Synced("run/progress.log", "sample/0 "), command);
    run.lines("view ", 4);
    let message = ended(&run.ends(), 0);
    let shares: Vec<f64> = message
        .lines()
        .filter(|line| line.contains("view "))
        .map(|line| line.split(" %").next().unwrap().trim().parse().unwrap())
        .collect();
    assert!(shares.len() > 3 && shares.is_sorted(), "{message}");
    assert!(shares.iter().all(|share| (0.0..=100.0).contains(share)), "{message}");
    assert!(clocks(&message, "view ").is_sorted(), "{message}");
    assert!(!message.contains(" 0 s left"), "{message}");
}

#[test]
fn packing_and_views_can_be_cancelled_and_what_stands_can_be_gone_on_with() {
    let place = with_spheres();
    let scene = Scene::load(place.path("scene.toml")).unwrap();
    // A run goes on with the backend that began it alone.
    let engine = Engine::open(&EngineOptions::default().with_backend(Backend::Bvh)).unwrap();
    let cancel = Cancel::default();
    let mut packed = false;
    let mut told = |progress: Progress| match progress {
        Progress::Loading(loading) => {
            packed = packed || loading.step == LoadStep::Packing;
            end_at(&cancel, packed);
        }
        other => panic!("{other:?}"),
    };
    let mut control = Control::default().with_progress(&mut told).with_cancel(cancel.clone());
    let ended = engine.prepare_with(&scene, &mut control);
    assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
    assert!(packed);

    // From its own thread, in the middle of a view: earlier ones stand.
    let place = workplace();
    let scene = scene_with_views(&place);
    let cancel = Cancel::default();
    let mut before = 0.0;
    let mut told = |progress: Progress| {
        let Progress::Views(views) = progress else { return };
        assert!((before..=1.0).contains(&views.share), "{} after {before}", views.share);
        before = views.share;
        end_at(&cancel, views.view == Exposure::Sample(2));
    };
    let mut sink = RunDirectory::create(place.path("run"), Format::Npy, false).unwrap();
    let control = Control::default().with_progress(&mut told).with_cancel(cancel.clone());
    let ended = engine.run(&scene, &mut sink, control);
    assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
    assert!((0.25..0.75).contains(&before), "{before} of five views, the third in work");
    drop(sink);
    let mut sink = RunDirectory::resume(place.path("run"), &scene).unwrap();
    let skip = sink.committed().to_vec();
    assert_eq!(skip, [Exposure::Flat(0), Exposure::Sample(0), Exposure::Sample(1)]);
    engine.run(&scene, &mut sink, Control::default().with_skip(skip)).unwrap();
    drop(sink);
    let mut whole = RunDirectory::create(place.path("whole"), Format::Npy, false).unwrap();
    engine.run(&scene, &mut whole, Control::default()).unwrap();
    drop(whole);
    for name in ["flat.npy", "sample.npy"] {
        let bytes = |run: &str| fs::read(place.path(run).join(name)).unwrap();
        assert!(bytes("run") == bytes("whole"), "{name}");
    }
}

/// Five views.
fn scene_with_views(place: &Workplace) -> Scene {
    let angles = "scan.angles={ from = \"0 deg\", to = \"90 deg\", count = 5 }".to_owned();
    Scene::load_with(place.path("scene.toml"), &[angles]).unwrap()
}
