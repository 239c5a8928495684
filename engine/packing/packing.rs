//! Packings: sizes of the bodies, the box that they are packed in, and which of them are kept.
//!
//! Discs and spheres are packed in a periodic box around the region, and those wholly inside the
//! region are kept. In the box no place differs from another, so the centres of bodies of one size
//! have the same density wherever such a body fits, up to the wall. Bodies added between hard walls
//! would crowd along them.

use glam::{DQuat, DVec3};

use super::periodic::{Packed, pack as pack_periodic};
use super::region::{Region, unit_ball};
use super::share::{self, Share};
use super::sorted::Cells;
use super::{InstanceTransform, fibres, refused};
use beamlet_core::random::Draws;
use beamlet_core::units::Dimension::Length;
use beamlet_core::watch::{LoadStep, Task};
use beamlet_core::{Error, Result};
use beamlet_model::scene::{
    Object, Packing, PackingAmount, PackingKind, Shape, ShapeOrMesh, limits,
};

/// Diameters farther than this from the median, in standard deviations of ln d, are drawn anew: the
/// largest has to fit into the region. It takes 0.05 % from the standard deviation.
const TRUNCATION: f64 = 4.0;
/// Least gap, m: well above what f64 loses in 10 m.
const LEAST_GAP: f64 = 1e-9;
/// Relative error of the fill.
const FILL_ERROR: f64 = 0.01;
/// Numbers of bodies up to this one are few.
const FEW: f64 = 500.0;
/// Most bodies in a box: in the region, its corners and the wall.
const MOST_IN_BOX: f64 = 2.5 * limits::INSTANCES as f64;

/// Share of the remaining progress that an attempt fills. About one packing in fifty needs a second
/// attempt.
const ATTEMPT: f64 = 0.98;

const SIZE: u8 = 0;

/// The packed bodies, in m.
#[derive(Debug, Clone, Copy)]
pub(super) struct Prototype {
    /// Nominal radius, which gives the volume.
    pub(crate) radius: f64,
    /// Radius of the farthest corner of a facet over the nominal one, at least 1.
    pub(crate) outer: f64,
    /// Length of a cylinder, 0 of a sphere.
    pub(crate) height: f64,
    /// Standard deviation of ln(diameter).
    pub(crate) spread: f64,
    /// Least distance of two surfaces, and of one from the wall.
    pub(crate) gap: f64,
}

impl Prototype {
    fn new(object: &Object, spec: &Packing, reach: f64) -> Option<Self> {
        let ShapeOrMesh::Shape(shape) = &object.geometry else { return None };
        let (radius, outer, height) = match *shape {
            Shape::Cylinder { radius, height, sides } => {
                (radius, sides.map_or(1.0, cylinder_corner), height)
            }
            Shape::Sphere { radius, sides } => (radius, sides.map_or(1.0, sphere_corner), 0.0),
            _ => return None,
        };
        // The device sees f32: two surfaces this far apart stay so when each coordinate is rounded, with
        // twice the distance that they need.
        let placement = &object.placement;
        let offset = placement.position.iter().fold(0.0_f64, |most, x| most.max(x.abs()));
        let resolved = 4.0 * f64::from(f32::EPSILON) * (reach + offset / placement.scale);
        let gap = spec.gap.max(LEAST_GAP / placement.scale).max(resolved);
        Some(Self { radius, outer, height, spread: spec.diameter_spread, gap })
    }

    /// Radius of the farthest corner of a body of this size.
    pub(super) fn outer_radius(&self, size: f64) -> f64 {
        self.radius * self.outer * size
    }

    /// Distance of a body's centre from the wall.
    fn margin(&self, size: f64) -> f64 {
        self.outer_radius(size) + self.gap
    }

    /// A diameter over the median, which is log-normal and truncated.
    pub(super) fn size(&self, draws: &mut Draws) -> f64 {
        if self.spread <= 0.0 {
            return 1.0;
        }
        loop {
            let deviation = draws.normal();
            if deviation.abs() <= TRUNCATION {
                return libm::exp(self.spread * deviation);
            }
        }
    }

    /// The largest of the sizes.
    pub(super) fn largest(&self) -> f64 {
        libm::exp(self.spread * TRUNCATION)
    }

