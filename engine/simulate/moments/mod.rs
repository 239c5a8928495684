//! Moments kept from a run: the sample as rays saw it, for other masks, steps, spectra,
//! materials or detectors without another search through its surfaces.
//!
//! Moments do not depend on masks, mask steps, spot or energy. A cell of one lattice is cut and
//! interpolated to cells of another (`resample`); moments become results at the energies of the
//! other scene (`illuminate::EnergyBinning`). Rays that no sum of moments can describe are traced
//! again, which needs the meshes.

mod bytes;
mod cell_cache;
mod compatibility;
mod content;
mod finer;
mod resample;

pub use beamlet_files::moment_file::MomentWriter;
pub(crate) use bytes::cell_bytes;
pub use bytes::write;

use crate::detector::DetectorModel;
use crate::illuminate::EnergyBinning;
use crate::sampling::{CellBatch, Lattice};
use beamlet_core::locked_file::LockedFile;
use beamlet_core::{Error, Result, input_file, numbers};
use beamlet_files::layout;
use beamlet_files::moment_file::{self, MomentFile};
use beamlet_model::media::MaterialTable;
use beamlet_model::optics::Optics;
use beamlet_model::scene::{Scene, Transport};
use cell_cache::{CellCache, Part};
use content::Bounds;
pub use finer::Finer;
use finer::SetUp;
use resample::{Covered, Resampled};
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// How much stronger than in the run that kept them moments may refract in another scene: rays
/// are flagged with that much in hand.
pub(crate) const DELTA_HEADROOM: f64 = 2.0;

/// Moments of a run (`simulate --keep-moments`). Clones share files and cache.
#[derive(Debug, Clone)]
pub struct StoredMoments {
    kept: Arc<Kept>,
    shared: Arc<CellCache>,
}

/// Files of the moments of a run.
#[derive(Debug)]
struct Kept {
    run: PathBuf,
    directory: PathBuf,
    scene: Scene,
    views: Vec<MomentFile>,
    /// Shared lock of the run: nobody replaces it while its moments are read.
    _lock: Option<LockedFile>,
}

impl StoredMoments {
    /// Opens the moments of the run in `run`.
    ///
    /// # Errors
    /// [`Error::File`] if there is no run, or it kept no moments, or lacks those of a view;
    /// [`Error::Scene`] if its scene cannot be read.
    ///
    /// # Example
    ///
    /// ```no_run
    /// let moments = beamlet::moments::StoredMoments::open("run".as_ref())?;
    /// println!("{} bytes", moments.bytes());
    /// # Ok::<(), beamlet::Error>(())
    /// ```
    pub fn open(run: &Path) -> Result<Self> {
        layout::refuse_unjoined(run)?;
        let scene_path = run.join(layout::SCENE);
        if !scene_path.is_file() {
            let file = "is a file: name a run that keeps moments";
            let lacks = format!("is not a run directory: it has no {}", layout::SCENE);
            let problem = layout::problem_of(run, file, &lacks);
            return Err(Error::file(run, problem, None));
        }
        let scene = Scene::load(&scene_path)?;
        for path in scene.files_without_hash() {
            log::warn!(
                "{}: has no hash of {}: whether the run was made with it cannot be verified",
                scene_path.display(),
                path.display()
            );
        }
        let directory = run.join(layout::MOMENTS);
        if !directory.is_dir() {
            let problem = "has no moments: simulate with --keep-moments";
            return Err(Error::file(run, problem, None));
        }
        let lock = lock(run)?;
        let scene_digest = moment_file::scene_digest(run)?;
        let views = (0..scene.scan.views())
            .map(|view| MomentFile::open(&directory, numbers::count(view), &scene_digest))
            .collect::<Result<_>>()?;
        let run = run.to_path_buf();
        let kept = Arc::new(Kept { run, directory, scene, views, _lock: lock });
        Ok(Self { kept, shared: Arc::default() })
    }

    /// Caches up to `bytes` of the cells that the first scene makes, so that later scenes with the
    /// same sampling reuse them: those with the same energies, constants, spot, detector, reach of the
    /// scan, place and period of the sample mask and, under a spectrum, thickness and material of
    /// the masks.
    #[must_use]
    pub fn sharing(self, bytes: u64) -> Self {
        Self { shared: Arc::new(CellCache::new(bytes)), ..self }
    }

    /// The scene of the run.
    #[must_use]
    pub fn scene(&self) -> &Scene {
        &self.kept.scene
    }

    /// Where the moments are.
    #[must_use]
    pub fn directory(&self) -> &Path {
        &self.kept.directory
    }

