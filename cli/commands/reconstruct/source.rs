//! Inputs of `beamlet reconstruct`.

use crate::commands::simulate::command_line;
use crate::failure::Failure;
use crate::progress::Reporter;
use beamlet::cli_support::options::ReconstructArguments;
use beamlet::reconstruct::Input;
use beamlet::retrieve::{self, ImagesTo, Record, RetrieveOptions};
use beamlet::scene::Scene;
use beamlet::stack::{Format, OpenRun, layout};
use beamlet::{Cancel, Engine, RowsControl};
use std::path::{Path, PathBuf};

/// Inputs of a reconstruction, and their scene.
pub(super) struct Source {
    pub(super) input: Input,
    pub(super) scene: Option<Scene>,
    /// Images that were made on the way.
    pub(super) retrieved: Option<PathBuf>,
    /// Standard deviation of the curves without sample, m of offset.
    pub(super) flat_width: Option<f64>,
}

impl Source {
    pub(super) fn of(
        given: &ReconstructArguments,
        engine: &Engine,
        cancel: &Cancel,
        reporter: &mut Reporter,
    ) -> Result<Self, Failure> {
        if let Some(geometry) = &given.geometry {
            return Self::of_file(given, geometry);
        }
        let (mut folders, mut scene, mut retrieved) = (Vec::new(), None, None);
        for input in &given.inputs {
            if layout::is_run(input) {
                let images = input.join(layout::RETRIEVED);
                if !layout::is_retrieved(&images) {
                    if given.dry_run {
                        let problem = "is not retrieved yet: run beamlet retrieve before --dry-run";
                        return Err(Failure::File { path: input.clone(), problem: problem.into() });
                    }
                    retrieve_run(engine, input, &images, cancel, reporter)?;
                    retrieved = Some(images.clone());
                }
                folders.push(images);
                if scene.is_none() {
                    scene = Some(OpenRun::open(input)?.scene().clone());
                }
            } else if input.is_file() {
                let is_scene = input.extension().is_some_and(|it| it == "toml" || it == "json");
                let problem = match is_scene {
                    true => "is a scene: simulate it, and give the run directory",
                    false => "is a file: sinograms need --geometry SCENE, for angles and distances",
                };
                return Err(Failure::File { path: input.clone(), problem: problem.into() });
            } else {
                folders.push(input.clone());
            }
        }
        let input = Input::of_images(&folders)?;
        let record = Record::read(&folders[0].join(layout::RECORD))?;
        if scene.is_none() {
            scene = record.geometry.map(|text| Scene::from_toml(&text, &folders[0])).transpose()?;
        }
        Ok(Self { input, scene, retrieved, flat_width: record.flat_width })
    }

    fn of_file(given: &ReconstructArguments, geometry: &Path) -> Result<Self, Failure> {
        let usage = |problem: &str| Err(Failure::Usage(problem.into()));
        let [path] = given.inputs.as_slice() else {
            return usage("--geometry requires exactly one file of sinograms");
        };
        if path.is_dir() {
            return usage(
                "--geometry is for files of sinograms; retrieved images have their own geometry",
            );
        }
        let [quantity] = given.quantity.as_slice() else {
            return usage(
                "a file of sinograms needs --quantity: mu (-ln of the transmission), delta (rad) \
                          or dark-field (rad^2)",
            );
        };
        // A run is the set-up of its scene.
        let geometry = match layout::is_run(geometry) {
            true => &geometry.join(layout::SCENE),
            false => geometry,
        };
        let scene = Scene::load_with(geometry, &given.set)?;
        let input = Input::of_file(path, *quantity, &scene)
            .map_err(|error| Scene::locate(geometry, &given.set, error))?;
        Ok(Self { input, scene: Some(scene), retrieved: None, flat_width: None })
    }
}

/// Retrieves a run as `beamlet retrieve RUN` does.
fn retrieve_run(
    engine: &Engine,
    run: &Path,
    images: &Path,
    cancel: &Cancel,
    reporter: &mut Reporter,
) -> Result<(), Failure> {
    let input = retrieve::Input::of_run(&OpenRun::open(run)?, false)?;
    let mut progress = |done, all| reporter.rows(done, all);
    let mut control =
        RowsControl::default().with_progress(&mut progress).with_cancel(cancel.clone());
    let command = command_line();
    let to = ImagesTo::new(images, Format::default()).with_command(Some(&command));
    retrieve::retrieve(engine, input, &RetrieveOptions::default(), to, &mut control)?;
    Ok(())
}
