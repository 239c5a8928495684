//! Helpers of the tests: engines that listen to the validation layer, and figures that
//! are printed beside the tolerances they are held to (`cargo test -- --nocapture`).

#![allow(dead_code, reason = "every test binary uses another part")]

pub(crate) mod cuts;
pub(crate) mod files;
#[cfg(target_os = "linux")]
pub(crate) mod gate;
pub(crate) mod log;
#[cfg(feature = "cli")]
pub(crate) mod program;

use beamlet::retrieve::{Background, Method, RetrieveOptions};
use beamlet::scene::Scene;
use beamlet::stack::{Sink, Stacks};
use beamlet::{Backend, Control, Engine, EngineOptions, Result, RunRecord, Simulation};
use std::ops::Deref;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// Carbon of 2.0 g/cm3 at 30 keV: mu in 1/m, delta.
pub(crate) const CARBON: [f64; 2] = [51.235, 4.6092e-7];
/// Water at 30 keV.
pub(crate) const WATER: [f64; 2] = [37.559, 2.5604e-7];
/// Gold at 30 keV, 1/m.
pub(crate) const GOLD: f64 = 53_122.0;

/// Options of a fit without a model of the masks: a Gaussian, unless a method is chosen, with a free background.
pub(crate) fn free_gaussian() -> RetrieveOptions {
    RetrieveOptions::default().with_method(Method::Gaussian).with_background(Background::Free)
}

/// An engine that fails a test at the call in which the validation layer speaks, or a kernel writes beyond a buffer.
#[must_use = "an engine that does nothing tests nothing"]
#[derive(Debug)]
pub(crate) struct Checked(Engine);

impl Deref for Checked {
    type Target = Engine;

    fn deref(&self) -> &Engine {
        &self.0
    }
}

// These methods hide methods of the engine. `.ci/test` compares the log of the layer for all other calls.
impl Checked {
    #[track_caller]
    pub(crate) fn simulate(&self, scene: &Scene) -> Result<Stacks> {
        self.silent(self.0.simulate(scene))
    }

    #[track_caller]
    pub(crate) fn run(
        &self,
        scene: &Scene,
        sink: &mut dyn Sink,
        control: Control<'_>,
    ) -> Result<RunRecord> {
        self.silent(self.0.run(scene, sink, control))
    }

    #[track_caller]
    pub(crate) fn prepare(&self, scene: &Scene) -> Result<Simulation> {
        self.silent(self.0.prepare(scene))
    }

    /// Result of a call, if the validation layer printed nothing.
    #[track_caller]
    fn silent<T>(&self, returned: T) -> T {
        assert_eq!(self.0.validation_messages(), 0, "messages of the validation layer");
        assert_eq!(self.0.overflows(), 0, "buffers that were written beyond their end");
        returned
    }
}

/// The engine of this backend.
pub(crate) fn engine(backend: Backend) -> Checked {
    engine_of(EngineOptions::default().with_backend(backend))
}

/// An engine with these options of runs. All engines of a program share a device and its kernels.
pub(crate) fn engine_of(options: EngineOptions) -> Checked {
    static SHARED: OnceLock<Engine> = OnceLock::new();
    let shared = SHARED.get_or_init(|| engine_with(EngineOptions::default()).0);
    Checked(shared.with_options(options))
}

/// An engine with a device of its own, whose buffers have guards; with `BEAMLET_VALIDATION` in the environment under the
/// validation layer.
pub(crate) fn engine_with(options: EngineOptions) -> Checked {
    let validation = std::env::var_os("BEAMLET_VALIDATION").is_some();
    let options = options.with_validation(validation).with_guards(true);
    Checked(Engine::open(&options).expect("a Vulkan device"))
}

/// True if no test may leave anything out: `.ci/test` sets `BEAMLET_COMPLETE`. Elsewhere tests leave out what needs
/// Chromium, a second driver, the validation layer or ray query, where it is missing.
pub(crate) fn complete() -> bool {
    std::env::var_os("BEAMLET_COMPLETE").is_some()
}

/// The backends that this device can run; in a complete run it must run both.
pub(crate) fn backends() -> Vec<Backend> {
    let device = engine(Backend::Bvh);
    let mut all = vec![Backend::Bvh];
    if device.description().ray_query {
        all.push(Backend::RayQuery);
    }
    assert!(all.len() == 2 || !complete(), "no ray query, and BEAMLET_COMPLETE is set");
    all
}

/// The folder of the package: where the tests were built, or on another machine the working folder.
pub(crate) fn root() -> PathBuf {
    let built = Path::new(env!("CARGO_MANIFEST_DIR"));
    if built.join("tests/support").is_dir() { built.into() } else { PathBuf::from(".") }
}

/// A folder for files that tests leave: the one of the build, or on another machine the system's.
pub(crate) fn leftovers() -> PathBuf {
    let built = Path::new(env!("CARGO_TARGET_TMPDIR"));
    if built.is_dir() { built.into() } else { std::env::temp_dir() }
}

/// True if every case runs, as `.ci/long` does, in place of a sample of them.
pub(crate) fn everything() -> bool {
    std::env::var_os("BEAMLET_ALL").is_some()
}

/// The amount of a test: `few`, or `all` with `BEAMLET_ALL`.
pub(crate) fn amount<T>(few: T, all: T) -> T {
    if everything() { all } else { few }
}

/// Every `every`-th case; all of them where everything is asked for. A list of combinations keeps
/// each value of each of its lists where `every` has no factor in common with their lengths.
pub(crate) fn sample<T>(cases: Vec<T>, every: usize) -> impl Iterator<Item = T> {
    cases.into_iter().step_by(if everything() { 1 } else { every })
}

/// Largest of some deviations, with where it was found. A test ends it with `holds`.
#[must_use = "without `holds` nothing is compared"]
#[derive(Debug)]
pub(crate) struct Worst {
    what: &'static str,
    tolerance: f64,
    value: f64,
    place: String,
    count: usize,
    compared: bool,
}

impl Worst {
    pub(crate) fn new(what: &'static str, tolerance: f64) -> Self {
        Self { what, tolerance, value: 0.0, place: String::new(), count: 0, compared: false }
    }

    /// Takes a deviation; one that is not a number is infinite.
    pub(crate) fn take(&mut self, deviation: f64, place: impl FnOnce() -> String) {
        let deviation = if deviation.is_nan() { f64::INFINITY } else { deviation.abs() };
        self.count += 1;
        if deviation > self.value {
            self.value = deviation;
            self.place = place();
        }
    }

    /// Prints the largest deviation and fails where it exceeds the tolerance, or where there was
    /// none to take.
    #[track_caller]
    pub(crate) fn holds(mut self) {
        self.print();
        self.compared = true;
        let Self { what, tolerance, value, place, count, .. } = &self;
        assert!(*count > 0, "{what}: nothing was compared");
        assert!(value <= tolerance, "{what}: {value:e} exceeds {tolerance:e} at {place}");
    }

    #[allow(clippy::print_stdout, reason = "measured figures are what this is for")]
    fn print(&self) {
        let Self { what, tolerance, value, place, count, .. } = self;
        println!(
            "measured {what}: {value:.3e} of {tolerance:.1e} allowed, at {place} (of {count})"
        );
    }
}

impl Drop for Worst {
    /// Fails a test that forgot `holds`; one that failed before it still prints its figures.
    fn drop(&mut self) {
        if !self.compared {
            self.print();
            assert!(std::thread::panicking(), "{}: ended without `holds`", self.what);
        }
    }
}
