//! Loss of contrast by bodies of one material at random places in another (docs/physics.md, "Microstructure").

use super::hard_spheres::HardSpheres;
use super::pairs::Pairs;
use crate::optics::waves::{Form, structure_by_rays, structure_by_waves};
use crate::scene::{BodyShape, Microstructure};
use beamlet_core::numbers;
use std::f64::consts::{FRAC_PI_2, PI};
use std::sync::Arc;

/// Sizes of a spread, over this many standard deviations of ln d on either side.
const SIZES: u32 = 13;
const DEVIATIONS: f64 = 4.0;
/// Points of each angle of a cylinder's direction.
const DIRECTIONS: u32 = 10;
/// Last wavenumber of correlations, per radius: those of spheres fall with the square of the wavenumber, times the
/// fourth power of their form. Points for each unit, of the product with the shear too.
const LAST: f64 = 40.0;
const POINTS_PER_RADIAN: f64 = 8.0;
const MOST_POINTS: f64 = 1e5;
/// Fraction of the volume up to which the structure factor of hard spheres is that of fluids.
pub const FLUID: f64 = 0.5;

/// Error of [`kept_by_order`].
const BY_FIT: f64 = 0.1;

/// Bodies of one size.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Size {
    /// Radius, m.
    radius: f64,
    /// Number per volume, 1/m³; of cylinders their length per volume, 1/m².
    density: f64,
}

/// How spheres lie to one another.
#[derive(Debug, Clone, PartialEq)]
enum Order {
    /// Hard spheres in equilibrium.
    HardSpheres(HardSpheres),
    /// With the pair distribution of a table.
    Table(Arc<Pairs>),
}

impl Order {
    /// Structure factor. `x`: wavenumber times the diameter.
    fn structure_factor(&self, x: f64) -> f64 {
        match self {
            Self::HardSpheres(spheres) => spheres.structure_factor(x),
            Self::Table(pairs) => pairs.structure_factor(x),
        }
    }
}

/// Bodies at random places that do not overlap.
#[derive(Debug, Clone, PartialEq)]
pub struct Bodies {
    shape: BodyShape,
    fraction: f64,
    order: Order,
    sizes: Vec<Size>,
}

/// Loss of contrast per path length, −d ln(contrast)/dl, 1/m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Loss {
    /// Loss by waves, with the order of bodies among one another.
    pub value: f64,
    /// Loss by waves of as many bodies at independent places.
    pub independent: f64,
    /// Loss by rays of bodies at independent places.
    pub rays: f64,
    /// Error of `value` as a fraction of it, by different sizes and by phases that are not small.
    pub error: f64,
}

impl Bodies {
    /// Bodies of a material.
    #[must_use]
    pub fn new(of: &Microstructure) -> Self {
        let shares: Vec<[f64; 2]> = match of.spread > 0.0 {
            false => vec![[1.0; 2]],
            true => (0..SIZES)
                .map(|at| {
                    let at = DEVIATIONS * (2.0 * f64::from(at) / f64::from(SIZES - 1) - 1.0);
                    [libm::exp(of.spread * at), libm::exp(-0.5 * at * at)]
                })
                .collect(),
        };
        let radius = 0.5 * of.diameter;
        let content = |radius: f64| match of.shape {
            BodyShape::Spheres | BodyShape::Voids => 4.0 / 3.0 * PI * radius.powi(3),
            BodyShape::Cylinders => PI * radius * radius,
        };
        let all: f64 = shares.iter().map(|[size, share]| share * content(size * radius)).sum();
        let size = |[size, share]: &[f64; 2]| Size {
            radius: size * radius,
            density: of.fraction * share / all,
        };
        Self {
            shape: of.shape,
            fraction: of.fraction,
            order: Order::HardSpheres(HardSpheres::new(of.fraction)),
            sizes: shares.iter().map(size).collect(),
        }
    }

    /// The same with the places of a table.
    pub(super) fn with_pairs(self, pairs: Option<Pairs>) -> Self {
        let order = pairs.map_or(self.order, |pairs| Order::Table(Arc::new(pairs)));
        Self { order, ..self }
    }

    /// Table of the pair distribution.
    pub(super) fn pairs(&self) -> Option<&Pairs> {
        match &self.order {
            Order::HardSpheres(_) => None,
            Order::Table(pairs) => Some(pairs),
        }
    }

