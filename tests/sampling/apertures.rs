//! Light behind masks whose apertures end along z.

use super::kinds::{apart, run, sum_over_energies, tube};
use crate::support::{amount, engine, sample};
use beamlet::Backend;
use beamlet::scene::{Scene, Transport};
use std::path::Path;

/// Tolerance of the light that is compared.
const TOLERANCE: f64 = 6e-4;

/// A ball and a tilted rod, whose surfaces bend light along z and change the depth along it.
const OBJECTS: &str = "[[object]]\nname = \"ball\"\nshape = { sphere = { radius = \"120 um\" } }\n\
     material = \"Al\"\nposition = [\"-60 um\", \"0 mm\", \"25 um\"]\n\
     [[object]]\nname = \"rod\"\nshape = { cylinder = { radius = \"90 um\", height = \"4 mm\" } }\n\
     material = \"PMMA\"\nrotate = [{ axis = [0, 1, 0], angle = \"50 deg\" }]\n\
     position = [\"160 um\", \"0 mm\", \"0 mm\"]\n";

fn scene(text: &[&str]) -> Scene {
    Scene::from_toml(&[text, &[OBJECTS]].concat().concat(), Path::new(".")).expect("a scene")
}

/// A mask alone before pixels smaller than its apertures: rows lie in the shadow of its bars, wholly or in part.
/// `mask`: its keys; `spot`: of the source along z.
fn tracked(mask: &str, spot: &str) -> Scene {
    scene(&[
        "[source]\ndistance = \"0.75 m\"\nenergy = \"20 keV\"\nspot = [\"10 um\", \"",
        spot,
        "\"]\n[detector]\ndistance = \"0.9 m\"\npixels = [14, 9]\npitch = \"30 um\"\n\
         [sample_mask]\ndistance = \"0.7 m\"\n",
        mask,
        "[scan]\nmask_offsets = [[\"0 um\", \"0 um\"]]\n",
    ])
}

/// Two masks before pixels of 150 x 120 um, steps along x and z; `leak`: transmission of the bars.
fn stepped(sample_mask: &str, leak: &str) -> Scene {
    let leak = format!("transmission = {leak}\n");
    scene(&[
        "[source]\ndistance = \"1.2 m\"\nenergy = \"25 keV\"\nspot = \"20 um\"\n\
         [detector]\ndistance = \"1.5 m\"\npixels = [4, 4]\npitch = [\"150 um\", \"120 um\"]\n\
         [scan]\nmask_offsets = [[\"0 um\", \"0 um\"], [\"-9 um\", \"11 um\"], [\"13 um\", \"-20 um\"]]\n\
         [sample_mask]\ndistance = \"1.19 m\"\n",
        sample_mask,
        &leak,
        "[detector_mask]\ndistance = \"1.48 m\"\nshape = \"rectangle\"\naperture = \"40 um\"\n\
         aperture_z = \"50 um\"\n",
        &leak,
    ])
}

const SQUARES: &str = "shape = \"rectangle\"\naperture = \"25 um\"\naperture_z = \"30 um\"\n";
const HOLES: &str =
    "shape = \"round\"\naperture = \"40 um\"\nperiod = \"120 um\"\ntransmission = 0.0\n";

pub(super) fn scenes() -> Vec<(&'static str, Scene)> {
    let moved = [SQUARES, "offset_z = \"17 um\"\n"].concat();
    let hexagonal =
        "shape = \"round\"\naperture = \"22 um\"\nlattice = \"hexagonal\"\nperiod_z = \"30 um\"\n";
    let pattern =
        "pattern = [\"0110\", \"1011\", \"0001\"]\npattern_pixel = [\"25 um\", \"21 um\"]\n";
    let mut behind = stepped(SQUARES, "0.0");
    behind.sample_mask = None;
    behind.scan.mask_offsets = vec![0.0];
    behind.scan.mask_offsets_z.clear();
    vec![
        ("beam tracking", tracked(HOLES, "10 um")),
        ("blur along z", tracked(HOLES, "60 um")),
        ("squares", stepped(SQUARES, "0.0")),
        ("squares off the rows", stepped(&moved, "0.0")),
        ("bars that leak", stepped(SQUARES, "0.2")),
        ("hexagonal lattice", stepped(hexagonal, "0.0")),
        ("pattern", stepped(pattern, "0.05")),
        ("detector mask alone", behind),
    ]
}

