//! What is told while meshes are read and checked: on a terminal, in a log, and to a library's
//! callback.

use super::{code_and_stderr, workplace};
use crate::support::program::Workplace;
use beamlet::geometry::LoadStep;
use beamlet::scene::Scene;
use beamlet::stack::ArraySink;
use beamlet::{Backend, Control, Engine, EngineOptions, Error, Progress, check};
use std::fs;
use std::process::Command;
use std::sync::atomic::{AtomicBool, Ordering};

/// A binary STL file of so many small boxes in rows of 200, 2.5 units apart.
fn boxes(count: u16) -> Vec<u8> {
    let mut file = vec![0_u8; 80];
    file.extend((12 * u32::from(count)).to_le_bytes());
    let faces =
        [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    for part in 0..count {
        let at = [part % 200, part / 200].map(|n| 2.5 * f32::from(n));
        for [a, b, c, d] in faces {
            for triangle in [[a, b, c], [a, c, d]] {
                file.extend([0; 12]);
                for corner in triangle {
                    let [i, j, k] =
                        [corner & 1, corner >> 1 & 1, corner >> 2].map(|bit| bit as f32);
                    let place = [at[0] + i, at[1] + j, k];
                    place.iter().for_each(|v| file.extend(v.to_le_bytes()));
                }
                file.extend([0; 2]);
            }
        }
    }
    file
}

/// The scene with a mesh of so many boxes for its object, and the `--set` for it.
fn with_boxes(count: u16) -> (Workplace, [&'static str; 4]) {
    let place = workplace();
    fs::write(place.path("many.stl"), boxes(count)).unwrap();
    let sets = ["--set", "object.part.mesh=many.stl", "--set", "object.part.unit=1 um"];
    (place, sets)
}

/// What the program draws on a terminal.
fn on_a_terminal(place: &Workplace, words: &[&str]) -> String {
    let words = words.iter().map(|word| format!("'{word}'")).collect::<Vec<_>>().join(" ");
    let line = format!("stty cols 200; {} {words}", env!("CARGO_BIN_EXE_beamlet"));
    let mut command = Command::new("script");
    command.args(["--quiet", "--return", "--command", &line, "/dev/null"]);
    let output = command.current_dir(place.path("")).env_remove("RUST_LOG").output().unwrap();
    let shown = String::from_utf8_lossy(&output.stdout).into_owned();
    assert_eq!(code_and_stderr(&output), (Some(0), String::new()), "{words}: {shown}");
    shown
}

#[test]
fn a_terminal_shows_what_is_read_and_checked_and_a_pipe_does_not() {
    let (place, sets) = with_boxes(30_000);
    let run = ["simulate", "scene.toml", "-o", "run", "--backend", "bvh"];
    for words in [&["check", "scene.toml"][..], &run] {
        let shown = on_a_terminal(&place, &[words, &sets].concat());
        assert!(shown.contains("checking \"part\"") && shown.contains(" %"), "{shown}");
        assert!(shown.contains("objects  ") || shown.contains("rays     "), "{shown}");
    }
    let shown = on_a_terminal(&place, &[&["check", "-q", "scene.toml"][..], &sets].concat());
    assert!(!shown.contains("checking \"part\"") && shown.contains("memory  "), "{shown}");
    let (code, message) =
        code_and_stderr(&place.beamlet(&[&["check", "scene.toml"][..], &sets].concat()));
    assert_eq!((code, message), (Some(0), String::new()), "lines come every ten seconds");
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
            assert!(loading.done <= loading.total && loading.objects == 1, "{loading:?}");
            let name = if loading.step == LoadStep::Nesting { "" } else { "part" };
            assert_eq!(loading.object, name);
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
    let all = [LoadStep::Reading, LoadStep::Joining, LoadStep::Checking, LoadStep::Nesting];
    assert_eq!(steps, all);
    // `check` tells the same, and amounts to the same as without.
    let mut steps = Vec::new();
    let mut told = |progress: Progress| {
        let Progress::Loading(loading) = progress else { panic!("{progress:?}") };
        steps.push(loading.step);
    };
    let report = check::check_watched(&scene, None, Some(&mut told)).unwrap();
    assert_eq!(report, check::check(&scene).unwrap());
    steps.dedup();
    assert_eq!(steps, all);
}

#[test]
fn loading_can_be_cancelled() {
    let (place, sets) = with_boxes(3000);
    let scene = scene(&place, &sets);
    let engine = Engine::open(&EngineOptions::default()).unwrap();
    for at in [LoadStep::Reading, LoadStep::Joining, LoadStep::Checking, LoadStep::Nesting] {
        let cancel = AtomicBool::new(false);
        let mut told = |progress: Progress| match progress {
            Progress::Loading(loading) => {
                cancel.fetch_or(loading.step == at, Ordering::Relaxed);
            }
            other => panic!("{at:?}: {other:?}"),
        };
        let mut control = Control::default().with_progress(&mut told).with_cancel(&cancel);
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
fn cuts_are_told_measured_by_check_alone_and_end_where_they_are_cancelled() {
    let scene = overlapping();
    let engine = Engine::open(&EngineOptions::default()).unwrap();
    let mut steps = Vec::new();
    let mut told = |progress: Progress| {
        let Progress::Loading(loading) = progress else { panic!("{progress:?}") };
        steps.push(loading.step);
    };
    let mut control = Control::default().with_progress(&mut told);
    engine.prepare_with(&scene, &mut control).unwrap();
    assert!(steps.contains(&LoadStep::Cutting) && !steps.contains(&LoadStep::Comparing));
    let mut steps = Vec::new();
    let mut told = |progress: Progress| {
        let Progress::Loading(loading) = progress else { panic!("{progress:?}") };
        steps.push(loading.step);
    };
    let report = check::check_watched(&scene, None, Some(&mut told)).unwrap();
    assert!(steps.contains(&LoadStep::Comparing), "{steps:?}");
    assert_eq!(report.contacts.len(), 1);
    assert_eq!(report.objects[0].cut_by, ["b"]);
    assert!(report.to_string().contains("\"a\" and \"b\" overlap"), "{report}");

    let cancel = AtomicBool::new(false);
    let mut told = |progress: Progress| {
        if let Progress::Loading(loading) = progress {
            cancel.fetch_or(loading.step == LoadStep::Cutting, Ordering::Relaxed);
        }
    };
    let mut control = Control::default().with_progress(&mut told).with_cancel(&cancel);
    let ended = engine.prepare_with(&scene, &mut control);
    assert!(matches!(ended, Err(Error::Interrupted)), "{ended:?}");
}
