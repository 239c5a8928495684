//! Error of δ of round bodies near the axis of rotation, whose rim lies in one place of its pixel in every view.

use super::shape::CurveGeometry;
use beamlet_model::optics::Optics;
use beamlet_model::scene::{Object, Scene, Shape, ShapeOrMesh};
use serde::Serialize;
use std::f64::consts::PI;

/// Error of δ from which on it is stated.
const LARGE: f64 = 0.02;
/// Distance from the axis, pixels, from which on the rim has another place in every view.
const OFF_AXIS: f64 = 3.0;
/// Part of the radius of a section that is its middle.
const MIDDLE: f64 = 0.8;
/// Rows and views that are looked at, at most.
const MOST: [usize; 2] = [24, 360];

/// Error of δ by the rim of a round body about the axis of rotation, relative to δ: least and greatest of its slices.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct RimError {
    /// Name of the object.
    pub object: String,
    /// Least relative error of δ.
    pub least: f64,
    /// Greatest relative error of δ.
    pub greatest: f64,
}

impl RimError {
    /// The range of some errors; `None` where none is large.
    fn of(object: &Object, errors: Vec<f64>) -> Option<Self> {
        let [least, greatest] = errors
            .into_iter()
            .fold([f64::INFINITY, f64::NEG_INFINITY], |[a, b], it| [a.min(it), b.max(it)]);
        let is_large = least.abs().max(greatest.abs()) >= LARGE && least <= greatest;
        is_large.then(|| Self { object: object.name.clone(), least, greatest })
    }

    /// The error and what mends it, in words.
    #[must_use]
    pub fn warning(&self) -> String {
        let (object, size) = (&self.object, self.size("its slices"));
        format!(
            "{object:?} is round about the axis of rotation: its rim has the same place between the apertures in every \
             view, and delta is {size}; stand it three pixels off the axis, or give scan.dithers over a pixel"
        )
    }

    /// The error of integrals of `phase_errors`, in words.
    #[must_use]
    pub fn of_phase(&self) -> String {
        format!("the phase of {:?} is {}", self.object, self.size("its rows and views"))
    }

    fn size(&self, places: &str) -> String {
        let [least, greatest] = [self.least, self.greatest].map(|it| 100.0 * it);
        match greatest - least < 1.0 {
            true => format!("about {least:+.0} % off"),
            false => format!("about {least:+.0} to {greatest:+.0} % off in {places}"),
        }
    }
}

/// Errors of 2 % or more of δ of the cylinders, tubes, cones, spheres and ellipsoids of a scan over angles without
/// dithers, by first order: a value of a pixel is the mean of the refraction angles that its aperture sees at the
/// offsets, weighted by the squared slopes of the curve of the masks. The sum of angle times place over the pixels is
/// the area of δ (docs/reconstruction.md). None without two masks, and behind masks with shifts.
#[must_use]
pub fn rim_errors(scene: &Scene) -> Vec<RimError> {
    let scan = &scene.scan;
    let has_pixels = scan.dithers.is_empty() && scene.group() == 1;
    if scan.angles.len() < 2 || !has_pixels || !scan.is_circle() {
        return Vec::new();
    }
    let Some(samples) = Samples::of(scene) else { return Vec::new() };
    let stated = scene
        .objects
        .iter()
        .filter_map(|object| RimError::of(object, Outline::of(object)?.errors(scene, &samples)));
    stated.collect()
}

/// Errors of 2 % or more of the integrals of refraction along rows (`--phase`) through the middle of the bodies of
/// [`rim_errors`] in a view, over δ times their chords, by the same first order. None without two masks, behind masks with
/// shifts, and with dithers.
#[must_use]
pub fn phase_errors(scene: &Scene) -> Vec<RimError> {
    if !scene.scan.dithers.is_empty() || scene.group() > 1 {
        return Vec::new();
    }
    let Some(samples) = Samples::of(scene) else { return Vec::new() };
    let stated = scene.objects.iter().filter_map(|object| {
        let errors = Outline::of(object)?.errors_of_phase(scene, &samples);
        RimError::of(object, errors)
    });
    stated.collect()
}

