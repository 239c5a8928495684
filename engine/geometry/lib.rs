//! Internal to beamlet: geometry of the sample, as welded, closed, oriented triangle surfaces in world metres.
//!
//! `load` reads the objects of a scene (`mesh_file`, `shapes`), welds and places them (`joins`, `junctions`,
//! `repeated`), unites touching parts of a mesh (`united`), refuses open and self-crossing meshes
//! (`examined`, `defects`, `trial`), turns inside-out ones (`body`, `orientation`), cuts away volumes
//! covered by later objects (`overlap`), and finds which object surrounds which (`nesting`).
//! [`check_clearance`] and [`Swept::fov_warnings`] compare the volume swept over the views with the set-up.

pub mod adjacency;
mod analytic;
mod assemble;
mod body;
mod convex;
mod defects;
mod delaunay;
mod distance;
mod examined;
mod export;
mod joins;
mod junctions;
mod kinks;
mod lids;
pub mod load;
mod mask_mesh;
mod mesh_file;
mod nesting;
mod orientation;
mod overlap;
mod placed;
mod placement;
mod polygon;
pub mod read;
mod repeated;
mod scattering_axis;
mod search;
mod shapes;
mod sizes;
mod smooth;
mod surface;
mod swept;
mod topology;
mod tree;
mod trial;
mod united;

pub use adjacency::across_edges;
pub use analytic::{AnalyticShape, Entry, Form as AnalyticForm, Tube};
pub use beamlet_core::watch::{LoadProgress, LoadStep, Watcher};
pub use defects::{DefectCount, DefectPlace, Defects};
pub use export::{NamedMesh, write_meshes};
pub use kinks::largest_kinks;
pub use lids::Lids;
pub use load::{load, load_lenient_watched, load_watched, triangles_in_files};
pub use mask_mesh::{MaskMeshOptions, MaskPlace, mask_meshes};
pub use overlap::PEAK_PER_CUT_TRIANGLE;
pub(crate) use placed::Partners;
pub use placed::{FacetOf, Place, Placed, Prototype};
pub use read::{file_hash, hash_arrays};
pub use sizes::unit_warnings;
pub use smooth::{CornerNormals, corner_normals};
pub use surface::PEAK_PER_TRIANGLE;
pub use swept::{BeamExtent, Swept, check_clearance, swept};

/// All surfaces of the sample in world coordinates (m), welded and oriented outwards (away from
/// the material of their object; the surface of a void points into the void). They are closed,
/// but for objects that allow defects.
#[derive(Debug, Clone, Default)]
#[non_exhaustive]
pub struct Sample {
    /// Vertex positions, m.
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, counter-clockwise seen from outside the material.
    pub triangles: Vec<[u32; 3]>,
    /// Component of each triangle.
    pub triangle_component: Vec<u32>,
    /// Connected surface components.
    pub components: Vec<Component>,
    /// Objects in the order of the scene.
    pub objects: Vec<ObjectSummary>,
    /// Pairs of objects that overlap, the earlier one first: the later one wins. `check` alone finds them.
    pub overlaps: Vec<[u32; 2]>,
    /// Surfaces with several places, each once.
    #[doc(hidden)]
    pub prototypes: Vec<Prototype>,
    /// Their places; places of one prototype are adjacent.
    #[doc(hidden)]
    pub placed: Vec<Placed>,
    /// Exact shapes among them that cross.
    #[doc(hidden)]
    pub partners: Partners,
}

/// A connected surface of one object.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct Component {
    /// Index of the object that it bounds.
    pub object: u32,
    /// Object whose material is on the outer side of the surface; `None`: the surroundings.
    pub outside: Option<u32>,
    /// Signed volume, m3; negative for a void.
    pub volume: f64,
    /// Area, m2.
    pub area: f64,
    /// Least and greatest corner of the bounding box, m.
    pub bounds: [[f64; 3]; 2],
    /// Where it is not upright; `None`: anywhere.
    #[doc(hidden)]
    pub lids: Option<Lids>,
    /// How far normals of rough walls may lean up or down, sine.
    #[doc(hidden)]
    pub leans: f64,
    /// True if normals between the corners of its facets refract light.
    #[doc(hidden)]
    pub smooth: bool,
}

/// An object in numbers.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct ObjectSummary {
    /// Name in the scene.
    pub name: String,
    /// Number of triangles, after cuts; a mesh with many places counts once.
    pub triangles: usize,
    /// Number of its places; 0 without instances.
    pub instances: usize,
    /// Volume of its outer surfaces less its voids, m3: after cuts, but of whole exact shapes where others cross
    /// these, instances of one object too.
    pub volume: f64,
    /// Least and greatest corner of its bounding box, m.
    pub bounds: [[f64; 3]; 2],
    /// Objects that contain it, by its components (`None`: the surroundings).
    pub inside: Vec<Option<u32>>,
    /// Later objects whose surfaces intersect its own, or that cover a part of it: the covered volume is
    /// cut away.
    pub cut_by: Vec<u32>,
    /// SHA-256 of the mesh as read (file bytes, or arrays), hexadecimal; empty for shapes.
    pub hash: String,
    /// Defects of its surface.
    pub defects: Defects,
    /// Warnings about it, in words (suspicious size, for one).
    pub warnings: Vec<String>,
}
