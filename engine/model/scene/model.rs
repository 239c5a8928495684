//! The scene model. All values are SI (metres, radians, 1/m) except energies in keV; ranges are
//! documented on the fields and enforced by [`Scene::validate`].

use std::collections::BTreeMap;
use std::path::PathBuf;

use super::{
    Beam, Detector, MaterialSpec, Microstructure, Object, RandomRays, Scan, Scattering, ShapeOrMesh,
};
use crate::spot::Spot;

/// Name of the region of the surroundings among the objects.
const REGION: &str = "surroundings";

/// A whole scene, every default filled in. See docs/scene.md for the file form.
#[derive(Debug, Clone, PartialEq)]
pub struct Scene {
    /// Directory that relative paths start from.
    pub directory: PathBuf,
    /// A line that describes the scene to people; nothing depends on it.
    pub title: Option<String>,
    /// X-ray source.
    pub source: Source,
    /// Detector.
    pub detector: Detector,
    /// Mask before the sample, if there is one.
    pub sample_mask: Option<MaskSpec>,
    /// Mask before the detector, if there is one.
    pub detector_mask: Option<MaskSpec>,
    /// How rays are chosen.
    pub sampling: Sampling,
    /// Mask offsets and angles.
    pub scan: Scan,
    /// Materials defined in the scene; they shadow built-in names.
    pub materials: BTreeMap<String, MaterialSpec>,
    /// Scattering of materials defined in the scene, by their names.
    pub scattering: BTreeMap<String, Scattering>,
    /// Microstructure of materials defined in the scene, by their names.
    pub microstructures: BTreeMap<String, Microstructure>,
    /// Name of the material of the surroundings (medium 0). It has no end; where the scene has a
    /// region ([`Scene::fill_region`]) it is what lies outside of that.
    pub surroundings: String,
    /// Name of the material on the way from the source to the detector. It hardens a spectrum; the
    /// open value stays 1.
    pub path_material: String,
    /// True if the first object is the region of the surroundings.
    pub(super) has_region: bool,
    /// Objects of the sample. Where they overlap the one listed later wins.
    pub objects: Vec<Object>,
    /// SHA-256, 64 lower-case hexadecimal digits, of files that the scene refers to, by their paths;
    /// hashes of meshes are fields of their objects. A file with another hash is refused when it is read.
    pub files: BTreeMap<PathBuf, String>,
}

impl Scene {
    /// An empty scene in vacuum without masks, one frame of it; relative paths start from the working
    /// directory. Set the other fields afterwards.
    ///
    /// # Example
    ///
    /// ```
    /// use beamlet::scene::{Beam, Detector, MaterialSpec, Object, Scene, Shape, Source};
    ///
    /// let source = Source::new(1.21, [30e-6, 26e-6], Beam::Energy(30.0));
    /// let mut scene = Scene::new(source, Detector::new(1.8, [64, 4], [150e-6; 2]));
    /// scene.scan.angles = vec![0.0, 1.0];
    /// let carbon = MaterialSpec::Formula { formula: "C".into(), density: 2.0 };
    /// scene.materials.insert("carbon fibre".into(), carbon);
    /// let ball = Shape::Sphere { radius: 4e-3, sides: None };
    /// scene.objects.push(Object::new("ball", ball, "carbon fibre"));
    /// scene.validate()?;
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    #[must_use]
    pub fn new(source: Source, detector: Detector) -> Self {
        Self {
            directory: PathBuf::from("."),
            source,
            detector,
            sample_mask: None,
            detector_mask: None,
            sampling: Sampling::default(),
            scan: Scan::default(),
            materials: BTreeMap::new(),
            scattering: BTreeMap::new(),
            microstructures: BTreeMap::new(),
            title: None,
            surroundings: "vacuum".into(),
            path_material: "vacuum".into(),
            has_region: false,
            objects: Vec::new(),
            files: BTreeMap::new(),
        }
    }
}

impl Scene {
    /// Fills a region around the sample, a water bath for one: it becomes the first object, named
    /// "surroundings", and the material of the path lies outside. It turns with the sample, and is part
    /// of sample stacks only, as objects are.
    pub fn fill_region(&mut self, region: impl Into<ShapeOrMesh>, material: impl Into<String>) {
        let region = Object::new(REGION, region, material);
        if self.region().is_some() {
            self.objects.remove(0);
        }
        self.has_region = true;
        self.objects.insert(0, region);
        self.surroundings.clone_from(&self.path_material);
    }

