//! What a scene has to fulfil, whether it was read from a file or built in the library.

use std::collections::HashSet;

use super::derived::AT_DETECTOR;
use super::validate_beam::validate_beam;
use super::validate_detector::validate_detector;
use super::validate_instances::validate_instances;
use super::validate_material::validate_material;
use super::validate_shape::validate_shape;
use super::{MaskBody, MaskSpec, Mesh, Scene, ShapeOrMesh, limits};
use crate::spot::Spot;
use crate::units::Dimension::{self, Angle, Length};
use crate::{Error, Result, printed};

impl Scene {
    /// Checks every range, and the order of what stands along the optical axis. That meshes
    /// exist, that materials are known, and that the sample fits between the masks is checked
    /// where they are loaded.
    ///
    /// # Errors
    ///
    /// [`Error::Scene`] for the first value that is not allowed, with its key.
    pub fn validate(&self) -> Result<()> {
        self.validate_axis()?;
        for (key, mask) in
            [("sample_mask", &self.sample_mask), ("detector_mask", &self.detector_mask)]
        {
            if let Some(mask) = mask {
                validate_mask(key, mask)?;
            }
        }
        self.validate_order()?;
        self.validate_periods()?;
        self.validate_sampling()?;
        self.validate_scan()?;
        for (name, spec) in &self.materials {
            validate_material(name, spec)?;
        }
        named("surroundings.material", &self.surroundings)?;
        self.validate_objects()
    }

    fn validate_axis(&self) -> Result<()> {
        let (source, detector) = (&self.source, &self.detector);
        positive("source.distance", source.distance, Length)?;
        validate_spot(&source.spot)?;
        spot_in_view(&source.spot, detector.pitch, detector.pixels)?;
        validate_beam(&source.beam)?;
        validate_detector(self)?;
        ordered(
            "detector.distance",
            detector.distance,
            source.distance < detector.distance,
            format!("more than source.distance, {}", Length.format(source.distance)),
        )
    }

    /// Time grows with the apertures that a pixel sees.
    fn validate_periods(&self) -> Result<()> {
        let detector = &self.detector;
        let most = limits::APERTURES_PER_PIXEL;
        for (table, mask) in
            [("sample_mask", &self.sample_mask), ("detector_mask", &self.detector_mask)]
        {
            let Some(mask) = mask else { continue };
            let pixel = detector.pitch[0] * mask.distance / detector.distance;
            if pixel / mask.period > most {
                return Err(Error::scene(
                    format!("{table}.period"),
                    Length.format(mask.period),
                    format!(
                        "at least {}, {most:.0} apertures in a pixel",
                        Length.format(pixel / most)
                    ),
                ));
            }
        }
        Ok(())
    }

    /// Source, sample mask, rotation centre, detector mask, detector: in this order.
    fn validate_order(&self) -> Result<()> {
        let centre = self.source.distance;
        if let Some(mask) = &self.sample_mask {
            let half = mask.body.thickness() / 2.0;
            ordered(
                "sample_mask.distance",
                mask.distance,
                mask.distance - half > 0.0 && mask.distance + half < centre,
                format!(
                    "bars between the source and the rotation centre at source.distance, {}",
                    Length.format(centre)
                ),
            )?;
        }
        if let Some(mask) = &self.detector_mask {
            let half = mask.body.thickness() / 2.0;
            let back = self.detector.distance + AT_DETECTOR;
            ordered(
                "detector_mask.distance",
                mask.distance,
                mask.distance - half > centre && mask.distance + half <= back,
                format!(
                    "bars between the rotation centre at source.distance, {}, and the detector \
                     at {}; the distance is that of the centre plane of the bars",
                    Length.format(centre),
                    Length.format(self.detector.distance)
                ),
            )?;
        }
        Ok(())
    }

