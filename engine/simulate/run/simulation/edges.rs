//! Error of edges off the rotation centre, by rays from points of the spot beside its centre: the
//! light of lines through the sample with them, and with the rays from the centre in their place.

mod light;

use super::Simulation;
use crate::run::edge_blur::{EdgeBlur, LightPath, Suspect, suspects};
use crate::trace::Tracer;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_core::numbers::{self, single};
use beamlet_geometry as geometry;
use beamlet_interface::{Ray, RayResult};
use light::{LitPoint, largest_error};

/// Objects and views that rays are traced through.
const MOST_SUSPECTS: usize = 4;
/// Places of their lines, share of their size across.
const LINES: [f64; 2] = [0.3, 0.7];
/// Points of the spot beside its centre, standard deviations: the first, and from one to the next.
const FIRST_POINT: f64 = -3.25;
const POINT_STEP: f64 = 0.5;
const POINTS: u32 = 14;
/// Rays to a window of a line before it is refined.
const RAYS_PER_WINDOW: f64 = 8.0;
/// Most rays of a line before it is refined, of each point of the spot.
const MOST_RAYS: u32 = 2048;
/// Times that an interval in which rays differ is halved, and its least width, m.
const HALVINGS: u32 = 12;
const LEAST_WIDTH: f64 = 20e-9;
/// Least difference of the light of two rays that differ, as a share.
const UNLIKE_LIGHT: f32 = 0.05;
/// Least distance of their landing points, as a share of a window.
const UNLIKE_LANDING: f64 = 0.25;

/// A line through the sample in the plane of the rotation centre.
struct Line {
    pose: u32,
    /// Along x (0) or z (1).
    axis: usize,
    /// Its ends, m.
    ends: [f64; 2],
    /// Its place along the other axis, m.
    at: f64,
}

/// Offset of a point of the spot, m, and its share of the light.
fn spot_points(sigma: f64) -> impl Iterator<Item = [f64; 2]> {
    (0..POINTS).map(move |index| {
        let t = FIRST_POINT + POINT_STEP * f64::from(index);
        let density = libm::exp(-0.5 * t * t) / (2.0 * std::f64::consts::PI).sqrt();
        [t * sigma, POINT_STEP * density]
    })
}

impl Simulation {
    /// The largest error that edges off the rotation centre leave in a recorded value: of opaque edges
    /// where that is within the tolerance, else by rays. `None` where there is no sample, or each ray
    /// draws its source point.
    ///
    /// # Errors
    /// As [`Simulation::run`].
    #[doc(hidden)]
    pub fn edge_blur(&self, cancel: &Cancel) -> Result<Option<EdgeBlur>> {
        let swept = geometry::swept(&self.scene, &self.sample);
        let mut suspects = suspects(&self.scene, &swept);
        let Some(Suspect { object, bound, y, .. }) = suspects.first().cloned() else {
            return Ok(None);
        };
        let mut largest = EdgeBlur { error: bound, traced: false, object, y };
        let tolerance = self.scene.sampling.tolerances().light;
        if bound <= tolerance {
            return Ok(Some(largest));
        }
        suspects.truncate(MOST_SUSPECTS);
        (largest.error, largest.traced) = (0.0, true);
        let paths = [0, 1].map(|axis| LightPath::new(&self.scene, axis));
        let mut tracer = self.tracer(self.start.backend, &self.alone)?;
        tracer.set_cancel(cancel.clone());
        for suspect in suspects.iter().filter(|suspect| suspect.bound > tolerance) {
            for line in self.lines(suspect, &paths) {
                let error = self.error_of_line(&mut tracer, &line, &paths[line.axis])?;
                if error > largest.error {
                    (largest.error, largest.y) = (error, suspect.y);
                    largest.object.clone_from(&suspect.object);
                }
            }
        }
        Ok(Some(largest))
    }

