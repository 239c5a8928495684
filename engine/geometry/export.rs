//! Samples as meshes, and meshes as files.

use std::fmt::Write as _;
use std::path::Path;

use glam::DVec3;

use super::surface::{SIMPLIFY, Surface};
use super::{Placed, Prototype, Sample};
use beamlet_core::error::{Error, Result};
use beamlet_core::units::Dimension::Length;
use beamlet_core::{numbers, printed, reserve, whole_file};
use beamlet_model::scene::MeshFormat;

/// Bytes of a triangle with its share of vertices, as a mesh and in the longest of the formats.
const PER_TRIANGLE: u64 = 250;

/// A surface with a name, as mesh files hold it.
#[derive(Debug, Clone, Default, PartialEq)]
#[non_exhaustive]
pub struct NamedMesh {
    /// Name of the object.
    pub name: String,
    /// Vertex positions, m.
    pub vertices: Vec<[f64; 3]>,
    /// Vertex indices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl NamedMesh {
    /// A mesh of vertices (m) and triangles that index them.
    #[must_use]
    pub fn new(name: impl Into<String>, vertices: Vec<[f64; 3]>, triangles: Vec<[u32; 3]>) -> Self {
        Self { name: name.into(), vertices, triangles }
    }

    /// Volume that it encloses where it is closed, m3.
    #[must_use]
    pub fn volume(&self) -> f64 {
        // About a place of it, or a mesh far from the origin loses its digits.
        let place = self.vertices.first().copied().unwrap_or_default();
        let corner = |vertex: u32| {
            DVec3::from_array(self.vertices[vertex as usize]) - DVec3::from_array(place)
        };
        let six = |triangle: &[u32; 3]| {
            let [a, b, c] = triangle.map(corner);
            a.dot(b.cross(c))
        };
        self.triangles.iter().map(six).sum::<f64>() / 6.0
    }
}

impl Sample {
    /// Its surfaces as meshes in the world (m), one for each object, in their order. Exact shapes
    /// become facets whose vertices lie on the surface; nothing of it is farther than `error` (m,
    /// > 0) from them. Shapes that cross are cut as these facets.
    ///
    /// # Errors
    /// [`Error::Argument`] where that takes more than 2,048 facets around a shape;
    /// [`Error::Memory`]; more triangles than 32 bits can count.
    pub fn meshes(&self, error: f64) -> Result<Vec<NamedMesh>> {
        let mut meshes: Vec<NamedMesh> = self
            .objects
            .iter()
            .map(|object| NamedMesh::new(&object.name, Vec::new(), Vec::new()))
            .collect();
        self.add_triangles(&mut meshes);
        let mut at = 0;
        while let Some(first) = self.placed.get(at) {
            // Places of one prototype are adjacent.
            let same = |it: &&Placed| it.prototype == first.prototype;
            let count = self.placed[at..].iter().take_while(same).count();
            self.add_placed(&mut meshes, at..at + count, error)?;
            at += count;
        }
        self.add_crossing(&mut meshes, error)?;
        Ok(meshes)
    }

    /// Adds shapes that cross, without what others cover of them.
    fn add_crossing(&self, meshes: &mut [NamedMesh], error: f64) -> Result<()> {
        if self.partners.is_empty() {
            return Ok(());
        }
        let facets = |prototype: &Prototype, placed: &Placed| match prototype.shape {
            Some(shape) => shape.surface(error / placed.place.largest_scale()),
            None => Surface::default(),
        };
        for (mesh, body) in meshes.iter_mut().zip(self.resolved(facets)?) {
            let first = numbers::count(mesh.vertices.len());
            mesh.vertices.extend(body.surface.vertices.iter().map(DVec3::to_array));
            let triangles = body.surface.triangles.iter();
            mesh.triangles.extend(triangles.map(|it| it.map(|vertex| first + vertex)));
        }
        Ok(())
    }

    fn add_triangles(&self, meshes: &mut [NamedMesh]) {
        let mut moved = vec![u32::MAX; self.vertices.len()];
        for (triangle, component) in self.triangles.iter().zip(&self.triangle_component) {
            let mesh = &mut meshes[self.components[*component as usize].object as usize];
            // Objects share no vertices.
            mesh.triangles.push(triangle.map(|vertex| {
                let moved = &mut moved[vertex as usize];
                if *moved == u32::MAX {
                    *moved = numbers::count(mesh.vertices.len());
                    mesh.vertices.push(self.vertices[vertex as usize]);
                }
                *moved
            }));
        }
    }

