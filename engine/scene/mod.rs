//! The scene: what is simulated, resolved to SI units with every default filled in.

mod model;

pub use model::{
    Detector, MaskBody, MaskSpec, MaterialSpec, Mesh, Object, Placement, Sampling, Scan, Scene,
    Scheme, Shape, ShapeOrMesh, Source, Transport,
};