    /// Bytes of all views.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.kept.views.iter().map(MomentFile::bytes).sum()
    }

    /// Reads the moments of every view and cuts them to the lattice of `scene`, as the engine does
    /// before it makes light of them, but without a device: the number of cells.
    ///
    /// # Errors
    /// [`Error::File`] names the file of a view that cannot be read, or whose numbers cannot belong to
    /// this run; [`Error::Scene`] if the scene differs in more than moments can follow.
    pub fn cells(&self, scene: &Scene) -> Result<usize> {
        scene.validate()?;
        let detector = DetectorModel::of(scene)?;
        let optics = detector.optics();
        let lattice = Lattice::of(optics, MaterialTable::of(scene)?.strongest());
        let source = self.for_scene(scene, optics, &lattice)?;
        let rows = -lattice.halo..i64::from(optics.detector.pixels[1]) + lattice.halo;
        let mut cells = 0;
        for view in (0_u32..).take(self.kept.views.len()) {
            source.read(view, &rows, &mut Covered::default(), |cell_rows| {
                cells += cell_rows.cells.len();
                Ok(())
            })?;
        }
        Ok(cells)
    }

    /// Prepares the moments for another scene.
    ///
    /// # Errors
    /// [`Error::Scene`] where the scene differs in more than moments can follow, and says in what.
    pub(crate) fn for_scene(
        &self,
        scene: &Scene,
        optics: &Optics,
        lattice: &Lattice,
    ) -> Result<StoredSource> {
        let kept = &self.kept;
        compatibility::check(&kept.scene, scene)?;
        let detector = DetectorModel::of(&kept.scene)?;
        let traced = detector.optics();
        let (base, now) = (MaterialTable::of(&kept.scene)?, MaterialTable::of(scene)?);
        let media = compatibility::media(&kept.scene, &base, scene, &now)?;
        let reference = base.mean();
        let same_constants = media.constants == base.constants && media.weights == base.weights;
        let old = Lattice::of(traced, base.strongest());
        let resample = Resampled::new([traced, optics], [&old, lattice], media.names.len())?;
        let wide = kept.views.iter().any(MomentFile::has_wide);
        let exact = scene.sampling.transport == Transport::Exact;
        let was = SetUp::new(&kept.scene, traced, &old, &base)?;
        let is = SetUp::new(scene, optics, lattice, &now)?;
        let finer = finer::finer(&was, &is, resample.cuts());
        Ok(StoredSource {
            kept: kept.clone(),
            shared: self.shared.clone(),
            resample,
            finer,
            media,
            reference,
            flagged: DELTA_HEADROOM * base.strongest(),
            retrace: (wide || exact) && !(same_constants && base.energies.len() == 1),
        })
    }
}

/// Locks a run for readers, where it has a log to lock.
fn lock(run: &Path) -> Result<Option<LockedFile>> {
    let path = run.join(layout::LOG);
    let Ok(file) = input_file::open(&path) else { return Ok(None) };
    match LockedFile::shared(file) {
        None => Err(Error::file(path, "another beamlet process is writing this run", None)),
        locked => Ok(locked),
    }
}

/// Kept moments as the cell rows of another scene.
#[derive(Debug)]
pub(crate) struct StoredSource {
    kept: Arc<Kept>,
    shared: Arc<CellCache>,
    resample: Resampled,
    /// The property for which the other scene needs finer cells, if any.
    pub(crate) finer: Option<Finer>,
    /// Materials of the other scene in the order of the moments.
    pub(crate) media: MaterialTable,
    /// Constants that exact transport was computed at.
    pub(crate) reference: Vec<beamlet_model::material::Constants>,
    /// The strongest delta that rays were flagged for.
    pub(crate) flagged: f64,
    /// Exact transport of some rays has to be repeated.
    pub(crate) retrace: bool,
}

impl StoredSource {
    /// Directory of the run that kept them.
    pub(crate) fn run(&self) -> &Path {
        &self.kept.run
    }

    /// Tolerance of the sampling of that run.
    pub(crate) fn base_tolerance(&self) -> f64 {
        self.kept.scene.sampling.tolerances().light
    }

    /// Lists of the cell rows of some rows of a view, those without a sample among them, handed over
    /// in parts: as `gather`, of `spectral`, makes them, or as it made them for a scene before.
    ///
    /// # Errors
    /// [`Error::File`] if the file cannot be read or is damaged; errors of `gather` and `take`.
    pub(crate) fn lists(
        &self,
        spectral: &EnergyBinning,
        view: u32,
        [rows, lit]: [&Range<i64>; 2],
        mut gather: impl FnMut(&CellBatch) -> Result<Vec<CellBatch>>,
        mut take: impl FnMut(&[CellBatch]) -> Result<()>,
    ) -> Result<()> {
        let shared = &self.shared;
        let place = (view, rows.clone());
        let made = shared.find(&self.resample, spectral, &place);
        let blank = |covered: &Covered| {
            let mut blank = self.resample.blank(rows, lit, covered);
            blank.keep_nothing(self.media.moment_words());
            blank
        };
        if let Some(part) = made {
            part.lists_of(rows).try_for_each(|lists| take(&lists))?;
            return take(&gather(&blank(&part.covered))?);
        }
        let mut keeps = shared.takes(&self.resample, spectral, 0);
        let mut part = Part::default();
        let mut covered = std::mem::take(&mut part.covered);
        self.read(view, rows, &mut covered, |cell_rows| {
            let lists = gather(&cell_rows)?;
            take(&lists)?;
            if keeps {
                part.lists.push(lists);
                keeps = shared.takes(&self.resample, spectral, part.bytes());
                if !keeps {
                    part.lists = Vec::new();
                }
            }
            Ok(())
        })?;
        part.covered = covered;
        take(&gather(&blank(&part.covered))?)?;
        if keeps {
            shared.insert(&self.resample, spectral, place, part);
        }
        Ok(())
    }

    /// Hands over the cell rows of some rows of a view, cut to the lattice of the other scene, and notes
    /// the covered part of it.
    fn read(
        &self,
        view: u32,
        rows: &Range<i64>,
        covered: &mut Covered,
        mut take: impl FnMut(CellBatch) -> Result<()>,
    ) -> Result<()> {
        let words = self.media.moment_words();
        let bounds = Bounds::of(self.resample.old(), view);
        let old_rows = self.resample.old_rows(rows);
        let file = &self.kept.views[view as usize];
        bytes::read(file, &old_rows, words, bounds, |block| {
            take(self.resample.map(block, rows, covered))
        })
    }
}
