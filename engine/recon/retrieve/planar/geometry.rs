//! What a scene and the options say of a retrieval in two directions.

use super::super::method::{Method, refuse_lists};
use super::super::options::RetrieveOptions;
use super::super::profile::Profile;
use super::super::strips::Strip;
use super::aperture::Aperture;
use super::lattice::Lattice;
use beamlet_core::{Error, Result};
use beamlet_model::optics::{FrontView, Mask, Openings, Optics};
use beamlet_model::scene::{ApertureLattice, ApertureShape, Blur, MaskSpec, Scene};
use beamlet_model::spot::deviation;

/// Relative difference of the axes of a circle, by rounding.
const SAME: f64 = 1e-9;

/// Curves that are retrieved in two directions.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Design {
    /// Beamlets of a sample mask alone, on a lattice.
    Beamlets(Lattice),
    /// Mask steps along x and z, m.
    Steps(Vec<[f64; 2]>),
}

impl Design {
    /// The design of a scene; `None` for slits along z that are moved along x.
    ///
    /// # Errors
    /// [`Error::Argument`] for options that contradict each other or the scene.
    pub(crate) fn of(scene: &Scene, options: &RetrieveOptions) -> Result<Option<Self>> {
        let z = offsets_z(scene, options);
        let x = &scene.scan.mask_offsets;
        if !z.is_empty() {
            if options.lattice.is_some() {
                let found = "a lattice beside offsets along z";
                return Err(Error::argument("lattice", found, "one of both"));
            }
            if z.len() != x.len() {
                let found = format!("{} offsets along z for {} along x", z.len(), x.len());
                return Err(Error::argument("offsets_z", found, "one for each offset along x"));
            }
            return Ok(Some(Self::Steps(x.iter().zip(&z).map(|(x, z)| [*x, *z]).collect())));
        }
        refuse_lists(scene)?;
        let lattice = match options.lattice {
            Some(lattice) => Some(lattice),
            None => lattice_of(scene)?,
        };
        for (name, given) in [
            ("aperture", options.aperture.filter(|_| lattice.is_none())),
            ("detector_aperture", options.detector_aperture),
        ] {
            if given.is_some() {
                let allowed = "a lattice of a sample mask alone, or offsets along z of two masks";
                return Err(Error::argument(name, "an aperture", allowed));
            }
        }
        Ok(lattice.map(Self::Beamlets))
    }

    /// Refuses methods and scans that have no form in two directions.
    ///
    /// # Errors
    /// [`Error::Argument`] with the option; [`Error::Scene`] for masks that the design does not have.
    pub(crate) fn check(&self, scene: &Scene, options: &RetrieveOptions) -> Result<()> {
        let [of_beamlets, of_steps] = options.method().in_two_directions();
        let (serves, allowed) = match self {
            Self::Beamlets(_) => {
                (of_beamlets, "gaussian, beamlet or moments for beamlets on a lattice")
            }
            Self::Steps(_) => (of_steps, "gaussian or exact-curve for steps along x and z"),
        };
        if !serves {
            return Err(Error::argument("method", options.method().name(), allowed));
        }
        match self {
            Self::Beamlets(_) => check_beamlets(scene, options),
            Self::Steps(_) => check_steps(scene, options.method()),
        }
    }
}

fn check_beamlets(scene: &Scene, options: &RetrieveOptions) -> Result<()> {
    const NO_PLACE: &str =
        "a column of a lattice has no single place along x; or steps along x and z";
    if options.phase {
        let allowed = format!("no phase: {NO_PLACE}");
        return Err(Error::argument("phase", "beamlets on a lattice", allowed));
    }
    let scan = &scene.scan;
    if !scan.dithers.is_empty() {
        let allowed = format!("no dithers: {NO_PLACE}");
        return Err(Error::scene("scan.dithers", "beamlets on a lattice", allowed));
    }
    if scan.view_offsets.iter().any(|list| *list != scan.mask_offsets) {
        let allowed = "the same offset at every angle: a flat has the beamlets at one offset";
        return Err(Error::scene("scan.view_offsets", "offsets that differ", allowed));
    }
    if scene.detector_mask.is_some() {
        let allowed = "a sample mask alone for beamlets on a lattice";
        return Err(Error::scene("detector_mask", "a mask", allowed));
    }
    if scene.sample_mask.is_none() {
        let allowed = "a sample mask for beamlets on a lattice";
        return Err(Error::scene("sample_mask", "nothing", allowed));
    }
    let steps = scene.scan.mask_offsets.len();
    if steps != 1 {
        let allowed = "exactly 1 offset for beamlets on a lattice";
        return Err(Error::scene("scan.mask_offsets", format!("{steps} offsets"), allowed));
    }
    Ok(())
}

