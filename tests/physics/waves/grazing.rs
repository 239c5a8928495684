//! Faces near and below the critical angle by waves: mirrored light as by rays.

use super::{BY_WAVES, OFFSETS, engine, simulate};
use crate::reference::normal::{SIGMA_PER_FWHM, cumulative};
use crate::reference::waves::block::Block;
use crate::support::cuts::{Cut, bands, batches, no_bit_changes};
use crate::support::{Worst, backends, sample};
use crate::thin_masks::REFERENCE;
use beamlet::scene::{Beam, MaterialSpec, Object, Scene, Shape, Transport};
use beamlet::{Backend, spectrum};

/// Decrement of a block: its critical angle is 1.41 mrad.
const DELTA: f64 = 1e-6;
const DEPTH: f64 = 10e-3;

/// Adds a block whose left face passes through x in the middle of the sample, turned from the beam by an angle.
fn add_block(scene: &mut Scene, x: f64, angle: f64) {
    scene.materials.insert("matter".into(), MaterialSpec::Constants { mu: 0.0, delta: DELTA });
    let shape = Shape::Box { size: [2e-3, DEPTH, 4e-3] };
    let mut block = Object::new("block", shape, "matter");
    block.placement.rotate.push(([0.0, 0.0, 1.0], angle));
    block.placement.position = [x + 1e-3 * angle.cos(), 1e-3 * angle.sin(), 0.0];
    scene.objects.push(block);
}

/// A block whose face is in the middle of the aperture of the middle column.
fn behind_masks(columns: u32, angle: f64) -> Scene {
    let mut scene = REFERENCE.scene(columns, 0.012, &OFFSETS, BY_WAVES);
    add_block(&mut scene, 0.0, angle);
    scene
}

/// Change of light by the sample, `[step][column]`.
fn change(scene: &Scene) -> Vec<Vec<f64>> {
    let stacks = simulate(scene, Backend::Bvh);
    let steps = stacks.flat.shape()[0];
    let columns = stacks.flat.shape()[2];
    let of = |step: usize, column: usize| {
        f64::from(stacks.sample[[0, step, 0, column]]) - f64::from(stacks.flat[[step, 0, column]])
    };
    (0..steps).map(|step| (0..columns).map(|column| of(step, column)).collect()).collect()
}

const COLUMNS: usize = 60;
const PIXEL: f64 = 12e-6;
/// Source to sample, and sample to detector, m.
const ARM: f64 = 0.5;

/// A face without masks. Its place leaves its mirrored light, 420 um aside, on the detector.
fn without_masks(angle: f64) -> Scene {
    let text = format!(
        "[source]\ndistance = \"0.5 m\"\nspot = \"10 um\"\nenergy = \"20 keV\"\n\
         [detector]\ndistance = \"1 m\"\npixels = [{COLUMNS}, 1]\npitch = [\"12 um\", \"120 um\"]\n\
         [sampling]\ntransport = \"wave\"\ntolerance = 2e-5\n"
    );
    let mut scene = Scene::from_toml(&text, ".").expect("a scene");
    add_block(&mut scene, FACE, angle);
    scene
}

const FACE: f64 = 60e-6;

/// Mirrored light of each pixel by the law of reflection, in f64: all light below the critical angle.
fn mirrored(angle: f64) -> Vec<f64> {
    let blur = 10e-6 * SIGMA_PER_FWHM;
    let mut light = vec![0.0; COLUMNS];
    let (step, slope_of_face) = (1e-10, -angle.tan());
    let count = 400_000;
    for index in 0..count {
        let slope = FACE / ARM + (f64::from(index) + 0.5 - 0.5 * f64::from(count)) * step;
        let y = (FACE - slope * ARM) / (slope - slope_of_face);
        let glancing = slope.atan() - slope_of_face.atan();
        let below = glancing > 0.0 && glancing.sin() < (2.0 * DELTA).sqrt();
        if y.abs() > 0.5 * DEPTH * angle.cos() || !below {
            continue;
        }
        let after = (2.0 * slope_of_face.atan() - slope.atan()).tan();
        let landing = slope * (ARM + y) + after * (ARM - y);
        for (column, light) in light.iter_mut().enumerate() {
            let low = (column as f64 - 0.5 * COLUMNS as f64) * PIXEL;
            let below = |x: f64| cumulative((x - landing) / blur);
            *light += (below(low + PIXEL) - below(low)) * step * 2.0 * ARM / PIXEL;
        }
    }
    light
}