/// Places of the beam that give the value of a pixel, m at the axis from the centre of its part.
struct Samples {
    /// Ends of the places that an aperture sees, and their weight per length.
    parts: Vec<([f64; 2], f64)>,
    /// Size of a pixel, x and z, m at the axis.
    pitch: [f64; 2],
    pixels: [u32; 2],
    /// Displacement of the axis of rotation along x, m.
    axis: f64,
}

impl Samples {
    fn of(scene: &Scene) -> Option<Self> {
        let geometry = CurveGeometry::of(scene).ok()?;
        let curve = geometry.masks()?;
        let optics = Optics::of(scene);
        let mask = optics.sample_mask.as_ref()?;
        let at_axis = scene.axis_distance();
        let centre = scene.peak_offset()?;
        let offsets = &scene.scan.mask_offsets;
        let slopes = curve.evaluate(offsets.iter().map(|it| it - centre), curve.spread());
        let weights: Vec<f64> = slopes.iter().map(|[_, slope, _]| slope * slope).collect();
        let slits: Vec<[f64; 2]> = mask.openings(at_axis).ends().collect();
        let all = weights.iter().sum::<f64>() * slits.iter().map(|[a, b]| b - a).sum::<f64>();
        let parts = offsets.iter().zip(&weights).flat_map(|(offset, weight)| {
            let moved = offset * at_axis / mask.distance();
            slits.iter().map(move |ends| (ends.map(|end| end + moved), weight / all))
        });
        let scale = at_axis / scene.detector.distance;
        Some(Self {
            parts: parts.filter(|(_, weight)| *weight > 0.0).collect(),
            pitch: scene.detector.pitch.map(|pitch| pitch * scale),
            pixels: scene.detector.pixels,
            axis: scene.scan.axis.shift[0],
        })
    }

    /// Place of the middle of a column or row, m.
    fn place(&self, axis: usize, index: u32) -> f64 {
        (f64::from(index) + 0.5 - 0.5 * f64::from(self.pixels[axis])) * self.pitch[axis]
    }

    /// Places of the columns from a centre, and the angles of a section of these radii there, over -δ.
    fn angles(&self, radii: [f64; 2], centre: f64) -> impl Iterator<Item = [f64; 2]> {
        (0..self.pixels[0]).map(move |column| {
            let x = self.place(0, column) - self.axis - centre;
            let mean = self.parts.iter().map(|([low, high], weight)| {
                // The integral of the angle is the difference of the lengths, over δ.
                weight * (length(radii, x + low) - length(radii, x + high))
            });
            [x, mean.sum::<f64>()]
        })
    }

    /// Area of δ over its own of a section of these radii, outer and bore, about a place.
    fn area(&self, [outer, inner]: [f64; 2], centre: f64) -> f64 {
        let moment = self.angles([outer, inner], centre).map(|[x, mean]| x * mean);
        self.pitch[0] * moment.sum::<f64>() / (PI * (outer * outer - inner * inner))
    }

    /// Integral of the angles along the row over its own, in the middle of a section.
    fn phase(&self, radii: [f64; 2], centre: f64) -> f64 {
        let (mut before, mut sums) = (0.0, [0.0; 2]);
        for [x, mean] in self.angles(radii, centre) {
            let behind = before - self.pitch[0] * mean;
            if x.abs() < MIDDLE * radii[0] {
                sums = [sums[0] + f64::midpoint(before, behind), sums[1] + length(radii, x)];
            }
            before = behind;
        }
        sums[0] / sums[1]
    }
}

/// Length of the beam at a distance from the centre of a section of these radii, outer and bore.
fn length(radii: [f64; 2], x: f64) -> f64 {
    let [outer, inner] = radii.map(|radius| 2.0 * (radius * radius - x * x).max(0.0).sqrt());
    outer - inner
}

/// Round body about an upright axis.
struct Outline<'a> {
    shape: &'a Shape,
    scale: f64,
    position: [f64; 3],
}

