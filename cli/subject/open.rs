//! Opening a run, or a directory of retrieved images.

use super::Subject;
use crate::failure::Failure;
use beamlet::retrieve::{Input, Method, Record};
use beamlet::scene::Scene;
use beamlet::stack::layout::{self, RECORD, RETRIEVED, RUN};
use beamlet::stack::{Maps, OpenRun};
use std::path::{Path, PathBuf};

/// Images, of pixels or of beamlets or dithers, and their record.
struct Images {
    maps: Maps,
    of_beamlets: bool,
    record: Record,
    rows: usize,
    columns: usize,
}

impl Images {
    fn open(directory: &Path) -> Result<Self, Failure> {
        let maps = Maps::open(directory)?;
        let record = Record::read(&directory.join(RECORD))?;
        let first = maps.names().next().map(str::to_owned).unwrap_or_default();
        let (rows, columns) = maps.map(&first, 0)?.dim();
        let of_beamlets = record.method == Method::Beamlet.name()
            || !record.columns.is_empty()
            || record.group.is_some();
        Ok(Self { maps, of_beamlets, record, rows, columns })
    }
}

impl Subject {
    /// Opens a run, with its retrieved images or those in another directory, or a directory of
    /// retrieved images. Images must be whole and fit the run.
    pub(crate) fn open(path: &Path, retrieved: Option<&Path>) -> Result<Self, Failure> {
        if layout::is_run(path) {
            return Self::of_run(path, retrieved);
        }
        if retrieved.is_some() {
            let problem = format!("--retrieved is for runs; this is not a run: it has no {RUN}");
            return Err(Failure::Usage(problem));
        }
        if layout::is_retrieved(path) {
            return Self::of_images(path);
        }
        let neither = format!(
            "is neither a run directory (it has no {RUN}) nor a directory of retrieved images (it has no \
             {RECORD})"
        );
        let problem = layout::problem_of(path, &neither, &neither);
        Err(Failure::File { path: path.to_path_buf(), problem })
    }

    fn of_run(path: &Path, named: Option<&Path>) -> Result<Self, Failure> {
        let run = OpenRun::open(path)?;
        let frames = [run.flat()?, run.sample()?];
        let shape = frames[1].shape();
        let retrieved: PathBuf = named.map_or_else(|| path.join(RETRIEVED), Path::to_path_buf);
        let (mut record, mut maps, mut beamlets) = (None, None, None);
        if named.is_some() || retrieved.is_dir() {
            let mut found = Images::open(&retrieved)?;
            // Columns behind apertures are not the user's choice.
            let lit = Input::of_run(&run, found.record.counts)?.kept_columns();
            let kept = found.record.kept_columns.clone();
            let is_chosen = kept.is_some() && kept != lit.map(|columns| columns.to_string());
            found.of_beamlets |= kept.is_some();
            let (rows, columns) = (found.rows, found.columns);
            let differs = [rows, columns] != shape[2..];
            if is_chosen || found.record.bin.is_some() {
                return Err(Failure::File {
                    path: retrieved,
                    problem:
                        "was retrieved with --columns or --bin, so its pixels differ from the \
                              pixels of the run: give this directory without the run"
                            .into(),
                });
            }
            if differs && !found.of_beamlets || found.maps.views() > shape[0] {
                return Err(Failure::File {
                    path: retrieved,
                    problem: format!(
                        "holds {} views of {columns} x {rows} pixels; the run has {} of {} x {}",
                        found.maps.views(),
                        shape[0],
                        shape[3],
                        shape[2]
                    ),
                });
            }
            record = Some(found.record);
            *(if found.of_beamlets { &mut beamlets } else { &mut maps }) = Some(found.maps);
        }
        let counts = record.as_ref().is_some_and(|record: &Record| record.counts);
        let fitted = Input::of_run(&run, counts)?.whole();
        Ok(Self {
            path: path.to_path_buf(),
            retrieved,
            scene: Some(run.scene().clone()),
            run: Some(run),
            frames: Some(frames),
            maps,
            beamlets,
            record,
            fitted: Some(fitted),
            without: None,
            shape,
        })
    }

    /// Images alone. The stacks that they come from are shown with them where they still read.
    fn of_images(path: &Path) -> Result<Self, Failure> {
        let Images { maps, of_beamlets, record, rows, columns } = Images::open(path)?;
        let (fitted, without) = match Input::reopened(&record, path) {
            Ok(input) if record.group.is_some() => (Some(input.whole()), None),
            Ok(input) => (Some(input), None),
            Err(error) => (None, Some(error.to_string())),
        };
        let scene = match &fitted {
            Some(input) => Some(input.scene().clone()),
            None => record.geometry.as_ref().and_then(|text| Scene::from_toml(text, path).ok()),
        };
        let steps = fitted.as_ref().map_or(record.offsets.len(), |input| input.steps()[0]);
        let columns = match &fitted {
            Some(input) if of_beamlets => input.frame()[1],
            _ => columns,
        };
        let shape = [maps.views(), steps, rows, columns];
        let (maps, beamlets) = if of_beamlets { (None, Some(maps)) } else { (Some(maps), None) };
        Ok(Self {
            path: path.to_path_buf(),
            retrieved: path.to_path_buf(),
            run: None,
            frames: None,
            maps,
            beamlets,
            record: Some(record),
            fitted,
            without,
            scene,
            shape,
        })
    }
}
