//! Scenes and meshes that the tests share.

use beamlet::geometry::{Sample, load};
use beamlet::scene::{
    Beam, Detector, MaskBody, MaskSpec, Mesh, Object, Scene, Shape, ShapeOrMesh, Source,
};
use std::collections::HashMap;

pub(crate) fn mask(distance: f64) -> MaskSpec {
    let body = MaskBody::Bars { material: "gold".into(), thickness: 225e-6 };
    MaskSpec::new(distance, 1e-4, 2e-5, body)
}

pub(crate) fn scene(objects: Vec<Object>) -> Scene {
    let source = Source::new(1.21, [0.0; 2], Beam::Energy(30.0));
    let mut scene = Scene::new(source, Detector::new(1.8, [128, 128], [150e-6; 2]));
    scene.sample_mask = Some(mask(1.2));
    scene.detector_mask = Some(mask(1.8 - 112.5e-6));
    scene.objects = objects;
    scene
}

pub(crate) fn object(name: &str, geometry: impl Into<ShapeOrMesh>) -> Object {
    Object::new(name, geometry, "carbon")
}

pub(crate) fn shape(name: &str, shape: Shape) -> Object {
    object(name, shape)
}

/// A cube around the origin.
pub(crate) fn cube(name: &str, edge: f64) -> Object {
    shape(name, Shape::Box { size: [edge; 3] })
}

pub(crate) fn at(mut object: Object, position: [f64; 3]) -> Object {
    object.placement.position = position;
    object
}

/// A box around a place.
pub(crate) fn block(name: &str, size: [f64; 3], position: [f64; 3]) -> Object {
    at(shape(name, Shape::Box { size }), position)
}

/// Vertices and triangles of some surface.
#[derive(Clone, Default)]
pub(crate) struct Arrays(pub(crate) Vec<[f64; 3]>, pub(crate) Vec<[u32; 3]>);

impl Arrays {
    /// The surface of a shape, as the engine makes it.
    pub(crate) fn of(shape: Shape) -> Self {
        Self::of_object(object("x", shape))
    }

    /// The surface of an object where it stands.
    pub(crate) fn of_object(object: Object) -> Self {
        let sample = load(&scene(vec![object])).unwrap();
        Self(sample.vertices, sample.triangles)
    }

    pub(crate) fn cube(edge: f64) -> Self {
        Self::of(Shape::Box { size: [edge; 3] })
    }

    pub(crate) fn sphere(radius: f64) -> Self {
        Self::of(Shape::Sphere { radius, sides: Some(24) })
    }

    pub(crate) fn turned(mut self) -> Self {
        self.1.iter_mut().for_each(|triangle| triangle.swap(0, 1));
        self
    }

    pub(crate) fn moved(mut self, by: [f64; 3]) -> Self {
        for vertex in &mut self.0 {
            *vertex = [vertex[0] + by[0], vertex[1] + by[1], vertex[2] + by[2]];
        }
        self
    }

    pub(crate) fn and(mut self, other: Self) -> Self {
        let first = u32::try_from(self.0.len()).unwrap();
        self.0.extend(other.0);
        self.1.extend(other.1.iter().map(|triangle| triangle.map(|vertex| vertex + first)));
        self
    }

    pub(crate) fn object(self, name: &str) -> Object {
        object(name, Mesh::Arrays { vertices: self.0, triangles: self.1 })
    }

    pub(crate) fn load(self) -> beamlet::Result<Sample> {
        load(&scene(vec![self.object("part")]))
    }
}

/// The message of the error that a sample must give.
pub(crate) fn refusal(objects: Vec<Object>) -> String {
    load(&scene(objects)).unwrap_err().to_string()
}

pub(crate) fn close(a: f64, b: f64, relative: f64) -> bool {
    (a - b).abs() <= relative * b.abs()
}

/// The normal of a triangle, twice its area long.
pub(crate) fn normal([a, b, c]: [[f64; 3]; 3]) -> [f64; 3] {
    let [[u, v, w], [x, y, z]] = [b, c].map(|corner| [0, 1, 2].map(|i| corner[i] - a[i]));
    [v * z - w * y, w * x - u * z, u * y - v * x]
}

/// Every edge of every component has as many triangles one way as the other.
pub(crate) fn is_closed(sample: &Sample) -> bool {
    let mut edges: HashMap<(u32, [u32; 2]), i32> = HashMap::new();
    for ([a, b, c], component) in sample.triangles.iter().zip(&sample.triangle_component) {
        for [from, to] in [[*a, *b], [*b, *c], [*c, *a]] {
            let way = if from < to { 1 } else { -1 };
            *edges.entry((*component, [from.min(to), from.max(to)])).or_default() += way;
        }
    }
    edges.values().all(|it| *it == 0)
}
