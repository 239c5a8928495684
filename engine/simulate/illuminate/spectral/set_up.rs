//! The energies of a scene made ready to be gathered, and the parameters of the light of their
//! groups.

use super::super::light::{IlluminationBuffer, SpectralBand};
use super::edges::SharedEdges;
use super::exact::exact_retrace_threshold;
use super::{
    DISPLACEMENT_SHARE, EnergyBinning, FULL_SHARE, NEGLIGIBLE, SPREAD_OF_ROW, SPREAD_SHARE,
};
use crate::sampling::Lattice;
use crate::trace::FIRST_ORDER_ERROR;
use beamlet_core::Result;
use beamlet_core::numbers::{count, single};
use beamlet_gpu::Device;
use beamlet_interface::{EnergyParams, MOMENTS_PER_MATERIAL, MOMENTS_PER_PAIR};
use beamlet_model::material::Constants;
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::{Mask, MaskShape, Optics};
use beamlet_model::scene::Scene;
use std::sync::Arc;

impl EnergyBinning {
    /// For the lattice of a scene with several energies.
    ///
    /// # Errors
    /// As [`beamlet_model::material::constants_at_for`].
    pub(crate) fn new(
        scene: &Scene,
        optics: &Optics,
        media: &MaterialTable,
        lattice: &Lattice,
    ) -> Result<Self> {
        let reference = &media.mean();
        let Optics { analyser, detector, .. } = optics;
        let at = |mask: &Option<Mask>, plane: f64| {
            mask.as_ref()
                .map(|mask| {
                    let of = |&energy: &f64| MaskShape::of(scene, mask, plane, Some(energy));
                    media.energies.iter().map(of).collect::<Result<Vec<_>>>()
                })
                .transpose()
        };
        let masks =
            [at(&optics.sample_mask, lattice.plane)?, at(&optics.detector_mask, *analyser)?];
        let edges = SharedEdges::of(
            [0, 1].map(|i| masks[i].as_deref()),
            [analyser / lattice.plane, 1.0],
            &media.weights,
            lattice.edge_blur,
            lattice.period * analyser / lattice.plane,
        );
        let tolerances = optics.sampling.tolerances();
        let tolerance = DISPLACEMENT_SHARE * tolerances.angle * optics.lever_arm;
        // Displaced by this, the light of a cell of `FULL_SHARE` changes by a hundredth of the tolerance at edges.
        let first_order = FIRST_ORDER_ERROR * optics.lever_arm;
        let spare = tolerance.min(lattice.edge_blur * tolerances.light).max(first_order);
        let share = SPREAD_SHARE * libm::cbrt(tolerances.light / 1e-3).min(1.0);
        let (constants, variances) = constants(media, reference);
        let strongest =
            |m: usize| media.constants.iter().map(|it| it[m].delta.abs()).fold(0.0, f64::max);
        let params = EnergyParams {
            energies: count(media.weights.len()),
            materials: count(media.names.len()),
            moment_words: count(media.moment_words()),
            variances,
            heights: lattice.heights.into(),
            full_width: single(lattice.period * FULL_SHARE),
            tolerance: single(tolerance),
            spread_x: single((share * lattice.edge_blur).max(tolerance)),
            spread_z: single((share * lattice.row_blur()).max(SPREAD_OF_ROW) * detector.pitch[1]),
            gap: single(optics.gap()),
            ratio: single(analyser / detector.distance),
            row_pitch: single(detector.pitch[1]),
            row_blur: single(lattice.row_blur()),
            ..bytemuck::Zeroable::zeroed()
        };
        let mut spectral = Self {
            edges,
            weights: media.weights.clone(),
            params,
            constants,
            strongest: (0..media.names.len()).map(strongest).collect(),
            exact_retrace_threshold: exact_retrace_threshold(
                optics.sampling.transport,
                media,
                reference,
                spare / first_order,
            ),
            groups: Vec::new(),
            slopes: lattice.beamlet_geometry(optics).iter().map(|c| c.slope.into()).collect(),
            lattice: lattice.clone(),
            tolerance,
            row_slope: -detector.row_slope(),
            middle_row: detector.half(1),
            masks,
        };
        spectral.groups = [[false, false], [true, false], [false, true], [true, true]]
            .into_iter()
            .filter(|leaks| {
                let has = |i: usize| !leaks[i] || spectral.masks[i].is_some();
                let light = |n| spectral.weights[n] * spectral.passes(n, *leaks);
                has(0) && has(1) && (0..spectral.nodes()).map(light).sum::<f64>() >= NEGLIGIBLE
            })
            .collect();
        spectral.params.groups = count(spectral.groups.len());
        Ok(spectral)
    }

