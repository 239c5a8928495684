//! The quantity that all designs have in common: it sets the exposure of each.

use crate::check::ScanExposure;
use beamlet_core::units::Dimension;
use beamlet_core::units::number;
use beamlet_core::{Error, Result};
use beamlet_model::scene::{Photons, Scene};

/// A quantity of the scan.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Quantity {
    Time,
    Dose,
    Photons,
}

const QUANTITIES: [(&str, Quantity); 3] =
    [("time", Quantity::Time), ("dose", Quantity::Dose), ("photons", Quantity::Photons)];

/// The quantity that all designs have in common, and its value in SI units: exposure time of all frames, dose in water
/// at the axis of rotation, or photons of an open pixel over all frames with the sample.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Fixed {
    quantity: Quantity,
    /// `None`: the value of the scene without changes.
    value: Option<f64>,
}

impl Fixed {
    /// The quantity by its name, with its value where it is not that of the scene: "time=60 s".
    ///
    /// # Errors
    /// [`Error::Argument`] for another name, and a value that is no quantity above 0.
    pub(super) fn of(text: &str) -> Result<Self> {
        let (name, value) = text.split_once('=').map_or((text, None), |(n, v)| (n, Some(v)));
        let allowed = "time, dose or photons, alone or with a value above 0, as in \"time=60 s\", \"dose=5 mGy\", \
                       \"photons=1e6\"";
        let wrong = |found: String| Error::argument("fix", found, allowed);
        let known = QUANTITIES.iter().find(|known| known.0 == name.trim());
        let quantity = known.ok_or_else(|| wrong(format!("{:?}", name.trim())))?.1;
        let read = |value: &str| match quantity {
            Quantity::Time => Dimension::Time.parse(value).ok(),
            Quantity::Dose => Dimension::Dose.parse(value).ok(),
            Quantity::Photons => number(value),
        };
        let value = match value {
            None => None,
            Some(text) => {
                let value = read(text).filter(|value| value.is_finite() && *value > 0.0);
                Some(value.ok_or_else(|| wrong(format!("{:?}", text.trim())))?)
            }
        };
        Ok(Self { quantity, value })
    }

    /// True if a key of the scene sets photons or exposure.
    #[must_use]
    pub(super) fn sets(key: &str) -> bool {
        ["detector.photons", "detector.exposure"].contains(&key)
    }

    /// Takes the value of a scene where it has none.
    ///
    /// # Errors
    /// As [`Self::apply`].
    pub(super) fn resolve(&mut self, scene: &Scene) -> Result<()> {
        let of_scene = self.of_exposure(scene, &exposure(scene)?)?;
        self.value.get_or_insert(of_scene);
        Ok(())
    }

    /// Changes photons or exposure of a scene so that it has the quantity; gives the exposure.
    ///
    /// # Errors
    /// [`Error::Argument`] for a scene without photons, and a time without `detector.exposure`; errors of the beam.
    pub(super) fn apply(&self, scene: &mut Scene) -> Result<ScanExposure> {
        let found = exposure(scene)?;
        let now = self.of_exposure(scene, &found)?;
        let scale = self.value.unwrap_or(now) / now;
        if let Some(counts) = &mut scene.detector.counts {
            match &mut counts.photons {
                Photons::Number(value) | Photons::Exposure(value) => *value *= scale,
            }
        }
        Ok(found.scaled(scale))
    }

    fn of_exposure(&self, scene: &Scene, exposure: &ScanExposure) -> Result<f64> {
        match self.quantity {
            Quantity::Dose => Ok(exposure.water_dose),
            Quantity::Photons => {
                Ok(exposure.photons * (scene.scan.views() * scene.mask_steps()) as f64)
            }
            Quantity::Time => exposure.time.ok_or_else(|| {
                let allowed = "a scene with detector.exposure and source.current; or --fix photons";
                Error::argument("fix", "a time of a scene without exposure", allowed)
            }),
        }
    }
}

/// The exposure of a scene with photons.
pub(super) fn exposure(scene: &Scene) -> Result<ScanExposure> {
    let Some(counts) = &scene.detector.counts else {
        let allowed = "detector.photons, or detector.exposure with source.current";
        return Err(Error::argument("scene", "no photons", allowed));
    };
    ScanExposure::of(scene, counts)
}
