//! Light of a spectrum that passes the sample, by the optical depth at the mean constants.

use beamlet_core::numbers::{self, single};
use beamlet_model::media::MaterialTable;
use std::sync::Arc;

/// Light of all energies behind an optical depth at the mean constants. A sample hardens the beam: more of it passes
/// than exp(-depth), of a hard spectrum by orders of magnitude.
#[derive(Debug, Clone)]
pub(crate) struct Hardening {
    /// Optical depth of the light of all energies over the depth, by the square root of the depth; then the least
    /// ratio of an energy. None at one energy.
    ratios: Arc<[f32]>,
    /// Shares of parts of the light, and their refraction over that at the mean constants ([`parts_by_refraction`]).
    pub(crate) refraction: [[f32; PARTS]; 2],
}

/// Places of the table of light behind optical depths at the mean constants of a spectrum, by the square root of the
/// depth.
const HARDENING_PLACES: u32 = 257;
/// Deepest of them.
const HARDENING_DEEPEST: u32 = 64;

/// Most parts of the light of a spectrum that windows see apart.
const PARTS: usize = 4;

/// Shares of the light in parts of about equal light, and the refraction of each over that at the mean constants, the
/// largest first. Parts behind the last one have no light, and its refraction. `nodes`: weight and refraction.
fn parts_by_refraction(mut nodes: Vec<[f64; 2]>) -> [[f32; PARTS]; 2] {
    nodes.sort_unstable_by(|a, b| b[1].total_cmp(&a[1]));
    let all: f64 = nodes.iter().map(|[weight, _]| weight).sum();
    let few = nodes.len() <= PARTS;
    let mut before = 0.0;
    let place = |(index, [weight, ratio]): (usize, [f64; 2])| {
        let middle = (before + 0.5 * weight) / all;
        before += weight;
        let by_light = numbers::whole::<usize>((middle * PARTS as f64).floor());
        (if few { index } else { by_light }, [weight, ratio])
    };
    let placed: Vec<(usize, [f64; 2])> = nodes.into_iter().enumerate().map(place).collect();
    let (mut shares, mut ratios) = ([0.0; PARTS], [1.0; PARTS]);
    // A strong line may fill two parts.
    for (number, part) in placed.chunk_by(|a, b| a.0 == b.0).enumerate() {
        let share: f64 = part.iter().map(|(_, [weight, _])| weight).sum();
        let sum: f64 = part.iter().map(|(_, [weight, ratio])| weight * ratio).sum();
        shares[number] = single(share / all);
        ratios[number..].fill(single(sum / share));
    }
    [shares, ratios]
}

impl Hardening {
    pub(crate) fn of(media: &MaterialTable) -> Self {
        let nodes = media.attenuation_ratios();
        let weights = media.weights.iter().zip(media.refraction_ratios(&media.mean()));
        let refraction =
            parts_by_refraction(weights.map(|(weight, ratio)| [*weight, ratio]).collect());
        if nodes.len() < 2 {
            return Self { ratios: Arc::default(), refraction };
        }
        let all: f64 = nodes.iter().map(|[weight, _]| weight).sum();
        let least = nodes.iter().map(|[_, ratio]| *ratio).fold(f64::INFINITY, f64::min);
        let mean = nodes.iter().map(|[weight, ratio]| weight * ratio).sum::<f64>() / all;
        let ratio = |place: u32| {
            let share = f64::from(place) / f64::from(HARDENING_PLACES - 1);
            let depth = f64::from(HARDENING_DEEPEST) * share * share;
            let of = |[weight, ratio]: &[f64; 2]| weight / all * ((least - ratio) * depth).exp();
            match place {
                0 => mean,
                _ => least - nodes.iter().map(of).sum::<f64>().ln() / depth,
            }
        };
        let places = (0..HARDENING_PLACES).map(ratio);
        Self { ratios: places.chain([least]).map(single).collect(), refraction }
    }

    /// Share of the light that passes a depth.
    pub(crate) fn light(&self, depth: f32) -> f32 {
        (-self.depth(depth)).exp()
    }