impl<'a> Outline<'a> {
    /// The outline of an object; `None` for others.
    fn of(object: &'a Object) -> Option<Self> {
        let ShapeOrMesh::Shape(shape) = &object.geometry else { return None };
        let placement = &object.placement;
        let is_upright = placement
            .rotate
            .iter()
            .all(|([x, y, _], _)| x.to_bits() << 1 == 0 && y.to_bits() << 1 == 0);
        let is_round = match shape {
            Shape::Sphere { .. } => true,
            Shape::Ellipsoid { semi_axes: [x, y, _], .. } => {
                is_upright && x.to_bits() == y.to_bits()
            }
            Shape::Cylinder { .. } | Shape::Tube { .. } | Shape::Cone { .. } => is_upright,
            _ => false,
        };
        let is_one = object.instances.is_none();
        (is_round && is_one).then_some(Self {
            shape,
            scale: placement.scale,
            position: placement.position,
        })
    }

    /// Radii of the section at a height above the centre, outer and bore; `None` beyond the body.
    fn radii(&self, height: f64) -> Option<[f64; 2]> {
        let z = height / self.scale;
        let within = |height: f64| (z.abs() <= 0.5 * height).then_some(());
        let [outer, inner] = match self.shape {
            Shape::Cylinder { radius, height, .. } => within(*height).map(|()| [*radius, 0.0]),
            Shape::Tube { outer, inner, height, .. } => within(*height).map(|()| [*outer, *inner]),
            Shape::Cone { radius, top_radius, height, .. } => {
                within(*height).map(|()| [radius + (top_radius - radius) * (z / height + 0.5), 0.0])
            }
            Shape::Sphere { radius, .. } => Some([(radius * radius - z * z).max(0.0).sqrt(), 0.0]),
            Shape::Ellipsoid { semi_axes: [x, _, height], .. } => {
                Some([x * (1.0 - (z / height).powi(2)).max(0.0).sqrt(), 0.0])
            }
            _ => None,
        }?;
        (outer > 0.0).then_some([self.scale * outer, self.scale * inner])
    }

    /// Distance of the centre from the axis of rotation, m.
    fn distance(&self) -> f64 {
        self.position[0].hypot(self.position[1])
    }

    /// Places of the centre in some views, m at the axis. Bodies on the axis are alike in all views.
    fn centres(&self, scene: &Scene) -> Vec<f64> {
        let ([x, y, _], angles) = (self.position, &scene.scan.angles);
        let few = if self.distance() > 0.0 { MOST[1] } else { 1 };
        let views = angles.iter().step_by(angles.len().div_ceil(few).max(1));
        // The beam turns about the sample.
        views.map(|angle| x * libm::cos(*angle) + y * libm::sin(*angle)).collect()
    }

    /// Radii of the sections in some rows that have a rim of this kind: not within a pixel of the ends of the field, and not
    /// of few pixels.
    fn sections(&self, samples: &Samples) -> Vec<[f64; 2]> {
        let rows = samples.pixels[1];
        let step = (rows as usize).div_ceil(MOST[0]);
        let heights = (0..rows).step_by(step).map(|row| -samples.place(1, row) - self.position[2]);
        let mut sections: Vec<[f64; 2]> = heights.filter_map(|height| self.radii(height)).collect();
        sections.dedup();
        let half = 0.5 * f64::from(samples.pixels[0]) * samples.pitch[0];
        let [most, least] = [half - self.distance() - samples.pitch[0], 4.0 * samples.pitch[0]];
        sections.retain(|[outer, _]| *outer < most && *outer > least);
        sections
    }

    /// Relative errors of δ of the sections in some rows.
    fn errors(&self, scene: &Scene, samples: &Samples) -> Vec<f64> {
        if self.distance() >= OFF_AXIS * samples.pitch[0] {
            return Vec::new();
        }
        let views = self.centres(scene);
        let mean = |radii: [f64; 2]| {
            let of_view = views.iter().map(|centre| samples.area(radii, *centre));
            of_view.sum::<f64>() / views.len() as f64 - 1.0
        };
        self.sections(samples).into_iter().map(mean).collect()
    }