    /// Mean of the size to this power.
    pub(super) fn mean_power(&self, power: f64) -> f64 {
        libm::exp(power * power * self.spread * self.spread / 2.0)
    }
}

/// Corner of the faceted cylinder over its radius: the facets keep the area of the section.
fn cylinder_corner(sides: u32) -> f64 {
    let step = std::f64::consts::TAU / f64::from(sides.max(3));
    (step / libm::sin(step)).sqrt()
}

/// Corner of the faceted sphere over its radius: the facets keep the volume. Between two latitudes
/// they are the frustum of a regular pyramid.
fn sphere_corner(sides: u32) -> f64 {
    let step = std::f64::consts::TAU / f64::from(sides.max(4));
    let area = f64::from(sides) / 2.0 * libm::sin(step);
    let bands = sides.max(4).div_ceil(2);
    let ring =
        |band: u32| libm::sincos(std::f64::consts::PI * (f64::from(band) / f64::from(bands) - 0.5));
    let frustum = |band: u32| {
        let ((z, r), (above, next)) = (ring(band), ring(band + 1));
        area * (above - z) * (r * r + r * next + next * next) / 3.0
    };
    libm::cbrt(unit_ball(3) / (0..bands).map(frustum).sum::<f64>())
}

/// Makes the packing of an object, whose key is `key`.
///
/// # Errors
/// [`Error::Scene`] where it cannot be made; [`Error::Memory`]; [`Error::Interrupted`].
pub(super) fn pack(
    key: &str,
    object: &Object,
    spec: &Packing,
    task: Task<'_>,
) -> Result<Vec<InstanceTransform>> {
    let solid = Region::solid(&spec.region);
    let reach = solid.half_sides::<3>().iter().fold(0.0_f64, |most, side| most.max(*side));
    let Some(body) = Prototype::new(object, spec, reach) else {
        let (found, allowed) = ("another shape", "a cylinder or a sphere");
        return Err(refused(key, "instances.packing", found.into(), allowed.into()));
    };
    let placed = |position: DVec3, scale: f64, scale_z: f64| InstanceTransform {
        scale,
        scale_z,
        rotation: DQuat::IDENTITY,
        position,
    };
    match spec.kind {
        PackingKind::RandomFibres => fibres::pack(key, &solid, &body, spec, task),
        PackingKind::Spheres => {
            let found = Filling::<3> { key, region: &solid, body, spec, task }.pack()?;
            Ok(found.into_iter().map(|(at, size)| placed(at.into(), size, size)).collect())
        }
        PackingKind::ParallelFibres => {
            let Some(section) = Region::cross_section(&spec.region, body.height) else {
                let found = Length.rounded(body.height);
                let allowed = "no more than the height of instances.region: fibres stay inside";
                return Err(refused(key, "shape.cylinder.height", found, allowed.into()));
            };
            let found = Filling::<2> { key, region: &section, body, spec, task }.pack()?;
            let upright =
                |([x, y], size): ([f64; 2], f64)| placed(DVec3::new(x, y, 0.0), size, 1.0);
            Ok(found.into_iter().map(upright).collect())
        }
    }
}

/// How much the region shall hold.
pub(super) struct Target {
    /// Volume of bodies, m3, or m2 across parallel fibres; without bound where their number is given.
    pub(crate) volume: f64,
    /// Number of bodies; of a volume, the mean.
    pub(crate) count: f64,
    is_count: bool,
}

impl Target {
    /// Target for bodies of `mean` volume in a region of `volume`.
    ///
    /// # Errors
    /// [`Error::Scene`] where there would be too many.
    pub(super) fn new(key: &str, amount: PackingAmount, volume: f64, mean: f64) -> Result<Self> {
        let target = match amount {
            PackingAmount::Count(count) => {
                Self { volume: f64::INFINITY, count: f64::from(count), is_count: true }
            }
            PackingAmount::Fill(fill) => {
                Self { volume: fill * volume, count: fill * volume / mean, is_count: false }
            }
        };
        let most = f64::from(limits::INSTANCES);
        if target.count > most {
            let (found, fill) = (format!("about {:.0} bodies", target.count), most * mean / volume);
            let allowed = format!("up to {most:.0}, a fill of {fill:.3}");
            return Err(refused(key, target.key(), found, allowed));
        }
        Ok(target)
    }