/// As `light_of_all_kinds_of_scenes_holds_the_tolerance`: the largest error is 0.5 tolerances
/// and the largest root mean square is 0.11. Every other scene against a third of the tolerance; all of them against a
/// sixth with `BEAMLET_ALL`.
#[test]
fn light_behind_apertures_holds_the_tolerance() {
    let engine = engine(Backend::Bvh);
    for (name, scene) in sample(scenes(), 2) {
        let (want, _) = run(&engine, &scene, TOLERANCE / amount(3.0, 6.0));
        let (got, record) = run(&engine, &scene, TOLERANCE);
        let [worst, rms] = apart(&got, &want);
        let told = record.sampling.expect("reported errors");
        println!(
            "measured apertures, {name}: worst {worst:.1e}, rms {rms:.1e}, told {:.1e}, {} rays",
            told.worst_error, record.tally.patch_rays
        );
        assert!(worst < 2.5 * TOLERANCE && rms < 0.25 * TOLERANCE, "{name}: {worst} {rms}");
        assert!(told.worst_error > 0.0 && told.worst_error <= TOLERANCE, "{name}: {told:?}");
        assert_eq!(told.beyond_tolerance, 0, "{name}");
    }
}

/// A box of dense matter behind round apertures, whose lid is seen at grazing incidence over 1e-4 of a row.
const LID: &str = "[source]\ndistance = \"150.77 mm\"\nspot = [\"11 um\", \"8.3 um\"]\nenergy = \"22 keV\"\n\
     [detector]\ndistance = \"433.38 mm\"\npixels = [4, 3]\npitch = [\"77.76 um\", \"52.06 um\"]\n\
     [sample_mask]\ndistance = \"143.21 mm\"\nmaterial = \"lead\"\nthickness = \"158 um\"\n\
     shape = \"round\"\naperture = \"18.29 um\"\naperture_z = \"7.068 um\"\nlattice = \"hexagonal\"\n\
     period_z = \"11.685 um\"\noffset_z = \"3.861 um\"\n\
     [scan]\nmask_offsets = [[\"-11.165 um\", \"1.504 um\"], [\"6.95 um\", \"-4.91 um\"]]\n\
     angles = [\"-2.4397456947 rad\"]\n\
     [materials.dense]\nmu = \"41201.97 1/m\"\ndelta = 7.48e-7\n\
     [[object]]\nname = \"box\"\nmaterial = \"dense\"\ncenter = false\n\
     shape = { box = { size = [\"3.94 um\", \"12.423 um\", \"28.065 um\"] } }\n\
     rotate = [{ axis = [1, 0, 0], angle = \"90 deg\" }]\n\
     position = [\"42.633 um\", \"-38.839 um\", \"-11.844 um\"]\n";

/// No line beside a lid gets the landing of light beyond it: slopes over whole cells would take 5e-3 of a pixel. Lines
/// are 1/65536 of a row or more apart, so that the light of the lid stays uncertain by 1.6e-5.
#[test]
fn light_beside_a_lid_behind_apertures_holds_every_tolerance() {
    let engine = engine(Backend::Bvh);
    let scene = Scene::from_toml(LID, Path::new(".")).expect("a scene");
    let (want, _) = run(&engine, &scene, 1e-6);
    for tolerance in [1e-3, 1e-4, 3e-5, 1e-5] {
        let (got, _) = run(&engine, &scene, tolerance);
        let [worst, _] = apart(&got, &want);
        println!("measured lid: {worst:.1e} at {tolerance:.1e}");
        assert!(worst < f64::max(tolerance, 2e-5), "{worst} at {tolerance}");
    }
}