    /// Optical depth of the light of all energies behind a depth at the mean constants.
    pub(crate) fn depth(&self, depth: f32) -> f32 {
        let (true, false) = (depth > 0.0, self.ratios.is_empty()) else { return depth };
        let (last, deepest) = (HARDENING_PLACES - 1, HARDENING_DEEPEST as f32);
        let within = depth.min(deepest);
        let place = (within / deepest).sqrt() * last as f32;
        let first = numbers::whole::<usize>(f64::from(place)).min(last as usize - 1);
        let [low, high] = [self.ratios[first], self.ratios[first + 1]];
        let ratio = low + (high - low) * (place - first as f32);
        // Deeper down only the light of the least ratio is left.
        ratio * within + self.ratios[last as usize + 1] * (depth - within)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use beamlet_model::material::Constants;

    /// Air and two materials, of these attenuations at four energies, 1/m.
    fn media(attenuation: [[f64; 4]; 2]) -> MaterialTable {
        let of = |mu: f64| Constants { mu, delta: 1e-7, ..Constants::default() };
        let constants =
            (0..4).map(|node| vec![of(0.0), of(attenuation[0][node]), of(attenuation[1][node])]);
        MaterialTable {
            names: ["air", "one", "other"].map(String::from).to_vec(),
            energies: vec![8.0, 15.0, 25.0, 38.0],
            weights: vec![0.1, 0.4, 0.3, 0.2],
            constants: constants.collect(),
            axes: Vec::new(),
            of_object: vec![1, 2],
            roughness: vec![0.0; 2],
        }
    }

    /// Light behind a path in one of the materials, and its depth at the mean constants.
    fn behind(media: &MaterialTable, material: usize, path: f64) -> [f64; 2] {
        let of = |(w, c): (&f64, &Vec<Constants>)| w * (-c[material].mu * path).exp();
        let all = media.weights.iter().zip(&media.constants).map(of).sum();
        [all, media.mean()[material].mu * path]
    }

    #[test]
    fn light_is_the_sum_over_the_energies() {
        let one = [600.0, 90.0, 30.0, 12.0];
        let media = media([one, one.map(|mu| 3.0 * mu)]);
        let hardening = Hardening::of(&media);
        for path in [1e-7, 1e-5, 1e-4, 1e-3, 4e-3, 2e-2, 8e-2] {
            for material in [1, 2] {
                let [want, depth] = behind(&media, material, path);
                let got = f64::from(hardening.light(single(depth)));
                assert!((got / want - 1.0).abs() < 2e-3, "{material} {path}: {got} {want}");
                // Faint absorbers have their own law, not only light near 1: f32 holds it to 6e-8 of light.
                let off = (got.ln() - want.ln()).abs();
                assert!(off < 2e-3 * want.ln().abs() + 1.2e-7, "{material} {path}: {off} {want}");
            }
        }
    }

    /// Materials that harden the beam by different laws: the estimate has no less light than either.
    #[test]
    fn light_of_several_materials_is_not_underestimated() {
        let media = media([[600.0, 90.0, 30.0, 12.0], [500.0, 100.0, 70.0, 60.0]]);
        let hardening = Hardening::of(&media);
        for path in [1e-4, 1e-3, 4e-3, 2e-2] {
            for material in [1, 2] {
                let [light, depth] = behind(&media, material, path);
                let got = f64::from(hardening.light(single(depth)));
                assert!(got > 0.995 * light, "{material} {path}: {got} {light}");
            }
        }
    }

    #[test]
    fn parts_have_all_light_and_its_mean_refraction() {
        let even = |count: u8| -> Vec<[f64; 2]> {
            (0..count).map(|i| [1.0 + f64::from(i % 3), 0.5 + 0.1 * f64::from(i)]).collect()
        };
        // Strong lines between others.
        let first = vec![[6.0, 1.5], [1.0, 1.2], [1.0, 1.0], [1.0, 0.8], [1.0, 0.5]];
        let middle = vec![[0.5, 1.5], [7.0, 1.2], [1.0, 1.0], [1.0, 0.8], [0.5, 0.5]];
        let cases = [
            (even(1), 1),
            (even(2), 2),
            (even(4), 4),
            (even(5), 4),
            (even(30), 4),
            (first, 3),
            (middle, 3),
        ];
        for (nodes, used) in cases {
            let all: f64 = nodes.iter().map(|[weight, _]| weight).sum();
            let mean: f64 = nodes.iter().map(|[weight, ratio]| weight * ratio).sum::<f64>() / all;
            let [shares, ratios] = parts_by_refraction(nodes);
            let sum: f64 = shares.iter().map(|share| f64::from(*share)).sum();
            let by_parts: f64 =
                shares.iter().zip(ratios).map(|(a, b)| f64::from(*a) * f64::from(b)).sum();
            assert!((sum - 1.0).abs() < 1e-6 && (by_parts / mean - 1.0).abs() < 1e-6, "{used}");
            assert!(shares[..used].iter().all(|share| *share > 0.0), "{shares:?}");
            assert!(shares[used..].iter().all(|share| *share <= 0.0), "{shares:?}");
            assert!(ratios[..used].is_sorted_by(|a, b| a > b), "{ratios:?}");
            assert!(ratios[used..].iter().all(|ratio| (ratio - ratios[used - 1]).abs() <= 0.0));
        }
    }

    #[test]
    fn one_energy_has_its_exponential() {
        let mut media = media([[50.0; 4]; 2]);
        media.weights.truncate(1);
        media.constants.truncate(1);
        let hardening = Hardening::of(&media);
        assert!(hardening.ratios.is_empty());
        assert_eq!(hardening.light(0.7).to_bits(), (-0.7_f32).exp().to_bits());
    }
}
