//! The paper's scene as text, and what the tests of scene files do with it.

use crate::kept::kept;
use beamlet::scene::Scene;
use beamlet::{Error, Place};

pub(crate) const PAPER: &str = include_str!("scene_paper.toml");

pub(crate) fn load(text: &str) -> Result<Scene, Error> {
    kept(text, Scene::from_toml(text, "somewhere"))
}

/// Place, key, what was found and what is allowed of the first error in a scene.
#[track_caller]
pub(crate) fn parts(result: Result<Scene, Error>) -> (Place, String, String, String) {
    let error = result.expect_err("an error in the scene");
    match &error.each()[0] {
        Error::Scene { place, key, found, allowed, .. } => {
            ((**place).clone(), key.clone(), found.clone(), allowed.clone())
        }
        other => panic!("not a scene error: {other}"),
    }
}

/// Loads the paper's scene from a file with overrides.
pub(crate) fn with_sets(sets: &[&str]) -> Result<Scene, Error> {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let path = directory.path().join("paper.toml");
    std::fs::write(&path, PAPER).expect("the scene is written");
    let sets: Vec<_> = sets.iter().map(|set| (*set).to_owned()).collect();
    kept(PAPER, Scene::load_with(&path, &sets))
}