#[test]
fn mirrored_light_lands_by_the_law_of_reflection_within_2e_4_and_none_is_lost() {
    let angle = 0.3e-3;
    let got = change(&without_masks(angle)).remove(0);
    let want = mirrored(angle);
    let all: f64 = want.iter().sum();
    // The face takes 4.2 um at the sample.
    assert!((all - 0.42e-3 * DEPTH * 2.0 / PIXEL).abs() < 0.01, "{all}");
    // Light that the gap behind the face diffracts: 8e-5 at 100 um.
    let mut worst = Worst::new("waves, mirrored light", 2e-4);
    for (column, (got, want)) in got.iter().zip(&want).enumerate().take(20) {
        worst.take(got - want, || format!("column {column}: {got} {want}"));
    }
    worst.holds();
    // The gap diffracts λz/(4π²x) beyond x on either side of the detector: 7e-4 pixels in all.
    let mut rest = Worst::new("waves, light of the detector, pixels", 1e-3);
    rest.take(got.iter().sum(), || "all columns".into());
    rest.holds();
}

#[test]
fn mirrored_light_behind_masks_is_as_by_rays_within_1e_4() {
    // Light that neighbouring apertures diffract changes, too: by 6e-5.
    let mut worst = Worst::new("waves, mirrored light behind masks", 1e-4);
    let mut scene = behind_masks(11, 0.51e-3);
    scene.sampling.tolerance = Some(2e-5);
    let waves = change(&scene);
    scene.sampling.transport = Transport::Auto;
    let rays = change(&scene);
    let most = rays.iter().flatten().copied().fold(0.0, f64::max);
    assert!(most > 0.02, "{most}");
    for (step, (waves, rays)) in waves.iter().zip(&rays).enumerate() {
        for (column, (waves, rays)) in waves.iter().zip(rays).enumerate().take(3) {
            worst.take(waves - rays, || format!("step {step}, column {column}: {waves} {rays}"));
        }
    }
    worst.holds();
}

#[test]
fn light_of_a_face_matches_its_field_in_steps_along_the_beam() {
    // The gap of 9 to 17 um in the field has sharp ends: 1.1e-3. Light of the face diffracts: 2.4e-3 of 4.9e-2 leave
    // the opening of its pixel.
    let mut beside = Worst::new("waves, light beside a face, its field in steps", 2e-3);
    let mut thrown = Worst::new("waves, light of a face, its field in steps", 3e-3);
    let centres: Vec<f64> = (-5..=5).map(|column| f64::from(column) * 150e-6).collect();
    // Total reflection; refraction on the way in at 1.2, and on the way out at 0.65 critical angles: all light lands in
    // the opening of a pixel. All with `BEAMLET_ALL`, else the first and the last.
    for angle in sample(vec![0.51e-3, 1.69e-3, -0.925e-3_f64], 2) {
        // Rays refract all light; Fresnel's equations reflect a part.
        let inside = (angle * angle - angle.signum() * 2.0 * DELTA).max(0.0).sqrt();
        let reflectivity = ((angle.abs() - inside) / (angle.abs() + inside)).powi(2);
        let passes = if inside > 0.0 { 1.0 - reflectivity } else { 1.0 };
        let got = change(&behind_masks(11, angle)).remove(2);
        let block = Block { middle: 1.212, depth: DEPTH, angle, delta: DELTA };
        let want = block.change(&REFERENCE.set_up(), 20e-6, &REFERENCE.window(), &centres);
        let most = want[..4].iter().copied().fold(0.0, f64::max);
        assert!(most > 0.03, "{angle}: {want:?}");
        for (column, (got, want)) in got.iter().zip(&want).enumerate() {
            let (worst, got) =
                if column < 4 { (&mut thrown, got * passes) } else { (&mut beside, *got) };
            worst.take(got - want, || format!("{angle}, column {column}: {got} {want}"));
        }
    }
    beside.holds();
    thrown.holds();
}