    /// The region of the surroundings, which is the first object then.
    #[must_use]
    pub fn region(&self) -> Option<&Object> {
        self.objects.first().filter(|first| self.has_region && first.name == REGION)
    }

    /// The objects that the scene lists: all but the region of the surroundings.
    #[doc(hidden)]
    pub fn listed_objects(&self) -> &[Object] {
        &self.objects[usize::from(self.region().is_some())..]
    }

    /// True if a material of this name scatters.
    #[must_use]
    pub fn scatters(&self, material: &str) -> bool {
        self.microstructures.contains_key(material)
            || self.scattering.get(material).is_some_and(|it| it.mean() > 0.0)
    }

    /// Where a scene file has a key of the object of this number.
    #[doc(hidden)]
    pub fn object_key(&self, number: usize, key: &str) -> String {
        let dot = if key.is_empty() { "" } else { "." };
        match number.checked_sub(usize::from(self.region().is_some())) {
            Some(listed) => format!("object[{listed}]{dot}{key}"),
            None if key == "material" => "surroundings.material".into(),
            None => format!("surroundings.region{dot}{key}"),
        }
    }

    /// Where a scene file has the material of medium 0.
    #[doc(hidden)]
    pub fn surroundings_key(&self) -> &'static str {
        if self.region().is_some() { "surroundings.path_material" } else { "surroundings.material" }
    }
}

/// X-ray source on the optical axis at (0, -distance, 0).
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Source {
    /// Source to rotation centre, m. > 0.
    pub distance: f64,
    /// The focal spot; `[x, z].into()` is the Gaussian of that FWHM in m.
    pub spot: Spot,
    /// One photon energy, or a spectrum.
    pub beam: Beam,
    /// Tube current of the built-in tube, mA. > 0.
    pub current: Option<f64>,
}

impl Source {
    /// A source at a distance (m) before the rotation centre. `spot`: a [`Spot`], or `[x, z]`, the
    /// FWHM of a Gaussian in m.
    #[must_use]
    pub fn new(distance: f64, spot: impl Into<Spot>, beam: Beam) -> Self {
        Self { distance, spot: spot.into(), beam, current: None }
    }
}

/// A mask, periodic without end in x. Slits are unbounded in z: one of the width `aperture` in each period, or the
/// slits of `apertures`; `shifts` displace the slits of successive periods. Other apertures are periodic in z as well.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct MaskSpec {
    /// Source to the centre plane of the bars, m.
    pub distance: f64,
    /// Period in the mask plane, m. Default: pitch * mask distance / detector distance.
    pub period: f64,
    /// Aperture width in the mask plane, m. 0 < aperture <= period. With `apertures` the narrowest of them.
    pub aperture: f64,
    /// Ends of the slits of a period from its middle in the mask plane, m, ascending; empty: one slit of the
    /// width `aperture` in the middle.
    pub apertures: Vec<[f64; 2]>,
    /// Displacements along +x of the slits of successive periods, m: column c is behind the entry
    /// c modulo their number, after which the mask repeats; empty: none.
    pub shifts: Vec<f64>,
    /// Displacement of the lattice along +x in the mask plane, m.
    pub offset: f64,
    /// Outline of the apertures.
    pub shape: ApertureShape,
    /// Places of apertures that end along z.
    pub lattice: ApertureLattice,
    /// Height of the apertures in the mask plane, m; none of slits.
    pub aperture_z: Option<f64>,
    /// Distance along z from a row of apertures to the next in the mask plane, m; none of slits.
    pub period_z: Option<f64>,
    /// Displacement of the lattice along +z in the mask plane, m.
    pub offset_z: f64,
    /// Open and closed pixels of a period along x and z, in place of apertures of one outline.
    pub pattern: Option<super::Pattern>,
    /// Size of a pixel of the pattern along x and z in the mask plane, m.
    pub pattern_pixel: Option<[f64; 2]>,
    /// Rectangular apertures of a period, in place of apertures of one outline; empty: none.
    pub rectangles: Vec<super::Rectangle>,
    /// Form of the bars.
    pub body: MaskBody,
    /// Angle of the walls of the bars to the optical axis, rad: slits are wider at the face towards the detector
    /// where it is above 0.
    pub taper: f64,
    /// Plate that carries the bars: all light passes it.
    pub substrate: Option<Substrate>,
}

/// Flat plate of a material across the beam.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Substrate {
    /// Material name.
    pub material: String,
    /// Thickness along y, m. > 0.
    pub thickness: f64,
}

impl Substrate {
    /// A plate of this thickness, m.
    #[must_use]
    pub fn new(material: impl Into<String>, thickness: f64) -> Self {
        Self { material: material.into(), thickness }
    }
}