/// Scenes that determinism.rs cuts: apertures with a blur along z, and others under a tube.
pub(super) fn cut_scenes() -> [Scene; 2] {
    let mut spectrum = stepped(SQUARES, "0.1");
    spectrum.source.beam = tube(60.0, 2);
    spectrum.detector.pixels = [3, 4];
    [tracked(HOLES, "60 um"), spectrum]
}

/// The sum over runs at each energy: of two at a third of the tolerance; of three at a sixth with `BEAMLET_ALL`.
#[test]
fn light_of_a_spectrum_behind_apertures_is_the_sum_over_its_energies() {
    let engine = engine(Backend::Bvh);
    let mut alone = tracked(HOLES, "10 um");
    alone.detector.pixels = amount([10, 7], [14, 9]);
    for (name, mut scene) in
        [("beam tracking", alone), ("bars that leak", stepped(SQUARES, "0.05"))]
    {
        let (nodes, finer) = amount((2, 3.0), (3, 6.0));
        scene.source.beam = tube(40.0, nodes);
        let sum = sum_over_energies(&engine, &scene, TOLERANCE / finer);
        let (got, _) = run(&engine, &scene, TOLERANCE);
        let [worst, rms] = apart(&got, &sum);
        println!("measured apertures, a tube, {name}: worst {worst:.1e}, rms {rms:.1e}");
        assert!(worst < 5.0 * TOLERANCE && rms < 0.5 * TOLERANCE, "{name}: {worst} {rms}");
    }
}

#[test]
fn exact_light_of_a_spectrum_behind_apertures_is_the_sum_over_its_energies() {
    let engine = engine(Backend::Bvh);
    let mut scene = stepped(SQUARES, "0.0");
    scene.source.beam = tube(40.0, amount(2, 3));
    scene.sampling.transport = Transport::Exact;
    let sum = sum_over_energies(&engine, &scene, TOLERANCE / amount(3.0, 6.0));
    let (got, _) = run(&engine, &scene, TOLERANCE);
    let [worst, rms] = apart(&got, &sum);
    println!("measured apertures, squares, exact: worst {worst:.1e}, rms {rms:.1e}");
    // As without a spectrum.
    assert!(worst < 2.5 * TOLERANCE && rms < 0.25 * TOLERANCE, "{worst} {rms}");
}

/// Light that leaks through bars is added at each mask step, whichever strip of the mask a row sees and however many
/// steps the device works on together: where it is too faint to be followed, in pixels as wide as a period, and in
/// narrower ones.
#[test]
fn faint_light_of_bars_is_that_of_each_step_alone() {
    let engine = engine(Backend::Bvh);
    let mut scene = tracked(&HOLES.replace("transmission = 0.0", "transmission = 6e-6"), "10 um");
    let steps = [[0.0, 0.0], [35e-6, 20e-6], [-50e-6, 45e-6], [10e-6, -60e-6]];
    for pitch in [120e-6 * 0.9 / 0.7, 30e-6] {
        scene.detector.pitch[0] = pitch;
        let mut flat = |steps: &[[f64; 2]]| {
            scene.scan.mask_offsets = steps.iter().map(|step| step[0]).collect();
            scene.scan.mask_offsets_z = steps.iter().map(|step| step[1]).collect();
            engine.simulate(&scene).expect("a stack").flat
        };
        let together = flat(&steps);
        let least = together.iter().copied().fold(f32::INFINITY, f32::min);
        assert!((5.9e-6..6.1e-6).contains(&least), "{pitch}: bars let {least:e} through");
        for (number, step) in steps.iter().enumerate() {
            let of_step = together.index_axis(ndarray::Axis(0), number);
            assert!(flat(&[*step]).iter().eq(of_step.iter()), "{pitch}: step {number}");
        }
    }
}
