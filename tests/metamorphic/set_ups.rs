//! Set-ups drawn from a seed: source, masks, detector and scan.

use super::draws::Draws;
use super::support::root;
use beamlet::scene::{
    Anode, ApertureLattice, ApertureShape, Beam, Blur, Detector, DetectorMode, Filter, MaskBody,
    MaskSpec, Rectangle, Scene, Source, SpectrumOrigin, SpectrumSpec, Spot, SpotPart,
};
use std::f64::consts::{FRAC_PI_2, PI};

/// A file of a spectrum with few rows.
const SPECTRUM: &str = "tests/metamorphic/spectrum.csv";

/// Space for the sample about the rotation centre, m.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Room {
    /// Width and height of the field of view at the rotation centre.
    pub(crate) view: [f64; 2],
    /// Half of the depth that the masks leave.
    pub(crate) depth: f64,
}

/// A scene without objects, and the space that it has for them.
pub(crate) fn set_up(draws: &mut Draws) -> (Scene, Room) {
    let magnification = draws.log_between(1.05, 20.0);
    let length = draws.log_between(0.3, 4.0);
    let source_distance = length / magnification;
    let lever = length - source_distance;
    let pixels = draws.pick([[6, 2], [4, 3], [5, 2], [8, 1], [3, 3]]);
    let pitch = draws.log_between(10e-6, 150e-6);
    let pitch = [pitch, if draws.chance(0.3) { pitch * draws.between(0.5, 2.0) } else { pitch }];
    let view = [0, 1].map(|it| f64::from(pixels[it]) * pitch[it] / magnification);
    let spot = [spot_width(draws), spot_width(draws)];
    // Wider spots leave nothing of a sample to be seen.
    let widest = draws.log_between(0.1, 1.5) * pitch[0] / (magnification - 1.0);
    let spot = spot.map(|it| it.min(widest));
    let mut source = Source::new(source_distance, spot, beam(draws));
    let mut aside = draws.aside();
    if aside.chance(0.2) {
        source.spot = two_gaussians(&mut aside, spot);
    }
    let mut scene = Scene::new(source, Detector::new(length, pixels, pitch));
    let depth = (2.0 * view[0]).min(0.4 * lever).min(0.4 * source_distance);
    let room = Room { view, depth };
    masks(draws, &mut scene, room);
    if draws.chance(0.06) {
        let sigma = [0, 1].map(|it| pitch[it] * draws.between(0.1, 0.6));
        scene.detector.blur = Some(Blur::Gaussian { sigma });
    }
    if draws.chance(0.2) {
        scene.detector.mode = DetectorMode::Integrating;
    }
    let angle = match draws.below(5) {
        0 => FRAC_PI_2,
        1 => draws.between(-0.02, 0.02),
        _ => draws.between(-PI, PI),
    };
    scene.scan.angles = vec![angle];
    scene.sampling.max_rays = 20_000;
    (scene, room)
}

fn spot_width(draws: &mut Draws) -> f64 {
    if draws.chance(0.15) { 0.0 } else { draws.between(2e-6, 90e-6) }
}

/// A narrow and a broad Gaussian about one centre, in either order.
fn two_gaussians(draws: &mut Draws, fwhm: [f64; 2]) -> Spot {
    let broad = [0, 1].map(|axis| (fwhm[axis] * draws.between(1.0, 3.0)).max(1e-6));
    let weight = draws.between(0.2, 0.8);
    let part = |weight, fwhm| SpotPart::new(weight, fwhm, [0.0; 2]);
    let mut parts = vec![part(weight, fwhm), part(1.0 - weight, broad)];
    if draws.chance(0.5) {
        parts.reverse();
    }
    Spot::gaussians(parts)
}

fn beam(draws: &mut Draws) -> Beam {
    if draws.chance(0.75) {
        return Beam::Energy(draws.between(20.0, 100.0));
    }
    let file = SpectrumOrigin::File { path: root().join(SPECTRUM) };
    if draws.chance(0.4) {
        return Beam::Spectrum(SpectrumSpec::new(file));
    }
    let tube = SpectrumOrigin::Tube {
        anode: Anode::Tungsten,
        kvp: draws.between(40.0, 110.0),
        anode_angle: draws.between(0.15, 0.4),
        inherent_filters: Vec::new(),
    };
    let filters = vec![Filter::new("aluminium", draws.between(0.5e-3, 3e-3))];
    Beam::Spectrum(SpectrumSpec::new(tube).with_filters(filters).with_nodes(4))
}

