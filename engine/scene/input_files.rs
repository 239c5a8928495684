//! The files that a scene is made of.

use super::{Beam, Blur, MaterialSpec, Mesh, Scatter, Scene, ShapeOrMesh, SpectrumOrigin};
use std::path::PathBuf;

impl Scene {
    /// Every file that the scene refers to, from where the program runs: meshes, spectrum, tables
    /// of materials, kernels, image of scatter, image or profile of the focal spot. The scene file
    /// itself is not among them.
    #[must_use]
    pub fn input_files(&self) -> Vec<PathBuf> {
        let mut files = Vec::new();
        for object in &self.objects {
            if let ShapeOrMesh::Mesh(Mesh::File { path, .. }) = &object.geometry {
                files.push(self.resolve(path));
            }
        }
        for material in self.materials.values() {
            if let MaterialSpec::Table { path } = material {
                files.push(self.resolve(path));
            }
        }
        if let Beam::Spectrum(spectrum) = &self.source.beam
            && let SpectrumOrigin::File { path } = &spectrum.origin
        {
            files.push(self.resolve(path));
        }
        if let Some(Blur::Kernel(kernel)) = &self.detector.blur {
            files.push(self.resolve(&kernel.path));
        }
        match &self.detector.scatter {
            Some(Scatter::Image(path)) => files.push(self.resolve(path)),
            Some(Scatter::Kernel { kernel, .. }) => files.push(self.resolve(&kernel.path)),
            None => {}
        }
        // The spot is read with the scene: its path needs no directory.
        let spot = self.source.spot.fit().map(|fit| PathBuf::from(&fit.file));
        files.extend(spot.filter(|file| !file.as_os_str().is_empty()));
        files
    }
}
