//! `beamlet view`: pictures of a scene, of a run or of retrieved images.

mod chosen;
mod volume;

use super::pictures::{PictureForm, Pictures};
use crate::args::{View, ViewOfRun, ViewOfScene};
use crate::failure::Failure;
use crate::picture::sample::{self, Camera};
use crate::picture::set_up;
use crate::progress::Reporter;
use beamlet::Control;
use beamlet::scene::Scene;
use beamlet::stack::layout;
use std::io::Write;
use std::path::PathBuf;

pub(super) fn run(arguments: &View, out: &mut impl Write) -> Result<(), Failure> {
    let of_scene = &arguments.of_scene;
    let form = PictureForm { format: arguments.format, width: arguments.width };
    let mut reporter = Reporter::new(arguments.messages);
    let camera = of_scene.azimuth.is_some() || of_scene.elevation.is_some();
    let (pictures, read) = if arguments.what.is_dir() {
        if !of_scene.sets.is_empty() || of_scene.device.device.is_some() || camera {
            let problem =
                "--set, --azimuth, --elevation and --device are for scenes; this is a folder";
            return Err(Failure::Usage(problem.into()));
        }
        let read = std::iter::once(&arguments.what).chain(&arguments.of_run.retrieved);
        let read = read.cloned().collect();
        reporter.doing("drawing");
        let pictures = match layout::is_volume(&arguments.what) {
            true => volume::of(&arguments.what, &arguments.of_run, form)?,
            false => chosen::of(&arguments.what, &arguments.of_run, form)?,
        };
        (pictures, read)
    } else {
        let ViewOfRun { show, maps, retrieved, ranges, view, step, row, pixel, slice } =
            &arguments.of_run;
        let numbers = [view, step, row, slice].iter().any(|number| number.is_some());
        let lists = !show.is_empty() || !maps.is_empty() || !ranges.is_empty();
        if numbers || lists || pixel.is_some() || retrieved.is_some() {
            let problem = "--show, --map, --retrieved, --range, --view, --step, --row, --pixel and \
                           --slice are for runs, retrieved images and reconstructions; this is a scene";
            return Err(Failure::Usage(problem.into()));
        }
        scene(arguments, form, &mut reporter)?
    };
    reporter.finish();
    pictures.write(&arguments.output, arguments.overwrite, &read, out)
}

/// Set-up and sample, and the files that they are of.
fn scene(
    arguments: &View,
    form: PictureForm,
    reporter: &mut Reporter,
) -> Result<(Pictures, Vec<PathBuf>), Failure> {
    let ViewOfScene { sets, azimuth, elevation, device } = &arguments.of_scene;
    let failed = |error| Failure::from(Scene::locate(&arguments.what, sets, error));
    let scene = beamlet::cli_support::load_scene(&arguments.what, sets)?;
    let mut progress = |progress| reporter.update(progress);
    let mut control = Control::default().with_progress(&mut progress);
    let geometry = beamlet::load_sample(&scene, &mut control).map_err(failed)?;
    reporter.doing("drawing");
    beamlet::geometry::check_clearance(&scene, &geometry).map_err(failed)?;
    let mut pictures = Pictures::new(form);
    pictures.add("set_up", &set_up::draw(&scene, &geometry)?)?;
    if !geometry.objects.is_empty() {
        let from = Camera::default();
        let camera = Camera {
            azimuth: azimuth.map_or(from.azimuth, f64::to_radians),
            elevation: elevation.map_or(from.elevation, f64::to_radians),
        };
        let drawing =
            sample::draw(&scene, &geometry, camera, device.device.as_deref()).map_err(failed)?;
        pictures.add("sample", &drawing)?;
    }
    let mut read = scene.input_files();
    read.push(arguments.what.clone());
    Ok((pictures, read))
}