fn masks(draws: &mut Draws, scene: &mut Scene, room: Room) {
    let [with_sample_mask, with_detector_mask] =
        draws.pick([[false; 2], [true, false], [false, true], [true; 2], [true; 2], [true; 2]]);
    if with_sample_mask {
        let body = bars(draws, 0.3 * scene.source.distance);
        let nearest = room.depth + 0.5 * body.thickness() + 1e-4;
        let farthest = (0.5 * scene.source.distance).max(1.01 * nearest);
        let gap = draws.log_between(nearest, farthest);
        let mask = mask(draws, scene, scene.source.distance - gap, body);
        let steps = 3 + draws.below(3);
        let half = 0.5 * mask.period;
        scene.scan.mask_offsets = if draws.chance(0.5) {
            let step = mask.period / steps as f64;
            (0..steps).map(|it| (it as f64 + 0.5) * step - half).collect()
        } else {
            (0..steps).map(|_| draws.between(-half, half)).collect()
        };
        if let Some([_, period]) = mask.heights() {
            let mut aside = draws.aside();
            let offset = |_: &f64| aside.between(-0.5, 0.5) * period;
            scene.scan.mask_offsets_z = scene.scan.mask_offsets.iter().map(offset).collect();
        }
        scene.sample_mask = Some(mask);
    }
    if with_detector_mask {
        let lever = scene.detector.distance - scene.source.distance;
        let body = bars(draws, 0.3 * lever);
        let before = if draws.chance(0.7) { 0.0 } else { draws.between(0.0, 0.2 * lever) };
        let distance = scene.detector.distance - 0.5 * body.thickness() - before;
        scene.detector_mask = Some(mask(draws, scene, distance, body));
    }
}

fn bars(draws: &mut Draws, thickest: f64) -> MaskBody {
    match draws.below(4) {
        0 => MaskBody::Sheet { transmission: 0.0 },
        1 => MaskBody::Sheet { transmission: draws.between(0.02, 0.97) },
        _ => MaskBody::Bars {
            material: draws.pick(["gold", "tungsten", "lead"]).into(),
            thickness: draws.log_between(20e-6, 400e-6).min(thickest),
        },
    }
}

fn mask(draws: &mut Draws, scene: &Scene, distance: f64, body: MaskBody) -> MaskSpec {
    let one_in_a_pixel = scene.detector.pitch[0] * distance / scene.detector.distance;
    let factor = match draws.below(8) {
        0 => 2.0,
        1 => 0.5,
        2 => draws.between(0.6, 1.7),
        _ => 1.0,
    };
    let period = factor * one_in_a_pixel;
    let mut mask = MaskSpec::new(distance, period, period * draws.between(0.15, 0.8), body);
    if draws.chance(0.5) {
        mask.offset = draws.between(-0.5, 0.5) * period;
    }
    let mut aside = draws.aside();
    design(&mut aside, &mut mask);
    match mask.apertures.is_empty() && mask.shifts.is_empty() {
        true => {
            ended(&mut aside, mask, scene.detector.pitch[1] * distance / scene.detector.distance)
        }
        false => mask,
    }
}

/// Steepest light at the edge of a detector.
const STEEPEST: f64 = 4e-3;

/// In some of the masks apertures end along z: on a lattice, or rectangles of a list. `row`: a row of pixels on the mask.
fn ended(draws: &mut Draws, mask: MaskSpec, row: f64) -> MaskSpec {
    if !draws.chance(0.35) {
        return mask;
    }
    let period = row * draws.between(0.5, 1.6);
    let height = period * draws.between(0.2, 0.8);
    let offset_z = draws.between(-0.5, 0.5) * period;
    let listed = draws.chance(0.4) && matches!(mask.body, MaskBody::Sheet { .. });
    let shape = draws.pick([ApertureShape::Rectangle, ApertureShape::Round, ApertureShape::Cross]);
    let hexagonal = draws.chance(0.4);
    let least = [mask.aperture, mask.period - mask.aperture, height, period - height];
    let least = least.into_iter().fold(f64::INFINITY, f64::min);
    if STEEPEST * mask.body.thickness() > 0.3 * least {
        return mask;
    }
    let mut ended = if listed {
        // One in each quarter of a period.
        let rectangle = |quarter: [f64; 2]| {
            let half = [0.5 * mask.period, 0.5 * period];
            let size = half.map(|half| half * draws.between(0.2, 0.9));
            let mut centre = [0.0; 2];
            for axis in 0..2 {
                let free = 0.5 * (half[axis] - size[axis]);
                centre[axis] = quarter[axis] * 0.5 * half[axis] + draws.between(-free, free);
            }
            Rectangle { centre, size }
        };
        let quarters = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]];
        let lengths = [mask.period, period];
        mask.clone().with_rectangles(quarters.map(rectangle).to_vec(), lengths)
    } else {
        mask.with_heights(shape, height, period)
    };
    if hexagonal && !listed {
        ended.lattice = ApertureLattice::Hexagonal;
    }
    ended.offset_z = offset_z;
    ended
}

/// Two slits in a period, or slits of neighbouring periods that are displaced.
fn design(draws: &mut Draws, mask: &mut MaskSpec) {
    let bar = mask.period - mask.aperture;
    if draws.chance(0.15) {
        let parted = draws.between(0.1, 0.4) * bar;
        let cut = draws.between(0.25, 0.75) * mask.aperture;
        let low = -0.5 * (mask.aperture + parted);
        mask.apertures = vec![[low, low + cut], [low + cut + parted, low + mask.aperture + parted]];
        mask.aperture = cut.min(mask.aperture - cut);
    }
    if draws.chance(0.25) {
        let reach = if mask.apertures.is_empty() { 0.4 * bar } else { 0.2 * bar };
        mask.shifts = (0..2 + draws.below(3)).map(|_| draws.between(-reach, reach)).collect();
    }
}
