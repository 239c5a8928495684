//! Every design of docs/designs.md with a retrieval: a wedge, a sphere and a fibre behind a plate, simulated and
//! retrieved, and the share of noisy values within their uncertainty.

use crate::groups::retrieve;
use crate::reference::draws::Draws;
use crate::support::{engine, sample};
use beamlet::Backend;
use beamlet::retrieve::{Method, RetrieveOptions, RetrievedArrays};
use beamlet::scene::Scene;
use ndarray::{Array4, Axis};
use std::fmt::Write;

/// Decrement of the wedge, the sphere and the fibre, which do not absorb.
const DELTA: f64 = 5e-7;
/// Change of the wedge's thickness per length, along x and z.
const SLOPES: [f64; 2] = [0.6, -0.8];
/// Transmission of the plate.
const TRANSMISSION: f64 = 0.8;
/// Angle of the fibre from the z axis about +y.
const TURN: f64 = 30.0;
/// Magnification of the sample on the detector: 1.5 m over 1 m.
const MAGNIFICATION: f64 = 1.5;
/// Images with an uncertainty.
const CONTRASTS: [&str; 6] =
    ["transmission", "refraction", "refraction_z", "dark_field", "dark_field_z", "dark_field_xz"];
/// Photons of an open pixel.
const PHOTONS: f64 = 200_000.0;

/// Steps of the sample mask.
#[derive(Clone, Copy, PartialEq)]
enum Steps {
    /// One exposure.
    None,
    /// This number of steps along x, and the outermost, um.
    Line(u32, f64),
    /// This number of steps along x and along z, and their distance, um; the first at this multiple of it.
    Grid(u32, f64, f64),
}

impl Steps {
    fn text(self) -> String {
        match self {
            Self::None => String::new(),
            Self::Line(count, half) => format!(
                "[scan]\nmask_offsets = {{ from = \"-{half} um\", to = \"{half} um\", count = {count} }}\n"
            ),
            Self::Grid(count, step, first) => {
                let at = |index: u32| (f64::from(index) + first) * step;
                let pair = |n: u32| format!("[\"{} um\", \"{} um\"]", at(n % count), at(n / count));
                let pairs: Vec<String> = (0..count * count).map(pair).collect();
                format!("[scan]\nmask_offsets = [{}]\n", pairs.join(", "))
            }
        }
    }
}

/// A set-up with its retrieval.
struct Design {
    name: &'static str,
    masks: &'static str,
    steps: Steps,
    pixels: [u32; 2],
    /// Width and height of a pixel, um.
    pitch: f64,
    method: Method,
    /// Draws of the noise.
    draws: u64,
}

fn designs() -> Vec<Design> {
    use Method::{Beamlet, ExactCurve, Moments};
    use Steps::{Grid, Line, None};
    let line = Line(9, 24.0);
    let of = |name, masks, steps, (columns, rows, pitch), method, draws| {
        let pixels = [columns, rows];
        Design { name, masks, steps, pixels, pitch, method, draws }
    };
    let two = (48, 3, 150.0);
    let plane = (36, 14, 100.0);
    let pixels = (36, 8, 75.0);
    vec![
        of("slits, 2 pixels a period", TRACKED, None, (96, 3, 75.0), Beamlet, 6),
        of("two masks", TWO, line, two, ExactCurve, 6),
        of("several slits", SEVERAL, Line(19, 27.0), two, Moments, 6),
        of("asymmetric, one exposure", ASYMMETRIC, None, (240, 1, 150.0), ExactCurve, 12),
        of("squares, hexagonal", SQUARES_HEXAGONAL, Grid(5, 9.0, -2.0), plane, ExactCurve, 2),
        of("skipped", SKIPPED, line, (96, 3, 75.0), ExactCurve, 6),
        of("taper and substrate", TAPERED, line, two, ExactCurve, 6),
        of("layers", LAYERED, line, two, ExactCurve, 6),
        of(
            "squares, steps over a period",
            STEPPED,
            Grid(6, 95.0 / 6.0, -2.5),
            pixels,
            ExactCurve,
            1,
        ),
        of("slits, 10 pixels a period", TRACKED, None, (240, 1, 15.0), Beamlet, 18),
        of("squares in two masks", SQUARES, Grid(5, 9.0, -2.0), plane, ExactCurve, 2),
        of("pattern, steps over a period", CODED, Grid(6, 75.0 / 6.0, 0.0), pixels, ExactCurve, 1),
    ]
}