    /// Loss at a shear in the plane of the bodies, m. `phase`: twice the wavenumber times the difference of delta
    /// between bodies and host, rad/m.
    #[must_use]
    pub fn loss(&self, phase: f64, shear: f64) -> Loss {
        match self.shape {
            BodyShape::Spheres | BodyShape::Voids => self.of_spheres(phase, shear),
            BodyShape::Cylinders => self.of_cylinders(phase, shear),
        }
    }

    fn of_spheres(&self, phase: f64, shear: f64) -> Loss {
        let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
            self.sizes.iter().map(|size| size.density * of(size.radius)).sum()
        };
        let independent = sum(&|radius| structure_by_waves(Form::Sphere, radius, phase, shear));
        let rays = sum(&|radius| structure_by_rays(Form::Sphere, radius, phase, shear));
        let weak = sum(&|radius| weak_sphere(radius, phase, shear));
        let of_size = |size: &Size| {
            let form = form(size.radius, phase);
            size.density * form * form * correlation(&self.order, size.radius, shear)
        };
        let local: f64 = self.sizes.iter().map(of_size).sum();
        if !(weak > 0.0 && independent > 0.0) {
            return Loss { value: 0.0, independent, rays, error: 0.0 };
        }
        // Loss that independent spheres lack against weak ones, and the part of it that dense ones lack.
        let lacking = weak - independent;
        let mean = sum(&|radius| radius) / sum(&|_| 1.0);
        let kept = kept_by_order(self.fraction, 0.5 * shear / mean);
        // The least: order takes the same part as of weak ones.
        let least = (independent * (1.0 + local / weak)).max(0.0);
        let value = (weak + local - lacking * kept).max(least);
        let by_phase = lacking.abs() * (BY_FIT + 0.5 * (lacking / weak).abs());
        let by_sizes = match self.sizes.len() {
            1 => 0.0,
            _ => (local - self.decoupled(phase, shear)).abs(),
        };
        Loss { value, independent, rays, error: (by_phase + by_sizes) / value }
    }

    /// Correlations of spheres whose sizes do not depend on their places.
    fn decoupled(&self, phase: f64, shear: f64) -> f64 {
        let number: f64 = self.sizes.iter().map(|size| size.density).sum();
        let volume: f64 = self.sizes.iter().map(|size| size.density * size.radius.powi(3)).sum();
        let mean = libm::cbrt(volume / number);
        integral(mean, shear, |q| {
            let of =
                |size: &Size| size.density * form(size.radius, phase) * amplitude(q * size.radius);
            let mean_form = self.sizes.iter().map(of).sum::<f64>() / number;
            number * mean_form * mean_form * (self.order.structure_factor(2.0 * q * mean) - 1.0)
        })
    }

    /// Cylinders of all directions. Those that do not overlap scatter between 1 − `fraction` times as much as
    /// independent ones and as much.
    fn of_cylinders(&self, phase: f64, shear: f64) -> Loss {
        let mean = |of: fn(Form, f64, f64, f64) -> f64| {
            let angle = |at: u32| FRAC_PI_2 * (f64::from(at) + 0.5) / f64::from(DIRECTIONS);
            let mut sum = 0.0;
            for size in &self.sizes {
                for rise in (0..DIRECTIONS).map(angle) {
                    // A cylinder that rises towards the beam has longer chords on a shorter shadow.
                    let across = libm::cos(rise);
                    for turn in (0..DIRECTIONS).map(angle) {
                        let shear = shear * libm::cos(turn);
                        let loss = of(Form::Cylinder, size.radius, phase / across, shear);
                        sum += size.density * across * across * loss;
                    }
                }
            }
            sum * FRAC_PI_2 / f64::from(DIRECTIONS * DIRECTIONS)
        };
        let (independent, rays) = (mean(structure_by_waves), mean(structure_by_rays));
        let value = independent * (1.0 - 0.5 * self.fraction);
        Loss { value, independent, rays, error: 0.5 * self.fraction / (1.0 - 0.5 * self.fraction) }
    }
}

/// Loss of one sphere of a small phase, m²: 2π r⁴ (½ phase)² (1 − G), G the autocorrelation of its projection.
fn weak_sphere(radius: f64, phase: f64, shear: f64) -> f64 {
    let lag = (shear / radius).abs();
    let half = 0.5 * lag;
    // 1 − G without cancellation is not needed: shears are above 1e-4 radii.
    let kept = if lag >= 2.0 {
        0.0
    } else {
        let root = (1.0 - half * half).sqrt();
        root * (1.0 + 0.5 * half * half)
            + 2.0 * half * half * (1.0 - 0.25 * half * half) * libm::log(half / (1.0 + root))
    };
    0.5 * PI * phase * phase * radius.powi(4) * (1.0 - kept)
}

