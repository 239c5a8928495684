//! Light of a spectrum from one trace.

use super::{BY_WAVES, FIBRE, OFFSETS, add_cylinder, simulate};
use crate::support::Worst;
use crate::thin_masks::{LEAKING, REFERENCE};
use beamlet::Backend;
use beamlet::scene::{Beam, Scene};
use beamlet::spectrum;

#[test]
fn light_of_a_spectrum_is_the_sum_of_its_energies_within_2e_5() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("spectrum.csv");
    let lines: Vec<String> = (0..31).map(|k| format!("{},1", 25.0 + 0.5 * f64::from(k))).collect();
    std::fs::write(&path, format!("energy_keV,weight\n{}\n", lines.join("\n"))).expect("a file");
    let mut worst = Worst::new("waves, a spectrum", 2e-5);
    for masks in [&REFERENCE, &LEAKING] {
        let beam = format!("spectrum = {{ file = \"{}\", nodes = 3 }}", path.display());
        let text = masks.text(4, 0.0003, &OFFSETS, BY_WAVES);
        let text = text.replace(&format!("energy = \"{} keV\"", masks.energy), &beam);
        let mut scene = Scene::from_toml(&text, ".").expect("a scene");
        add_cylinder(&mut scene, 46e-6, 60e-6, FIBRE);
        // Numbers hold at one energy only.
        scene.materials.clear();
        scene.objects[0].material = "carbon".into();
        let nodes = spectrum::nodes(&scene).expect("nodes");
        assert_eq!(nodes.energies.len(), 3);
        let all = simulate(&scene, Backend::Bvh);
        let mut sum = all.sample.mapv(|_| 0.0);
        for (energy, weight) in nodes.energies.iter().zip(&nodes.weights) {
            let mut one = scene.clone();
            one.source.beam = Beam::Energy(*energy);
            let light = simulate(&one, Backend::Bvh).sample;
            sum.zip_mut_with(&light, |sum, light| *sum += weight * f64::from(*light));
        }
        for ((place, got), want) in all.sample.indexed_iter().zip(&sum) {
            worst.take(f64::from(*got) - want, || format!("{place:?}: {got} for {want}"));
        }
    }
    worst.holds();
}