    const fn key(&self) -> &'static str {
        if self.is_count { "instances.count" } else { "instances.fill" }
    }

    /// How many of the bodies with these volumes, in their order, come nearest to the target; `None`
    /// where they are too few.
    fn needed(&self, volumes: impl Iterator<Item = f64>) -> Option<usize> {
        let (mut sum, mut taken) = (0.0, 0);
        for volume in volumes {
            if self.is_count && taken as f64 >= self.count {
                break;
            }
            if sum + volume > self.volume {
                let nearer = self.volume - sum > sum + volume - self.volume;
                return Some(taken + usize::from(nearer));
            }
            sum += volume;
            taken += 1;
        }
        (self.is_count && taken as f64 >= self.count).then_some(taken)
    }

    /// The share of the target that these bodies are.
    pub(super) fn share(&self, count: usize, volume: f64) -> f64 {
        if self.is_count { count as f64 / self.count } else { volume / self.volume }
    }

    /// The error of a region that holds only a share of the target.
    pub(super) fn unreached(&self, key: &str, spec: &Packing, share: f64) -> Error {
        let (found, reached) = match spec.amount {
            PackingAmount::Fill(fill) => (format!("{fill}"), format!("fill {:.3}", fill * share)),
            PackingAmount::Count(count) => (
                count.to_string(),
                format!("count {:.0}", (f64::from(count) * share + 1e-6).floor()),
            ),
        };
        let allowed = "a packing that fits the region without overlap: fewer or smaller bodies, or \
                       a larger region";
        let found = format!("{found}; the packing reached {reached}");
        refused(key, self.key(), found, allowed.into())
    }

    /// # Errors
    /// [`Error::Scene`] where whole bodies of this volume in all miss the fill by more than 1 %.
    pub(super) fn check(&self, key: &str, count: usize, volume: f64, region: f64) -> Result<()> {
        if self.is_count || (volume / self.volume - 1.0).abs() <= FILL_ERROR {
            return Ok(());
        }
        let found = format!(
            "{} with {count} whole bodies, which fill {}",
            self.volume / region,
            volume / region
        );
        let allowed = "a fill that a whole number of bodies reaches within 1 %; or count instead";
        Err(refused(key, self.key(), found, allowed.into()))
    }
}

/// Discs (D = 2) or spheres (D = 3) in a region.
struct Filling<'a, const D: usize> {
    key: &'a str,
    region: &'a Region,
    body: Prototype,
    spec: &'a Packing,
    task: Task<'a>,
}

