//! Noise of the flat in the images of a retrieval, where views share it.

use super::quantity::Quantity;
use crate::retrieve::Record;
use beamlet_core::Result;
use beamlet_core::numbers::single;
use beamlet_files::{Maps, layout::RECORD};
use ndarray::Array2;
use std::path::PathBuf;

/// Noise that the flat adds to the sinograms of all views.
#[derive(Debug)]
pub(super) enum SharedNoise {
    /// Each view has a flat of its own.
    None,
    /// One flat: its deviations of the values of sinograms, one image for each folder, `[row][column]`.
    Known(Vec<Array2<f32>>),
    /// The images do not determine the noise that views share, for this reason.
    Unknown(&'static str),
}

impl SharedNoise {
    /// Words for the record.
    pub(super) fn words(&self) -> String {
        match self {
            Self::None => "each view has a flat of its own".to_owned(),
            Self::Known(_) => "included".to_owned(),
            Self::Unknown(reason) => format!("unknown: {reason}"),
        }
    }

    /// The noise of the flats of folders of images in the sinograms of a quantity.
    ///
    /// # Errors
    /// [`beamlet_core::Error::File`] for images that cannot be read.
    pub(super) fn of(folders: &[(PathBuf, Maps)], quantity: Quantity) -> Result<Self> {
        let mut all = Vec::new();
        let mut flats = Vec::new();
        for (path, maps) in folders {
            let record = Record::read(&path.join(RECORD))?;
            if record.flats_every.is_some() {
                return Ok(Self::Unknown("flats are interpolated between views"));
            }
            if !maps.is_shared("flat_centre") {
                return Ok(Self::None);
            }
            let names = match quantity {
                Quantity::Mu => ["flat_area_sigma", "flat_width"],
                Quantity::Delta => ["flat_centre_sigma", "flat_width"],
                Quantity::DarkField => ["flat_width_sigma", "flat_width"],
            };
            if !names.iter().all(|name| maps.names().any(|other| other == *name)) {
                return Ok(Self::Unknown("the images have no flat_area_sigma: retrieve again"));
            }
            let flat = record.sources.first().cloned();
            if !record.columns.is_empty() || (flat.is_some() && flats.contains(&flat)) {
                return Ok(Self::Unknown("dithers share a flat"));
            }
            flats.push(flat);
            let [mut sigmas, widths] = [maps.map(names[0], 0)?, maps.map(names[1], 0)?];
            let angle = record.angle_per_shift;
            sigmas.zip_mut_with(&widths, |sigma, width| {
                let factor = match quantity {
                    Quantity::Mu => 1.0,
                    Quantity::Delta => angle.abs(),
                    Quantity::DarkField => 2.0 * angle * angle * f64::from(*width),
                };
                *sigma = single(factor * f64::from(*sigma));
            });
            all.push(sigmas);
        }
        Ok(Self::Known(all))
    }
}
