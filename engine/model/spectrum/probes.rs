//! Probes of accuracy: what energy nodes have to integrate as the whole spectrum does.
//!
//! Each probe is a function of energy whose mean over the spectrum is a quantity of the image:
//! transmissions of slabs of every material of the sample, of several thicknesses; deflections by
//! every material behind each of those slabs, weighted by what arrives; leakage of the mask bars,
//! alone and behind slabs.

use super::Spectrum;
use crate::material::{self, Constants};
use crate::scene::Scene;
use beamlet_core::Result;

/// Transmissions of the slabs that are tried.
const TRANSMISSIONS: [f64; 13] =
    [0.98, 0.9, 0.7, 0.5, 0.35, 0.2, 0.1, 0.05, 0.02, FLOOR, 5e-3, 2e-3, 5e-4];

/// Errors are relative to the value, or to this part of the open beam where the value is less.
pub(super) const FLOOR: f64 = 0.01;

/// A material of the scene at some energies.
struct Medium<'a> {
    name: &'a str,
    key: String,
    constants: Vec<Constants>,
}

/// Optical depth = sum of attenuation times thickness: index of the medium, m.
type LayeredPath = Vec<(usize, f64)>;

struct Probe {
    slab: LayeredPath,
    /// Medium whose deflection is weighted, and its mean delta behind the slab.
    deflection: Option<(usize, f64)>,
    /// Scale that errors are relative to.
    scale: f64,
}

/// All probes of a scene under a spectrum.
pub(super) struct Probes<'a> {
    scene: &'a Scene,
    energies: &'a [f64],
    media: Vec<Medium<'a>>,
    list: Vec<Probe>,
}

