//! Effect of the bars of a mask on light, by its energy and angle.

use super::mask::Openings;
use super::{Mask, Optics};
use crate::material;
use crate::scene::{MaskBody, Scene};
use beamlet_core::Result;
use beamlet_core::numbers::single;
use std::borrow::Cow;

/// Shares of the light of all energies (keV, each with its weight) that the bars of the sample mask and
/// of the detector mask let through along the axis; 0 without the mask.
///
/// # Errors
/// As [`material::constants_at_for`].
pub fn mean_leaks(
    scene: &Scene,
    optics: &Optics,
    (energies, weights): (&[f64], &[f64]),
) -> Result<[f64; 2]> {
    let mean = |mask: &Option<Mask>| -> Result<f64> {
        let Some(mask) = mask else { return Ok(0.0) };
        energies
            .iter()
            .zip(weights)
            .map(|(energy, weight)| Ok(weight * leak(scene, mask, *energy)?))
            .sum()
    };
    Ok([mean(&optics.sample_mask)?, mean(&optics.detector_mask)?])
}

/// Light that bars let pass behind both masks, over the mean of the curve of their apertures over a period: at
/// energies (keV) with their weights. A missing mask is open everywhere.
///
/// # Errors
/// As [`material::constants_at_for`].
pub fn leak_over_mean(
    scene: &Scene,
    optics: &Optics,
    (energies, weights): (&[f64], &[f64]),
) -> Result<f64> {
    let masks = [&optics.sample_mask, &optics.detector_mask].map(Option::as_ref);
    let open = masks.map(|mask| mask.map_or(1.0, Mask::open_share));
    let [mut leaked, mut modulated] = [0.0; 2];
    for (energy, weight) in energies.iter().zip(weights) {
        let (mut passed, mut bars) = (*weight, [0.0; 2]);
        for (mask, bar) in masks.into_iter().zip(&mut bars) {
            if let Some(mask) = mask {
                let shape = MaskShape::of(scene, mask, mask.distance(), Some(*energy))?;
                passed *= shape.through_substrate(1.0);
                *bar = shape.leak(1.0);
            }
        }
        let [a, b] = bars;
        leaked += passed * (a * b + a * (1.0 - b) * open[1] + b * (1.0 - a) * open[0]);
        modulated += passed * (1.0 - a) * (1.0 - b) * open[0] * open[1];
    }
    Ok(leaked / modulated)
}

/// Share of the light of all energies (keV, each with its weight) that the substrates of the masks let through
/// along the axis.
///
/// # Errors
/// As [`material::constants_at_for`].
pub fn through_substrates(
    scene: &Scene,
    optics: &Optics,
    (energies, weights): (&[f64], &[f64]),
) -> Result<f64> {
    let mut sum = 0.0;
    for (energy, weight) in energies.iter().zip(weights) {
        let mut share = *weight;
        for mask in optics.sample_mask.iter().chain(&optics.detector_mask) {
            let shape = MaskShape::of(scene, mask, mask.distance(), Some(*energy))?;
            share *= shape.through_substrate(1.0);
        }
        sum += share;
    }
    Ok(sum)
}

/// Share of the light of each energy, keV, that the sample mask lets through on average; 1 without the mask.
///
/// # Errors
/// As [`material::constants_at_for`].
pub fn through_sample_mask(scene: &Scene, energies: &[f64]) -> Result<Vec<f64>> {
    let optics = Optics::of(scene);
    let Some(mask) = &optics.sample_mask else { return Ok(vec![1.0; energies.len()]) };
    let attenuation = |layers: Vec<(String, (&str, f64))>| {
        let mut sums = vec![0.0; energies.len()];
        for (key, (material, thickness)) in layers {
            let all = material::constants_over_for(scene, material, energies, &key)?;
            sums.iter_mut().zip(all).for_each(|(sum, constants)| *sum += constants.mu * thickness);
        }
        Ok::<_, beamlet_core::Error>(sums)
    };
    let bars = attenuation(mask.body().layers_by_key(mask.name()))?;
    let plate = mask.substrate().map(|plate| {
        (format!("{}.substrate.material", mask.name()), (&*plate.material, plate.thickness))
    });
    let plate = attenuation(plate.into_iter().collect())?;
    let sheet = match mask.body() {
        MaskBody::Sheet { transmission } => *transmission,
        _ => 1.0,
    };
    let open = mask.open_share();
    let share = |(bars, plate): (&f64, &f64)| {
        libm::exp(-plate) * (open + (1.0 - open) * sheet * libm::exp(-bars))
    };
    Ok(bars.iter().zip(&plate).map(share).collect())
}