impl MaskSpec {
    /// A mask at a distance (m) from the source, with its period and aperture (m) in its own
    /// plane and an aperture on the optical axis.
    #[must_use]
    pub const fn new(distance: f64, period: f64, aperture: f64, body: MaskBody) -> Self {
        Self {
            distance,
            period,
            aperture,
            apertures: Vec::new(),
            shifts: Vec::new(),
            offset: 0.0,
            shape: ApertureShape::Slit,
            lattice: ApertureLattice::Rectangular,
            aperture_z: None,
            period_z: None,
            offset_z: 0.0,
            pattern: None,
            pattern_pixel: None,
            rectangles: Vec::new(),
            body,
            taper: 0.0,
            substrate: None,
        }
    }

    /// The mask with apertures of this outline, height and period along z (m, in its own plane) in place of
    /// slits.
    #[must_use]
    pub fn with_heights(mut self, shape: ApertureShape, aperture_z: f64, period_z: f64) -> Self {
        self.shape = shape;
        self.aperture_z = Some(aperture_z);
        self.period_z = Some(period_z);
        self
    }

    /// dx/dy of the walls of the bars, which displaces walls on both sides of a slit outwards; 0 where they are
    /// parallel to the axis.
    #[must_use]
    pub fn wall_slope(&self) -> f64 {
        libm::tan(self.taper)
    }

    /// Rows of apertures along z after which the mask repeats.
    #[must_use]
    pub const fn rows_of_period(&self) -> u32 {
        match self.lattice {
            ApertureLattice::Rectangular => 1,
            ApertureLattice::Hexagonal => 2,
        }
    }

    /// Height of the apertures and distance of their rows along z, m; `None` of slits.
    #[must_use]
    pub fn heights(&self) -> Option<[f64; 2]> {
        match self.shape {
            ApertureShape::Slit => None,
            _ => self.aperture_z.zip(self.period_z).map(|(height, period)| [height, period]),
        }
    }
}

/// Places of apertures that end along z.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ApertureLattice {
    /// Apertures above each other.
    Rectangular,
    /// Every second row displaced by half a period along x.
    Hexagonal,
}

/// Outline of the apertures of a mask.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum ApertureShape {
    /// Slits along z without end.
    Slit,
    /// Rectangles with sides along x and z.
    Rectangle,
    /// Ellipses with axes along x and z; circles where both are equal.
    Round,
    /// Two bars of the whole width and height, each a third as thick.
    Cross,
}

impl ApertureShape {
    /// Area of the outline over its width times its height.
    pub(super) const fn filled(self) -> f64 {
        match self {
            Self::Slit | Self::Rectangle => 1.0,
            Self::Round => std::f64::consts::FRAC_PI_4,
            Self::Cross => 5.0 / 9.0,
        }
    }
}

impl MaskSpec {
    /// Source to the face of the bars before the mask's plane and to that behind it, m.
    #[must_use]
    pub fn faces(&self) -> [f64; 2] {
        let half = self.body.thickness() / 2.0;
        [self.distance - half, self.distance + half]
    }
}

/// Form of the bars of a mask.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum MaskBody {
    /// Straight boxes of a material.
    Bars {
        /// Material name.
        material: String,
        /// Thickness along y, m. > 0.
        thickness: f64,
    },
    /// Boxes of several materials behind one another, with the same slits.
    Layers {
        /// From the source on, one at least.
        layers: Vec<BarLayer>,
    },
    /// A hard-edged sheet without thickness.
    Sheet {
        /// Transmission of the bars, 0..=1.
        transmission: f64,
    },
}

/// A layer of the bars of a mask.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct BarLayer {
    /// Material name.
    pub material: String,
    /// Thickness along y, m. > 0.
    pub thickness: f64,
}

impl BarLayer {
    /// A layer of this thickness, m.
    #[must_use]
    pub fn new(material: impl Into<String>, thickness: f64) -> Self {
        Self { material: material.into(), thickness }
    }
}

impl MaskBody {
    /// Thickness along y, m, of all layers; 0 for a sheet.
    #[must_use]
    pub fn thickness(&self) -> f64 {
        self.layers().iter().map(|(_, thickness)| thickness).sum()
    }

    /// Material and thickness (m) of the layers of the bars, from the source on; none of a sheet.
    #[must_use]
    pub fn layers(&self) -> Vec<(&str, f64)> {
        match self {
            Self::Bars { material, thickness } => vec![(material, *thickness)],
            Self::Layers { layers } => {
                layers.iter().map(|layer| (&layer.material[..], layer.thickness)).collect()
            }
            Self::Sheet { .. } => Vec::new(),
        }
    }