const TWO: &str = "[sample_mask]\ndistance = \"0.95 m\"\nprojected_aperture = \"30 um\"\ntransmission = 0.0\n\
    [detector_mask]\naperture = \"30 um\"\ntransmission = 0.0\n";
const SEVERAL: &str = "[sample_mask]\ndistance = \"0.95 m\"\napertures = [[\"-9 um\", \"-3 um\"], [\"3 um\", \"9 um\"]]\n\
    transmission = 0.0\n[detector_mask]\naperture = \"30 um\"\ntransmission = 0.0\n";
const ASYMMETRIC: &str = "[sample_mask]\ndistance = \"0.95 m\"\nprojected_aperture = \"30 um\"\ntransmission = 0.0\n\
    shifts = [\"-20 um\", \"-10 um\", \"0 um\", \"10 um\", \"20 um\"]\n\
    [detector_mask]\naperture = \"30 um\"\ntransmission = 0.0\n";
const SKIPPED: &str = "[sample_mask]\ndistance = \"0.95 m\"\nperiod = \"95 um\"\nprojected_aperture = \"30 um\"\n\
    transmission = 0.0\noffset = \"23.75 um\"\n[detector_mask]\nperiod = \"150 um\"\naperture = \"30 um\"\n\
    transmission = 0.0\noffset = \"37.5 um\"\n";
const TAPERED: &str = "[sample_mask]\ndistance = \"0.95 m\"\nmaterial = \"gold\"\nthickness = \"100 um\"\n\
    aperture = \"20 um\"\ntaper = \"1 deg\"\nsubstrate = { material = \"silicon\", thickness = \"300 um\" }\n\
    [detector_mask]\naperture = \"30 um\"\ntransmission = 0.0\n";
const LAYERED: &str = "[sample_mask]\ndistance = \"0.95 m\"\naperture = \"20 um\"\n\
    layers = [{ material = \"gold\", thickness = \"40 um\" }, { material = \"silicon\", thickness = \"100 um\" }]\n\
    [detector_mask]\naperture = \"30 um\"\ntransmission = 0.0\n";
const TRACKED: &str = "[sample_mask]\ndistance = \"0.95 m\"\nperiod = \"95 um\"\naperture = \"30 um\"\ntransmission = 0.0\n";
const SQUARES: &str = "[sample_mask]\ndistance = \"0.95 m\"\nprojected_aperture = \"30 um\"\naperture_z = \"21 um\"\n\
    transmission = 0.0\n[detector_mask]\naperture = \"28 um\"\naperture_z = \"30 um\"\ntransmission = 0.0\n";
const ALONE: &str = "[sample_mask]\ndistance = \"0.95 m\"\nperiod = \"38 um\"\nshape = \"rectangle\"\naperture = \"16 um\"\n\
    aperture_z = \"20 um\"\ntransmission = 0.0\n";
const SQUARES_HEXAGONAL: &str = "[sample_mask]\ndistance = \"0.95 m\"\nprojected_aperture = \"30 um\"\naperture_z = \"21 um\"\n\
    lattice = \"hexagonal\"\nperiod_z = \"63.333333333333 um\"\ntransmission = 0.0\n\
    [detector_mask]\naperture = \"28 um\"\naperture_z = \"30 um\"\nlattice = \"hexagonal\"\nperiod_z = \"100 um\"\n\
    transmission = 0.0\n";
/// Before pixels of half a period.
const STEPPED: &str = "[sample_mask]\ndistance = \"0.95 m\"\nperiod = \"95 um\"\naperture = \"40 um\"\naperture_z = \"40 um\"\n\
    transmission = 0.0\n";