/// The scene with straight bars in place of tapered ones: slits are narrower by the mean narrowing of slanted walls
/// along the axis over energies (keV, each with its weight), weighted by the light that bars stop. Without tapers it is
/// the same scene.
///
/// # Errors
/// As [`material::constants_at_for`].
pub fn straightened<'s>(
    scene: &'s Scene,
    (energies, weights): (&[f64], &[f64]),
) -> Result<Cow<'s, Scene>> {
    let optics = Optics::of(scene);
    if !optics.has_walls() {
        return Ok(Cow::Borrowed(scene));
    }
    let mut straight = scene.clone();
    let masks = [&optics.sample_mask, &optics.detector_mask];
    for (mask, spec) in
        masks.into_iter().zip([&mut straight.sample_mask, &mut straight.detector_mask])
    {
        let (Some(mask), Some(spec)) = (mask, spec) else { continue };
        if !mask.is_tapered() {
            continue;
        }
        let mut sums = [0.0; 2];
        for (energy, weight) in energies.iter().zip(weights) {
            let shape = MaskShape::of(scene, mask, mask.distance(), Some(*energy))?;
            let leak = shape.leak(1.0);
            let dark = weight * (1.0 - leak);
            sums[0] += dark;
            sums[1] += dark * shape.widest_shadow(0.0) * shape.narrowing(1.0, leak);
        }
        let narrower = if sums[0] > 0.0 { sums[1] / sums[0] } else { 0.0 };
        spec.taper = 0.0;
        spec.aperture -= narrower;
        for [low, high] in &mut spec.apertures {
            *low += 0.5 * narrower;
            *high -= 0.5 * narrower;
        }
    }
    Ok(Cow::Owned(straight))
}

/// Share of the light of an energy, keV, that bars let through along the axis.
pub(super) fn leak(scene: &Scene, mask: &Mask, energy: f64) -> Result<f64> {
    Ok(MaskShape::of(scene, mask, mask.distance(), Some(energy))?.leak(1.0))
}

/// Shares of the modulated light by energy: the weights of the open beam (energies in keV, each with its weight)
/// times 1 − e of each mask, e the leak of its bars. Areas of illumination curves above their background
/// measure this light. The sum is 1. Shares of the open beam where bars absorb nothing.
///
/// # Errors
/// As [`material::constants_at_for`].
pub fn modulated(scene: &Scene, (energies, weights): (&[f64], &[f64])) -> Result<Vec<f64>> {
    let optics = Optics::of(scene);
    let masks = [&optics.sample_mask, &optics.detector_mask];
    let share = |(energy, weight): (&f64, &f64)| {
        let shares = masks.into_iter().flatten().map(|mask| {
            let shape = MaskShape::of(scene, mask, mask.distance(), Some(*energy))?;
            Ok((1.0 - shape.leak(1.0)) * shape.through_substrate(1.0))
        });
        Ok(weight * shares.product::<Result<f64>>()?)
    };
    let light: Vec<f64> = energies.iter().zip(weights).map(share).collect::<Result<_>>()?;
    let of_one = |light: &[f64]| -> Vec<f64> {
        let total: f64 = light.iter().sum();
        light.iter().map(|share| share / total).collect()
    };
    Ok(of_one(if light.iter().any(|share| *share > 0.0) { &light } else { weights }))
}

/// A mask as the light stages see it: apertures of one period, and its bars.
#[derive(Debug, Clone)]
pub struct MaskShape {
    /// Its openings in the plane of evaluation, m.
    pub openings: Openings,
    /// Extent along the optical axis, m.
    pub thickness: f64,
    /// Attenuation of bars along the axis; infinite where they are opaque.
    pub attenuation: f64,
    /// dx/dy of the walls of the bars, as [`Mask::wall_slope`].
    pub wall_slope: f64,
    /// Layers of the bars from the source on: shares of the thickness and of the attenuation.
    pub layers: Vec<[f64; 2]>,
    /// Transmission of bars that do not attenuate.
    pub transmission: f64,
    /// Attenuation of the substrate along the axis; 0 without one, and for no energy.
    pub substrate: f64,
}

/// Thickness (m) and attenuation of the layers of the bars of a mask, from the source on, at an energy (keV) or
/// opaque; none of a sheet.
fn attenuating(scene: &Scene, mask: &Mask, energy: Option<f64>) -> Result<Vec<[f64; 2]>> {
    let of = |(key, (material, thickness)): (String, (&str, f64))| {
        let mu = |energy| material::constants_at_for(scene, material, energy, &key);
        let mu = energy.map_or(Ok(f64::INFINITY), |energy| Ok(mu(energy)?.mu))?;
        Ok([thickness, mu * thickness])
    };
    mask.body().layers_by_key(mask.name()).into_iter().map(of).collect()
}

