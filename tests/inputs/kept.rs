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

/// Fails unless a scene has the hash of its `file`, whatever that holds, and is refused at `key` with the hash of another.
#[track_caller]
pub(crate) fn assert_hashed(text: &str, file: &str, contents: [&str; 2], key: &str) {
    let place = tempfile::tempdir().expect("a folder");
    let read = |text: &str| Scene::from_toml(text, place.path());
    let [first, second] = contents.map(|content| {
        std::fs::write(place.path().join(file), content).expect("a file");
        read(text).expect("a scene").files[Path::new(file)].clone()
    });
    assert_ne!(first, second);
    let recorded = format!("{text}\n[files]\n\"{file}\" = \"{first}\"\n");
    let error = read(&recorded).expect_err("another file").to_string();
    for word in [key, "sha256", "as in [files]"] {
        assert!(error.contains(word), "{word:?} in: {error}");
    }
}