impl<const D: usize> Filling<'_, D> {
    fn volume(&self, size: f64) -> f64 {
        let radius = self.body.radius * size;
        (0..D).fold(unit_ball(D), |volume, _| volume * radius)
    }

    /// Centres and sizes.
    fn pack(&self) -> Result<Vec<([f64; D], f64)>> {
        let (body, spec) = (&self.body, self.spec);
        let region = self.region.volume(0.0);
        let mean = self.volume(1.0) * body.mean_power(D as f64);
        let target = Target::new(self.key, spec.amount, region, mean)?;
        let largest = body.largest();
        if self.region.volume(body.margin(largest)) <= 0.0 {
            let found = format!(
                "bodies of up to {} in diameter with a gap of {}",
                Length.rounded(2.0 * body.outer_radius(largest)),
                Length.rounded(body.gap)
            );
            let allowed = "a region in which the largest body fits";
            return Err(refused(self.key, "instances.region", found, allowed.into()));
        }
        // Bodies have half the gap around them.
        let contact = |size: f64| body.outer_radius(size) + body.gap / 2.0;
        let least = Cells::<D>::least_side(2.0 * contact(largest));
        let half: [f64; D] = self.region.half_sides();
        let sides = half.map(|half| (2.0 * half).max(least));
        let mut best = 0.0_f64;
        self.task.begin(LoadStep::Packing, share::ALL)?;
        let mut left = Share::whole(self.task);
        for attempt in 0..self.attempts(&target) {
            let share = left.part([0.0, ATTEMPT]);
            left = left.part([ATTEMPT, 1.0]);
            let sizes = self.sizes(&target, &sides, attempt)?;
            let radii: Vec<f64> = sizes.iter().map(|size| contact(*size)).collect();
            let centres = match pack_periodic(sides, &radii, spec.seed, attempt, share)? {
                Packed::Whole(centres) => centres,
                Packed::Jammed { share } => {
                    let share = if best > 0.0 { best } else { share };
                    return Err(target.unreached(self.key, spec, share));
                }
            };
            let inside = |(at, size): ([f64; D], f64)| {
                let at: [f64; D] = std::array::from_fn(|k| at[k] - sides[k] / 2.0);
                self.region.contains(&at, body.margin(size)).then_some((at, size))
            };
            // Sizes are in the order of their draws: those left out are as random as those kept.
            let mut kept: Vec<_> = centres.into_iter().zip(sizes).filter_map(inside).collect();
            let volume =
                |kept: &[([f64; D], f64)]| kept.iter().map(|body| self.volume(body.1)).sum();
            if let Some(needed) = target.needed(kept.iter().map(|body| self.volume(body.1))) {
                kept.truncate(needed);
                target.check(self.key, kept.len(), volume(&kept), region)?;
                return Ok(kept);
            }
            best = best.max(target.share(kept.len(), volume(&kept)));
        }
        Err(target.unreached(self.key, spec, best))
    }

    /// Boxes packed until the region holds enough.
    fn attempts(&self, target: &Target) -> u32 {
        if target.count > FEW { 6 } else { 24 }
    }

    /// Bodies that a region is expected to keep beyond the target, in standard deviations of their
    /// number. A few bodies vary too much for an excess to pay: they are packed again and again first.
    fn excess(&self, target: &Target, attempt: u32) -> f64 {
        let few = 0.5 * f64::from(attempt.saturating_sub(7));
        if target.count > FEW { 2.0 + 2.0 * f64::from(attempt) } else { few }
    }

    /// Sizes of the bodies in a box, of which the region is expected to keep the target and a margin: the
    /// scatter of the number, and again for each further attempt.
    fn sizes(&self, target: &Target, sides: &[f64; D], attempt: u32) -> Result<Vec<f64>> {
        let largest = self.region.volume(self.body.margin(self.body.largest()));
        let space: f64 = sides.iter().product();
        let excess = self.excess(target, attempt) * self.deviation(target.count);
        let enough = target.count + excess;
        let mean = self.volume(1.0) * self.body.mean_power(D as f64);
        let (mut sizes, mut expected) = (Vec::new(), 0.0);
        let mut draws = Draws::new(self.spec.seed, [0, attempt, 0], SIZE);
        let mut drawn = 0;
        while expected < enough {
            // The sequence of one place is finite.
            drawn += 1;
            if drawn % 1_000_000 == 0 {
                draws = Draws::new(self.spec.seed, [drawn / 1_000_000, attempt, 0], SIZE);
            }
            let size = self.body.size(&mut draws);
            // A large body is kept less often than a small one: it is drawn more often instead.
            let room = self.region.volume(self.body.margin(size));
            if self.body.spread > 0.0 && draws.uniform() * room > largest {
                continue;
            }
            let counts = if target.volume.is_finite() { self.volume(size) / mean } else { 1.0 };
            expected += counts * room / space;
            sizes.push(size);
            if sizes.len() as f64 > MOST_IN_BOX {
                let found = format!("{} bodies and more around the region", sizes.len());
                let allowed = "a region much wider than its bodies, or fewer bodies";
                return Err(refused(self.key, target.key(), found, allowed.into()));
            }
        }
        Ok(sizes)
    }

    /// Approximate standard deviation of the number kept: of hard bodies in bulk, with the
    /// compressibility of scaled-particle theory, and of bodies at the wall.
    fn deviation(&self, count: f64) -> f64 {
        let d = D as f64;
        let fill =
            (count * self.volume(1.0) * self.body.mean_power(d) / self.region.volume(0.0)).min(0.9);
        let empty = 1.0 - fill;
        let bulk = match D {
            2 => empty * empty * empty / (1.0 + fill),
            _ => (empty * empty / (1.0 + 2.0 * fill)).powi(2),
        };
        // Bodies that differ in volume make the volume vary as their number would.
        let unequal = self.body.mean_power(d * std::f64::consts::SQRT_2).powi(2)
            / self.body.mean_power(d).powi(2);
        let at_wall = d * libm::pow(count, (d - 1.0) / d);
        (unequal * bulk * count + 0.15 * at_wall + 0.25).sqrt()
    }
}
