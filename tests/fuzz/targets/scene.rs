//! Scene texts: any bytes either load or are refused, and what loads can be written and read
//! again.
#![no_main]

use beamlet::scene::Scene;
use beamlet_fuzz::bare_seeds;
use libfuzzer_sys::fuzz_target;

fn seeds() -> Vec<Vec<u8>> {
    let json = concat!("j", include_str!("../scenes/random.json"));
    [json, include_str!("../scenes/spectrum.toml")].map(|text| text.as_bytes().to_vec()).to_vec()
}

fuzz_target!(init: bare_seeds(seeds), |text: &str| {
    // The first byte chooses the language.
    let scene = match text.strip_prefix('j') {
        Some(json) => Scene::from_json(json, "."),
        None => Scene::from_toml(text, "."),
    };
    if let Ok(scene) = scene {
        let again = scene.to_toml(".", &Default::default(), &[]).expect("it can be written");
        assert_eq!(Scene::from_toml(&again, ".").expect("it can be read again"), scene);
    }
});