/// Before pixels of 47.5 um in its plane.
const CODED: &str = "[sample_mask]\ndistance = \"0.95 m\"\npattern = [\"110\", \"001\", \"010\"]\n\
    pattern_pixel = \"25 um\"\ntransmission = 0.1\n";

impl Design {
    /// True for the rows whose apertures lie before borders of pixels: of a hexagonal lattice before an even number of
    /// rows the one above the axis has the places of a rectangular one.
    fn is_between(&self, row: usize) -> bool {
        let above = self.pixels[1] as usize / 2 - 1;
        self.masks.contains("hexagonal") && above.abs_diff(row) % 2 == 1
    }

    fn bodies(&self) -> Bodies {
        let field = f64::from(self.pixels[0]) * self.pitch * 1e-6 / MAGNIFICATION;
        // Angles vary by more over a pixel than over an aperture.
        Bodies { field, inner: if self.has_pixels() { 0.5 } else { 0.65 } }
    }

    /// Largest error of transmission and angles: behind a pattern without symmetry the change of an angle over a pixel
    /// enters the other angle as well.
    fn limit(&self) -> f64 {
        if self.masks.contains("pattern") { 0.02 } else { 0.01 }
    }

    /// Number of the directions in which angles are retrieved.
    fn directions(&self) -> usize {
        if matches!(self.steps, Steps::Grid(..)) { 2 } else { 1 }
    }

    /// True if pixels take the place of a detector mask in a scan.
    fn has_pixels(&self) -> bool {
        matches!(self.steps, Steps::Grid(..)) && !self.masks.contains("[detector_mask]")
    }

    fn scene(&self) -> Scene {
        let [columns, rows] = self.pixels;
        // Steps before pixels are at most twice the deviation of the blur: both borders of a pixel count alike.
        let spot = if self.has_pixels() { 60 } else { 20 };
        let text = format!(
            "[source]\ndistance = \"1 m\"\nspot = [\"{spot} um\", \"{spot} um\"]\nenergy = \"20 keV\"\n{}{}\
             [detector]\ndistance = \"1.5 m\"\npixels = [{columns}, {rows}]\npitch = \"{} um\"\n\
             [sampling]\ntolerance = 1e-4\nangle_tolerance = \"5 nrad\"\n{}",
            self.masks,
            self.steps.text(),
            self.pitch,
            self.bodies().text()
        );
        Scene::from_toml(&text, ".").unwrap_or_else(|error| panic!("{}: {error}", self.name))
    }
}

/// A wedge, a sphere and a fibre side by side over a field of view.
struct Bodies {
    /// Width of the field of view in the plane of the sample, m.
    field: f64,
    /// Part of the radius within which angles are compared.
    inner: f64,
}

impl Bodies {
    fn radius(&self) -> f64 {
        self.field / 7.0
    }

    /// Half the side of the wedge.
    fn half(&self) -> f64 {
        self.field / 9.0
    }