    /// Adds the places of one prototype.
    fn add_placed(
        &self,
        meshes: &mut [NamedMesh],
        places: std::ops::Range<usize>,
        error: f64,
    ) -> Result<()> {
        let first = places.start;
        let placed = &self.placed[places];
        let prototype = &self.prototypes[placed[0].prototype as usize];
        let largest = placed.iter().map(|it| it.place.largest_scale()).fold(0.0, f64::max);
        let made = match prototype.shape {
            None => None,
            Some(shape) => {
                let least = shape.least_error() * largest;
                if !(error.is_finite() && error >= least) {
                    return Err(Error::argument(
                        "error",
                        Length.rounded(error),
                        format!("{} or more, for the facets around a shape", Length.rounded(least)),
                    ));
                }
                let each = shape.triangles(error / largest);
                Some((shape, each))
            }
        };
        let each = made.map_or(prototype.triangles.len() as u64, |(_, each)| each);
        let all = each.saturating_mul(placed.len() as u64);
        if u32::try_from(all).is_err() {
            let problem = format!("{all} triangles are more than 32 bits can count");
            return Err(Error::mesh(
                "the meshes of the sample",
                problem,
                "all places of an object",
            ));
        }
        reserve::ask(all.saturating_mul(PER_TRIANGLE), "the meshes of the sample", SIMPLIFY)?;
        let made = made.map(|(shape, _)| shape.surface(error / largest));
        let (vertices, triangles) = match &made {
            Some(surface) => (&surface.vertices, &surface.triangles),
            None => (&prototype.vertices, &prototype.triangles),
        };
        for (at, placed) in (first..).zip(placed) {
            if self.partners.of(numbers::count(at)).is_some() {
                continue;
            }
            let object = self.components[placed.component as usize].object as usize;
            let mesh = &mut meshes[object];
            let first = numbers::count(mesh.vertices.len());
            let world = vertices.iter().map(|it| placed.place.world_from_own(*it).to_array());
            mesh.vertices.extend(world);
            mesh.triangles.extend(triangles.iter().map(|it| it.map(|vertex| first + vertex)));
        }
        Ok(())
    }
}

/// Writes meshes into a file, whole or not at all: OBJ with an object each, PLY (binary, f64) and
/// STL (binary, f32) with all of them as one. `unit`: the length of 1.0 in it, m.
///
/// # Errors
/// [`Error::Argument`] where the ending of the name is another, or the unit is not above 0;
/// [`Error::Memory`]; [`Error::File`] where it cannot be written.
pub fn write_meshes(path: &Path, meshes: &[NamedMesh], unit: f64) -> Result<()> {
    if !(unit.is_finite() && unit > 0.0) {
        return Err(Error::argument("unit", Length.rounded(unit), "a length above 0"));
    }
    let triangles = meshes.iter().map(|mesh| mesh.triangles.len()).sum::<usize>();
    let corners = meshes.iter().map(|mesh| mesh.vertices.len()).sum::<usize>();
    if u32::try_from(triangles.max(corners)).is_err() {
        let problem = format!("{triangles} triangles are more than 32 bits can count");
        return Err(Error::mesh(path.display().to_string(), problem, ""));
    }
    let write = match MeshFormat::of(path) {
        Some(MeshFormat::Obj) => obj,
        Some(MeshFormat::Ply) => ply,
        Some(MeshFormat::Stl) => stl,
        _ => {
            let found = printed::path(path);
            return Err(Error::argument("path", found, "a name that ends in .obj, .ply or .stl"));
        }
    };
    reserve::ask((triangles as u64).saturating_mul(PER_TRIANGLE), "the mesh file", SIMPLIFY)?;
    whole_file::write_file(path, &write(meshes, unit))
}

fn obj(meshes: &[NamedMesh], unit: f64) -> Vec<u8> {
    let mut text = format!("# beamlet {}\n", beamlet_core::program::VERSION);
    let _ = writeln!(text, "# 1.0 is {}", Length.format(unit));
    let mut first = 1;
    for mesh in meshes {
        let _ = writeln!(text, "o {}", printed::line(&mesh.name));
        for position in &mesh.vertices {
            let [x, y, z] = position.map(|it| it / unit);
            // Writing to a string cannot fail; f64 texts read back to the same bits.
            let _ = writeln!(text, "v {x:?} {y:?} {z:?}");
        }
        for [a, b, c] in &mesh.triangles {
            let _ = writeln!(text, "f {} {} {}", first + a, first + b, first + c);
        }
        first += numbers::count(mesh.vertices.len());
    }
    text.into_bytes()
}

fn ply(meshes: &[NamedMesh], unit: f64) -> Vec<u8> {
    let vertices: usize = meshes.iter().map(|mesh| mesh.vertices.len()).sum();
    let faces: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    let mut bytes = format!(
        "ply\nformat binary_little_endian 1.0\ncomment beamlet {}, 1.0 is {}\n\
         element vertex {vertices}\nproperty double x\nproperty double y\nproperty double z\n\
         element face {faces}\nproperty list uchar uint vertex_indices\nend_header\n",
        beamlet_core::program::VERSION,
        Length.format(unit)
    )
    .into_bytes();
    for position in meshes.iter().flat_map(|mesh| mesh.vertices.as_flattened()) {
        bytes.extend((position / unit).to_le_bytes());
    }
    let mut first = 0;
    for mesh in meshes {
        for triangle in &mesh.triangles {
            bytes.push(3);
            triangle.iter().for_each(|vertex| bytes.extend((first + vertex).to_le_bytes()));
        }
        first += numbers::count(mesh.vertices.len());
    }
    bytes
}

fn stl(meshes: &[NamedMesh], unit: f64) -> Vec<u8> {
    let mut bytes =
        format!("beamlet {}, 1.0 is {}", beamlet_core::program::VERSION, Length.format(unit))
            .into_bytes();
    bytes.resize(80, b' ');
    let count: usize = meshes.iter().map(|mesh| mesh.triangles.len()).sum();
    bytes.extend(numbers::count(count).to_le_bytes());
    for mesh in meshes {
        for triangle in &mesh.triangles {
            let corners = triangle.map(|it| DVec3::from_array(mesh.vertices[it as usize]) / unit);
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a).normalize_or_zero();
            for number in [normal, a, b, c].into_iter().flat_map(|it| it.as_vec3().to_array()) {
                bytes.extend(number.to_le_bytes());
            }
            bytes.extend([0; 2]);
        }
    }
    bytes
}