    /// Illumination parameters of the lists that kernels gather, in their order: of groups, then of energies.
    ///
    /// # Errors
    /// [`beamlet_core::Error::Memory`], or as [`beamlet_model::material::constants_at_for`].
    pub(crate) fn lights(
        &self,
        device: &Arc<Device>,
        scene: &Scene,
        optics: &Optics,
        media: &MaterialTable,
    ) -> Result<Vec<IlluminationBuffer>> {
        let edge_variance = |mask: usize, leaks: [bool; 2]| {
            let shapes = self.masks[mask].as_ref().filter(|_| !leaks[mask])?;
            let (mut sum, mut all) = ([0.0; 3], 0.0);
            for (n, shape) in shapes.iter().enumerate() {
                let weight = self.weights[n] * self.passes(n, leaks);
                all += weight;
                let narrowing = shape.narrowing(1.0, shape.leak(1.0));
                sum[0] += weight * shape.edge_variance();
                sum[1] += weight * narrowing;
                sum[2] += weight * narrowing * narrowing;
            }
            if all <= 0.0 {
                return Some(0.0);
            }
            let [edge_variance, narrowing, narrowing2] = sum.map(|s| s / all);
            // Either edge moves by half of the difference of the narrowing from its mean.
            Some(single(edge_variance + 0.25 * (narrowing2 - narrowing * narrowing)))
        };
        let groups = self.groups.iter().map(|&leaks| SpectralBand::Group {
            edge_variance: [edge_variance(0, leaks), edge_variance(1, leaks)],
        });
        groups
            .chain(SpectralBand::nodes(media))
            .map(|part| IlluminationBuffer::of_cells(device, scene, optics, &self.lattice, &part))
            .collect()
    }
}

/// Constants of the energies for kernels, and behind them the mean ones, with the number of moments of variances: of each
/// pair of materials where surfaces are rough, and of each material where some scatter.
fn constants(media: &MaterialTable, reference: &[Constants]) -> (Vec<f32>, u32) {
    let (materials, scattering) = (media.names.len(), media.scattering_words());
    let words = (materials * MOMENTS_PER_MATERIAL..scattering.start).step_by(MOMENTS_PER_PAIR);
    let all_pairs = (1..materials).flat_map(|b| (0..b).map(move |a| [a, b]));
    let pairs: Vec<([usize; 2], usize)> = all_pairs.zip(words.map(|word| word + 2)).collect();
    let words = pairs.iter().map(|(_, word)| *word).chain(scattering.clone());
    let mut all: Vec<f64> = words.map(|word| word as f64).collect();
    let variances = count(all.len());
    let ratios = media.refraction_ratios(reference);
    let means = std::iter::once((reference, 1.0));
    for (node, ratio) in media.constants.iter().map(Vec::as_slice).zip(ratios).chain(means) {
        all.push(ratio);
        all.extend(node.iter().flat_map(|it| [it.mu, it.delta]));
        all.extend(pairs.iter().map(|([a, b], _)| (node[*a].delta - node[*b].delta).powi(2)));
        all.extend(node.iter().take(scattering.len()).map(|it| it.scattering));
    }
    (all.into_iter().map(single).collect(), variances)
}
