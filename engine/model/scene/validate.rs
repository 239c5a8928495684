//! Requirements on a scene, read from a file or built in the library.

use std::collections::HashSet;

use super::keys::detector::validate_thresholds;
use super::keys::faults::{Faults, named, too_long};
use super::keys::material::MaterialEntry;
use super::keys::record::check;
use super::{
    Beam, Exposure, MaskSpec, Motion, Photons, Quality, Scene, Scheme, SpectrumOrigin,
    SpectrumSpec, Transport, limits, path,
};
use crate::spot::Spot;
use beamlet_core::units::Dimension::Length;
use beamlet_core::{Error, Result, numbers};

impl Scene {
    /// Checks every range, and the order of the elements along the optical axis. The existence of meshes,
    /// the names of materials, and the clearance of the sample are checked where they are loaded.
    ///
    /// # Errors
    ///
    /// [`Error::Scene`] for a value that is not allowed, with its key; [`Error::Several`] for more
    /// than one.
    pub fn validate(&self) -> Result<()> {
        Error::of_all(self.faults())
    }

    /// The errors of all values that are not allowed.
    pub(super) fn faults(&self) -> Vec<Error> {
        let mut faults = Faults::default();
        let below = |table: &str| {
            let table = table.to_owned();
            move |name: &str| format!("{table}.{name}")
        };
        check(&self.source, &below("source"), &mut faults);
        faults.note(spot_in_view(&self.source.spot, self.detector.pitch, self.detector.pixels));
        check(&self.detector, &below("detector"), &mut faults);
        faults.note(self.validate_energies());
        faults.note(self.validate_exposure());
        self.validate_order(&mut faults);
        for (key, mask) in self.masks() {
            check(mask, &below(key), &mut faults);
        }
        self.validate_apertures(&mut faults);
        faults.note(self.validate_sample_mask());
        faults.note(self.validate_detector_mask());
        faults.note(self.validate_periods());
        faults.note(self.validate_shadows());
        faults.note(self.validate_heights());
        check(&self.sampling, &below("sampling"), &mut faults);
        if self.sampling.quality == Some(Quality::Noise) && self.detector.counts.is_none() {
            let allowed =
                "\"standard\" or \"fine\"; \"noise\" needs detector.photons or detector.exposure";
            faults.add(Error::scene("sampling.quality", "\"noise\" without photons", allowed));
        }
        check(&self.scan, &below("scan"), &mut faults);
        if self.scan.darks_every.is_some() && self.detector.counts.is_none() {
            let allowed = "detector.photons or detector.exposure: dark frames are detector numbers";
            faults.add(Error::scene("scan.darks_every", "dark frames without photons", allowed));
        }
        faults.note(self.validate_offsets("scan.mask_offsets", &self.scan.mask_offsets));
        faults.note(self.validate_offsets_z());
        faults.note(self.validate_view_offsets());
        faults.note(self.validate_motions());
        faults.note(self.validate_errors());
        for (name, spec) in &self.materials {
            faults.note(named("materials", name));
            let table = path::join("materials", name);
            let entry = MaterialEntry::of(self, name, spec);
            check(&entry, &|key| path::join(&table, key), &mut faults);
        }
        faults.note(self.validate_scattering());
        faults.note(named(self.surroundings_key(), &self.surroundings));
        faults.note(named("surroundings.path_material", &self.path_material));
        let mut names = HashSet::new();
        for (index, object) in self.objects.iter().enumerate() {
            let key = |key: &str| self.object_key(index, key);
            check(object, &key, &mut faults);
            if !names.insert(&object.name) {
                let found = format!("{:?}, the name of an earlier object", object.name);
                faults.add(Error::scene(key("name"), found, "a unique name"));
            }
        }
        faults.0
    }

