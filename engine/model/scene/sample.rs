//! The sample of a scene: materials, and objects with their shapes or meshes and places.

use std::path::{Path, PathBuf};

use super::Instances;
use glam::{DQuat, DVec3};

/// Definition of a material.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum MaterialSpec {
    /// Chemical formula and density.
    Formula {
        /// Such as "C" or "H2O".
        formula: String,
        /// Density, g/cm3. > 0.
        density: f64,
    },
    /// Shares by weight and density.
    Mixture {
        /// Formula, built-in material or entry of the scene with a formula, and its share by
        /// weight. > 0; they sum to 1 or to 100.
        parts: Vec<(String, f64)>,
        /// Density, g/cm3. > 0.
        density: f64,
    },
    /// Constants for the scene's single energy.
    Constants {
        /// Linear attenuation coefficient, 1/m. >= 0.
        mu: f64,
        /// Refractive index decrement.
        delta: f64,
    },
    /// Table file with columns `energy_keV,mu_per_cm,delta`.
    Table {
        /// The file, relative to the scene's directory.
        path: PathBuf,
    },
}

/// One object of the sample.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Object {
    /// Unique name.
    pub name: String,
    /// Shape or mesh.
    pub geometry: ShapeOrMesh,
    /// Material name.
    pub material: String,
    /// Its placement.
    pub placement: Placement,
    /// SHA-256 of the mesh file that the scene was resolved with, 64 lower-case hexadecimal
    /// digits. A mesh file that does not have it is refused.
    pub sha256: Option<String>,
    /// Take a mesh that is open or crosses itself, at one's own risk.
    pub allow_defects: bool,
    /// Places of copies of the shape or mesh; `None`: one copy at the object's own origin.
    pub instances: Option<Instances>,
    /// Standard deviation of the slopes of its surface against its facets, 0 to 0.3.
    pub roughness: f64,
    /// Correlation length of the heights of a rough surface, m, which waves need: their autocorrelation is
    /// exp(-r²/length²). Rays take slopes alone.
    pub correlation_length: Option<f64>,
    /// Which normals refract light.
    pub normals: Normals,
}

/// Normals that refract light at an object of facets.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub enum Normals {
    /// Normals of the facets.
    #[default]
    Facets,
    /// Normals of the surface that the facets approximate: interpolated between corners, but not across
    /// edges of more than 30 degrees.
    Smooth,
}

impl Object {
    /// An object of a material, where its shape or mesh has it: neither turned nor scaled.
    #[must_use]
    pub fn new(
        name: impl Into<String>,
        geometry: impl Into<ShapeOrMesh>,
        material: impl Into<String>,
    ) -> Self {
        Self {
            name: name.into(),
            geometry: geometry.into(),
            material: material.into(),
            placement: Placement::default(),
            sha256: None,
            allow_defects: false,
            instances: None,
            roughness: 0.0,
            correlation_length: None,
            normals: Normals::Facets,
        }
    }
}

/// Surface of an object.
#[derive(Debug, Clone, PartialEq)]
pub enum ShapeOrMesh {
    /// Built-in shape, in metres.
    Shape(Shape),
    /// Mesh file, or arrays given in the library.
    Mesh(Mesh),
}

impl From<Shape> for ShapeOrMesh {
    fn from(shape: Shape) -> Self {
        Self::Shape(shape)
    }
}

impl From<Mesh> for ShapeOrMesh {
    fn from(mesh: Mesh) -> Self {
        Self::Mesh(mesh)
    }
}

/// Built-in shapes: along z, centred. Curved surfaces are exact, or flat facets where `sides` is
/// given.
#[derive(Debug, Clone, PartialEq)]
pub enum Shape {
    /// Full edge lengths along x, y, z, m.
    Box {
        /// Edge lengths, m.
        size: [f64; 3],
    },
    /// Cylinder along z.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Height, m.
        height: f64,
        /// Facets around, which keep the area of the section. >= 3.
        sides: Option<u32>,
    },
    /// Cone along z, or truncated cone; its axis is halved by the origin.
    Cone {
        /// Radius at the lower end, -z, m.
        radius: f64,
        /// Radius at the upper end, m. >= 0.
        top_radius: f64,
        /// Height, m.
        height: f64,
        /// Facets around, which keep the area of the section. >= 3.
        sides: Option<u32>,
    },
    /// Regular prism along z; `radius` is the circumradius of its base, not area-corrected.
    Prism {
        /// Circumradius, m.
        radius: f64,
        /// Height, m.
        height: f64,
        /// Sides. >= 3.
        sides: u32,
    },
    /// A polygon drawn out along z, from -height/2 to height/2.
    Extrusion {
        /// Corners (x, y) of a polygon that does not cross or touch itself, either way round, m.
        points: Vec<[f64; 2]>,
        /// Height, m.
        height: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius, m.
        radius: f64,
        /// Facets around the equator, which keep the volume. >= 4.
        sides: Option<u32>,
    },
    /// Ellipsoid.
    Ellipsoid {
        /// Half its extent along x, y, z, m.
        semi_axes: [f64; 3],
        /// Facets around the equator, which keep the volume. >= 4.
        sides: Option<u32>,
    },
    /// Torus around z.
    Torus {
        /// Radius of the circle in the middle of the tube, m.
        radius: f64,
        /// Radius of the tube, m. < `radius`.
        tube_radius: f64,
        /// Facets around the ring and around the tube, which keep the volume, >= 4; `None`: facets within
        /// 10 nm of the surface, or two million of them.
        sides: Option<u32>,
    },
    /// Cylinder along z with a coaxial bore from end to end.
    Tube {
        /// Radius of the outer wall, m.
        outer: f64,
        /// Radius of the bore, m. < `outer`.
        inner: f64,
        /// Height, m.
        height: f64,
        /// Facets around each wall, which keep the areas of the sections. >= 3.
        sides: Option<u32>,
    },
}

