//! Beamlets and curves in two directions whose contrasts are known, made in f64 by quadrature.

mod beamlets;
mod light;
mod noise;
mod steps;

use super::super::images::Images;
use super::super::options::RetrieveOptions;
use super::super::retriever::Retriever;
use super::{Design, Lattice};
use beamlet_model::scene::Scene;
use light::{Blurred, Contrasts};
use ndarray::Array3;

/// Rotation centre to detector, m.
pub(super) const ARM: f64 = 0.59;
/// How much larger the mask is on the detector.
pub(super) const MAGNIFICATION: f64 = 1.5;
/// Names of the contrasts in the order of [`Contrasts`].
pub(super) const NAMES: [&str; 6] = super::super::images::CONTRASTS;

/// A sample mask alone before a detector of pixels of 10 um.
pub(super) struct Tracking {
    pub(super) lattice: Lattice,
    /// Place of a beamlet from the middle of the frame, m.
    pub(super) origin: [f64; 2],
    pub(super) light: Blurred,
    /// Rows and columns.
    pub(super) shape: [usize; 2],
}

pub(super) const PIXEL: f64 = 10e-6;

/// A scene of one or two masks before pixels of 10 um.
pub(super) fn scene([rows, columns]: [usize; 2], more: &str) -> Scene {
    let text = format!(
        "[source]\ndistance = \"1.21 m\"\nspot = [\"30 um\", \"30 um\"]\nenergy = \"30 keV\"\n\
         [detector]\ndistance = \"1.8 m\"\npixels = [{columns}, {rows}]\npitch = \"10 um\"\n\
         [sample_mask]\ndistance = \"1.2 m\"\nperiod = \"40 um\"\ntransmission = 0.0\n\
         aperture = \"10 um\"\n{more}"
    );
    Scene::from_toml(&text, ".").unwrap()
}

impl Tracking {
    /// Frame of beamlets behind an object of these contrasts.
    pub(super) fn frame(&self, of: &Contrasts) -> Array3<f32> {
        let [rows, columns] = self.shape;
        let blurred = self.light.behind(of, ARM);
        let mut frame = Array3::<f64>::zeros((1, rows, columns));
        let [height, width] = self.shape.map(|count| count as f64 * PIXEL);
        let reach = blurred.reach();
        let count = ((height + width) / self.lattice.distance()).ceil() as i64;
        for i in -count..=count {
            for j in -count..=count {
                let [x, z] = self.lattice.place([i as f64, j as f64]);
                let shift = [of.0[1] * ARM, of.0[2] * ARM];
                let centre = [x + self.origin[0] + shift[0], z + self.origin[1] + shift[1]];
                let off = [centre[0].abs() - width / 2.0, centre[1].abs() - height / 2.0];
                if off[0] < reach && off[1] < reach {
                    blurred.add(&mut frame, centre);
                }
            }
        }
        frame.mapv(|value| value as f32)
    }

    /// A retriever with this flat.
    pub(super) fn retriever_of(&self, options: &RetrieveOptions, flat: &Array3<f32>) -> Retriever {
        let scene = scene(self.shape, "");
        let design = Design::Beamlets(self.lattice);
        let mut retriever = Retriever::in_two_directions(&scene, &design, options).unwrap();
        retriever.set_flat_array(flat.view()).unwrap();
        retriever
    }

    /// Images of a sample frame.
    pub(super) fn images(&self, options: &RetrieveOptions, frames: [&Array3<f32>; 2]) -> Images {
        self.retriever_of(options, frames[0]).retrieve_array(frames[1].view()).unwrap()
    }
}

/// Values of an image that are numbers.
pub(super) fn known(images: &Images, name: &str) -> Vec<f64> {
    let values = images.get(name).unwrap().iter().map(|value| f64::from(*value));
    values.filter(|value| value.is_finite()).collect()
}

/// Asserts that every value of the contrasts is within a part of the truth, or of `units` where it is small.
pub(super) fn assert_within(images: &Images, truth: &Contrasts, parts: [f64; 6], about: &str) {
    for (k, name) in NAMES.into_iter().enumerate() {
        let values = known(images, name);
        assert!(values.len() >= 6, "{about}: {} values of {name}", values.len());
        let scale = truth.scale()[k];
        for value in values {
            let off = (value - truth.0[k]).abs() / scale;
            assert!(off < parts[k], "{about}: {name} {value:e}, truth {:e}", truth.0[k]);
        }
    }
}
