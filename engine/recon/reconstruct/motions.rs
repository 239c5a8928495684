//! Motions of the sample in the views of a scan.

use super::geometry::ScanGeometry;
use beamlet_core::{Error, Result};
use beamlet_model::scene::Motion;
use std::f64::consts::TAU;

/// Largest difference of translations, m, and of directions that count as equal.
const EQUAL: f64 = 1e-10;

impl ScanGeometry {
    /// The same scan with a motion of the sample in each view, as [`ScanGeometry::motions`] has them.
    /// Motions that are turns about one upright axis through the origin of the volume, which stays at the
    /// height of the optical axis, become a circle: angles, and the place of the axis. With a lever arm
    /// the axis has to be at `source_distance`, since angles refer to this plane. Other motions give their
    /// mean displacement of the origin along x to `axis`.
    #[must_use]
    pub fn with_motions(mut self, motions: Vec<Motion>) -> Self {
        match circle(&motions) {
            Some((angles, [x, y])) if self.lever.is_infinite() || y.abs() < EQUAL => {
                self.angles = angles;
                self.axis += x;
                self.source_distance += y;
                self.motions = None;
            }
            _ => {
                let place = |motion: &Motion| motion.point([0.0; 3])[0];
                let mean = motions.iter().map(place).sum::<f64>() / motions.len().max(1) as f64;
                let back = Motion::translation([-mean, 0.0, 0.0]);
                self.axis += mean;
                self.motions = Some(motions.iter().map(|motion| motion.then(&back)).collect());
            }
        }
        self
    }

    /// Motion of the sample in a view, with the shift of the axis.
    pub(super) fn motion(&self, view: usize) -> Motion {
        let motion = match &self.motions {
            Some(motions) => motions[view],
            None => Motion::about_z(-self.angles[view]),
        };
        motion.then(&Motion::translation([self.axis, 0.0, 0.0]))
    }

    /// Points of the frame of the set-up where the sample sees them in a view.
    pub(super) fn in_volume(&self, view: usize, point: [f64; 3]) -> [f64; 3] {
        self.motion(view).inverse().point(point)
    }

    /// z of the lowest and the highest place that a row sees on the axis of rotation, m.
    pub(super) fn heights(&self) -> [f64; 2] {
        let shrink = 1.0 / self.magnification();
        let ends = [self.rows[self.rows.len() - 1], self.rows[0]].map(|row| row * shrink);
        if self.motions.is_none() {
            return ends;
        }
        let seen = (0..self.angles.len())
            .flat_map(|view| ends.map(|z| self.in_volume(view, [self.axis, 0.0, z])[2]));
        seen.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], z| [low.min(z), high.max(z)])
    }

    /// # Errors
    /// [`Error::Argument`] naming the scan, where its views are no circle. `what` needs one.
    pub(super) fn require_circle(&self, what: &str) -> Result<()> {
        match &self.motions {
            None => Ok(()),
            Some(motions) => Err(Error::argument(
                "geometry",
                name(motions),
                format!("views on a circle for {what}; cgls, sirt and bb take any motion"),
            )),
        }
    }
}

fn near(a: [f64; 3], b: [f64; 3]) -> bool {
    a.iter().zip(b).all(|(a, b)| (a - b).abs() < EQUAL)
}

const UP: [f64; 3] = [0.0, 0.0, 1.0];

/// Angles of the set-up and translation, where motions are turns about one upright axis.
fn circle(motions: &[Motion]) -> Option<(Vec<f64>, [f64; 2])> {
    let [x, y, _] = motions.first()?.point([0.0; 3]);
    let fits = |motion: &Motion| {
        near(motion.direction(UP), UP) && near(motion.point([0.0; 3]), [x, y, 0.0])
    };
    if !motions.iter().all(fits) {
        return None;
    }
    let angle = |motion: &Motion| {
        let [x, y, _] = motion.direction([1.0, 0.0, 0.0]);
        (-libm::atan2(y, x)).rem_euclid(TAU)
    };
    let mut angles: Vec<f64> = motions.iter().map(angle).collect();
    // Views begin behind the widest gap.
    let mut order = angles.clone();
    order.sort_by(f64::total_cmp);
    let next = |n: usize| match order.get(n + 1) {
        Some(next) => *next,
        None => order[0] + TAU,
    };
    let widest = (0..order.len())
        .max_by(|a, b| (next(*a) - order[*a]).total_cmp(&(next(*b) - order[*b])))?;
    let last = order[widest];
    angles.iter_mut().filter(|angle| **angle <= last).for_each(|angle| *angle += TAU);
    Some((angles, [x, y]))
}

/// Name of a scan that is no circle.
fn name(motions: &[Motion]) -> &'static str {
    let all = |same: &dyn Fn(&Motion) -> bool| motions.iter().all(same);
    let first = motions.first().copied().unwrap_or_default();
    let [axis, place] = [first.direction(UP), first.point([0.0; 3])];
    let moves =
        |side: usize| !all(&|motion| (motion.point([0.0; 3])[side] - place[side]).abs() < EQUAL);
    match () {
        () if !all(&|motion| near(motion.direction(UP), axis)) => {
            "motions of the sample with an axis of rotation that turns, too"
        }
        () if !near(axis, UP) => "a scan about a tilted axis",
        () if moves(2) => "a helical scan, whose sample moves along the axis of rotation",
        () if moves(0) || moves(1) => {
            "a cycloidal scan, whose sample moves across the axis of rotation"
        }
        () if place[2].abs() < EQUAL => "a scan whose axis is not at the distance of its lever arm",
        () => "a sample whose origin is beside the optical axis along z",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(motions: Vec<Motion>) -> ScanGeometry {
        let places = |n: i32| (0..n).map(|n| f64::from(n) * 1e-4).collect::<Vec<_>>();
        let rows = places(4).into_iter().rev().collect();
        ScanGeometry::new([0.1, 0.2], places(8), rows, vec![0.0; motions.len()])
            .with_motions(motions)
    }

    fn turns(moved: impl Fn(f64) -> Motion) -> Vec<Motion> {
        (0..12).map(|n| 0.5 * f64::from(n)).map(|a| Motion::about_z(-a).then(&moved(a))).collect()
    }

    #[test]
    fn turns_about_one_upright_axis_are_a_circle() {
        let by = [1e-3, 2e-3, 0.0];
        let made = scan(turns(|_| Motion::translation(by)));
        assert_eq!(made.motions, None);
        let found = [made.axis, made.source_distance, 0.0];
        assert!(near(found, [1e-3, 0.102, 0.0]), "{found:?}");
        for (n, pair) in made.angles.windows(2).enumerate() {
            assert!((pair[1] - pair[0] - 0.5).abs() < 1e-12, "{n}: {:?}", made.angles);
        }
        assert!(made.require_circle("fbp").is_ok());
    }

    #[test]
    fn other_motions_have_names() {
        let tilt = Motion::about([1.0, 0.0, 0.0], 0.1).unwrap();
        for (moved, word) in [
            (turns(|a| Motion::translation([0.0, 0.0, a * 1e-3])), "helical"),
            (turns(|a| Motion::translation([a * 1e-3, 0.0, 0.0])), "cycloidal"),
            (turns(|_| tilt), "tilted axis"),
            (turns(|_| Motion::translation([0.0, 0.0, 1e-3])), "along z"),
            (turns(|a| Motion::about([1.0, 0.0, 0.0], 0.1 * a).unwrap()), "that turns"),
        ] {
            let message = scan(moved).require_circle("fbp").unwrap_err().to_string();
            assert!(message.contains(word) && message.contains("cgls"), "{message}");
        }
    }
}