    fn text(&self) -> String {
        let mm = 1e3;
        let (half, radius, third) = (self.half() * mm, self.radius() * mm, self.field / 3.0 * mm);
        // A turn about +y moves +x towards -z.
        let turn = -SLOPES[1].atan2(SLOPES[0]).to_degrees();
        let mu = -TRANSMISSION.ln() / 0.1;
        format!(
            "[[object]]\nname = \"wedge\"\nmaterial = \"light\"\nshape = {{ extrusion = {{ points = \
             [[\"{} mm\", \"0 mm\"], [\"{half} mm\", \"0 mm\"], [\"{half} mm\", \"{} mm\"], [\"{} mm\", \"{} mm\"]], \
             height = \"{} mm\" }} }}\nrotate = [{{ axis = [0, 1, 0], angle = \"{turn} deg\" }}]\n\
             position = [\"{} mm\", \"{} mm\", \"0 mm\"]\n\
             [[object]]\nname = \"sphere\"\nmaterial = \"light\"\nshape = {{ sphere = {{ radius = \"{radius} mm\" }} }}\n\
             [[object]]\nname = \"fibre\"\nmaterial = \"light\"\n\
             shape = {{ cylinder = {{ radius = \"{radius} mm\", height = \"{} mm\" }} }}\n\
             rotate = [{{ axis = [0, 1, 0], angle = \"{TURN} deg\" }}]\nposition = [\"{third} mm\", \"0 mm\", \"0 mm\"]\n\
             [[object]]\nname = \"plate\"\nmaterial = \"dark\"\nshape = {{ box = {{ size = [\"{} mm\", \"1 mm\", \"{} mm\"] }} }}\n\
             position = [\"0 mm\", \"10 mm\", \"0 mm\"]\n\
             [materials.light]\nmu = \"0 /cm\"\ndelta = {DELTA:e}\n[materials.dark]\nmu = \"{mu} /cm\"\ndelta = 0.0\n",
            -half,
            2.2 * half,
            -half,
            0.2 * half,
            2.0 * half,
            -third,
            -half,
            12.0 * radius,
            9.0 * third,
            9.0 * third,
        )
    }

    /// Refraction along x and z at a place in the plane of the sample, by line integrals, and the body there; `None`
    /// near the edge of a body.
    fn at(&self, [x, z]: [f64; 2]) -> Option<(usize, [f64; 2])> {
        let (radius, third) = (self.radius(), self.field / 3.0);
        let mut found = (3, [0.0; 2]);
        // The wedge, along its slope and across it.
        let [u, v] = {
            let x = x + third;
            [x * SLOPES[0] + z * SLOPES[1], z * SLOPES[0] - x * SLOPES[1]]
        };
        match u.abs().max(v.abs()) / self.half() {
            ..0.75 => found = (0, SLOPES.map(|slope| -DELTA * slope)),
            1.25.. => {}
            _ => return None,
        }
        let round = |distance: f64| 2.0 * DELTA / (radius * radius - distance * distance).sqrt();
        match x.hypot(z) / radius {
            part if part < self.inner => found = (1, [x, z].map(|at| at * round(x.hypot(z)))),
            1.25.. => {}
            _ => return None,
        }
        let (sin, cos) = TURN.to_radians().sin_cos();
        let across = (x - third) * cos - z * sin;
        match across.abs() / radius {
            part if part < self.inner => {
                found = (2, [cos, -sin].map(|part| part * across * round(across)))
            }
            1.25.. => {}
            _ => return None,
        }
        Some(found)
    }
}

/// Place of a value of the images on the detector.
fn place(design: &Design, found: &RetrievedArrays, [row, column]: [usize; 2]) -> [f64; 2] {
    let image = |name: &str| f64::from(found.images[name][[0, row, column]]);
    if design.steps == Steps::None && found.images.contains_key("flat_centre_z") {
        return [image("flat_centre"), image("flat_centre_z")];
    }
    let rows = f64::from(design.pixels[1]);
    [found.record.columns_m[column], (rows / 2.0 - 0.5 - row as f64) * design.pitch * 1e-6]
}

/// Body and angles that a value of the images has, means over the light that determines the angles along x and z.
fn truth(design: &Design, found: &RetrievedArrays, at: [usize; 2]) -> Option<(usize, [f64; 2])> {
    let bodies = design.bodies();
    let centre = place(design, found, at);
    let is_plane = matches!(design.steps, Steps::Grid(..));
    let mean = |axis: usize| -> Option<(usize, f64)> {
        // Offsets from the centre in pixels, across and along the axis.
        let offsets: &[[f64; 2]] = match axis {
            // A pixel that is the analyser sees the displacement of light at its borders, along the whole of them.
            _ if design.has_pixels() => {
                const GAUSS: f64 = 0.288_675;
                &[[-0.5, -GAUSS], [-0.5, GAUSS], [0.5, -GAUSS], [0.5, GAUSS]]
            }
            // Apertures before the border of two pixels: two halves, whose middles are 0.07 pixels within.
            0 if is_plane && design.is_between(at[0]) => &[[-0.43, 0.0], [0.43, 0.0]],
            _ if is_plane && design.is_between(at[0]) => &[[0.0, -0.43], [0.0, 0.43]],
            _ => &[[0.0; 2]],
        };
        let mut sum = (0, 0.0);
        for [along, across] in offsets {
            let offset = if axis == 0 { [along, across] } else { [across, along] };
            let at = [0, 1].map(|k| (centre[k] + offset[k] * design.pitch * 1e-6) / MAGNIFICATION);
            let (body, angles) = bodies.at(at)?;
            sum = (body, sum.1 + angles[axis] / offsets.len() as f64);
        }
        Some(sum)
    };
    let ((body, x), (_, z)) = (mean(0)?, mean(1)?);
    (body < 3).then_some((body, [x, z]))
}