    /// Scattering belongs to materials of the scene, and to objects: light is compared with the open beam, which
    /// nothing scatters.
    fn validate_scattering(&self) -> Result<()> {
        if let Some(name) = self.scattering.keys().find(|name| !self.materials.contains_key(*name))
        {
            let key = path::join(&path::join("materials", name), "scattering");
            let found = format!("scattering of {name:?}, which [materials] does not define");
            return Err(Error::scene(key, found, "a material that the scene defines"));
        }
        if let Some(name) =
            self.microstructures.keys().find(|name| !self.materials.contains_key(*name))
        {
            let key = path::join(&path::join("materials", name), "microstructure");
            let found = format!("bodies in {name:?}, which [materials] does not define");
            return Err(Error::scene(key, found, "a material that the scene defines"));
        }
        for (name, structure) in &self.microstructures {
            let key = path::join(&path::join("materials", name), "microstructure");
            if structure.of == *name || self.scatters(&structure.of) {
                let found = format!("{:?}, which has structure of its own", structure.of);
                let allowed = "a material without `microstructure` and `scattering`";
                return Err(Error::scene(format!("{key}.of"), found, allowed));
            }
            let is_used = self.objects.iter().any(|object| object.material == *name);
            let has_curve =
                self.sample_mask.is_some() || self.sampling.transport == Transport::Wave;
            if is_used && !has_curve {
                let found =
                    "rays without a sample mask, whose curve has no width to take the contrast at";
                let allowed = "sampling.transport = \"wave\", a sample mask, or `scattering`";
                return Err(Error::scene(key, found, allowed));
            }
        }
        let around = [
            ("surroundings.path_material", &self.path_material),
            (self.surroundings_key(), &self.surroundings),
        ];
        if let Some((key, name)) = around.into_iter().find(|(_, name)| self.scatters(name)) {
            let has = if self.microstructures.contains_key(name) {
                "microstructure"
            } else {
                "scattering"
            };
            let found = format!("{name:?}, which has `{has}`, around the objects");
            let allowed = "a material without `scattering` and `microstructure`; objects and `surroundings.region` may scatter";
            return Err(Error::scene(key, found, allowed));
        }
        let is_in_cells = self.has_heights() && self.sampling.scheme == Scheme::Cells;
        match self.objects.iter().find(|object| is_in_cells && self.scatters(&object.material)) {
            None => Ok(()),
            Some(object) => {
                let name = &object.name;
                let found = format!(
                    "\"cells\" with the scattering object {name:?} and apertures that end along z"
                );
                let allowed = "\"random\": cells widen light along x alone";
                Err(Error::scene("sampling.scheme", found, allowed))
            }
        }
    }

    /// The masks that there are, by their keys.
    #[doc(hidden)]
    pub fn masks(&self) -> impl Iterator<Item = (&'static str, &MaskSpec)> {
        let masks = [("sample_mask", &self.sample_mask), ("detector_mask", &self.detector_mask)];
        masks.into_iter().filter_map(|(key, mask)| Some((key, mask.as_ref()?)))
    }

    /// Where it takes a file to know the highest energy, the run and `check` look.
    fn validate_energies(&self) -> Result<()> {
        match &self.source.beam {
            Beam::Energy(energy) => validate_thresholds(&self.detector, *energy),
            Beam::Spectrum(SpectrumSpec { origin: SpectrumOrigin::Tube { kvp, .. }, .. }) => {
                validate_thresholds(&self.detector, *kvp)
            }
            Beam::Spectrum(_) => Ok(()),
        }
    }

    /// A tube current and an exposure need one another, and a tube of known output.
    fn validate_exposure(&self) -> Result<()> {
        let photons = self.detector.counts.map(|counts| counts.photons);
        let both = "source.current together with detector.exposure, or detector.photons alone";
        let (key, found, allowed) = match (self.source.current, photons) {
            (None, None | Some(Photons::Number(_))) => return Ok(()),
            (Some(_), Some(Photons::Number(_))) => {
                ("source.current", "both source.current and detector.photons", both)
            }
            (Some(_), None) => ("source.current", "a tube current without detector.exposure", both),
            (None, Some(Photons::Exposure(_))) => {
                ("detector.exposure", "an exposure without source.current", both)
            }
            (Some(_), Some(Photons::Exposure(_))) => match &self.source.beam {
                Beam::Spectrum(spec) if matches!(spec.origin, SpectrumOrigin::Tube { .. }) => {
                    return Ok(());
                }
                _ => (
                    "source.current",
                    "a tube current without the built-in tube, whose output is known",
                    "source.spectrum with anode and kvp; or detector.photons in place of \
                     source.current and detector.exposure",
                ),
            },
        };
        Err(Error::scene(key, found, allowed))
    }