    fn validate_sampling(&self) -> Result<()> {
        let sampling = &self.sampling;
        if let Some(cells) = sampling.cells {
            count("sampling.cells", cells, 1, limits::CELLS)?;
        }
        count("sampling.rows", sampling.rows, 1, limits::ROWS)?;
        let cells = u64::from(sampling.cells.unwrap_or(1)) * u64::from(sampling.rows);
        if cells > u64::from(limits::CELLS) {
            let found = format!("{cells} in {} rows", sampling.rows);
            let allowed = format!("cells × rows up to {}", limits::CELLS);
            return Err(Error::scene("sampling.cells", found, allowed));
        }
        if !limits::TOLERANCE.contains(&sampling.tolerance) {
            return Err(Error::scene(
                "sampling.tolerance",
                format!("{:?}", sampling.tolerance),
                "a share of open beam from 1e-6 to 1e-2",
            ));
        }
        positive("sampling.angle_tolerance", sampling.angle_tolerance, Angle)?;
        count("sampling.max_rays", sampling.max_rays, 1, limits::RAYS)?;
        sampling.rays.iter().try_for_each(|rays| count("sampling.rays", *rays, 1, limits::RAYS))?;
        let [x, z] = sampling.rays.map(u64::from);
        match x * z {
            rays if rays <= limits::RAYS_OF_PIXEL => Ok(()),
            rays => {
                let allowed = format!("up to {} in a pixel", limits::RAYS_OF_PIXEL);
                Err(Error::scene("sampling.rays", format!("{rays} in a pixel"), allowed))
            }
        }
    }

    fn validate_scan(&self) -> Result<()> {
        let scan = &self.scan;
        series("scan.mask_offsets", &scan.mask_offsets, Length, limits::MASK_OFFSETS)?;
        series("scan.angles", &scan.angles, Angle, limits::ANGLES)?;
        let moved = scan.mask_offsets.iter().find(|offset| offset.abs() > 0.0);
        match (moved, &self.sample_mask) {
            (Some(offset), None) => Err(Error::scene(
                "scan.mask_offsets",
                format!("{} without a sample mask", Length.format(*offset)),
                "only \"0 m\" where there is no [sample_mask] to move",
            )),
            _ => Ok(()),
        }
    }

    fn validate_objects(&self) -> Result<()> {
        let mut names = HashSet::new();
        for (index, object) in self.objects.iter().enumerate() {
            let key = |key: &str| format!("object[{index}].{key}");
            named(&key("name"), &object.name)?;
            if !names.insert(&object.name) {
                let found = format!("{:?}, the name of an earlier object", object.name);
                return Err(Error::scene(key("name"), found, "a name of its own"));
            }
            named(&key("material"), &object.material)?;
            match &object.geometry {
                ShapeOrMesh::Shape(shape) => validate_shape(&key("shape"), shape)?,
                ShapeOrMesh::Mesh(Mesh::File { path, unit }) => {
                    if path.as_os_str().is_empty() {
                        return Err(Error::scene(key("mesh"), "\"\"", "path of a file"));
                    }
                    positive(&key("unit"), *unit, Length)?;
                }
                ShapeOrMesh::Mesh(Mesh::Arrays { .. }) => {}
            }
            let placement = &object.placement;
            plain(&key("scale"), placement.scale, placement.scale > 0.0, "a number > 0")?;
            for (turn, (axis, angle)) in placement.rotate.iter().enumerate() {
                let key = |what: &str| format!("object[{index}].rotate[{turn}].{what}");
                let length = libm::hypot(libm::hypot(axis[0], axis[1]), axis[2]);
                let allowed = "a direction of finite length > 0";
                plain(&key("axis"), length, length > 0.0, allowed)?;
                finite(&key("angle"), *angle, Angle)?;
            }
            for offset in placement.position {
                finite(&key("position"), offset, Length)?;
            }
            if let Some(instances) = &object.instances {
                validate_instances(&key("instances"), instances, &object.geometry)?;
            }
        }
        Ok(())
    }
}

