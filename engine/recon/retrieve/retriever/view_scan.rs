//! Mask offsets of the sample in a view, and what fits curves at them.

use super::super::fitter::Fitter;
use super::super::method::Method;
use super::super::scan::along;
use super::super::value_noise::{NoiseFactors, ValueNoise};
use super::Retriever;
use beamlet_core::{Error, Result};
use beamlet_model::optics::WholePeriods;
use beamlet_model::scene::Scene;
use std::borrow::Cow;

/// Offsets of each angle, if they differ from the flat's.
#[derive(Debug)]
pub(super) struct ViewScans {
    /// Offsets without whole periods, m, by angle.
    lists: Vec<Vec<[f64; 2]>>,
    /// Views of an angle.
    dithers: usize,
}

/// Corrections of the frames of a view before its curves are fitted.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Corrected<'a> {
    /// Mask offsets of the frames, m, without whole periods; `None`: as they were to be.
    pub(crate) offsets: Option<&'a [[f64; 2]]>,
    /// Noise of the values, which were divided by the doses: the mean of the frames.
    pub(crate) noise: NoiseFactors,
}

impl Corrected<'_> {
    /// Frames as they are.
    pub(crate) const NONE: Self = Self { offsets: None, noise: NoiseFactors::ONE };
}

/// The scan of a view.
#[derive(Debug)]
pub(in crate::retrieve) struct ViewScan<'a> {
    pub(crate) offsets: &'a [[f64; 2]],
    /// Noise of its values.
    pub(crate) noise: ValueNoise,
    pub(crate) fitter: Option<Cow<'a, Fitter>>,
}

impl ViewScans {
    /// The offsets of the angles of a scene, of each list along x by `offsets`; `None` if all equal the flat's.
    ///
    /// # Errors
    /// Those of `offsets`, with the angle.
    pub(super) fn of(
        scene: &Scene,
        offsets: impl Fn(&[f64]) -> Result<Vec<[f64; 2]>>,
    ) -> Result<Option<Self>> {
        let scan = &scene.scan;
        if scan.view_offsets.iter().all(|list| *list == scan.mask_offsets) {
            return Ok(None);
        }
        let of_angle = |(angle, list): (usize, &Vec<f64>)| {
            offsets(list).map_err(|error| match error {
                Error::Scene { key, found, allowed, .. } if key == "scan.mask_offsets" => {
                    Error::scene(format!("scan.view_offsets[{angle}]"), found, allowed)
                }
                other => other,
            })
        };
        let lists = scan.view_offsets.iter().enumerate().map(of_angle).collect::<Result<_>>()?;
        Ok(Some(Self { lists, dithers: scan.dithers_of_angle() }))
    }

    /// The offsets of the angles of slits whose flat has `periods`.
    ///
    /// # Errors
    /// [`Error::Scene`] with the angle whose offsets `method` cannot serve.
    pub(super) fn of_slits(
        scene: &Scene,
        method: Method,
        periods: WholePeriods,
    ) -> Result<Option<Self>> {
        let steps = scene.scan.mask_offsets.len();
        Self::of(scene, |list| {
            if steps == 1 || method == Method::Beamlet {
                let found = format!("{steps} mask steps at each angle, which differ");
                let allowed = match method == Method::Beamlet {
                    true => "beamlet needs the same offset at every angle".to_owned(),
                    false => format!(
                        "{method} fits a curve in every view: steps of several angles form no curve, since the sample turns between them"
                    ),
                };
                return Err(Error::scene("scan.view_offsets", found, allowed));
            }
            method.check(scene, list)?;
            let x = periods.nearest_to(&scene.scan.mask_offsets, list).without(list);
            Ok(x.into_iter().map(|x| [x, 0.0]).collect())
        })
    }

    /// Angles with offsets.
    pub(super) fn angles(&self) -> usize {
        self.lists.len()
    }
}

impl Retriever {
    /// Refuses more views than have mask offsets.
    ///
    /// # Errors
    /// [`Error::Scene`].
    pub(in super::super) fn check_views(&self, views: usize) -> Result<()> {
        let Some(scans) = &self.view_scans else { return Ok(()) };
        let has = scans.angles() * scans.dithers;
        if views <= has {
            return Ok(());
        }
        let found = format!("offsets of {has} views for {views}");
        Err(Error::scene("scan.view_offsets", found, "offsets of every view of the sample"))
    }

    /// The scan of a view of the sample, with the corrections of its frames.
    ///
    /// # Errors
    /// [`Error::Argument`] where the scene has no offsets of the view; [`Error::Device`],
    /// [`Error::Memory`].
    pub(super) fn view_scan<'a>(
        &'a self,
        view: usize,
        corrected: Corrected<'a>,
    ) -> Result<ViewScan<'a>> {
        let own = corrected.offsets.map_or_else(|| self.own_offsets(view), |own| Ok(Some(own)))?;
        self.scan_at(own, corrected.noise)
    }

    /// The scan of values at other offsets than those of the flat, where they are given, and with this noise.
    ///
    /// # Errors
    /// [`Error::Device`], [`Error::Memory`].
    pub(in crate::retrieve) fn scan_at<'a>(
        &'a self,
        offsets: Option<&'a [[f64; 2]]>,
        noise: NoiseFactors,
    ) -> Result<ViewScan<'a>> {
        let is_usual = offsets.is_none() && noise.is_one();
        let (offsets, noise) = (offsets.unwrap_or(&self.offsets), self.value_noise(noise));
        let fitter = match self.layout.fitter() {
            Some(fitter) if is_usual => Some(Cow::Borrowed(fitter)),
            Some(fitter) => Some(Cow::Owned(fitter.at(&along(offsets, 0), noise)?)),
            None => None,
        };
        Ok(ViewScan { offsets, noise, fitter })
    }

    /// Offsets of a view, if views have offsets of their own.
    pub(super) fn own_offsets(&self, view: usize) -> Result<Option<&[[f64; 2]]>> {
        let Some(scans) = &self.view_scans else { return Ok(None) };
        let Some(offsets) = scans.lists.get(view / scans.dithers) else {
            let found = format!("view {view}");
            let views = scans.angles() * scans.dithers;
            let allowed = format!("0 to {}, of which the scene has mask offsets", views - 1);
            return Err(Error::argument("view", found, allowed));
        };
        Ok(Some(offsets))
    }
}