/// Shares of layers of the thickness and attenuation of all.
fn shares(layers: &[[f64; 2]], [thickness, attenuation]: [f64; 2]) -> Vec<[f64; 2]> {
    if layers.len() < 2 || !(attenuation.is_finite() && attenuation > 0.0) {
        return vec![[1.0; 2]];
    }
    layers.iter().map(|layer| [layer[0] / thickness, layer[1] / attenuation]).collect()
}

impl MaskShape {
    /// The mask seen from the source in the plane at `plane`, at an energy (keV) or opaque.
    ///
    /// # Errors
    /// As [`material::constants_at_for`].
    pub fn of(scene: &Scene, mask: &Mask, plane: f64, energy: Option<f64>) -> Result<Self> {
        let openings = mask.openings(plane);
        let layers = attenuating(scene, mask, energy)?;
        let (thickness, attenuation, transmission) = match mask.body() {
            MaskBody::Sheet { transmission } => (0.0, 0.0, *transmission),
            _ => {
                let sum = |of: usize| layers.iter().map(|layer| layer[of]).sum::<f64>();
                (sum(0), sum(1), 0.0)
            }
        };
        let substrate = match (mask.substrate(), energy) {
            (Some(plate), Some(energy)) => {
                let key = format!("{}.substrate.material", mask.name());
                let constants = material::constants_at_for(scene, &plate.material, energy, &key)?;
                constants.mu * plate.thickness
            }
            _ => 0.0,
        };
        // Without bars there is nothing for any material to do.
        let (thickness, attenuation, transmission) = if openings.bar() > 0.0 {
            (thickness, attenuation, transmission)
        } else {
            (0.0, 0.0, 1.0)
        };
        Ok(Self {
            openings,
            thickness: thickness * mask.scale_at(plane),
            attenuation,
            wall_slope: if thickness > 0.0 { mask.wall_slope() } else { 0.0 },
            layers: shares(&layers, [thickness, attenuation]),
            // Bars of a material that does not absorb are no mask at all.
            transmission: if thickness > 0.0 && attenuation <= 0.0 { 1.0 } else { transmission },
            substrate,
        })
    }

    /// The apertures of a period: sorted open intervals about its centre, m in the plane of
    /// evaluation, as devices hold them.
    pub fn apertures(&self) -> Vec<[f32; 2]> {
        self.openings.ends().map(|ends| ends.map(single)).collect()
    }

    /// Transmission of bars wider than their shadow, as `thick_bars` in light/mask.glsl.
    pub fn leak(&self, secant: f64) -> f64 {
        if self.attenuation > 0.0 {
            libm::exp(-self.attenuation * secant)
        } else {
            self.transmission
        }
    }

    /// Transmission of the substrate at an angle.
    pub fn through_substrate(&self, secant: f64) -> f64 {
        if self.substrate > 0.0 { libm::exp(-self.substrate * secant) } else { 1.0 }
    }

    /// Mean place of a soft edge behind its inner end, and its variance, as shares of the shadow, where both edges of
    /// an aperture are alike on average: of bars of several layers.
    fn mean_edge(&self, secant: f64) -> [f64; 2] {
        let depth = self.attenuation * secant;
        let mut sums = [0.0; 3];
        for sourceward in [true, false] {
            let mut layers = self.layers.clone();
            if !sourceward {
                layers.reverse();
            }
            let (mut share, mut passed) = (0.0, 0.0);
            for [thickness, attenuation] in layers {
                // Moments of z, in shares of the layer, with the density exp(-a z) on 0 to 1.
                let a = (attenuation * depth).max(1e-9);
                let light = libm::exp(-passed) * -libm::expm1(-a);
                let tail = libm::exp(-a) / -libm::expm1(-a);
                let [mean, variance] = match a < 0.01 {
                    true => [0.5 - a / 12.0, 1.0 / 12.0 - a * a / 240.0],
                    false => [1.0 / a - tail, 1.0 / (a * a) - tail * (1.0 + tail)],
                };
                let mean = share + thickness * mean;
                sums[0] += light;
                sums[1] += light * mean;
                sums[2] += light * (mean * mean + thickness * thickness * variance);
                share += thickness;
                passed += attenuation * depth;
            }
        }
        let mean = sums[1] / sums[0];
        [mean, sums[2] / sums[0] - mean * mean]
    }