fn validate_spot(spot: &Spot) -> Result<()> {
    let parts = spot.parts();
    let most = limits::SPOT_PARTS as usize;
    if parts.is_empty() || parts.len() > most {
        let found = format!("{} Gaussians", parts.len());
        return Err(Error::scene("source.spot.gaussians", found, format!("1 to {most}")));
    }
    let several = parts.len() > 1 || parts[0].offset.iter().any(|offset| *offset != 0.0);
    for (index, part) in parts.iter().enumerate() {
        let key = |key: &str| match several {
            true => format!("source.spot.gaussians[{index}].{key}"),
            false => "source.spot".to_owned(),
        };
        plain(&key("weight"), part.weight, part.weight >= 0.0, "a number >= 0")?;
        part.fwhm.iter().try_for_each(|fwhm| not_negative(&key("fwhm"), *fwhm, Length))?;
        part.offset.iter().try_for_each(|offset| finite(&key("offset"), *offset, Length))?;
    }
    let sum: f64 = parts.iter().map(|part| part.weight).sum();
    plain("source.spot.gaussians", sum, sum > 0.0, "weights with a finite sum > 0")
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
            Length.format(size),
            format!("up to {}, the field of view", Length.format(most)),
        )),
    }
}

fn validate_mask(table: &str, mask: &MaskSpec) -> Result<()> {
    let key = |key: &str| format!("{table}.{key}");
    positive(&key("distance"), mask.distance, Length)?;
    positive(&key("period"), mask.period, Length)?;
    positive(&key("aperture"), mask.aperture, Length)?;
    finite(&key("offset"), mask.offset, Length)?;
    if mask.aperture > mask.period {
        return Err(Error::scene(
            key("aperture"),
            format!("{} in the mask plane", Length.format(mask.aperture)),
            format!("no more than the period, {}", Length.format(mask.period)),
        ));
    }
    match &mask.body {
        MaskBody::Bars { material, thickness } => {
            named(&key("material"), material)?;
            positive(&key("thickness"), *thickness, Length)
        }
        MaskBody::Sheet { transmission } => {
            let inside = (0.0..=1.0).contains(transmission);
            plain(&key("transmission"), *transmission, inside, "a number from 0 to 1")
        }
    }
}

pub(super) fn positive(key: &str, value: f64, dimension: Dimension) -> Result<()> {
    if value.is_finite() && value > 0.0 {
        return Ok(());
    }
    Err(Error::scene(key, dimension.format(value), "a value > 0"))
}

pub(super) fn not_negative(key: &str, value: f64, dimension: Dimension) -> Result<()> {
    if value.is_finite() && value >= 0.0 {
        return Ok(());
    }
    Err(Error::scene(key, dimension.format(value), "a value >= 0"))
}

pub(super) fn finite(key: &str, value: f64, dimension: Dimension) -> Result<()> {
    if value.is_finite() {
        return Ok(());
    }
    Err(Error::scene(key, dimension.format(value), "a finite value"))
}

pub(super) fn plain(key: &str, value: f64, fulfilled: bool, allowed: &str) -> Result<()> {
    if value.is_finite() && fulfilled {
        return Ok(());
    }
    Err(Error::scene(key, format!("{value:?}"), allowed))
}

pub(super) fn count(key: &str, value: u32, least: u32, most: u32) -> Result<()> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(Error::scene(key, value.to_string(), format!("a whole number from {least} to {most}")))
}

pub(super) fn named(key: &str, name: &str) -> Result<()> {
    if name.trim().is_empty() {
        return Err(Error::scene(key, format!("{name:?}"), "a name"));
    }
    if name.chars().any(printed::is_unsafe) {
        let found = format!("\"{}\"", printed::line(name));
        return Err(Error::scene(key, found, "a name without control or bidirectional characters"));
    }
    Ok(())
}

fn ordered(key: &str, value: f64, fulfilled: bool, allowed: String) -> Result<()> {
    if fulfilled {
        return Ok(());
    }
    Err(Error::scene(key, Length.format(value), allowed))
}

fn series(key: &str, values: &[f64], dimension: Dimension, most: u32) -> Result<()> {
    if values.is_empty() || values.len() > most as usize {
        let found = format!("{} of them", values.len());
        return Err(Error::scene(key, found, format!("1 to {most} of them")));
    }
    values.iter().try_for_each(|value| finite(key, *value, dimension))
}
