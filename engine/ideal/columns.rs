//! Columns of ideal images: where the light of each passes, and how far it may be deflected.

use beamlet_core::Result;
use beamlet_model::optics::Optics;
use beamlet_model::scene::Scene;
use beamlet_recon::retrieve::beamlets::Beamlets;
use beamlet_recon::retrieve::joined::JoinedColumns;
use beamlet_recon::retrieve::method::Method;
use beamlet_recon::retrieve::{centre_of_lights, columns_of_images};

/// Columns of the images of a view.
#[derive(Debug)]
pub(super) struct IdealColumns {
    /// Openings of each, x from the optical axis on the detector, m; none behind bars.
    pub(super) openings: Vec<Vec<[f64; 2]>>,
    /// Centres as geometry.json has them, m.
    pub(super) places: Vec<f64>,
    /// Columns of all dithers side by side.
    pub(super) joined: Option<JoinedColumns>,
}

impl IdealColumns {
    /// Columns of the images that retrieval makes of the scene: pixels, or beamlets behind a sample mask
    /// alone.
    pub(super) fn of(scene: &Scene) -> Result<Self> {
        let optics = Optics::of(scene);
        let offset = optics.offsets.lists()[0][0];
        let tracks = scene.detector_mask.is_none()
            && scene.scan.mask_offsets.len() == 1
            && Method::Beamlet.check(scene, &scene.scan.mask_offsets).is_ok();
        let (openings, places) = match &optics.sample_mask {
            Some(mask) if tracks => {
                let places = Beamlets::of(scene)?.places().to_vec();
                let seen = mask.openings_in_columns(&optics.detector, offset);
                let half = 0.5 * seen.narrowest(0) * optics.detector.pitch[0];
                (places.iter().map(|at| vec![[at - half, at + half]]).collect(), places)
            }
            _ => of_frames(scene, &optics, offset),
        };
        let joined = JoinedColumns::of(scene, &places);
        Ok(Self { openings, places, joined })
    }

    /// Place on the detector of a share of the width of all openings of a column, m. Columns without
    /// openings have none.
    pub(super) fn at(&self, column: usize, share: f64) -> Option<f64> {
        let openings = &self.openings[column];
        let width: f64 = openings.iter().map(|[low, high]| high - low).sum();
        let mut rest = share * width;
        for [low, high] in openings {
            if rest <= high - low {
                return Some(low + rest);
            }
            rest -= high - low;
        }
        openings.last().map(|[_, high]| *high)
    }

    /// Places of the columns of the images, all dithers side by side, m.
    pub(super) fn places_of_images(&self) -> Vec<f64> {
        self.joined.as_ref().map_or_else(|| self.places.clone(), |it| it.places().to_vec())
    }
}

/// Openings and places of the columns of images that are made of columns of frames.
fn of_frames(scene: &Scene, optics: &Optics, offset: f64) -> (Vec<Vec<[f64; 2]>>, Vec<f64>) {
    let (openings, lights) = (optics.column_openings(offset), optics.column_lights());
    let of_image = |columns: &Vec<usize>| {
        let own: Vec<[f64; 2]> =
            columns.iter().flat_map(|column| openings[*column].iter().copied()).collect();
        let own_lights: Vec<[f64; 2]> = columns.iter().map(|column| lights[*column]).collect();
        (own, centre_of_lights(&own_lights))
    };
    columns_of_images(scene).iter().map(of_image).unzip()
}

/// Refraction angle that moves light by half a period of the sample mask on the analyser, rad; infinite
/// without a sample mask.
pub(super) fn half_period(scene: &Scene) -> f64 {
    let optics = Optics::of(scene);
    0.5 * optics.curve_period() * scene.magnification() / scene.lever_arm()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_run_through_the_openings_of_a_column() {
        let openings = vec![vec![[0.0, 1.0], [3.0, 6.0]], Vec::new()];
        let columns = IdealColumns { openings, places: vec![0.0; 2], joined: None };
        assert_eq!(columns.at(0, 0.125), Some(0.5));
        assert_eq!(columns.at(0, 0.5), Some(4.0));
        assert_eq!(columns.at(0, 1.0), Some(6.0));
        assert_eq!(columns.at(1, 0.5), None);
    }
}
