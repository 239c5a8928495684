//! Scenes of the tests for tests/schema.sh, which holds them to the JSON Schema.

use std::collections::BTreeMap;
use std::collections::hash_map::DefaultHasher;
use std::hash::{Hash, Hasher};
use std::path::Path;

use beamlet::Error;
use beamlet::scene::Scene;

/// Passes on what a scene loaded to. Where `BEAMLET_SCENES_TO` names a folder, a scene that loads is
/// written there, as the text and as resolved.
pub(crate) fn kept(text: &str, scene: Result<Scene, Error>) -> Result<Scene, Error> {
    if let (Some(folder), Ok(scene)) = (std::env::var_os("BEAMLET_SCENES_TO"), &scene) {
        let resolved = scene.to_toml(".", &BTreeMap::new(), &[]).expect("a resolved scene");
        for text in [text, &resolved] {
            let mut hasher = DefaultHasher::new();
            text.hash(&mut hasher);
            let path = Path::new(&folder).join(format!("{:016x}.toml", hasher.finish()));
            std::fs::write(path, text).expect("a scene is written");
        }
    }
    scene
}