fn check_steps(scene: &Scene, method: Method) -> Result<()> {
    if method != Method::ExactCurve {
        refuse_lists(scene)?;
    }
    if let Some(list) = scene.detector_mask.as_ref().and_then(MaskSpec::list_key) {
        let found = "a list of apertures, which each pixel sees another part of";
        let allowed = "a list in the sample mask, before pixels or apertures on a lattice";
        return Err(Error::scene(format!("detector_mask.{list}"), found, allowed));
    }
    match (&scene.sample_mask, &scene.detector_mask) {
        (None, _) => {
            let allowed = "a sample mask for steps along x and z";
            Err(Error::scene("sample_mask", "nothing", allowed))
        }
        (_, None) if method != Method::ExactCurve => {
            let allowed = "both masks for steps along x and z; or method exact-curve";
            Err(Error::scene("detector_mask", "nothing", allowed))
        }
        _ => Ok(()),
    }
}

/// Lattice of the apertures of a sample mask alone; `None` for slits and with a detector mask.
fn lattice_of(scene: &Scene) -> Result<Option<Lattice>> {
    let optics = Optics::of(scene);
    let Some(mask) = optics.sample_mask.as_ref().filter(|_| optics.detector_mask.is_none()) else {
        return Ok(None);
    };
    let [x, z] = mask.openings(optics.detector.distance).period;
    let lattice = scene.sample_mask.as_ref().map(|mask| mask.lattice);
    match lattice.filter(|_| z.is_finite()) {
        None => Ok(None),
        Some(ApertureLattice::Hexagonal) => Lattice::new([[x, 0.0], [0.5 * x, 0.5 * z]]).map(Some),
        Some(_) => Lattice::turned([x, z], 0.0).map(Some),
    }
}

/// The aperture of a sample mask as it is on the detector: of the options, else of the scene where it is a rectangle
/// or a circle.
pub(crate) fn aperture(scene: &Scene, options: &RetrieveOptions) -> Option<Aperture> {
    let optics = Optics::of(scene);
    let shape = scene.sample_mask.as_ref().map(|mask| mask.shape);
    options.aperture.or_else(|| {
        let openings = optics.sample_mask.as_ref()?.openings(optics.detector.distance);
        of_openings(shape?, &openings)
    })
}

/// The aperture of openings with this outline; `None` for outlines that no fit knows.
fn of_openings(shape: ApertureShape, openings: &Openings) -> Option<Aperture> {
    let [width, height] = [0, 1].map(|axis| openings.narrowest(axis));
    match shape {
        ApertureShape::Rectangle => Some(Aperture::Rectangle([width, height])),
        ApertureShape::Round if (width / height - 1.0).abs() < SAME => Some(Aperture::Round(width)),
        _ => None,
    }
}

/// Offsets of the sample mask along z, m: of the options, else of the scene where they differ.
fn offsets_z(scene: &Scene, options: &RetrieveOptions) -> Vec<f64> {
    if !options.offsets_z.is_empty() {
        return options.offsets_z.clone();
    }
    let z = &scene.scan.mask_offsets_z;
    let differ = z.iter().any(|offset| offset.to_bits() != z[0].to_bits());
    if differ { z.clone() } else { Vec::new() }
}

