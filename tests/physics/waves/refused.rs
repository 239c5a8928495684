//! Scenes that waves refuse by name.

use super::{BY_WAVES, FIBRE, add_cylinder, without_distance};
use crate::support::engine;
use crate::thin_masks::REFERENCE;
use beamlet::check::Check;
use beamlet::scene::{Refine, Scene, Scheme, Spot, SpotPart};
use beamlet::{Backend, Error};

fn refusal(change: impl Fn(&mut Scene)) -> String {
    let mut scene = REFERENCE.scene(4, 0.0003, &[0.0], BY_WAVES);
    add_cylinder(&mut scene, 5e-6, 20e-6, FIBRE);
    change(&mut scene);
    let error = engine(Backend::Bvh).prepare(&scene).expect_err("a refusal");
    assert!(matches!(error, Error::Scene { .. }), "{error:?}");
    let checked = Check::of(&scene).without_estimate().run().expect_err("a refusal");
    assert_eq!(checked.to_string(), error.to_string());
    error.to_string()
}

#[test]
fn scenes_that_waves_do_not_describe_are_refused_by_name() {
    let has = |text: String, word: &str| {
        assert!(text.contains("sampling.transport") && text.contains(word), "{text}");
    };
    has(refusal(|scene| scene.sampling.scheme = Scheme::Random), "random");
    has(refusal(|scene| scene.sampling.refine = Refine::Device), "device");
    has(refusal(|scene| scene.objects[0].roughness = 1e-3), "cylinder");
    // Rows of 3 um at the sample.
    let low = |scene: &mut Scene| {
        scene.sample_mask = None;
        scene.detector.pitch[1] = 4.5e-6;
    };
    has(refusal(low), "um high at the sample and no sample mask");
    let point = |scene: &mut Scene| {
        scene.sample_mask = None;
        scene.source.spot = Spot::gaussians(vec![SpotPart::new(1.0, [0.0; 2], [0.0; 2])]);
    };
    has(refusal(point), "no sample mask");
    let parts = [[30e-6, 10e-6], [30e-6, 20e-6]].map(|fwhm| SpotPart::new(0.5, fwhm, [0.0; 2]));
    has(refusal(|scene| scene.source.spot = Spot::gaussians(parts.to_vec())), "along z");
    let wide = |scene: &mut Scene| {
        let text = REFERENCE.text(4000, 0.01, &[0.0], BY_WAVES);
        let metal = "material = \"gold\"\nthickness = \"5 mm\"";
        let text = without_distance(&text.replace("transmission = 0.0", metal));
        *scene = Scene::from_toml(&text, ".").expect("a scene");
    };
    has(refusal(wide), "shadow");
}