    /// Lines along both axes through the visible part of an object.
    fn lines(&self, suspect: &Suspect, paths: &[LightPath; 2]) -> Vec<Line> {
        let rotation = self.scene.source.distance;
        let detector = &self.scene.detector;
        let extents = [suspect.extent.x, suspect.extent.z];
        let seen = [0, 1].map(|axis| {
            let half = 0.5 * detector.size()[axis] * rotation / detector.distance;
            // As seen from the source, at the nearer and the farther end.
            let scales = suspect.extent.y.map(|y| rotation / (rotation + y));
            let all = extents[axis].iter().flat_map(|at| scales.map(|scale| at * scale));
            let [low, high] = all.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], at| {
                [low.min(at), high.max(at)]
            });
            [[low, high], [low.max(-half), high.min(half)]]
        });
        let mut lines = Vec::new();
        for axis in 0..2 {
            let [[low, high], [first, last]] = seen[axis];
            let [_, [near, far]] = seen[1 - axis];
            if last <= first || far <= near {
                continue;
            }
            let path = &paths[axis];
            let window = path.windows.period / (1.0 + path.lever);
            // What passes through the field along the slits has no edge there.
            let ends_inside = low >= first || high <= last;
            if axis == 1 && !ends_inside {
                continue;
            }
            let margin = window + 4.0 * path.sigma * suspect.y.abs() / rotation;
            let ends = [first - margin, last + margin];
            lines.extend(LINES.map(|share| Line {
                pose: suspect.pose,
                axis,
                ends,
                at: near + share * (far - near),
            }));
        }
        lines
    }

    /// Largest error of a recorded value of a line.
    fn error_of_line(&self, tracer: &mut Tracer, line: &Line, path: &LightPath) -> Result<f64> {
        let points: Vec<[f64; 2]> = spot_points(path.sigma).collect();
        let offsets: Vec<f64> =
            std::iter::once(0.0).chain(points.iter().map(|[offset, _]| *offset)).collect();
        let traced = self.trace_line(tracer, line, path, &offsets)?;
        let Some((centre, beside)) = traced.split_first() else { return Ok(0.0) };
        let steps = self.scene.scan.offsets_of(self.scene.scan.view_of(line.pose as usize));
        Ok(largest_error(path, steps, centre, points.iter().zip(beside)))
    }

    /// Rays along a line from each offset of the source, closer where they differ.
    fn trace_line(
        &self,
        tracer: &mut Tracer,
        line: &Line,
        path: &LightPath,
        offsets: &[f64],
    ) -> Result<Vec<Vec<LitPoint>>> {
        let width = line.ends[1] - line.ends[0];
        let window = path.windows.period / (1.0 + path.lever);
        let count = (RAYS_PER_WINDOW * width / window).ceil().clamp(8.0, f64::from(MOST_RAYS));
        let count = numbers::whole::<u32>(count);
        let even = (0..=count).map(|i| line.ends[0] + width * f64::from(i) / f64::from(count));
        let even: Vec<f64> = even.collect();
        let mut lines: Vec<Vec<(f64, RayResult)>> = vec![Vec::new(); offsets.len()];
        let mut wanted = vec![even; offsets.len()];
        let gap = single(self.detector.optics().gap());
        for _ in 0..=HALVINGS {
            let rays: Vec<Ray> = wanted
                .iter()
                .zip(offsets)
                .flat_map(|(places, offset)| places.iter().map(|x| ray(line, path, *x, *offset)))
                .collect();
            if rays.is_empty() {
                break;
            }
            let mut results = tracer.trace(&rays)?.into_iter();
            for (points, places) in lines.iter_mut().zip(&mut wanted) {
                points.extend(places.drain(..).zip(results.by_ref()));
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                let unlike = points.windows(2).filter(|pair| is_unlike(pair, line, path, gap));
                places.extend(unlike.map(|pair| 0.5 * (pair[0].0 + pair[1].0)));
            }
        }
        let lit = |(x, result): &(f64, RayResult)| LitPoint {
            x: *x,
            light: f64::from((-result.optical_depth).exp()),
            displacement: displacement(result, line, gap),
        };
        Ok(lines.iter().map(|points| points.iter().map(lit).collect()).collect())
    }
}

/// Displacement along a line on the plane of its windows, m.
fn displacement(result: &RayResult, line: &Line, gap: f32) -> f64 {
    match line.axis {
        0 => result.displacement_x.into(),
        _ => (result.displacement_z + gap * result.slope_z).into(),
    }
}

fn is_unlike(pair: &[(f64, RayResult)], line: &Line, path: &LightPath, gap: f32) -> bool {
    let [(x, a), (next, b)] = pair else { return false };
    let light = ((-a.optical_depth).exp() - (-b.optical_depth).exp()).abs();
    let landing = (displacement(a, line, gap) - displacement(b, line, gap)).abs();
    next - x > LEAST_WIDTH
        && (a.signature != b.signature
            || light > UNLIKE_LIGHT
            || landing > UNLIKE_LANDING * path.windows.width)
}

/// The ray through a place of a line from an offset of the source along it.
fn ray(line: &Line, path: &LightPath, place: f64, offset: f64) -> Ray {
    let own = [single(place), single((place - offset) / path.rotation)];
    let other = [single(line.at), single(line.at / path.rotation)];
    let [x, z] = if line.axis == 0 { [own, other] } else { [other, own] };
    Ray { x: x[0], z: z[0], slope_x: x[1], slope_z: z[1], pose: line.pose, key: 0 }
}
