//! A volume of sinograms that are corrected first: for beam hardening, views that lost their refraction, and rings.

use super::data::Data;
use super::geometry::ScanGeometry;
use super::hardening::BeamHardening;
use super::lost_record::MomentRecord;
use super::lost_views::LostViews;
use super::measured::Measured;
use super::method::Made;
use super::plan::VolumePlan;
use super::prepare::fill_images;
use super::quantity::Quantity;
use super::rings::suppress_rings;
use beamlet_core::Result;
use beamlet_core::rows_control::RowsControl;
use beamlet_gpu::Compute;
use ndarray::{Array2, Array3, ArrayView3};

/// Sinograms of a quantity, `[view][row][column]`, with the arrays beside them.
#[derive(Debug)]
pub struct Sinograms<'a> {
    /// The quantity.
    pub quantity: Quantity,
    /// −ln T, refraction angles (rad), or variances (rad²).
    pub values: Array3<f32>,
    /// Weights of the values, in iterative methods; values of weight 0 may be anything.
    pub weights: Option<Array3<f32>>,
    /// Views and rows in which a body reaches an end of the row; where nothing is known of it, `None`.
    pub reaching: Option<Array2<bool>>,
    /// Voxels that may differ from zero, `[z][y][x]`.
    pub mask: Option<ArrayView3<'a, bool>>,
    /// Volume that iterations begin with, `[z][y][x]`.
    pub start: Option<ArrayView3<'a, f32>>,
}

/// A volume of corrected sinograms.
#[derive(Debug)]
pub struct SinogramVolume {
    /// The volume.
    pub made: Made,
    /// Correction of −ln T for beam hardening.
    pub hardening: Option<BeamHardening>,
    /// Moments of refraction angles, and the views that lost them.
    pub moments: Option<MomentRecord>,
}

/// Corrects sinograms as a plan says, and reconstructs them by its method.
///
/// # Errors
/// As the corrections and the method.
pub fn reconstruct_sinograms(
    compute: &Compute,
    geometry: &ScanGeometry,
    plan: &VolumePlan,
    sinograms: Sinograms<'_>,
    control: &mut RowsControl<'_>,
) -> Result<SinogramVolume> {
    let Sinograms { quantity, mut values, mut weights, reaching, mask, start } = sinograms;
    let (mut hardening, mut moments) = (None, None);
    if let (Quantity::Mu, Some(choice)) = (quantity, &plan.beam_hardening) {
        let most = values.iter().copied().fold(0.0, f32::max);
        let polynomial = BeamHardening::up_to(choice, most.into())?;
        polynomial.apply_until(&mut values, &control.cancel)?;
        hardening = Some(polynomial);
    }
    if quantity == Quantity::Delta {
        let mut lost = lost_views(geometry, values.view(), weights.as_ref(), reaching)?;
        let chosen = (&plan.method, plan.keep_views);
        weights = lost.leave_out(geometry, chosen, &mut values, weights)?;
        moments = Some(lost.record().clone());
    }
    if plan.rings {
        suppress_rings(geometry, values.view_mut(), &control.cancel)?;
    }
    let measured = Measured::new(Data::of(quantity), values.view())
        .with_weights(weights.as_ref().map(|weights| weights.view()))
        .with_mask(mask)
        .with_start(start);
    let made = plan.method.volume(compute, geometry, &measured, &plan.grid, control)?;
    Ok(SinogramVolume { made, hardening, moments })
}

/// Views that lost their refraction. Values of weight 0 are filled from the pixels beside them; views without any
/// weight are not compared.
fn lost_views(
    geometry: &ScanGeometry,
    values: ArrayView3<'_, f32>,
    weights: Option<&Array3<f32>>,
    reaching: Option<Array2<bool>>,
) -> Result<LostViews> {
    let Some(weights) = weights else {
        return LostViews::find(geometry, values, reaching.as_ref().map(|it| it.view()));
    };
    let (views, rows, _) = values.dim();
    let mut unknown = reaching.unwrap_or_else(|| Array2::default((views, rows)));
    let mut angles = values.to_owned();
    for (number, (mut image, weights)) in
        angles.outer_iter_mut().zip(weights.outer_iter()).enumerate()
    {
        if weights.iter().all(|weight| *weight == 0.0) {
            image.fill(0.0);
            unknown.row_mut(number).fill(true);
            continue;
        }
        image.zip_mut_with(&weights, |angle, weight| {
            if *weight == 0.0 {
                *angle = f32::NAN;
            }
        });
    }
    let places = [&geometry.columns, &geometry.rows].map(Vec::as_slice);
    let (known, _) = fill_images(places, Quantity::Delta, angles.view(), None)?;
    LostViews::find(geometry, known.view(), Some(unknown.view()))
}
