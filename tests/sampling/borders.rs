//! Borders at which light changes, of pixels, rows and apertures, in scenes where an estimate may overlook them. Rays
//! alone (the device) and sums over facets (the host) overlook other ones: each is held against the other.

use crate::kinds::{apart, run, sum_over_energies};
use crate::support::{engine, sample};
use beamlet::Backend;
use beamlet::scene::Scene;

/// A box that turns hardly against rectangles: its faces throw light half a row away. Small pixels at a large
/// magnification.
const BOX: [&str; 2] = [
    "distance = \"151.179 mm\"\n[detector]\ndistance = \"500.897 mm\"\npixels = [3, 3]\n\
     pitch = [\"25.83 um\", \"46.709 um\"]\n\
     [sample_mask]\ndistance = \"150.928 mm\"\ntransmission = 0.1\naperture = \"2.0953 um\"\n\
     period = \"7.7829 um\"\noffset = \"-0.4052 um\"\n",
    "[[object]]\nname = \"box\"\n\
     shape = { box = { size = [\"6.2388 um\", \"5.538 um\", \"2.22565 um\"] } }\nmaterial = \"titanium\"\n\
     rotate = [{ axis = [0.83153, 0.4488, -0.32731], angle = \"0.0155072 rad\" }]\n\
     position = [\"-8.26123 um\", \"-2.10633 um\", \"13.38893 um\"]\n\
     [scan]\nangles = [\"-0.333515 rad\"]\n",
];
const ENDED: &str = "shape = \"rectangle\"\naperture_z = \"7.408 um\"\nperiod_z = \"14.2537 um\"\n\
    offset_z = \"-2.7207 um\"\n";
const STEPS: &str = "mask_offsets = [\"-2.59 um\", \"0 um\", \"2.59 um\"]\n";
const STEPS_ALONG_Z: &str = "mask_offsets = [[\"-2.5943 um\", \"-2.4855 um\"], \
    [\"0 um\", \"2.2827 um\"], [\"2.5943 um\", \"5.091 um\"]]\n";
/// A ball of few facets far before a detector, in whose mask a border of pixels lies in each aperture.
const BALL: [&str; 2] = [
    "distance = \"115.583 mm\"\n[detector]\ndistance = \"1.9834937 m\"\npixels = [4, 3]\npitch = \"68.2358 um\"\n\
     [detector_mask]\ndistance = \"1.9834473 m\"\nmaterial = \"gold\"\nthickness = \"92.78 um\"\n\
     aperture = \"40.323 um\"\nperiod = \"68.2342 um\"\noffset = \"31.448 um\"\n\
     [sample_mask]\ndistance = \"114.308666 mm\"\naperture = \"2 um\"\nperiod = \"3.932427 um\"\n\
     offset = \"1.65558 um\"\n",
    "[[object]]\nname = \"ball\"\nshape = { sphere = { radius = \"7.73946 um\", sides = 24 } }\n\
     material = \"copper\"\nrotate = [{ axis = [0, 0, 1], angle = \"2.4773 rad\" }]\n\
     position = [\"7.43922 um\", \"-1.63511 um\", \"1.36676 um\"]\n\
     [scan]\nangles = [\"-1.016124 rad\"]\n\
     mask_offsets = { from = \"-1.57297 um\", to = \"1.57297 um\", count = 5 }\n",
];
/// An upright prism that is turned so that rays cross its front and back edge apart: they are displaced by steps from 3 um
/// to one side over 0 to 3 um to the other, on a line that is steeper than a result may be.
const PRISM: &str = "[source]\ndistance = \"105.81 mm\"\nspot = \"0.30555 um\"\nenergy = \"53.6 keV\"\n\
    [detector]\ndistance = \"501.245 mm\"\npixels = [6, 2]\npitch = [\"10.0757 um\", \"18.65564 um\"]\n\
    [sample_mask]\ndistance = \"105.4585 mm\"\ntransmission = 0\nperiod = \"2.119867724649187 um\"\n\
    apertures = [[\"-0.662 um\", \"-0.017863 um\"], [\"0.27399 um\", \"0.662 um\"]]\n\
    [detector_mask]\ndistance = \"501.109 mm\"\ntransmission = 0\naperture = \"5.1147 um\"\n\
    offset = \"-2.0222 um\"\n\
    [scan]\nmask_offsets = [\"-1.0223 um\", \"-0.44184 um\", \"0.720317 um\", \"-0.87905 um\"]\n\
    angles = [\"-3.0998983651922365 rad\"]\n[materials.m]\nmu = \"1705 1/m\"\ndelta = 3.784e-6\n\
    [[object]]\nname = \"prism\"\nshape = { prism = { radius = \"1.654074 um\", height = \"11.4367 um\", \
    sides = 4 } }\nmaterial = \"m\"\nposition = [\"-3.4801836 um\", \"-6.1514943 um\", \"2.682687 um\"]\n";
