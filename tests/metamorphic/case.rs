//! A scene with the places of its instances, which a scene file refers to.

use beamlet::scene::{ApertureLattice, Instances, Object, Scene, Shape, ShapeOrMesh};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::fmt::Write;
use std::path::Path;

/// Place of an instance in its object.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Place {
    /// Rotation as a quaternion, w first.
    pub(crate) rotation: [f64; 4],
    /// Position, m.
    pub(crate) position: [f64; 3],
    pub(crate) scale: f64,
}

/// A scene; `places` has an entry for each object, empty where it has no instances.
#[derive(Debug, Clone)]
pub(crate) struct Case {
    pub(crate) scene: Scene,
    pub(crate) places: Vec<Vec<Place>>,
    /// Standard deviation of slopes of each object in the rough variant.
    pub(crate) roughness: Vec<f64>,
}

/// Axis along which a scene is mirrored.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Axis {
    X,
    Z,
}

impl Case {
    /// Adds an object.
    pub(crate) fn add(&mut self, object: Object, places: Vec<Place>) {
        self.scene.objects.push(object);
        self.places.push(places);
    }

    /// The scene with the places in files of this folder, named after `name`.
    pub(crate) fn written(&self, folder: &Path, name: &str) -> Scene {
        let mut scene = self.scene.clone();
        for (number, (object, places)) in scene.objects.iter_mut().zip(&self.places).enumerate() {
            if places.is_empty() {
                continue;
            }
            let path = folder.join(format!("{name}-{number}.csv"));
            std::fs::write(&path, table(places)).expect("the places are written");
            object.instances = Some(Instances::File(path));
        }
        scene
    }

    /// The scene as a file of it says, with the places behind it.
    pub(crate) fn text(&self, folder: &Path, name: &str) -> String {
        let scene = self.written(folder, name);
        let mut text = scene.to_toml(folder, &BTreeMap::new(), &[]).expect("the scene as TOML");
        for (number, places) in self.places.iter().enumerate().filter(|it| !it.1.is_empty()) {
            let lines = table(places).replace('\n', "\n# ");
            let _ = write!(text, "\n# {name}-{number}.csv:\n# {lines}\n");
        }
        text
    }

    /// The scene mirrored along an axis: its frames are the frames of this one with columns (x) or
    /// rows (z) reversed.
    pub(crate) fn mirrored(&self, along: Axis) -> Self {
        let mut case = self.clone();
        // Shapes are their own images along y, and images along x and z are these, turned.
        let (half_turn, reflected) = match along {
            Axis::X => ([0.0, 0.0, 1.0], [-1.0, 1.0, 1.0]),
            Axis::Z => ([1.0, 0.0, 0.0], [1.0, 1.0, -1.0]),
        };
        for (object, places) in case.scene.objects.iter_mut().zip(&mut case.places) {
            mirror_along_y(object);
            let placement = &mut object.placement;
            for (axis, angle) in &mut placement.rotate {
                (*axis, *angle) = (product(*axis, reflected), -*angle);
            }
            placement.position = product(placement.position, reflected);
            if places.is_empty() {
                placement.rotate.insert(0, (half_turn, PI));
            }
            for place in places {
                let [w, x, y, z] = place.rotation;
                let [x, y, z] = product([x, y, z], reflected);
                place.rotation = times_half_turn([w, -x, -y, -z], half_turn);
                place.position = product(place.position, reflected);
            }
        }
        if along == Axis::X {
            let scene = &mut case.scene;
            for mask in [&mut scene.sample_mask, &mut scene.detector_mask].into_iter().flatten() {
                mask.offset = -mask.offset;
                mask.rectangles.iter_mut().for_each(|it| it.centre[0] = -it.centre[0]);
                mask.apertures.reverse();
                mask.apertures.iter_mut().for_each(|[low, high]| (*low, *high) = (-*high, -*low));
                // The aperture before column k is before the column as far from the other side.
                let (columns, shifts) = (scene.detector.pixels[0] as usize, mask.shifts.clone());
                for (column, shift) in mask.shifts.iter_mut().enumerate() {
                    let other = (columns - 1 + columns * shifts.len() - column) % shifts.len();
                    *shift = -shifts[other];
                }
            }
            let scan = &mut scene.scan;
            scan.mask_offsets.iter_mut().chain(&mut scan.angles).for_each(|it| *it = -*it);
        } else {
            let scene = &mut case.scene;
            for mask in [&mut scene.sample_mask, &mut scene.detector_mask].into_iter().flatten() {
                mask.offset_z = -mask.offset_z;
                mask.rectangles.iter_mut().for_each(|it| it.centre[1] = -it.centre[1]);
                // Rows half a row above and below the axis are displaced by half a period against each other.
                let [_, rows] = scene.detector.pixels;
                if mask.lattice == ApertureLattice::Hexagonal && rows.is_multiple_of(2) {
                    mask.offset += 0.5 * mask.period;
                }
            }
            scene.scan.mask_offsets_z.iter_mut().for_each(|it| *it = -*it);
        }
        case
    }