    /// Share of the shadow width that narrows apertures, as `edge_mean` there gives it, where bars
    /// leak so much.
    pub fn narrowing(&self, secant: f64, leak: f64) -> f64 {
        let a = self.attenuation * secant;
        if a <= 0.0 || 1.0 - leak < 1e-5 {
            return 0.0;
        }
        if self.layers.len() > 1 {
            return 1.0 - 2.0 * self.mean_edge(secant)[0];
        }
        let mean = if a < 1e-3 { 1.0 - 0.5 * a } else { (1.0 - leak) / a };
        1.0 - 2.0 * (mean - leak) / (1.0 - leak)
    }

    /// Variance of an edge in squared shadow widths, as `edge_variance` there.
    pub fn edge_variance(&self) -> f64 {
        let (a, leak) = (self.attenuation, self.leak(1.0));
        if a <= 0.0 {
            return 0.0;
        }
        if self.layers.len() > 1 {
            return self.mean_edge(1.0)[1];
        }
        if a < 0.1 {
            return 1.0 / 12.0;
        }
        (1.0 / (a * a) - leak / ((1.0 - leak) * (1.0 - leak))).max(0.0)
    }

    /// Widths of the shadows of the walls at the low and the high edge of an aperture, m, for a ray of this dx/dy.
    pub fn shadows(&self, slope: f64) -> [f64; 2] {
        [self.wall_slope, -self.wall_slope].map(|wall| self.thickness * (slope + wall).abs())
    }

    /// Width of the wider of these shadows, m.
    pub fn widest_shadow(&self, slope: f64) -> f64 {
        self.thickness * (slope.abs() + self.wall_slope.abs())
    }

    /// Width of the narrowest aperture or bar, m in the plane of evaluation.
    pub fn narrowest(&self) -> f64 {
        let widths = self.apertures().into_iter().map(|[low, high]| f64::from(high - low));
        widths.fold(self.openings.bar(), f64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scene(mask: &str) -> Scene {
        let text = format!(
            "[source]\ndistance = \"1.2 m\"\nspot = \"30 um\"\nenergy = \"30 keV\"\n\
             [detector]\ndistance = \"2 m\"\npixels = [4, 1]\npitch = \"150 um\"\n\
             [sample_mask]\ndistance = \"1 m\"\naperture = \"20 um\"\n{mask}\n\
             [materials.bars]\nmu = \"100 /cm\"\ndelta = 1e-6\n"
        );
        Scene::from_toml(&text, ".").expect("a scene")
    }

    /// Width of the box that lets the same light through, docs/physics.md.
    #[test]
    fn straight_bars_leave_the_light_of_tapered_ones() {
        let tapered = scene("material = \"bars\"\nthickness = \"200 um\"\ntaper = \"-2 deg\"");
        let straight = straightened(&tapered, (&[30.0], &[1.0])).expect("bars");
        let found = straight.sample_mask.as_ref().expect("a mask");
        let (a, e) = (2.0, f64::exp(-2.0));
        let narrower = 200e-6 * 2.0_f64.to_radians().tan() * ((1.0 + e) / (1.0 - e) - 2.0 / a);
        assert!((found.aperture - (20e-6 - narrower)).abs() < 1e-12, "{}", found.aperture);
        assert!(found.taper.abs() < 1e-300 && tapered.sample_mask != straight.sample_mask);
    }

    /// Layers of one material have the edge of one bar.
    #[test]
    fn the_mean_edge_of_equal_layers_is_the_edge_of_a_bar() {
        let shape = |body: &str| {
            let scene = scene(body);
            let optics = Optics::of(&scene);
            let mask = optics.sample_mask.as_ref().expect("a mask");
            MaskShape::of(&scene, mask, 1.0, Some(30.0)).expect("bars")
        };
        let whole = shape("material = \"bars\"\nthickness = \"200 um\"");
        let layer = |um: u32| format!("{{ material = \"bars\", thickness = \"{um} um\" }}");
        let layers = shape(&format!("layers = [{}, {}]", layer(30), layer(170)));
        let leak = whole.leak(1.1);
        let narrowing = layers.narrowing(1.1, leak) - whole.narrowing(1.1, leak);
        assert!(narrowing.abs() < 1e-12, "{narrowing:e}");
        let variance = layers.edge_variance() - whole.edge_variance();
        assert!(variance.abs() < 1e-12, "{variance:e}");
        assert!((layers.attenuation - 2.0).abs() < 1e-12 && layers.layers.len() == 2);
    }
}
