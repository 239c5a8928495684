//! Scenes, and meshes given as arrays.

use crate::errors::raised;
use crate::stacks::json;
use beamlet::geometry::{NamedMesh, write_meshes};
use beamlet::scene::{Mesh, ShapeOrMesh};
use beamlet::stack::GeometryFile;
use numpy::PyReadonlyArray2;
use pyo3::prelude::*;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// A validated scene.
#[pyclass(frozen, module = "beamlet._beamlet")]
pub(crate) struct Scene {
    scene: beamlet::scene::Scene,
    origin: Origin,
    /// Overrides of the origin.
    sets: Vec<String>,
    /// Meshes given as arrays, by the name of the file that stands for them.
    meshes: BTreeMap<String, Arrays>,
}

/// Text of a scene.
enum Origin {
    File(PathBuf),
    Text { text: String, json: bool, directory: PathBuf },
}

impl Origin {
    fn load(&self, sets: &[String]) -> beamlet::Result<beamlet::scene::Scene> {
        use beamlet::scene::Scene;
        match self {
            Self::File(path) => Scene::load_with(path, sets),
            Self::Text { text, json: true, directory } => {
                Scene::from_json_with(text, directory, sets)
            }
            Self::Text { text, json: false, directory } => {
                Scene::from_toml_with(text, directory, sets)
            }
        }
    }
}

/// Vertices in a unit of their own, and triangles.
struct Arrays {
    vertices: Vec<[f64; 3]>,
    triangles: Vec<[u32; 3]>,
}

/// Vertices and triangles of numpy by the name of their mesh.
type GivenMeshes<'py> = BTreeMap<String, (PyReadonlyArray2<'py, f64>, PyReadonlyArray2<'py, u32>)>;

