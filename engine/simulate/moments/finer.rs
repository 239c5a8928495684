//! Requirements of a scene on kept cells that exceed those of the run.

use crate::sampling::Lattice;
use beamlet_core::Result;
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::{self, Optics};
use beamlet_model::scene::Scene;

/// Rounding of lengths that count as the same.
const SAME: f64 = 1e-9;
/// Fraction of the run's lengths, all together, down to which its cells serve: their error grows in
/// proportion.
const SERVED: f64 = 0.75;

/// A key of a scene by which kept cells may be too coarse, with the two values.
#[derive(Debug, Clone, PartialEq)]
pub struct Finer {
    /// Path of the key.
    pub(crate) key: String,
    /// Its value in the scene.
    pub(crate) found: String,
    /// Its value in the run.
    pub(crate) of_run: String,
}

/// One side of the comparison.
pub(super) struct SetUp<'a> {
    optics: &'a Optics,
    lattice: &'a Lattice,
    media: &'a MaterialTable,
    /// Shares of the light that bars stop, by mask; 1 without the mask.
    stopped: [f64; 2],
}

/// A length that cells were refined for: smaller ones need finer cells.
struct Scale {
    key: &'static str,
    what: &'static str,
    /// Unit of the text, and how many there are to 1.
    unit: (&'static str, f64),
    values: [f64; 2],
}

impl<'a> SetUp<'a> {
    /// # Errors
    /// Errors of a material of a mask without constants at an energy.
    pub(super) fn new(
        scene: &'a Scene,
        optics: &'a Optics,
        lattice: &'a Lattice,
        media: &'a MaterialTable,
    ) -> Result<Self> {
        let leaks = optics::mean_leaks(scene, optics, (&media.energies, &media.weights))?;
        // Bars that stop nothing have no edge that would need finer cells.
        let stopped = leaks.map(|leak| (1.0 - leak).max(SAME));
        Ok(Self { optics, lattice, media, stopped })
    }

    /// Blur at the rotation centre over the lever arm: angle of refraction that windows resolve. Infinite
    /// without a lever.
    fn angle(&self) -> f64 {
        self.lattice.edge_blur / self.optics.lever_arm.max(f64::MIN_POSITIVE)
    }

    /// Width of apertures as seen from the source, by mask: of any width where there is none.
    fn apertures(&self) -> [f64; 2] {
        [&self.optics.sample_mask, &self.optics.detector_mask]
            .map(|mask| mask.as_ref().map_or(f64::INFINITY, |mask| mask.openings(1.0).narrowest(0)))
    }

    /// Pitch of the light's grid as seen from the source, along x and z.
    fn pitches(&self) -> [f64; 2] {
        [0, 1].map(|axis| self.optics.detector.pitch_at(axis, 1.0))
    }

    /// The strongest refraction and attenuation.
    fn strongest(&self) -> [f64; 2] {
        let mu = self.media.constants.iter().flatten().map(|c| c.mu).fold(0.0, f64::max);
        [self.media.strongest(), mu]
    }
}

/// The key by which `now` most needs finer cells than `was`; `cut`: cells are cut at other beamlets or
/// rows.
pub(super) fn finer(was: &SetUp<'_>, now: &SetUp<'_>, cut: bool) -> Option<Finer> {
    let both = [was, now];
    let [apertures, pitches] = [both.map(SetUp::apertures), both.map(SetUp::pitches)];
    let strongest = both.map(SetUp::strongest);
    let micro = ("urad", 1e6);
    let scale = |key, what, unit, values| Scale { key, what, unit, values };
    let of = |pairs: [[f64; 2]; 2], i: usize| [pairs[0][i], pairs[1][i]];
    let stopped = |mask: usize| [was.stopped[mask], now.stopped[mask]];
    let inverse = |values: [f64; 2]| values.map(|value| 1.0 / value.max(f64::MIN_POSITIVE));
    let scales = [
        scale("detector.pitch", "rows seen under", micro, of(pitches, 1)),
        scale("detector.pitch", "columns seen under", micro, of(pitches, 0)),
        scale("sample_mask", "apertures seen under", micro, of(apertures, 0)),
        scale("detector_mask", "apertures seen under", micro, of(apertures, 1)),
        scale("sample_mask", "bars that stop a share of", ("", 1.0), stopped(0)),
        scale("detector_mask", "bars that stop a share of", ("", 1.0), stopped(1)),
        scale("source.spot", "a blur over lever arm of", micro, both.map(SetUp::angle)),
        scale("source", "an inverse of delta of", ("", 1.0), inverse(of(strongest, 0))),
        scale("source", "an attenuation length of", ("um", 1e6), inverse(of(strongest, 1))),
    ];
    let part = |scale: &Scale| (scale.values[1] / scale.values[0]).min(1.0);
    let all: f64 = scales.iter().map(part).product();
    let finest = scales.into_iter().min_by(|a, b| part(a).total_cmp(&part(b)));
    let finest = finest.filter(|_| all < SERVED);
    let text = |scale: &Scale, value: f64| {
        let (unit, per) = scale.unit;
        match value.is_finite() {
            true => format!("{} {:.4e} {unit}", scale.what, value * per),
            false => "none".into(),
        }
    };
    let found = finest.map(|scale| Finer {
        key: scale.key.into(),
        found: text(&scale, scale.values[1]),
        of_run: text(&scale, scale.values[0]),
    });
    let cut = cut.then(|| Finer {
        key: "detector".into(),
        found: "other beamlets or rows".into(),
        of_run: "cells between the borders of its own".into(),
    });
    found.or(cut)
}
