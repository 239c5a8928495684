//! Uncertainties that a set-up has without a sample.

use super::curves::Fits;
use super::images::{self, CONTRASTS};
use super::misfit::median;
use super::options::RetrieveOptions;
use super::planar::Design;
use super::retriever::{Layout, Retriever};
use super::value_noise::NoiseFactors;
use beamlet_core::Result;
use beamlet_core::cancel::Cancel;
use beamlet_model::scene::Scene;
use ndarray::{ArrayView3, s};

/// Most rows in the middle of a frame whose pixels are fitted.
const MOST_ROWS: usize = 8;
/// Most values of the model for them: some seconds.
const MOST_VALUES: usize = 1 << 24;

/// Median 1 sigma of transmission, refraction along x and z (rad), and dark field xx, zz and xz (rad^2), where flat and
/// sample have the noise of the options: of a flat without noise, `[step][row][column]`, on the detector of the scene.
/// `None` for slits that are moved along x, and for lists of many apertures, whose fits take minutes; a contrast
/// without an answer has none.
///
/// # Errors
/// [`beamlet_core::Error::Argument`] and [`beamlet_core::Error::Scene`] for a set-up or options that no method takes.
pub fn sigmas_in_two_directions(
    scene: &Scene,
    options: &RetrieveOptions,
    flat: ArrayView3<'_, f32>,
) -> Result<Option<[Option<f64>; 6]>> {
    let Some(design) = Design::of(scene, options)? else { return Ok(None) };
    let mut retriever = Retriever::in_two_directions(scene, &design, options)?;
    let (steps, rows, columns) = flat.dim();
    let Layout::Steps(curves) = retriever.layout() else {
        retriever.set_flat_array(flat)?;
        return Ok(retriever.flat_curves().map(|flat| retriever.sigmas(flat)));
    };
    let most = MOST_VALUES / (columns * steps * curves.model.model.terms()).max(1);
    let most = most.min(MOST_ROWS).min(rows);
    if most == 0 {
        return Ok(None);
    }
    let first = (rows - most) / 2;
    let some = flat.slice(s![.., first..first + most, ..]).to_owned();
    let scan = retriever.scan_at(None, NoiseFactors::ONE)?;
    let band = (some, beamlet_core::numbers::count(first));
    Ok(Some(retriever.sigmas(&retriever.curves(band, &scan, None, &Cancel::default())?)))
}

impl Retriever {
    /// Expected 1 sigma of the contrasts in two directions where nothing is in the beam, median over the image: with the
    /// noise of counts in flat and sample alike; for weights by counts the inverse of the Fisher information. Empty
    /// where values are no counts or a contrast has none, and of slits.
    pub(super) fn expected(&self) -> Vec<(&'static str, f64)> {
        let planar = self.flat_curves().filter(|flat| flat.planar(0).is_some());
        let Some(flat) = planar.filter(|_| self.options().gain.is_some()) else {
            return Vec::new();
        };
        let sigmas: Option<Vec<f64>> = self.sigmas(flat).into_iter().collect();
        CONTRASTS.into_iter().zip(sigmas.unwrap_or_default()).collect()
    }

    /// Median 1 sigma of each contrast where flat and sample have the noise of these curves; `None` where no curve
    /// determines it.
    fn sigmas(&self, flat: &Fits) -> [Option<f64>; 6] {
        let of = |curve| images::contrasts(&curve, &curve, self.angle_per_shift());
        let known: Vec<[f64; 12]> = flat.known().map(of).collect();
        std::array::from_fn(|k| median(known.iter().map(|of| of[6 + k]).collect()))
    }
}