/// Errors of the transmission, and of the angles over the largest one of a body, largest of each body; and the number
/// of values.
fn errors(design: &Design, found: &RetrievedArrays) -> [([f64; 2], usize); 3] {
    let mut all = [([0.0_f64; 2], 0); 3];
    let flags = &found.images["flags"];
    let inner = design.bodies().inner;
    let largest = 2.0 * DELTA * inner / (1.0 - inner * inner).sqrt();
    for ((_, row, column), flag) in flags.indexed_iter() {
        let at = [row, column];
        let image =
            |name: &str| found.images.get(name).map(|image| f64::from(image[[0, row, column]]));
        let is_empty = image("transmission").is_some_and(f64::is_nan) && *flag == 0.0;
        let Some((body, angles)) = truth(design, found, at).filter(|_| !is_empty) else {
            continue;
        };
        let (worst, count) = &mut all[body];
        let mut take = |k: usize, error: f64| {
            worst[k] = worst[k].max(if error.is_nan() { f64::INFINITY } else { error.abs() })
        };
        take(0, image("transmission").unwrap() / TRANSMISSION - 1.0);
        let names = ["refraction", "refraction_z"];
        for (name, angle) in names.into_iter().zip(angles).take(design.directions()) {
            take(1, (image(name).unwrap() - angle) / largest);
        }
        *count += 1;
    }
    all
}

/// Shares of values with noise that lie within their uncertainty of the value without noise, by contrast.
fn coverage(
    design: &Design,
    scene: &Scene,
    frames: [&Array4<f64>; 2],
    truth: &RetrievedArrays,
) -> Vec<(&'static str, f64, usize)> {
    let mut draws = Draws(65);
    let options = RetrieveOptions::default().with_method(design.method).with_gain(1.0);
    let mut counts = CONTRASTS.map(|name| (name, [0_usize; 2]));
    for _ in 0..design.draws {
        let [flat, sample] = frames.map(|of| of.mapv(|light| draws.poisson(PHOTONS * light)));
        let found = retrieve(scene, &flat, &sample, &options).unwrap();
        for (name, [within, all]) in &mut counts {
            let (Some(values), Some(sigmas)) =
                (found.images.get(*name), found.images.get(&format!("{name}_sigma")))
            else {
                continue;
            };
            for ((value, sigma), want) in values.iter().zip(sigmas).zip(&truth.images[*name]) {
                let pull = f64::from(value - want) / f64::from(*sigma);
                if pull.is_finite() {
                    *within += usize::from(pull.abs() < 1.0);
                    *all += 1;
                }
            }
        }
    }
    // The dark field of one exposure of slits is not determined.
    for name in if design.directions() == 2 { &CONTRASTS[..3] } else { &CONTRASTS[..2] } {
        let (_, [_, all]) = counts.iter().find(|(of, _)| of == name).unwrap();
        assert!(*all > 100, "{}, {name}: {all} values", design.name);
    }
    let known = counts.into_iter().filter(|(_, [_, all])| *all > 0);
    known.map(|(name, [within, all])| (name, within as f64 / all as f64, all)).collect()
}