/// Loss that hard spheres lack against weak ones, as a part of what independent ones lack: exp(−17 f s^(2/3)), f the fraction
/// and s the shear over the diameter. Phases behind dense spheres are nearly Gaussian, and lose what weak ones do. The
/// factor and the power are fitted to Monte Carlos of hard spheres at fractions of 0.1 to 0.5, shears of 0.01 to 0.3
/// diameters and phases of up to 3 rad, within [`BY_FIT`] (test: `chords_of_a_monte_carlo_lose_what_their_medium_does`).
fn kept_by_order(fraction: f64, shear: f64) -> f64 {
    libm::exp(-17.0 * fraction * libm::cbrt(shear * shear))
}

/// Integral of the phase of a sphere over its shadow, m²: ½ phase times its volume.
fn form(radius: f64, phase: f64) -> f64 {
    0.5 * phase * 4.0 / 3.0 * PI * radius.powi(3)
}

/// Transform of a sphere at a wavenumber times its radius, over its volume.
fn amplitude(x: f64) -> f64 {
    if x < 1e-2 {
        return 1.0 - x * x / 10.0;
    }
    3.0 * (libm::sin(x) - x * libm::cos(x)) / (x * x * x)
}

/// Change of the loss by the places of spheres of a radius among one another, over the square of `form`.
fn correlation(order: &Order, radius: f64, shear: f64) -> f64 {
    integral(radius, shear, |q| {
        amplitude(q * radius).powi(2) * (order.structure_factor(2.0 * q * radius) - 1.0)
    })
}