#[test]
fn faces_below_the_critical_angle_have_the_light_of_rays_at_short_wavelengths() {
    let error = |energy: f64| {
        let mut scene = behind_masks(11, 0.51e-3);
        scene.source.beam = Beam::Energy(energy);
        scene.sampling.tolerance = Some(1e-5);
        let waves = change(&scene);
        scene.sampling.transport = Transport::Auto;
        let rays = change(&scene);
        let pairs = waves.iter().flatten().zip(rays.iter().flatten());
        pairs.map(|(waves, rays)| (waves - rays).abs()).fold(0.0, f64::max)
    };
    let errors = [30.0, 300.0].map(error);
    // The ends of the gap diffract in proportion to the wavelength: by 2.3e-3, and 2.1e-4.
    assert!(errors[1] < 0.15 * errors[0] && errors[0] < 3e-3, "{errors:?}");
}

#[test]
fn light_near_grazing_is_counted() {
    for backend in backends() {
        let tally =
            |angle| engine(backend).simulate(&behind_masks(3, angle)).expect("stacks").record.tally;
        for angle in [0.3e-3, 1.2e-3_f64] {
            let tally = tally(angle);
            // Share of a period.
            let (got, want) = (1e-9 * tally.grazing_light as f64, DEPTH * angle / 100e-6);
            assert!((got - want).abs() < 0.01 * want + 1e-4, "{angle}: {got} for {want}");
            assert!(tally.reflected > 0);
        }
        // Above the critical angle, on the way out of matter, and far from both.
        for angle in [1.6e-3, -0.8e-3, 8e-3_f64] {
            let tally = tally(angle);
            assert_eq!(tally.reflected, 0, "{angle}");
            assert_eq!(tally.grazing_light > 0, angle < 5e-3, "{angle}");
        }
    }
}

#[test]
fn energies_of_a_spectrum_have_critical_angles_of_their_own() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("spectrum.csv");
    std::fs::write(&path, "energy_keV,weight\n26,1\n30,1\n40,1\n").expect("a file");
    let beam = format!("spectrum = {{ file = \"{}\", nodes = 3 }}", path.display());
    let text = REFERENCE.text(17, 0.012, &OFFSETS, BY_WAVES);
    let mut scene =
        Scene::from_toml(&text.replace("energy = \"30 keV\"", &beam), ".").expect("a scene");
    add_block(&mut scene, 0.0, 0.9e-3);
    scene.materials.clear();
    scene.objects[0].material = "carbon".into();
    let nodes = spectrum::nodes(&scene).expect("nodes");
    let all = simulate(&scene, Backend::Bvh);
    let mut sum = all.sample.mapv(|_| 0.0);
    let mut reflects = Vec::new();
    for (energy, weight) in nodes.energies.iter().zip(&nodes.weights) {
        let mut one = scene.clone();
        one.source.beam = Beam::Energy(*energy);
        let light = simulate(&one, Backend::Bvh);
        reflects.push(light.record.tally.reflected > 0);
        sum.zip_mut_with(&light.sample, |sum, light| *sum += weight * f64::from(*light));
    }
    assert!(reflects.contains(&true) && reflects.contains(&false), "{reflects:?}");
    let mut worst = Worst::new("waves, mirrored light of a spectrum", 1e-4);
    for ((place, got), want) in all.sample.indexed_iter().zip(&sum) {
        worst.take(f64::from(*got) - want, || format!("{place:?}: {got} for {want}"));
    }
    worst.holds();
}

#[test]
fn bands_and_batches_change_no_bit_of_mirrored_light() {
    let mut scene = behind_masks(11, 0.51e-3);
    scene.detector.pixels[1] = 3;
    // Lines differ over a row.
    scene.objects[0].placement.rotate.push(([0.0, 1.0, 0.0], 5e-3));
    let cuts = [bands(1), Cut { batch: Some(1000), ..bands(2) }, batches(257)];
    let whole = no_bit_changes("mirrored light", &scene, &cuts);
    assert!(whole.record.tally.grazing_light > 0);
}