    /// The scene with its axis of rotation nearer to the detector by this share of their distance, and its sample where it
    /// was; a scene at angle 0.
    pub(crate) fn with_origin_behind(&self, share: f64) -> Self {
        let mut case = self.clone();
        let scene = &mut case.scene;
        let behind = share * (scene.detector.distance - scene.source.distance);
        scene.source.distance += behind;
        scene.objects.iter_mut().for_each(|object| object.placement.position[1] -= behind);
        case
    }

    /// The rough variant before a point source: a spot blurs edges as if they were at the axis of rotation.
    pub(crate) fn roughened(&self) -> Self {
        let mut case = self.clone();
        case.scene.source.spot = [0.0; 2].into();
        if self.roughness.iter().any(|it| *it > 0.0) {
            case.scene.sampling.max_rays = 4000;
        }
        for (object, roughness) in case.scene.objects.iter_mut().zip(&self.roughness) {
            object.roughness = *roughness;
        }
        case
    }

    /// The scene seen from angle 0, its sample turned in place of what turns about it.
    pub(crate) fn turned(&self) -> Self {
        let mut case = self.clone();
        let angle = -std::mem::replace(&mut case.scene.scan.angles[0], 0.0);
        let (sin, cos) = angle.sin_cos();
        for object in &mut case.scene.objects {
            let placement = &mut object.placement;
            placement.rotate.push(([0.0, 0.0, 1.0], angle));
            let [x, y, z] = placement.position;
            placement.position = [cos * x - sin * y, sin * x + cos * y, z];
        }
        case
    }
}

/// Mirrors the surface of an object along its own y.
fn mirror_along_y(object: &mut Object) {
    if let ShapeOrMesh::Shape(Shape::Extrusion { points, .. }) = &mut object.geometry {
        points.iter_mut().for_each(|[_, y]| *y = -*y);
    }
}

fn product(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    std::array::from_fn(|axis| a[axis] * b[axis])
}

/// The rotation by a quaternion behind that by half a turn about `axis`.
fn times_half_turn([w, x, y, z]: [f64; 4], axis: [f64; 3]) -> [f64; 4] {
    let [a, b, c] = axis;
    let real = -(x * a + y * b + z * c);
    [real, w * a + y * c - z * b, w * b + z * a - x * c, w * c + x * b - y * a]
}

/// Places as a file has them.
fn table(places: &[Place]) -> String {
    let mut text = String::from("x_m,y_m,z_m,scale,qw,qx,qy,qz\n");
    for Place { rotation: [w, x, y, z], position: [a, b, c], scale } in places {
        let _ = writeln!(text, "{a:e},{b:e},{c:e},{scale},{w},{x},{y},{z}");
    }
    text
}