/// ∫ f(q) (1 − J₀(qΛ)) q dq/2π by midpoints.
fn integral(radius: f64, shear: f64, f: impl Fn(f64) -> f64) -> f64 {
    let last = LAST / radius;
    let points = (LAST * POINTS_PER_RADIAN * (1.0 + shear.abs() / radius)).min(MOST_POINTS).ceil();
    let step = last / points;
    let term = |at: u32| {
        let q = step * (f64::from(at) + 0.5);
        f(q) * (1.0 - libm::j0(q * shear)) * q
    };
    (0..numbers::whole::<u32>(points)).map(term).sum::<f64>() * step / (2.0 * PI)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice the wavenumber times a difference of delta of 4e-7 at 30 keV, rad/m.
    const PHASE: f64 = 2.0 * 1.52e11 * 4e-7;
    const SHEAR: f64 = 0.29e-6;

    fn spheres(diameter: f64, fraction: f64) -> Bodies {
        Bodies::new(&Microstructure::new(BodyShape::Spheres, "silica", diameter, fraction))
    }

    /// ∫∫ [1 − cos Δφ] over squares of the shadow of a sphere, by a plain sum over 2,000 × 1,000 midpoints.
    fn plain(radius: f64, phase: f64, shear: f64) -> f64 {
        let half = 0.5 * shear;
        let [wide, high] = [radius + half, radius];
        let chord = |x: f64, z: f64| phase * (radius * radius - x * x - z * z).max(0.0).sqrt();
        let mut sum = 0.0;
        for i in 0..2000 {
            let x = wide * (f64::from(i) + 0.5) / 2000.0;
            for j in 0..1000 {
                let z = high * (f64::from(j) + 0.5) / 1000.0;
                sum += 1.0 - libm::cos(chord(x - half, z) - chord(x + half, z));
            }
        }
        4.0 * sum * wide / 2000.0 * high / 1000.0
    }

    #[test]
    fn dilute_spheres_lose_what_a_plain_sum_over_their_shadow_says() {
        for (diameter, phase) in [(1e-6, PHASE), (5e-6, PHASE), (10e-6, 8.0 * PHASE)] {
            let density = 1e-4 / (PI / 6.0 * diameter * diameter * diameter);
            let expected = density * plain(0.5 * diameter, phase, SHEAR);
            let loss = spheres(diameter, 1e-4).loss(phase, SHEAR);
            assert!(
                (loss.independent / expected - 1.0).abs() < 2e-4,
                "{diameter}: {loss:?} {expected}"
            );
            assert!((loss.value / expected - 1.0).abs() < 8e-4, "{diameter}: {loss:?} {expected}");
        }
    }

    /// A weak sphere in closed form is the quadrature of a thousandth of the phase, which errs by 4e-5 where a section is
    /// as wide as the shear.
    #[test]
    fn weak_spheres_have_the_autocorrelation_of_their_shadow() {
        for shear in [0.03, 0.3, 1.0, 1.9, 2.5_f64] {
            let expected = structure_by_waves(Form::Sphere, 1.0, 1e-3, shear);
            let found = weak_sphere(1.0, 1e-3, shear);
            assert!((found / expected - 1.0).abs() < 1e-4, "{shear}: {found} {expected}");
        }
    }

    /// Beyond twice the diameter nothing of a sphere interferes: twice its mean square of the phase, ½ · 2 · ∫ φ². Order
    /// then takes away what its neighbours exclude: the loss is that of a mixture, by its fluctuations.
    #[test]
    fn large_shears_lose_the_mean_square_of_the_phase() {
        let (diameter, phase) = (0.05e-6_f64, PHASE);
        let radius = 0.5 * diameter;
        let fraction = 1e-5;
        let density = fraction / (4.0 / 3.0 * PI * radius.powi(3));
        let expected = density * 0.5 * PI * phase * phase * radius.powi(4);
        let loss = spheres(diameter, fraction).loss(phase, 5e-6);
        assert!((loss.value / expected - 1.0).abs() < 1e-3, "{loss:?} {expected}");
    }

    /// The closed form is the integral over wavenumbers of the form, but for its tail.
    #[test]
    fn integrals_over_wavenumbers_are_those_of_the_shadow() {
        let one = form(1.0, 1e-3);
        for shear in [0.5, 1.0, 2.5] {
            let found = one * one * integral(1.0, shear, |q| amplitude(q).powi(2));
            let expected = weak_sphere(1.0, 1e-3, shear);
            assert!((found / expected - 1.0).abs() < 3e-3, "{shear}: {found} {expected}");
        }
    }

    #[test]
    fn order_of_dense_spheres_reduces_the_loss() {
        let of = |fraction: f64| {
            let loss = spheres(10e-6, fraction).loss(PHASE, SHEAR);
            loss.value / loss.independent
        };
        let ratios = [0.01, 0.1, 0.3, 0.5].map(of);
        assert!(ratios.windows(2).all(|pair| pair[1] < pair[0]), "{ratios:?}");
        assert!((ratios[0] - 1.0).abs() < 0.01 && ratios[3] > 0.5, "{ratios:?}");
    }

    /// A narrow spread is one size, and its error is stated.
    #[test]
    fn spreads_join_one_size() {
        let with = |spread: f64| {
            let one = Microstructure::new(BodyShape::Voids, "air", 20e-6, 0.3);
            Bodies::new(&Microstructure { spread, ..one }).loss(PHASE, SHEAR)
        };
        let [one, narrow, wide] = [0.0, 1e-3, 0.3].map(with);
        println!("{one:?} {narrow:?} {wide:?}");
        assert!((narrow.value / one.value - 1.0).abs() < 1e-4, "{one:?} {narrow:?}");
        assert!(wide.error > narrow.error && wide.error < 0.1, "{wide:?}");
        // The mean of d³ over d⁴ falls: larger spheres share the volume.
        assert!(wide.value < one.value, "{one:?} {wide:?}");
    }

    /// Cylinders along one direction average to those of all: weak ones by the isotropic transform of a rod,
    /// f ½ phase² A/(2π) ∫ (π/q) [2 J₁(qr)/(qr)]² (1 − J₀(qΛ)) q dq.
    #[test]
    fn cylinders_of_all_directions_have_the_transform_of_rods() {
        let (diameter, fraction) = (5e-6, 1e-4);
        let radius = 0.5 * diameter;
        let of = Microstructure::new(BodyShape::Cylinders, "carbon", diameter, fraction);
        let phase = 1e-3 * PHASE;
        let found = Bodies::new(&of).loss(phase, SHEAR).independent;
        let step = 0.01 / radius;
        let sum: f64 = (0..200_000)
            .map(|at| {
                let q = step * (f64::from(at) + 0.5);
                let form = 2.0 * libm::j1(q * radius) / (q * radius);
                PI * form * form * (1.0 - libm::j0(q * SHEAR)) * step
            })
            .sum();
        let area = PI * radius * radius;
        let expected = fraction * area * 0.25 * phase * phase * sum / (2.0 * PI);
        assert!((found / expected - 1.0).abs() < 3e-3, "{found} {expected}");
    }
}