fn owned(meshes: GivenMeshes<'_>) -> BTreeMap<String, Arrays> {
    let arrays = |(name, (vertices, triangles)): (String, (PyReadonlyArray2<'_, f64>, _))| {
        let triangles: PyReadonlyArray2<'_, u32> = triangles;
        let vertices = vertices.as_array().outer_iter().map(|v| [v[0], v[1], v[2]]).collect();
        let triangles = triangles.as_array().outer_iter().map(|t| [t[0], t[1], t[2]]).collect();
        (name, Arrays { vertices, triangles })
    };
    meshes.into_iter().map(arrays).collect()
}

impl Scene {
    /// The scene with its arrays.
    pub(crate) fn scene(&self) -> beamlet::Result<beamlet::scene::Scene> {
        self.with_arrays(&self.scene)
    }

    /// The scene with more overrides, and with its arrays.
    pub(crate) fn with_sets(&self, more: &[String]) -> beamlet::Result<beamlet::scene::Scene> {
        self.with_arrays(&self.origin.load(&[&self.sets, more].concat())?)
    }

    fn with_arrays(&self, scene: &beamlet::scene::Scene) -> beamlet::Result<beamlet::scene::Scene> {
        self.with_meshes(scene, |_, Arrays { vertices, triangles }, unit| {
            let vertices = vertices.iter().map(|at| at.map(|x| x * unit)).collect();
            Ok(Mesh::Arrays { vertices, triangles: triangles.clone() })
        })
    }

    /// The scene with its arrays as PLY files in `folder`. A file holds the vertices in the unit of the
    /// arrays: objects of different units may share it.
    pub(crate) fn scene_with_files(&self, folder: &Path) -> beamlet::Result<beamlet::scene::Scene> {
        self.with_meshes(&self.scene, |name, Arrays { vertices, triangles }, unit| {
            let path = folder.join(name);
            let mesh = NamedMesh::new(name, vertices.clone(), triangles.clone());
            write_meshes(&path, &[mesh], 1.0)?;
            Ok(Mesh::file(path, unit))
        })
    }

    /// The scene with a mesh by `place`, from name, arrays and unit (m), for each mesh of arrays.
    fn with_meshes(
        &self,
        scene: &beamlet::scene::Scene,
        mut place: impl FnMut(&str, &Arrays, f64) -> beamlet::Result<Mesh>,
    ) -> beamlet::Result<beamlet::scene::Scene> {
        let mut scene = scene.clone();
        for object in &mut scene.objects {
            let ShapeOrMesh::Mesh(Mesh::File { path, unit, .. }) = &object.geometry else {
                continue;
            };
            let name = path.to_string_lossy().into_owned();
            let Some(arrays) = self.meshes.get(&name) else { continue };
            object.geometry = place(&name, arrays, unit.unwrap_or(1.0))?.into();
        }
        Ok(scene)
    }

    /// Gives an error that came up after loading its place in the scene file.
    pub(crate) fn located(&self, mut error: beamlet::Error) -> beamlet::Error {
        if let beamlet::Error::Mesh { object, .. } = &mut error
            && self.meshes.keys().any(|name| object.contains(name.as_str()))
        {
            // The file of arrays is temporary and says nothing; the name of the object is before it.
            object.truncate(object.find(" (").unwrap_or(object.len()));
        }
        match &self.origin {
            Origin::File(path) => beamlet::scene::Scene::locate(path, &self.sets, error),
            Origin::Text { .. } => error,
        }
    }
}

#[pymethods]
impl Scene {
    /// Loads a scene file with overrides `key.path=value`. `meshes`: vertices and triangles by the name
    /// of the mesh file that stands for them in the overrides.
    #[staticmethod]
    fn load(
        py: Python<'_>,
        path: PathBuf,
        sets: Vec<String>,
        meshes: GivenMeshes<'_>,
    ) -> PyResult<Self> {
        let origin = Origin::File(path);
        let scene = py.detach(|| origin.load(&sets)).map_err(|error| raised(py, &error))?;
        Ok(Self { scene, origin, sets, meshes: owned(meshes) })
    }

    /// Reads a scene from text, JSON or TOML. `meshes`: as for [`Self::load`], in text and overrides.
    #[staticmethod]
    fn parse(
        py: Python<'_>,
        text: &str,
        json: bool,
        directory: PathBuf,
        sets: Vec<String>,
        meshes: GivenMeshes<'_>,
    ) -> PyResult<Self> {
        let origin = Origin::Text { text: text.to_owned(), json, directory };
        let scene = origin.load(&sets).map_err(|error| raised(py, &error))?;
        Ok(Self { scene, origin, sets, meshes: owned(meshes) })
    }

    /// The resolved scene as TOML for a file in `directory`, where meshes given as arrays are written.
    fn to_toml(&self, py: Python<'_>, directory: PathBuf) -> PyResult<String> {
        self.scene_with_files(&directory)
            .and_then(|scene| scene.to_toml(directory, &BTreeMap::new(), &[]))
            .map_err(|error| raised(py, &error))
    }

    /// Mask offsets, m.
    #[getter]
    fn mask_offsets(&self) -> Vec<f64> {
        self.scene.scan.mask_offsets.clone()
    }

    /// Mask offsets along z, m; empty without any.
    #[getter]
    fn mask_offsets_z(&self) -> Vec<f64> {
        self.scene.scan.mask_offsets_z.clone()
    }

    /// Angles of the views, rad.
    #[getter]
    fn angles(&self) -> Vec<f64> {
        let scan = &self.scene.scan;
        (0..scan.views()).map(|view| scan.angle_of(view)).collect()
    }

    /// Columns and rows of the detector.
    #[getter]
    fn pixels(&self) -> [u32; 2] {
        self.scene.detector.pixels
    }

    /// Distances of columns and of rows, m.
    #[getter]
    fn pitch(&self) -> [f64; 2] {
        self.scene.detector.pitch
    }

    /// Angles, distances, columns and rows as geometry.json has them.
    #[getter]
    fn geometry(&self) -> PyResult<String> {
        json(&GeometryFile::of(&self.scene))
    }

    /// Photon energy, keV; `None` for a spectrum.
    #[getter]
    fn energy(&self) -> Option<f64> {
        self.scene.source.beam.single_energy()
    }

    /// Title; `None` without one.
    #[getter]
    fn title(&self) -> Option<String> {
        self.scene.title.clone()
    }
}
