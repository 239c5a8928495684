//! What a scene has to fulfil, whether it was read from a file or built in the library.

use std::collections::HashSet;

use super::derived::AT_DETECTOR;
use super::validate_beam::validate_beam;
use super::validate_detector::validate_detector;
use super::validate_instances::validate_instances;
use super::validate_material::validate_material;
use super::validate_shape::validate_shape;
use super::{
    MaskBody, MaskSpec, Mesh, MeshFormat, Normals, Placement, RandomRays, Scene, ShapeOrMesh,
    limits,
};
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
    /// [`Error::Scene`] for a value that is not allowed, with its key; [`Error::Several`] for more
    /// than one.
    pub fn validate(&self) -> Result<()> {
        Error::of_all(self.faults())
    }

    /// The errors of all values that are not allowed.
    pub(super) fn faults(&self) -> Vec<Error> {
        let mut faults = Faults::default();
        self.validate_axis(&mut faults);
        for (key, mask) in self.masks() {
            validate_mask(key, mask, &mut faults);
        }
        faults.note(self.validate_sample_mask());
        faults.note(self.validate_detector_mask());
        faults.note(self.validate_periods());
        self.validate_sampling(&mut faults);
        self.validate_scan(&mut faults);
        for (name, spec) in &self.materials {
            faults.note(validate_material(name, spec));
        }
        faults.note(named(self.surroundings_key(), &self.surroundings));
        faults.note(named("surroundings.path_material", &self.path_material));
        self.validate_objects(&mut faults);
        faults.0
    }

    /// The masks that there are, by their keys.
    pub(crate) fn masks(&self) -> impl Iterator<Item = (&'static str, &MaskSpec)> {
        let masks = [("sample_mask", &self.sample_mask), ("detector_mask", &self.detector_mask)];
        masks.into_iter().filter_map(|(key, mask)| Some((key, mask.as_ref()?)))
    }

    fn validate_axis(&self, faults: &mut Faults) {
        let (source, detector) = (&self.source, &self.detector);
        faults.note(positive("source.distance", source.distance, Length));
        faults.note(validate_spot(&source.spot));
        faults.note(spot_in_view(&source.spot, detector.pitch, detector.pixels));
        validate_beam(&source.beam, faults);
        validate_detector(self, faults);
        if detector.distance > 0.0 && detector.distance <= source.distance {
            let found = Length.format(detector.distance);
            let allowed = format!("more than source.distance, {}", Length.format(source.distance));
            faults.add(Error::scene("detector.distance", found, allowed));
        }
    }

    /// Time grows with the apertures that a pixel sees.
    fn validate_periods(&self) -> Result<()> {
        let detector = &self.detector;
        let most = limits::APERTURES_PER_PIXEL;
        for (table, mask) in self.masks() {
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

    /// The sample mask stands between the source and the rotation centre, with its bars.
    fn validate_sample_mask(&self) -> Result<()> {
        let Some(mask) = &self.sample_mask else { return Ok(()) };
        let centre = self.source.distance;
        let [front, back] = mask.faces();
        // Values that cannot be have errors of their own.
        let is_out = centre > 0.0 && has_place(mask) && (front <= 0.0 || back >= centre);
        if !is_out {
            return Ok(());
        }
        let allowed = format!(
            "bars between the source and the rotation centre at source.distance, {}",
            Length.format(centre)
        );
        misplaced("sample_mask", mask, [0.0, centre], allowed)
    }

    /// The detector mask stands between the rotation centre and the detector, with its bars.
    fn validate_detector_mask(&self) -> Result<()> {
        let Some(mask) = &self.detector_mask else { return Ok(()) };
        let (centre, end) = (self.source.distance, self.detector.distance);
        let [front, back] = mask.faces();
        let is_out = centre > 0.0
            && end > centre
            && has_place(mask)
            && (front <= centre || back > end + AT_DETECTOR);
        if !is_out {
            return Ok(());
        }
        let allowed = format!(
            "bars between the rotation centre at source.distance, {}, and the detector at {}; the \
             distance is that of the centre plane of the bars",
            Length.format(centre),
            Length.format(end)
        );
        misplaced("detector_mask", mask, [centre, end], allowed)
    }

    fn validate_sampling(&self, faults: &mut Faults) {
        let sampling = &self.sampling;
        if let Some(cells) = sampling.cells {
            faults.note(count("sampling.cells", cells, 1, limits::CELLS));
        }
        faults.note(count("sampling.rows", sampling.rows, 1, limits::ROWS));
        let cells = u64::from(sampling.cells.unwrap_or(1)) * u64::from(sampling.rows);
        if cells > u64::from(limits::CELLS) {
            let found = format!("{cells} in {} rows", sampling.rows);
            let allowed = format!("cells × rows up to {}", limits::CELLS);
            faults.add(Error::scene("sampling.cells", found, allowed));
        }
        if !limits::TOLERANCE.contains(&sampling.tolerance) {
            faults.add(Error::scene(
                "sampling.tolerance",
                format!("{:?}", sampling.tolerance),
                "a share of open beam from 1e-6 to 1e-2",
            ));
        }
        faults.note(positive("sampling.angle_tolerance", sampling.angle_tolerance, Angle));
        faults.note(count("sampling.max_rays", sampling.max_rays, 1, limits::RAYS));
        let [x, z] = match sampling.rays {
            RandomRays::Count(count) => [count, 1],
            RandomRays::Grid(grid) => grid,
        };
        let mut rays = [x, z].into_iter();
        faults.note(rays.try_for_each(|rays| count("sampling.rays", rays, 1, limits::RAYS)));
        let all = u64::from(x) * u64::from(z);
        if all > limits::RAYS_OF_PIXEL {
            let allowed = format!("up to {} in a pixel", limits::RAYS_OF_PIXEL);
            let found = format!("{all} in a pixel");
            faults.add(Error::scene("sampling.rays", found, allowed));
        }
    }

    fn validate_scan(&self, faults: &mut Faults) {
        let scan = &self.scan;
        faults.note(series("scan.mask_offsets", &scan.mask_offsets, Length, limits::MASK_OFFSETS));
        faults.note(series("scan.angles", &scan.angles, Angle, limits::ANGLES));
        let moved = scan.mask_offsets.iter().find(|offset| offset.abs() > 0.0);
        if let (Some(offset), None) = (moved, &self.sample_mask) {
            faults.add(Error::scene(
                "scan.mask_offsets",
                format!("{} without a sample mask", Length.format(*offset)),
                "only \"0 m\" where there is no [sample_mask] to move",
            ));
        }
    }

    fn validate_objects(&self, faults: &mut Faults) {
        let mut names = HashSet::new();
        for (index, object) in self.objects.iter().enumerate() {
            let key = |key: &str| self.object_key(index, key);
            faults.note(named(&key("name"), &object.name));
            if !names.insert(&object.name) {
                let found = format!("{:?}, the name of an earlier object", object.name);
                faults.add(Error::scene(key("name"), found, "a name of its own"));
            }
            faults.note(named(&key("material"), &object.material));
            match &object.geometry {
                ShapeOrMesh::Shape(shape) => validate_shape(&key("shape"), shape, faults),
                ShapeOrMesh::Mesh(mesh) => {
                    faults.note(validate_mesh(&key(""), mesh));
                }
            }
            validate_placement(&key, &object.placement, faults);
            let slopes = limits::ROUGHNESS;
            let allowed = format!("a number from 0 to {slopes}, standard deviation of a slope");
            let inside = (0.0..=slopes).contains(&object.roughness);
            faults.note(plain(&key("roughness"), object.roughness, inside, &allowed));
            if let (Normals::Smooth, ShapeOrMesh::Shape(shape)) = (object.normals, &object.geometry)
                && !shape.has_facets()
            {
                let allowed = "\"facets\" where a curved shape without sides has its exact surface";
                faults.add(Error::scene(key("normals"), "\"smooth\"", allowed));
            }
            if let Some(instances) = &object.instances {
                validate_instances(&key("instances"), instances, &object.geometry, faults);
            }
        }
    }
}

fn validate_placement(key: &dyn Fn(&str) -> String, placement: &Placement, faults: &mut Faults) {
    faults.note(plain(&key("scale"), placement.scale, placement.scale > 0.0, "a number > 0"));
    for (turn, (axis, angle)) in placement.rotate.iter().enumerate() {
        let key = |what: &str| key(&format!("rotate[{turn}].{what}"));
        let length = libm::hypot(libm::hypot(axis[0], axis[1]), axis[2]);
        let allowed = "a direction of finite length > 0";
        faults.note(plain(&key("axis"), length, length > 0.0, allowed));
        faults.note(finite(&key("angle"), *angle, Angle));
    }
    let mut position = placement.position.iter();
    faults.note(position.try_for_each(|offset| finite(&key("position"), *offset, Length)));
}

/// Whether distance and thickness of a mask are such that it can stand anywhere.
fn has_place(mask: &MaskSpec) -> bool {
    mask.distance > 0.0 && mask.body.thickness() >= 0.0
}

/// The error of a mask whose bars do not stand between two planes: of its thickness where its own
/// plane does and the bars are thick, and else of its distance.
fn misplaced(table: &str, mask: &MaskSpec, [low, high]: [f64; 2], allowed: String) -> Result<()> {
    let (distance, thickness) = (mask.distance, mask.body.thickness());
    if distance > low && distance < high - AT_DETECTOR && thickness > limits::THICK_BARS {
        let most = 2.0 * (distance - low).min(high - distance);
        // Without the rounding of a difference.
        let most = Length.format((most * 1e9).round() / 1e9);
        let key = format!("{table}.thickness");
        let allowed =
            format!("up to {most} at {table}.distance = {}: {allowed}", Length.format(distance));
        return Err(Error::scene(key, Length.format(thickness), allowed));
    }
    Err(Error::scene(format!("{table}.distance"), Length.format(distance), allowed))
}

/// The errors of values found so far.
#[derive(Debug, Default)]
pub(super) struct Faults(Vec<Error>);

impl Faults {
    pub(super) fn add(&mut self, error: Error) {
        self.0.push(error);
    }

    pub(super) fn note(&mut self, checked: Result<()>) {
        self.0.extend(checked.err());
    }
}

/// `table`: of the object, such as `object[0]`.
fn validate_mesh(table: &str, mesh: &Mesh) -> Result<()> {
    let Mesh::File { path, unit, group } = mesh else { return Ok(()) };
    let key = |key: &str| format!("{table}.{key}");
    if path.as_os_str().is_empty() {
        return Err(Error::scene(key("mesh"), "\"\"", "path of a file"));
    }
    let format = MeshFormat::of(path);
    if let Some(group) = group {
        named(&key("group"), group)?;
        if format.is_some_and(|it| !it.has_groups()) {
            let allowed = "no group: STL and PLY files name no parts, OBJ and 3MF do";
            return Err(Error::scene(key("group"), format!("{group:?}"), allowed));
        }
    }
    match (unit, format.is_some_and(MeshFormat::has_unit)) {
        (Some(unit), false) => positive(&key("unit"), *unit, Length),
        (None, true) => Ok(()),
        (Some(unit), true) => {
            let allowed = "no unit: a 3MF file tells its own";
            Err(Error::scene(key("unit"), Length.format(*unit), allowed))
        }
        (None, false) => Err(Error::scene(key("unit"), "nothing", "the length of 1.0 in the file")),
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

fn validate_mask(table: &str, mask: &MaskSpec, faults: &mut Faults) {
    let key = |key: &str| format!("{table}.{key}");
    faults.note(positive(&key("distance"), mask.distance, Length));
    faults.note(positive(&key("period"), mask.period, Length));
    faults.note(positive(&key("aperture"), mask.aperture, Length));
    faults.note(finite(&key("offset"), mask.offset, Length));
    if mask.aperture > mask.period {
        faults.add(Error::scene(
            key("aperture"),
            format!("{} in the mask plane", Length.format(mask.aperture)),
            format!("no more than the period, {}", Length.format(mask.period)),
        ));
    }
    match &mask.body {
        MaskBody::Bars { material, thickness } => {
            faults.note(named(&key("material"), material));
            faults.note(positive(&key("thickness"), *thickness, Length));
        }
        MaskBody::Sheet { transmission } => {
            let inside = (0.0..=1.0).contains(transmission);
            let allowed = "a number from 0 to 1";
            faults.note(plain(&key("transmission"), *transmission, inside, allowed));
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

fn series(key: &str, values: &[f64], dimension: Dimension, most: u32) -> Result<()> {
    if values.is_empty() || values.len() > most as usize {
        let found = format!("{} of them", values.len());
        return Err(Error::scene(key, found, format!("1 to {most} of them")));
    }
    values.iter().try_for_each(|value| finite(key, *value, dimension))
}