impl Shape {
    /// True if its surface is made of flat facets.
    #[doc(hidden)]
    pub const fn has_facets(&self) -> bool {
        match self {
            Self::Box { .. } | Self::Prism { .. } | Self::Extrusion { .. } | Self::Torus { .. } => {
                true
            }
            Self::Cylinder { sides, .. }
            | Self::Cone { sides, .. }
            | Self::Sphere { sides, .. }
            | Self::Ellipsoid { sides, .. }
            | Self::Tube { sides, .. } => sides.is_some(),
        }
    }
}

/// A triangle mesh.
#[derive(Debug, Clone, PartialEq)]
pub enum Mesh {
    /// A file.
    File {
        /// The file, relative to the scene's directory.
        path: PathBuf,
        /// The length of 1.0 in it, m; `None` if the file states it ([`MeshFormat::has_unit`]).
        unit: Option<f64>,
        /// The object, group or material of the file that is taken; `None`: all of it.
        group: Option<String>,
    },
    /// Vertices in metres and triangles that index them, counter-clockwise seen from outside.
    Arrays {
        /// Vertex positions, m.
        vertices: Vec<[f64; 3]>,
        /// Vertex indices.
        triangles: Vec<[u32; 3]>,
    },
}

impl Mesh {
    /// All of a file without a unit. `unit`: the length of 1.0 in it, m.
    #[must_use]
    pub fn file(path: impl Into<PathBuf>, unit: f64) -> Self {
        Self::File { path: path.into(), unit: Some(unit), group: None }
    }
}

/// Format of a mesh file, by the ending of its name.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MeshFormat {
    /// STL, binary or text.
    Stl,
    /// Wavefront OBJ.
    Obj,
    /// PLY, binary or text.
    Ply,
    /// 3MF, the format of 3D printing.
    ThreeMf,
}

impl MeshFormat {
    /// The format of a file of this name; `None` where it is none of them.
    #[must_use]
    pub fn of(path: &Path) -> Option<Self> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "stl" => Some(Self::Stl),
            "obj" => Some(Self::Obj),
            "ply" => Some(Self::Ply),
            "3mf" => Some(Self::ThreeMf),
            _ => None,
        }
    }

    /// True if files state the length of 1.0 in them.
    #[must_use]
    pub const fn has_unit(self) -> bool {
        matches!(self, Self::ThreeMf)
    }

    /// True if files name their objects, groups or materials.
    #[must_use]
    pub const fn has_groups(self) -> bool {
        matches!(self, Self::Obj | Self::ThreeMf)
    }
}

/// Placement of an object: center, then scale, then rotations, then position.
#[derive(Debug, Clone, PartialEq)]
pub struct Placement {
    /// Move the centre of the bounding box to the mesh origin first.
    pub center: bool,
    /// Scale about the mesh origin. > 0.
    pub scale: f64,
    /// Rotations about the mesh origin in the order listed: axis, angle in rad.
    pub rotate: Vec<([f64; 3], f64)>,
    /// Translation, m.
    pub position: [f64; 3],
}

impl Default for Placement {
    fn default() -> Self {
        Self { center: false, scale: 1.0, rotate: Vec::new(), position: [0.0; 3] }
    }
}

impl Placement {
    /// A direction of the mesh or shape behind the rotations; axes without a direction do not turn it.
    pub(crate) fn rotate_direction(&self, direction: DVec3) -> DVec3 {
        let turn = |direction: DVec3, (axis, angle): &([f64; 3], f64)| {
            let axis = DVec3::from_array(*axis).try_normalize();
            axis.map_or(direction, |axis| DQuat::from_axis_angle(axis, *angle) * direction)
        };
        self.rotate.iter().fold(direction, turn)
    }
}
