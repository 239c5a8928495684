//! Beams from the command line: of a scene, of a spectrum file, of the built-in tube.

use crate::failure::Failure;
use beamlet::scene::{Beam, Scene, SpectrumOrigin, SpectrumSpec};
use std::path::Path;

/// A scene about nothing, for what needs materials and a beam only.
const BARE: &str = "[source]\ndistance = \"1 m\"\nspot = \"0 um\"\nenergy = \"1 keV\"\n[detector]\n\
                    distance = \"2 m\"\npixels = [1, 1]\npitch = \"1 um\"\n";

/// A scene about nothing with this beam; files are found from the working directory.
pub(super) fn bare(beam: Beam) -> Result<Scene, Failure> {
    let mut scene = Scene::from_toml(BARE, ".")?;
    scene.source.beam = beam;
    scene.validate()?;
    Ok(scene)
}

/// True if a path names a scene and not a spectrum.
pub(super) fn is_scene(path: &Path) -> bool {
    let ending = path.extension().map(|text| text.to_string_lossy().to_lowercase());
    matches!(ending.as_deref(), Some("toml" | "json"))
}

/// The scene at `path`, or one about nothing with the spectrum of a file.
pub(super) fn of_file(path: &Path, sets: &[String]) -> Result<Scene, Failure> {
    if is_scene(path) {
        return Ok(Scene::load_with(path, sets)?);
    }
    if !sets.is_empty() {
        let problem = format!(
            "--set is for scenes; {} is not a scene",
            beamlet::cli_support::printed::path(path)
        );
        return Err(Failure::Usage(problem));
    }
    let origin = SpectrumOrigin::File { path: path.to_owned() };
    bare(Beam::Spectrum(SpectrumSpec::new(origin)))
}