    /// Relative errors of the phase of the sections in some rows and views.
    fn errors_of_phase(&self, scene: &Scene, samples: &Samples) -> Vec<f64> {
        let views = self.centres(scene);
        let of = |radii: [f64; 2]| {
            views.iter().map(move |centre| samples.phase(radii, *centre) - 1.0).collect::<Vec<_>>()
        };
        self.sections(samples).into_iter().flat_map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cylinder of this radius, m, this far from the axis along x, m, behind the masks of a laboratory.
    fn errors(radius: f64, aside: f64, more: &str) -> Vec<RimError> {
        let text = format!(
            "[source]\ndistance = \"1.22 m\"\nspot = \"30 um\"\nenergy = \"28 keV\"\n\
             [sample_mask]\ndistance = \"1.2 m\"\naperture = \"20 um\"\ntransmission = 0\n\
             [detector_mask]\naperture = \"30 um\"\ntransmission = 0\n\
             [detector]\ndistance = \"1.8 m\"\npixels = [96, 3]\npitch = \"150 um\"\n\
             [scan]\nmask_offsets = {{ from = \"-30 um\", to = \"30 um\", count = 7 }}\n\
             angles = {{ from = \"0 deg\", to = \"360 deg\", count = 90 }}\n{more}\n\
             [[object]]\nname = \"rod\"\nmaterial = \"PMMA\"\nposition = [\"{aside} m\", \"0 m\", \"0 m\"]\n\
             shape = {{ cylinder = {{ radius = \"{radius} m\", height = \"4 mm\" }} }}\n"
        );
        rim_errors(&Scene::from_toml(&text, ".").expect("a scene"))
    }

    /// Areas of δ of simulated and retrieved rows (`exact-curve`), over pi R^2 delta. First order leaves 7 % of δ:
    /// at the rim itself light leaves the curve.
    #[test]
    fn errors_by_rims_are_those_of_simulated_rows() {
        let simulated =
            [(2.50, 0.192), (2.54, -0.108), (2.56, -0.182), (2.58, 0.073), (2.60, 0.158)];
        for (radius, truth) in simulated {
            let found = errors(radius * 1e-3, 0.0, "");
            let [error] = &found[..] else { panic!("{radius}: {found:?}") };
            assert!((error.least - truth).abs() < 0.07, "{radius} mm: {error:?} for {truth}");
            assert!(error.least.to_bits() == error.greatest.to_bits(), "{error:?}");
            assert!(error.warning().contains("scan.dithers"), "{}", error.warning());
        }
    }

    /// A rod of 25 pixels radius behind apertures that see 30 % of each pixel, simulated and retrieved with `--phase`: 0.890
    /// of δ times its chords within 0.8 of the radius. First order leaves 4 %: light at the rim leaves the curve.
    #[test]
    fn phases_miss_rims_as_simulated_rows_do() {
        let text = "[source]\ndistance = \"1.6 m\"\nspot = \"30 um\"\nenergy = \"20 keV\"\n\
            [sample_mask]\ndistance = \"1.55 m\"\ntransmission = 0\nprojected_aperture = \"15 um\"\n\
            [detector_mask]\ntransmission = 0\nprojected_aperture = \"15 um\"\n\
            [detector]\ndistance = \"2.0 m\"\npixels = [72, 1]\npitch = \"50 um\"\n\
            [scan]\nmask_offsets = { from = \"-16 um\", to = \"16 um\", count = 9 }\n\
            [[object]]\nname = \"rod\"\nmaterial = \"PMMA\"\n\
            shape = { cylinder = { radius = \"1 mm\", height = \"5 mm\" } }\n";
        let scene = Scene::from_toml(text, ".").expect("a scene");
        let [error] = &phase_errors(&scene)[..] else { panic!("no error") };
        assert!((error.least + 0.11).abs() < 0.04, "{error:?}");
        assert!(error.of_phase().contains("% off"), "{}", error.of_phase());
        let dithered = text.replace("[[object]]", "dithers = [\"0 um\", \"25 um\"]\n[[object]]");
        assert_eq!(phase_errors(&Scene::from_toml(&dithered, ".").expect("a scene")), []);
    }

    #[test]
    fn bodies_off_the_axis_and_dithers_have_none() {
        assert_eq!(errors(2.5e-3, 3.3 * 101.667e-6, ""), []);
        // Two pixels off the axis the rim has many places.
        let aside = errors(2.5e-3, 2.0 * 101.667e-6, "");
        assert!(aside.iter().all(|it| it.least.abs().max(it.greatest) < 0.06), "{aside:?}");
        assert_eq!(errors(2.5e-3, 0.0, "dithers = [\"0 um\", \"50 um\"]"), []);
    }
}