impl<'a> Probes<'a> {
    pub(super) fn of(scene: &'a Scene, spectrum: &'a Spectrum) -> Result<Self> {
        let energies = &spectrum.energies_kev;
        let mut media: Vec<Medium<'a>> = Vec::new();
        let mut medium = |name: &'a str, key: String| -> Result<usize> {
            if let Some(known) = media.iter().position(|medium| medium.name == name) {
                return Ok(known);
            }
            let constants = material::constants_over_for(scene, name, energies, &key)?;
            media.push(Medium { name, key, constants });
            Ok(media.len() - 1)
        };
        let around = medium(&scene.surroundings, scene.surroundings_key().into())?;
        let mut sample = Vec::new();
        for (index, object) in scene.objects.iter().enumerate() {
            sample.push(medium(&object.material, scene.object_key(index, "material"))?);
        }
        sample.sort_unstable();
        sample.dedup();
        let (mut bars, mut plates) = (Vec::new(), Vec::new());
        for (key, mask) in scene.masks() {
            let mut path = Vec::new();
            for (key, (material, thickness)) in mask.body.layers_by_key(key) {
                path.push((medium(material, key)?, thickness));
            }
            if !path.is_empty() {
                bars.push(path);
            }
            if let Some(plate) = &mask.substrate {
                let at = medium(&plate.material, format!("{key}.substrate.material"))?;
                plates.push((at, plate.thickness));
            }
        }
        let mut probes = Self { scene, energies, media, list: Vec::new() };
        probes.fill(&spectrum.weights, around, &sample, (&bars, &plates));
        Ok(probes)
    }

    fn fill(
        &mut self,
        weights: &[f64],
        around: usize,
        sample: &[usize],
        (bars, plates): (&[LayeredPath], &[(usize, f64)]),
    ) {
        let mean = |values: Vec<f64>| -> f64 {
            let total: f64 = weights.iter().sum();
            values.iter().zip(weights).map(|(value, weight)| value * weight).sum::<f64>() / total
        };
        let mut list = Vec::new();
        let add = |list: &mut Vec<Probe>, slab: LayeredPath, deflected: &[usize]| {
            let passed = self.passed(&slab);
            let transmission = mean(passed.clone());
            let scale = transmission.max(FLOOR);
            for &medium in deflected {
                let delta = |(index, passed): (usize, &f64)| {
                    passed * self.media[medium].constants[index].delta
                };
                let bent = mean(passed.iter().enumerate().map(delta).collect());
                let delta = bent / transmission;
                if delta.is_finite() && delta.abs() > 0.0 {
                    let deflection = Some((medium, delta));
                    list.push(Probe { slab: slab.clone(), deflection, scale });
                }
            }
            list.push(Probe { slab, deflection: None, scale });
        };
        // The surroundings fill the way from the source to the detector.
        add(&mut list, vec![(around, self.scene.detector.distance)], &[around]);
        let leaks: Vec<LayeredPath> =
            bars.iter().cloned().chain((bars.len() > 1).then(|| bars.concat())).collect();
        for leak in &leaks {
            add(&mut list, leak.clone(), &[]);
        }
        add(&mut list, Vec::new(), sample);
        if !plates.is_empty() {
            add(&mut list, plates.to_vec(), sample);
        }
        for &medium in sample {
            for transmission in TRANSMISSIONS {
                let passed = |thickness| mean(self.passed(&[(medium, thickness)]));
                let Some(thickness) = thickness_of(transmission, passed) else { continue };
                add(&mut list, vec![(medium, thickness)], sample);
                for leak in &leaks {
                    let mut slab = leak.clone();
                    slab.push((medium, thickness));
                    add(&mut list, slab, &[]);
                }
            }
        }
        self.list = list;
    }

    /// Transmission of a slab at each energy of the spectrum.
    fn passed(&self, slab: &[(usize, f64)]) -> Vec<f64> {
        let depth = |index: usize| -> f64 {
            slab.iter().map(|(medium, t)| self.media[*medium].constants[index].mu * t).sum()
        };
        (0..self.energies.len()).map(|index| (-depth(index)).exp()).collect()
    }

    /// Absorption edges, keV, ascending, each with the medium that has it.
    pub(super) fn edges(&self) -> Result<Vec<(f64, usize)>> {
        let mut edges = Vec::new();
        for (index, medium) in self.media.iter().enumerate() {
            let own = material::edges(self.scene, medium.name, &medium.key)?;
            edges.extend(own.into_iter().map(|edge| (edge, index)));
        }
        edges.sort_by(|a, b| a.0.total_cmp(&b.0));
        Ok(edges)
    }

    /// The most that any probe jumps, relative to its scale, where an edge of `medium` lies
    /// between the rows `row - 1` and `row`. What mu ~ E^-3 and delta ~ E^-2 change between the
    /// rows is no jump.
    pub(super) fn jump(&self, row: usize, medium: usize) -> f64 {
        let above: Vec<Constants> = self.media.iter().map(|medium| medium.constants[row]).collect();
        let below = self.media[medium].constants[row - 1];
        let ratio = self.energies[row - 1] / self.energies[row];
        let mut smooth = above.clone();
        let (mu, delta) = (below.mu * ratio.powi(3), below.delta * ratio.powi(2));
        smooth[medium] = Constants { mu, delta, ..below };
        let change = |probe: &Probe| (probe.value(&above) - probe.value(&smooth)).abs();
        self.list.iter().map(change).fold(0.0, f64::max)
    }

    /// Every probe over its scale at each row of the spectrum: [row][probe].
    pub(super) fn at_rows(&self) -> Vec<Vec<f64>> {
        let row = |index: usize| {
            let constants: Vec<_> = self.media.iter().map(|m| m.constants[index]).collect();
            self.values(&constants)
        };
        (0..self.energies.len()).map(row).collect()
    }

    /// Every probe over its scale at other energies, keV: [energy][probe].
    pub(super) fn at(&self, energies: &[f64]) -> Result<Vec<Vec<f64>>> {
        let over = |medium: &Medium<'_>| {
            material::constants_over_for(self.scene, medium.name, energies, &medium.key)
        };
        let media = self.media.iter().map(over).collect::<Result<Vec<_>>>()?;
        let row = |index: usize| {
            let constants: Vec<_> = media.iter().map(|constants| constants[index]).collect();
            self.values(&constants)
        };
        Ok((0..energies.len()).map(row).collect())
    }

    fn values(&self, constants: &[Constants]) -> Vec<f64> {
        self.list.iter().map(|probe| probe.value(constants)).collect()
    }
}

impl Probe {
    /// Over its scale, at an energy with these constants of the media.
    fn value(&self, constants: &[Constants]) -> f64 {
        let depth: f64 = self.slab.iter().map(|(medium, t)| constants[*medium].mu * t).sum();
        let weight = match self.deflection {
            // The error of a ratio of means, to first order.
            Some((medium, delta)) => constants[medium].delta / delta - 1.0,
            None => 1.0,
        };
        weight * (-depth).exp() / self.scale
    }
}

/// The thickness at which a falling function of it reaches a transmission, m; `None` where
/// nothing that fits a set-up does.
fn thickness_of(transmission: f64, passed: impl Fn(f64) -> f64) -> Option<f64> {
    let (mut low, mut high) = (1e-9_f64, 10.0_f64);
    if passed(high) > transmission {
        return None;
    }
    // A probe needs no exact place.
    for _ in 0..40 {
        let middle = (low * high).sqrt();
        *(if passed(middle) > transmission { &mut low } else { &mut high }) = middle;
    }
    Some(high)
}