/// A ball of few facets before pixels that the detector blurs, whose borders reach into wide apertures.
const BLURRED: &str = "[source]\ndistance = \"1.2 m\"\nenergy = \"20 keV\"\nspot = \"10 um\"\n\
    [detector]\ndistance = \"1.8 m\"\npixels = [6, 3]\npitch = \"75 um\"\n\
    blur = { sigma = [\"20 um\", \"20 um\"] }\n\
    [sample_mask]\ndistance = \"1.19 m\"\ntransmission = 0.0\naperture = \"20 um\"\n\
    period = \"49.58333 um\"\n\
    [detector_mask]\ndistance = \"1.79 m\"\ntransmission = 0.0\naperture = \"69 um\"\n\
    period = \"74.58333 um\"\n[scan]\nmask_offsets = [\"-8 um\", \"0 um\", \"8 um\"]\n\
    [[object]]\nname = \"ball\"\nshape = { sphere = { radius = \"80 um\", sides = 32 } }\n\
    material = \"PMMA\"\nposition = [\"11 um\", \"0 um\", \"7 um\"]\n";
const ENERGY: &str = "[source]\nenergy = \"28 keV\"\n";
const TUBE: &str = "[source]\nspectrum = { anode = \"tungsten\", kvp = \"46.574 kV\", nodes = 4, \
    anode_angle = \"0.355116 rad\", filters = [{ material = \"aluminium\", thickness = \"0.915932 mm\" }] }\n";
const SPOT: &str = "spot = \"1.6 um\"\n";
const TWO_PARTS: &str = "spot = { gaussians = [{ weight = 0.287, fwhm = [\"1.37988 um\", \"1.37988 um\"] }, \
    { weight = 0.713, fwhm = [\"1.60565 um\", \"2.32553 um\"] }] }\n";

fn scene(parts: &[&str]) -> Scene {
    Scene::from_toml(&parts.concat(), std::path::Path::new(".")).expect("a scene")
}

/// Energies of one cell have one displacement along z: with those of all energies in one, whatever they differ by, values
/// were 1e-3 off, with bars that leak and without (with `BEAMLET_ALL`).
#[test]
fn energies_that_refract_over_borders_of_rows_are_apart() {
    let engine = engine(Backend::Bvh);
    for leaks in sample(vec!["transmission = 0.324\n", "transmission = 0\n"], 2) {
        let scene = scene(&[TUBE, SPOT, BALL[0], leaks, BALL[1]]);
        let sum = sum_over_energies(&engine, &scene, 5e-5);
        let [worst, rms] = apart(&run(&engine, &scene, 1e-4).0, &sum);
        println!("measured borders, energies, {leaks:?}: worst {worst:.1e}, rms {rms:.1e}");
        assert!(worst < 2e-4 && rms < 8e-5, "{leaks}: {worst:e} {rms:e}");
    }
}

#[test]
fn light_at_borders_holds_the_tolerance() {
    let mean = &TUBE.replace("nodes = 4", "nodes = 1");
    let [point, opaque, leaks] =
        ["spot = \"0 um\"\n", "transmission = 0\n", "transmission = 0.324\n"];
    let cases = [
        ("parts of a spot", scene(&[mean, TWO_PARTS, BOX[0], BOX[1], STEPS]), 2e-4),
        ("energies", scene(&[TUBE, SPOT, BOX[0], BOX[1], STEPS]), 2e-4),
        ("ends along z", scene(&[mean, SPOT, BOX[0], ENDED, BOX[1], STEPS_ALONG_Z]), 2e-4),
        ("both", scene(&[TUBE, SPOT, BOX[0], ENDED, BOX[1], STEPS_ALONG_Z]), 2e-4),
        ("pixels in apertures", scene(&[ENERGY, point, BALL[0], opaque, BALL[1]]), 8e-4),
        ("borders that a detector blurs", scene(&[BLURRED]), 3e-4),
        ("steps on a line", scene(&[PRISM]), 2e-4),
        ("bars that leak", scene(&[TUBE, SPOT, BALL[0], leaks, BALL[1]]), 1e-3),
    ];
    let engine = engine(Backend::Bvh);
    for (name, scene, most) in cases {
        let runs = [1e-4, 1e-5].map(|tolerance| run(&engine, &scene, tolerance));
        let [worst, rms] = apart(&runs[0].0, &runs[1].0);
        let told = runs.each_ref().map(|it| it.1.sampling.expect("reported errors").worst_error);
        println!("measured borders, {name}: worst {worst:.1e}, rms {rms:.1e}, told {told:?}");
        assert!(worst < most, "{name}: {worst:e} of {most:e}");
    }
}