    /// Time grows with the apertures that a pixel sees.
    fn validate_periods(&self) -> Result<()> {
        let detector = &self.detector;
        let most = limits::APERTURES_PER_PIXEL;
        for (table, mask) in self.masks() {
            let pixel = detector.pitch[0] * mask.distance / detector.distance;
            let slits = mask.slits_of_period().len() as f64;
            if slits * pixel / mask.period > most {
                return Err(Error::scene(
                    format!("{table}.period"),
                    Length.rounded(mask.period),
                    format!(
                        "at least {}, {most:.0} apertures in a pixel",
                        Length.rounded(slits * pixel / most)
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Shadows of thick bars between several slits, and of slanted walls, leave each slit open and each bar dark.
    fn validate_shadows(&self) -> Result<()> {
        let detector = &self.detector;
        for (table, mask) in self.masks() {
            let thickness = mask.body.thickness();
            let slits = mask.slits();
            let layers = mask.body.layers().len();
            let is_bound = slits.len() > 1 || mask.taper != 0.0 || layers > 1;
            if !is_bound || thickness <= 0.0 || mask.heights().is_some() || !has_place(mask) {
                continue;
            }
            let widths = slits.iter().map(|[low, high]| high - low);
            let narrowest = widths.fold(mask.narrowest_bar(), f64::min);
            // Walls that close slits or bars are refused by their angle.
            if thickness * mask.wall_slope().abs() >= narrowest && mask.taper != 0.0 {
                continue;
            }
            let half = 0.5 * detector.pitch[0] * f64::from(detector.pixels[0]);
            let slope =
                (half + 2.0 * detector.pitch[0]) / detector.distance + mask.wall_slope().abs();
            if thickness * slope > narrowest {
                let found = format!(
                    "{}, whose shadow at the edge of the detector is {} wide",
                    Length.rounded(thickness),
                    Length.rounded(thickness * slope)
                );
                let allowed = format!(
                    "bars of {} whose shadow is no wider than the narrowest slit or bar, {}",
                    match (mask.taper == 0.0, layers) {
                        (false, _) => "a taper",
                        (_, 2..) => "several layers",
                        _ => "several slits",
                    },
                    Length.rounded(narrowest)
                );
                let key = format!("{table}.{}", mask.body.thickness_key());
                return Err(Error::scene(key, found, allowed));
            }
        }
        Ok(())
    }

    fn validate_motions(&self) -> Result<()> {
        let (motions, views) = (&self.scan.motions, self.scan.angles.len());
        if !motions.is_empty() && motions.len() != views {
            let found = format!("{} motions", motions.len());
            let allowed = format!("{views}, one for each angle, or none");
            return Err(Error::scene("scan.motions", found, allowed));
        }
        let is_wrong = |it: &Motion| !it.is_finite() || !limits::is_length(it.offset().length());
        match motions.iter().position(is_wrong) {
            Some(view) => Err(Error::scene(
                format!("scan.motions[{view}]"),
                format!("{:?}", motions[view]),
                format!("finite numbers, and a translation of {}", too_long()),
            )),
            None => self.validate_axis(),
        }
    }

    /// The axis of rotation lies between the source and the analyser.
    fn validate_axis(&self) -> Result<()> {
        let (axis, end) = (self.axis_distance(), self.analyser_distance());
        let centre = self.source.distance;
        // Values that cannot be have errors of their own.
        let is_out =
            centre > 0.0 && end > centre && axis.is_finite() && !(0.0..end).contains(&axis);
        if !is_out {
            return Ok(());
        }
        let key = if self.scan.motions.is_empty() { "scan.axis.shift" } else { "scan.motions" };
        let found = format!("an axis of rotation {} from the source", Length.rounded(axis));
        let end = Length.rounded(end);
        let allowed =
            format!("an axis between the source and the detector mask or detector, {end}");
        Err(Error::scene(key, found, allowed))
    }

    /// Lists of offsets of views are one for each angle, each with the steps of the scan.
    fn validate_view_offsets(&self) -> Result<()> {
        let (lists, steps) = (&self.scan.view_offsets, self.scan.mask_offsets.len());
        let views = self.scan.angles.len();
        if !lists.is_empty() && lists.len() != views {
            let found = format!("{} lists", lists.len());
            let allowed = format!("{views}, one for each angle, or none");
            return Err(Error::scene("scan.view_offsets", found, allowed));
        }
        for (view, list) in lists.iter().enumerate() {
            let key = format!("scan.view_offsets[{view}]");
            if list.len() != steps {
                let allowed = format!("{steps}, the number of scan.mask_offsets");
                return Err(Error::scene(key, format!("{} offsets", list.len()), allowed));
            }
            if let Some(offset) = list.iter().find(|offset| !offset.is_finite()) {
                return Err(Error::scene(key, format!("{offset}"), "finite numbers"));
            }
            self.validate_offsets(&key, list)?;
        }
        Ok(())
    }

    /// Lists of errors are one for each view, each with the steps of the scan.
    fn validate_errors(&self) -> Result<()> {
        let (views, steps) = (self.scan.views(), self.scan.mask_offsets.len());
        let errors = &self.scan.errors;
        for (name, lists) in [
            ("mask_offsets", &errors.mask_offsets),
            ("mask_offsets_z", &errors.mask_offsets_z),
            ("intensities", &errors.intensities),
        ] {
            let key = format!("scan.errors.{name}");
            if !lists.is_empty() && lists.len() != views {
                let found = format!("{} lists", lists.len());
                return Err(Error::scene(key, found, format!("{views}, one for each view")));
            }
            if let Some(view) = lists.iter().position(|list| list.len() != steps) {
                let found = format!("{} values in view {view}", lists[view].len());
                return Err(Error::scene(key, found, format!("{steps}, one for each mask step")));
            }
            let is_wrong =
                |value: &f64| !value.is_finite() || (name == "intensities" && *value <= 0.0);
            if let Some(view) = lists.iter().position(|list| list.iter().any(is_wrong)) {
                let found = format!("{:?} in view {view}", lists[view]);
                return Err(Error::scene(key, found, "finite numbers; intensities above 0"));
            }
        }
        if !errors.source.is_empty() && errors.source.len() != views {
            let found = format!("{} displacements", errors.source.len());
            let allowed = format!("{views}, one for each view");
            return Err(Error::scene("scan.errors.source_x", found, allowed));
        }
        if let Some(place) = errors.source.iter().flatten().find(|it| !limits::is_length(**it)) {
            return Err(Error::scene("scan.errors.source_x", Length.rounded(*place), too_long()));
        }
        if !errors.source.is_empty() && self.sample_mask.is_none() && self.detector_mask.is_some() {
            let found = "a displaced source with a detector mask alone";
            let allowed = "a set-up with a sample mask, or without masks";
            return Err(Error::scene("scan.errors.source_x", found, allowed));
        }
        if errors.mask_offsets_z.iter().flatten().any(|error| *error != 0.0)
            && self.sample_mask.as_ref().and_then(MaskSpec::heights).is_none()
        {
            let found = "displacements along z of a sample mask without edges along z";
            let allowed =
                "a sample mask whose apertures end along z (aperture_z, period_z or shape)";
            return Err(Error::scene("scan.errors.mask_offsets_z", found, allowed));
        }
        let lists = [&errors.mask_offsets, &errors.mask_offsets_z];
        let views = lists[0].len().max(lists[1].len()).max(errors.source.len());
        for view in 0..views {
            let [x, z] = self.applied_offsets(Exposure::Sample(numbers::count(view)));
            let key = |axis: usize, source: &str, mask: &str| match lists[axis].is_empty() {
                true => format!("scan.errors.{source}[{view}]"),
                false => format!("scan.errors.{mask}[{view}]"),
            };
            self.validate_offsets(&key(0, "source_x", "mask_offsets"), &x)?;
            if let Some((_, found, allowed)) = self.far_along_z(&z) {
                return Err(Error::scene(key(1, "source_z", "mask_offsets_z"), found, allowed));
            }
        }
        let flats = match self.scan.flats_every {
            Some(_) if !errors.is_none() => self.scan.flat_places().len(),
            _ => 0,
        };
        for flat in (0..).take(flats).map(Exposure::Flat) {
            self.validate_offsets("scan.errors", &self.applied_offsets(flat)[0])?;
        }
        Ok(())
    }

    fn validate_offsets(&self, key: &str, offsets: &[f64]) -> Result<()> {
        if let Some(mask) = &self.sample_mask {
            let most = limits::OFFSET_PERIODS * mask.pattern();
            let far = offsets.iter().find(|offset| offset.abs() > most);
            return far.map_or(Ok(()), |offset| {
                let allowed = format!(
                    "up to {}, {:e} periods of the sample mask",
                    Length.rounded(most),
                    limits::OFFSET_PERIODS
                );
                Err(Error::scene(key, Length.rounded(*offset), allowed))
            });
        }
        let moved = offsets.iter().find(|offset| offset.abs() > 0.0);
        let Some(offset) = moved else { return Ok(()) };
        let found = format!("{} without a sample mask", Length.rounded(*offset));
        let allowed = "only \"0 m\" where there is no [sample_mask] to move";
        Err(Error::scene(key, found, allowed))
    }
}

/// True if distance and thickness of a mask allow any position.
pub(super) fn has_place(mask: &MaskSpec) -> bool {
    mask.distance > 0.0 && mask.body.thickness() >= 0.0
}

/// Wider spots blur all pixels into one another, and take time without end.
fn spot_in_view(spot: &Spot, pitch: [f64; 2], pixels: [u32; 2]) -> Result<()> {
    let sides = [0, 1].map(|axis| pitch[axis] * f64::from(pixels[axis]));
    let most = sides.into_iter().fold(limits::SPOT, f64::max);
    let sizes = spot.parts().iter().flat_map(|part| part.fwhm.into_iter().chain(part.offset));
    match sizes.into_iter().find(|size| size.abs() > most) {
        None => Ok(()),
        Some(size) => Err(Error::scene(
            "source.spot",
            Length.rounded(size),
            format!("up to {}, the field of view", Length.rounded(most)),
        )),
    }
}
