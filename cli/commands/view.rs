//! `beamlet view`: pictures of a scene or of a run, as PNG files.

mod run_pictures;

use super::pictures::Pictures;
use crate::args::{View, ViewOfRun, ViewOfScene};
use crate::failure::Failure;
use crate::picture::sample::{self, Camera};
use crate::picture::set_up;
use beamlet::scene::Scene;
use std::io::Write;
use std::path::PathBuf;

/// Where the sample is looked at from, degrees.
const CAMERA: [f64; 2] = [35.0, 24.0];

pub(super) fn run(arguments: &View, out: &mut impl Write) -> Result<(), Failure> {
    let of_scene = &arguments.of_scene;
    let camera = of_scene.azimuth.is_some() || of_scene.elevation.is_some();
    let (pictures, read) = if arguments.what.is_dir() {
        if !of_scene.sets.is_empty() || of_scene.device.device.is_some() || camera {
            let problem =
                "--set, --azimuth, --elevation and --device are for scenes; this is a run";
            return Err(Failure::Usage(problem.into()));
        }
        (run_pictures::of(&arguments.what, &arguments.of_run)?, vec![arguments.what.clone()])
    } else {
        let ViewOfRun { show, maps, view, step, row, pixel } = &arguments.of_run;
        let numbers = [view, step, row].iter().any(|number| number.is_some());
        if numbers || pixel.is_some() || !show.is_empty() || !maps.is_empty() {
            let problem = "--show, --map, --view, --step, --row and --pixel are for run \
                           directories; this is a scene";
            return Err(Failure::Usage(problem.into()));
        }
        scene(arguments)?
    };
    pictures.write(&arguments.output, arguments.overwrite, &read, out)
}

/// Set-up and sample, and the files that they are of.
fn scene(arguments: &View) -> Result<(Pictures, Vec<PathBuf>), Failure> {
    let ViewOfScene { sets, azimuth, elevation, device } = &arguments.of_scene;
    let failed = |error| Failure::from(Scene::locate(&arguments.what, sets, error));
    let scene = Scene::load_with(&arguments.what, sets)?;
    let geometry = beamlet::geometry::load(&scene).map_err(failed)?;
    beamlet::geometry::check_clearance(&scene, &geometry).map_err(failed)?;
    let mut pictures = Pictures::default();
    pictures.add("set_up.png", &set_up::draw(&scene, &geometry)?)?;
    if !geometry.objects.is_empty() {
        let camera = Camera {
            azimuth: azimuth.unwrap_or(CAMERA[0]).to_radians(),
            elevation: elevation.unwrap_or(CAMERA[1]).to_radians(),
        };
        let drawing =
            sample::draw(&scene, &geometry, camera, device.device.as_deref()).map_err(failed)?;
        pictures.add("sample.png", &drawing)?;
    }
    let mut read = scene.input_files();
    read.push(arguments.what.clone());
    Ok((pictures, read))
}