/// Strips of the overlap of the apertures of both masks, or of a sample mask and a pixel, in the plane of the sample
/// mask: sizes of the options, else of the scene.
///
/// # Errors
/// [`Error::Argument`] for a mask whose apertures are not known.
pub(super) fn overlap(scene: &Scene, options: &RetrieveOptions) -> Result<Vec<Strip>> {
    let optics = Optics::of(scene);
    let magnification = scene.magnification();
    let unknown = |name: &str, found: &str| {
        let allowed =
            "width and height of each mask for exact-curve in two directions; or method gaussian";
        Err(Error::argument(name, found, allowed))
    };
    let shape = |name| scene.masks().find(|(key, _)| *key == name).map(|(_, mask)| mask.shape);
    let known = |given: Option<Aperture>, mask: Option<&Mask>, plane: f64| {
        given.or_else(|| of_openings(shape(mask?.name())?, &mask?.openings(plane)))
    };
    let plane = optics.detector_mask.as_ref().map_or(optics.analyser, Mask::distance);
    let analyser = match optics.detector_mask.as_ref() {
        None if options.detector_aperture.is_some() => {
            let allowed = "nothing: the scene has no detector mask";
            return Err(Error::argument("detector_aperture", "an aperture", allowed));
        }
        None => scene.detector.pitch,
        mask => match known(options.detector_aperture, mask, plane) {
            Some(Aperture::Rectangle(size)) => size,
            Some(Aperture::Round(_)) => return unknown("detector_aperture", "a round aperture"),
            None => return unknown("detector_aperture", "nothing"),
        },
    };
    let analyser = analyser.map(|width| width / magnification);
    if let Some(mask) = list(scene) {
        if options.aperture.is_some() {
            let allowed = "nothing: the scene has a list of apertures";
            return Err(Error::argument("aperture", "an aperture", allowed));
        }
        return Ok(strips_of_list(mask, scene.detector.pixels, analyser));
    }
    match known(options.aperture, optics.sample_mask.as_ref(), optics.analyser) {
        Some(Aperture::Rectangle(size)) => {
            Ok(Aperture::Rectangle(size.map(|width| width / magnification)).strips(analyser))
        }
        Some(Aperture::Round(diameter)) if optics.detector_mask.is_none() => {
            Ok(Aperture::Round(diameter / magnification).strips(analyser))
        }
        Some(Aperture::Round(_)) => unknown("aperture", "a round aperture"),
        None => unknown("aperture", "nothing"),
    }
}

/// True if a scene has the curve of its masks over steps along x and z.
pub(crate) fn knows_curve(scene: &Scene, options: &RetrieveOptions) -> bool {
    check_steps(scene, Method::ExactCurve).is_ok() && overlap(scene, options).is_ok()
}

/// Sample mask of a list of apertures; `None` without one.
pub(super) fn list(scene: &Scene) -> Option<&MaskSpec> {
    scene.sample_mask.as_ref().filter(|mask| mask.list_key().is_some())
}

/// Overlap of the rectangles of a list with an aperture of this size, m, over mask offsets.
fn strips_of_list(mask: &MaskSpec, pixels: [u32; 2], analyser: [f64; 2]) -> Vec<Strip> {
    let view = FrontView::of(mask, pixels, 1);
    let strips = view.map(|view| view.strips.strips).unwrap_or_default();
    let rectangles: Vec<[[f64; 2]; 2]> =
        strips.iter().flat_map(|strip| strip.x.iter().map(|x| [*x, strip.z])).collect();
    let area = |ends: &[[f64; 2]; 2]| ends.iter().map(|[low, high]| high - low).product::<f64>();
    let all: f64 = rectangles.iter().map(area).sum();
    let of = |ends: &[[f64; 2]; 2]| {
        // An aperture on the right lies before the analyser at an offset to the left.
        let along = [0, 1].map(|axis| {
            let [low, high] = ends[axis];
            Profile { boxes: [high - low, analyser[axis]], shift: -f64::midpoint(low, high) }
        });
        Strip { share: area(ends) / all, along }
    };
    rectangles.iter().map(of).collect()
}

/// Variances xx and zz of the blur of spot and detector, m^2 on the detector or, of steps, in the plane of the
/// sample mask.
pub(super) fn blur(scene: &Scene, is_steps: bool) -> [f64; 2] {
    let magnification = scene.magnification();
    let fwhm = scene.source.spot.fwhm();
    let detector = match &scene.detector.blur {
        Some(Blur::Gaussian { sigma }) if !is_steps || scene.detector_mask.is_none() => *sigma,
        _ => [0.0; 2],
    };
    let scale = if is_steps { magnification } else { 1.0 };
    [0, 1].map(|axis| {
        let spot = (magnification - 1.0) * deviation(fwhm[axis]);
        (spot.hypot(detector[axis]) / scale).powi(2)
    })
}