    /// Key of the thickness, below the key of the mask.
    #[must_use]
    pub const fn thickness_key(&self) -> &'static str {
        match self {
            Self::Layers { .. } => "layers",
            Self::Bars { .. } | Self::Sheet { .. } => "thickness",
        }
    }

    /// The layers of the bars, each with the key of its material; `mask`: key of the mask.
    #[must_use]
    pub fn layers_by_key(&self, mask: &str) -> Vec<(String, (&str, f64))> {
        let key = |layer: usize| match self {
            Self::Layers { .. } => format!("{mask}.layers[{layer}].material"),
            Self::Bars { .. } | Self::Sheet { .. } => format!("{mask}.material"),
        };
        let layers = self.layers().into_iter().enumerate();
        layers.map(|(number, layer)| (key(number), layer)).collect()
    }
}

/// How rays are chosen.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Sampling {
    /// Cells or random rays.
    pub scheme: Scheme,
    /// Cells: rule of the tolerances that have no number; `None`: [`Quality::Noise`] where the detector
    /// has photons, else [`Quality::Standard`].
    pub quality: Option<Quality>,
    /// Cells: error that sampling may leave in a recorded value, share of open beam. 1e-6 to 1e-2;
    /// `None`: by `quality`.
    pub tolerance: Option<f64>,
    /// Cells, with a sample mask: error of the mean refraction angle of the light that a mask step
    /// lets through, where no silhouette crosses the pixel, rad. > 0; `None`: by `quality`.
    pub angle_tolerance: Option<f64>,
    /// Cells: most rays of a pixel in a view. >= 1.
    pub max_rays: u32,
    /// Cells: share of the beamlets and rows whose error is measured by rays of their own. 0 to 1.
    pub audit: f64,
    /// Random: rays of a pixel and their targets.
    pub rays: RandomRays,
    /// Order of the transport.
    pub transport: Transport,
    /// Seed of every random number.
    pub seed: u64,
}

impl Default for Sampling {
    fn default() -> Self {
        Self {
            scheme: Scheme::Cells,
            quality: None,
            tolerance: None,
            angle_tolerance: None,
            max_rays: 200_000,
            audit: 0.005,
            rays: RandomRays::Count(5000),
            transport: Transport::Auto,
            seed: 1,
        }
    }
}

/// Rule of the tolerances of a scene that gives no numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Quality {
    /// A tenth of the noise of an open pixel, and of the expected deviation of the refraction angle.
    Noise,
    /// [`Tolerances::STANDARD`].
    Standard,
    /// [`Tolerances::FINE`].
    Fine,
}

/// Errors that sampling may leave.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tolerances {
    /// Error of a recorded value, share of open beam.
    pub light: f64,
    /// Error of the mean refraction angle where no silhouette crosses the pixel, rad.
    pub angle: f64,
}

impl Tolerances {
    /// 1e-4 of open beam and 30 nrad.
    pub const STANDARD: Self = Self { light: 1e-4, angle: 30e-9 };
    /// 1e-5 of open beam and 2 nrad.
    pub const FINE: Self = Self { light: 1e-5, angle: 2e-9 };
}

impl Sampling {
    /// The tolerances of a scene that a run has resolved; [`Tolerances::STANDARD`] for a missing number.
    #[must_use]
    pub fn tolerances(&self) -> Tolerances {
        let Tolerances { light, angle } = Tolerances::STANDARD;
        Tolerances {
            light: self.tolerance.unwrap_or(light),
            angle: self.angle_tolerance.unwrap_or(angle),
        }
    }

    /// Takes these tolerances where there is no number.
    #[doc(hidden)]
    pub fn fill(&mut self, tolerances: Tolerances) {
        self.tolerance.get_or_insert(tolerances.light);
        self.angle_tolerance.get_or_insert(tolerances.angle);
    }
}

/// How rays are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[non_exhaustive]
pub enum Scheme {
    /// One ray per cell boundary, cells integrated analytically.
    Cells,
    /// The paper's: targets spread over the pixel, random source offsets.
    Random,
}

/// Order of the transport through the sample.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Transport {
    /// First order, and exact for the rays that need it.
    Auto,
    /// First order in delta for every ray.
    FirstOrder,
    /// Exact transport, with refraction at every surface, for every ray.
    Exact,
    /// Waves: phases along straight lines, propagated along x.
    Wave,
}
