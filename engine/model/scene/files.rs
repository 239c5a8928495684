//! The files that a scene refers to, by the SHA-256 of their contents. Meshes carry their hash on their
//! object.

use std::io::{ErrorKind, Read};
use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};

use super::{
    Beam, Blur, Instances, KernelFile, MaterialSpec, Mesh, Scatter, Scene, ShapeOrMesh,
    SpectrumOrigin, path as keys,
};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, input_file};

impl Scene {
    /// Paths of the files that the scene reads, as it names them: spectrum, kernels, scatter,
    /// material tables, pair distributions and positions of instances. Spots are read with the scene, meshes carry their
    /// own hash.
    #[must_use]
    pub fn referenced_files(&self) -> Vec<&Path> {
        self.files_by_key().into_iter().map(|(_, path)| path).collect()
    }

    /// The same, each with the key that names it.
    #[doc(hidden)]
    pub fn files_by_key(&self) -> Vec<(String, &Path)> {
        let mut named: Vec<(String, &Path)> = Vec::new();
        if let Beam::Spectrum(spec) = &self.source.beam
            && let SpectrumOrigin::File { path } = &spec.origin
        {
            named.push(("source.spectrum".into(), path));
        }
        if let Some(Blur::Kernel(KernelFile { path, .. })) = &self.detector.blur {
            named.push(("detector.blur.kernel".into(), path));
        }
        match &self.detector.scatter {
            Some(Scatter::Image(path)) => named.push(("detector.scatter.image".into(), path)),
            Some(Scatter::Kernel { kernel, .. }) => {
                named.push(("detector.scatter.kernel".into(), &kernel.path));
            }
            None => {}
        }
        for (name, spec) in &self.materials {
            if let MaterialSpec::Table { path } = spec {
                named.push((keys::join(&keys::join("materials", name), "table"), path));
            }
        }
        for (name, structure) in &self.microstructures {
            if let Some(path) = &structure.pair_distribution {
                let key = keys::join(&keys::join("materials", name), "microstructure");
                named.push((keys::join(&key, "pair_distribution"), path));
            }
        }
        for (number, object) in self.objects.iter().enumerate() {
            if let Some(Instances::File(path)) = &object.instances {
                named.push((self.object_key(number, "instances"), path));
            }
        }
        named
    }

    /// Objects that are mesh files, by number, with these.
    #[doc(hidden)]
    pub fn mesh_files(&self) -> impl Iterator<Item = (usize, &Path)> {
        self.objects.iter().enumerate().filter_map(|(number, object)| match &object.geometry {
            ShapeOrMesh::Mesh(Mesh::File { path, .. }) => Some((number, path.as_path())),
            _ => None,
        })
    }

    /// Every file that the scene refers to, relative to the working directory:
    /// [`Scene::referenced_files`], meshes, and the image or profile of the focal spot. The scene file
    /// itself is not among them.
    #[must_use]
    pub fn input_files(&self) -> Vec<PathBuf> {
        let meshes = self.mesh_files().map(|(_, path)| path);
        let files = self.referenced_files().into_iter().chain(meshes);
        let mut files: Vec<PathBuf> = files.map(|path| self.resolve(path)).collect();
        // The spot is read with the scene: its path needs no directory.
        let spot = self.source.spot.fit().map(|fit| PathBuf::from(&fit.file));
        files.extend(spot.filter(|file| !file.as_os_str().is_empty()));
        files
    }

    /// The scene with the hash of every file that it refers to: existing hashes are compared with the
    /// files, missing ones are added. A missing file gets none.
    ///
    /// # Errors
    /// [`Error::File`] for a file that does not have the hash of the scene, or cannot be read.
    pub fn with_file_hashes(&self) -> Result<Self> {
        let mut scene = self.clone();
        for path in self.referenced_files() {
            if self.resolve(path).exists() {
                let found = self.hash_of(path)?;
                scene.files.insert(path.to_owned(), found);
            }
        }
        Ok(scene)
    }

    /// Files, meshes too, that do not have the hash that the scene has of them, or cannot be
    /// read: an error each. Files that are not there are left out.
    #[must_use]
    pub fn changed_files(&self) -> Vec<Error> {
        let recorded =
            |(number, path): (usize, _)| Some((path, self.objects[number].sha256.as_ref()?));
        let files = self.files.iter().map(|(path, recorded)| (path.as_path(), recorded));
        files
            .chain(self.mesh_files().filter_map(recorded))
            .filter(|(path, _)| self.resolve(path).exists())
            .filter_map(|(path, recorded)| self.compare(path, recorded).err())
            .collect()
    }

    /// A file that the scene refers to, from where the program runs; it has the hash that the
    /// scene has of it, if any.
    ///
    /// # Errors
    ///
    /// [`Error::File`] for another hash than the recorded one.
    #[doc(hidden)]
    pub fn checked(&self, path: &Path) -> Result<PathBuf> {
        if self.files.contains_key(path) {
            self.hash_of(path)?;
        }
        Ok(self.resolve(path))
    }

    /// The hash of a file as the scene records it; without a record, of its present contents.
    ///
    /// # Errors
    ///
    /// [`Error::File`] where the file cannot be read.
    #[doc(hidden)]
    pub fn file_hash(&self, path: &Path) -> Result<String> {
        self.files
            .get(path)
            .map_or_else(|| hash(&self.resolve(path)), |recorded| Ok(recorded.clone()))
    }

    /// The hash of a file, from the scene if it has one.
    fn hash_of(&self, path: &Path) -> Result<String> {
        match self.files.get(path) {
            Some(recorded) => self.compare(path, recorded),
            None => hash(&self.resolve(path)),
        }
    }

    fn compare(&self, path: &Path, recorded: &str) -> Result<String> {
        let path = self.resolve(path);
        let found = hash(&path)?;
        if found == recorded {
            return Ok(found);
        }
        let problem = format!(
            "is not the file that the scene was made with: sha256 {found}, the scene records \
             {recorded}"
        );
        Err(Error::file(path, problem, None))
    }
}

/// SHA-256 of a file, hexadecimal.
pub(super) fn hash(path: &Path) -> Result<String> {
    hash_until(path, &Cancel::default())
}

/// As `hash`, of files of any length.
///
/// # Errors
/// The file cannot be read; [`Error::Interrupted`].
pub fn hash_until(path: &Path, cancel: &Cancel) -> Result<String> {
    let read = || {
        let mut hasher = Sha256::new();
        let mut file = match input_file::open(path) {
            // The reader of an empty file reports the defect by line.
            Err(error) if error.kind() == ErrorKind::UnexpectedEof => return Ok(hasher.finalize()),
            opened => opened?,
        };
        let mut block = vec![0_u8; 1 << 16];
        loop {
            match file.read(&mut block)? {
                _ if cancel.is_cancelled() => break Ok(hasher.finalize()),
                0 => break Ok(hasher.finalize()),
                len => hasher.update(&block[..len]),
            }
        }
    };
    let digest = read().map_err(|error| Error::file(path, "cannot be read", Some(error)))?;
    cancel.check()?;
    Ok(digest.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// SHA-256 of a text or of bytes, in lower-case hexadecimal.
pub fn text_hash(text: impl AsRef<[u8]>) -> String {
    use std::fmt::Write;
    Sha256::digest(text).iter().fold(String::new(), |mut out, byte| {
        let _ = write!(out, "{byte:02x}");
        out
    })
}