/// Beamlets, steps along x and z, and pixels in place of a detector mask; every design with `BEAMLET_ALL`. T within 1 %, and α
/// within 1 % of the largest angle, behind each body (2 % of a pattern); 68 % of the noisy values within their uncertainty,
/// to three deviations of a share of their number and 2 %.
#[test]
fn each_design_gives_a_wedge_a_sphere_and_a_fibre_within_1_percent() {
    let engine = engine(Backend::Bvh);
    let mut wrong = String::new();
    for design in sample(designs(), 4) {
        let scene = design.scene();
        let stacks = engine.simulate(&scene).unwrap();
        let flat = stacks.flat.mapv(f64::from).insert_axis(Axis(0));
        let sample = stacks.sample.mapv(f64::from);
        let options = RetrieveOptions::default().with_method(design.method);
        let found = match retrieve(&scene, &flat, &sample, &options) {
            Ok(found) => found,
            Err(error) => {
                let _ = writeln!(wrong, "{}: {error}", design.name);
                continue;
            }
        };
        let mut line = design.name.to_owned();
        let bodies = ["wedge", "sphere", "fibre"];
        for (body, ([t, alpha], count)) in bodies.into_iter().zip(errors(&design, &found)) {
            let _ = write!(line, " | {body} {:.2} {:.2} % of {count}", 100.0 * t, 100.0 * alpha);
            if count < 4 || t.max(alpha) > design.limit() {
                let _ = writeln!(wrong, "{}, {body}: {t} {alpha} of {count}", design.name);
            }
        }
        for (name, share, all) in coverage(&design, &scene, [&flat, &sample], &found) {
            let _ = write!(line, " | {name} {:.1} %", 100.0 * share);
            let allowed = 0.02 + 3.0 * (0.683 * 0.317 / all as f64).sqrt();
            if (share - 0.683).abs() > allowed {
                let _ = writeln!(wrong, "{}, {name}: {share} of {all}", design.name);
            }
        }
        println!("{line}");
    }
    assert!(wrong.is_empty(), "\n{wrong}");
}

/// Errors about set-ups without a valid retrieval state the missing part.
#[test]
fn designs_without_a_retrieval_are_refused_with_what_they_lack() {
    use Method::{ExactCurve, Gaussian};
    let detector_mask = &TWO[TWO.find("[detector_mask]").unwrap()..];
    let coded_detector = format!(
        "{}{}",
        ALONE,
        CODED.replace("[sample_mask]\ndistance = \"0.95 m\"", "[detector_mask]")
    );
    // Pixels that see different slits.
    let wide = SEVERAL.replace("apertures =", "period = \"130 um\"\napertures =");
    let [line, grid] = [Steps::Line(9, 24.0), Steps::Grid(3, 10.0, -1.0)];
    for (masks, steps, method, words) in [
        (detector_mask, Steps::None, Gaussian, ["sample_mask: found nothing", "needs both masks"]),
        (&wide, line, ExactCurve, ["sample_mask.apertures", "use gaussian"]),
        (CODED, line, ExactCurve, ["sample_mask.pattern", "steps along x and z over a period"]),
        (CODED, grid, Gaussian, ["sample_mask.pattern", "exact-curve"]),
        (&coded_detector, grid, ExactCurve, ["detector_mask.pattern", "a list in the sample mask"]),
        (STEPPED, grid, Gaussian, ["detector_mask: found nothing", "method exact-curve"]),
    ] {
        let text = format!(
            "[source]\ndistance = \"1 m\"\nspot = \"20 um\"\nenergy = \"20 keV\"\n{masks}{}\
             [detector]\ndistance = \"1.5 m\"\npixels = [4, 4]\npitch = \"100 um\"\n",
            steps.text()
        );
        let scene = Scene::from_toml(&text, ".").unwrap();
        let frames = Array4::ones((1, scene.scan.mask_offsets.len(), 4, 4));
        let options = RetrieveOptions::default().with_method(method);
        let error = retrieve(&scene, &frames, &frames, &options).unwrap_err().to_string();
        assert!(words.iter().all(|word| error.contains(word)), "{masks}: {error}");
    }
}
