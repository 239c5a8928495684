//! Inputs of a reconstruction: images of one or several retrievals, or sinograms in files.

use super::centre::find_axis;
use super::data::Data;
use super::geometry::ScanGeometry;
use super::moment::reaching_ends;
use super::prepare::{PixelCounts, Preparation};
use super::quantity::Quantity;
use crate::retrieve::FLAGS;
use beamlet_core::array_file::{ArrayFile, Format, endings};
use beamlet_core::cancel::Cancel;
use beamlet_core::{Error, Result, reserve};
use beamlet_files::layout::{self, GEOMETRY, RECORD};
use beamlet_files::{GeometryFile, Maps, place_of};
use beamlet_model::scene::Scene;
use ndarray::{Array2, Array3};
use std::path::{Path, PathBuf};

/// Sinograms of one or more quantities, with the geometry of their views.
#[derive(Debug)]
pub struct Input {
    geometry: ScanGeometry,
    source: Source,
}

#[derive(Debug)]
enum Source {
    /// Folders of retrieved images. Columns of all, ascending by place: folder and column.
    Images { folders: Vec<(PathBuf, Maps)>, columns: Vec<[usize; 2]> },
    /// A file `[view][row][column]`.
    File { path: PathBuf, quantity: Quantity, file: ArrayFile },
}

impl Input {
    /// Folders of retrieved images with their geometry.json. The columns of several folders (dithers)
    /// interleave by their places.
    ///
    /// # Errors
    /// [`Error::File`] where a folder has no images or geometry, its images and geometry differ in views, rows
    /// or columns, or it differs from the first folder in views, rows or distances; where two columns measure
    /// the same place.
    pub fn of_images(folders: &[PathBuf]) -> Result<Self> {
        let open = |path: &PathBuf| {
            if !layout::is_retrieved(path) {
                let lacks = format!("holds no retrieved images: it has no {RECORD}");
                return Err(Error::file(path, layout::problem_of(path, &lacks, &lacks), None));
            }
            let maps = Maps::open(path)?;
            if !path.join(GEOMETRY).exists() {
                let problem = format!(
                    "has no {GEOMETRY}: the scene of the images has no angle for each view; list the angles in \
                     scan.angles and retrieve again"
                );
                return Err(Error::file(path, problem, None));
            }
            let file = GeometryFile::read(path)?;
            file.refuse_other_images(path, maps.sides())?;
            Ok((path.clone(), maps, file))
        };
        let opened = folders.iter().map(open).collect::<Result<Vec<_>>>()?;
        let Some((first_path, _, first)) = opened.first() else {
            return Err(Error::argument("images", "no folder", "one or more"));
        };
        for (path, _, other) in &opened[1..] {
            if let Some(differs) = difference(first, other) {
                let problem = format!("has other {differs} than {}", first_path.display());
                return Err(Error::file(path.join(GEOMETRY), problem, None));
            }
        }
        let mut places: Vec<(f64, [usize; 2])> = Vec::new();
        for (folder, (_, _, file)) in opened.iter().enumerate() {
            let of_folder = file.columns_m.iter().enumerate();
            places.extend(of_folder.map(|(column, place)| (*place, [folder, column])));
        }
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(pair) = places.windows(2).find(|pair| pair[1].0 - pair[0].0 < 1e-9) {
            let name =
                |at: [usize; 2]| format!("column {} of {}", at[1], opened[at[0]].0.display());
            let problem =
                format!("measures the same place as {}; dithers must differ", name(pair[0].1));
            return Err(Error::file(name(pair[1].1), problem, None));
        }
        let mut geometry = ScanGeometry::of_file(first, first_path)?;
        geometry.columns = places.iter().map(|(place, _)| *place).collect();
        let columns = places.iter().map(|(_, at)| *at).collect();
        let folders = opened.into_iter().map(|(path, maps, _)| (path, maps)).collect();
        Ok(Self { geometry, source: Source::Images { folders, columns } })
    }

    /// A file of sinograms, `[view][row][column]`, NPY or TIFF with a page for each view; `[view][column]`
    /// where the detector has one row. Values: −ln of the transmission, refraction angles in rad, or
    /// variances in rad², as `quantity` says. The scene has the angles, distances and pixels.
    ///
    /// # Errors
    /// [`Error::File`] for a file of another shape, naming the shape of the scene; [`Error::Scene`] where
    /// the views are no circle.
    pub fn of_file(path: &Path, quantity: Quantity, scene: &Scene) -> Result<Self> {
        let geometry = ScanGeometry::of_scene(scene);
        let Some(format) = Format::of(path).filter(|format| format.abilities().pages) else {
            let allowed = endings(|format| format.abilities().pages);
            return Err(Error::file(
                path,
                format!("is not a file of sinograms; allowed: {allowed}"),
                None,
            ));
        };
        let file = ArrayFile::open(path, format)?;
        let found = file.sides();
        let shape = geometry.shape().map(|side| side as u64);
        let [views, rows, columns] = shape;
        let is_flat = rows == 1 && found == [views, columns];
        let is_one = views == 1 && found == [rows, columns];
        if file.is_fortran() || !(found == shape || is_flat || is_one) {
            let order = if file.is_fortran() { " in Fortran order" } else { "" };
            let problem = format!(
                "has the shape {found:?}{order}; the scene has {views} angles, {rows} rows and {columns} \
                 columns; allowed: {shape:?}, [view][row][column]"
            );
            return Err(Error::file(path, problem, None));
        }
        Ok(Self { geometry, source: Source::File { path: path.to_owned(), quantity, file } })
    }

    /// The geometry of the sinograms.
    #[must_use]
    pub const fn geometry(&self) -> &ScanGeometry {
        &self.geometry
    }

    /// The same with the axis of rotation on a column, counted from 0 at the centre of the first and
    /// between columns by fractions; where views move the sample, its origin is there in their mean.
    #[must_use]
    pub fn with_centre(mut self, column: f64) -> Self {
        self.geometry.set_axis_column(column);
        self
    }

    /// The same with the axis of rotation found in the sinograms ([`super::find_axis`]): of μ, else of
    /// the dark field, else of δ.
    ///
    /// # Errors
    /// As [`Input::sinograms`] and [`super::find_axis`].
    pub fn with_found_centre(mut self, cancel: &Cancel) -> Result<Self> {
        let has = self.quantities();
        let order = [Quantity::Mu, Quantity::DarkField, Quantity::Delta];
        let of = order.into_iter().find(|of| has.contains(of)).unwrap_or(Quantity::Mu);
        let (sinograms, _) = self.sinograms(of, cancel)?;
        self.geometry.axis = find_axis(&self.geometry, sinograms.view(), Data::of(of), cancel)?;
        Ok(self)
    }

    /// Quantities that there are sinograms of.
    #[must_use]
    pub fn quantities(&self) -> Vec<Quantity> {
        match &self.source {
            Source::File { quantity, .. } => vec![*quantity],
            Source::Images { folders, .. } => {
                let has = |quantity: &Quantity| {
                    folders
                        .iter()
                        .all(|(_, maps)| maps.names().any(|name| name == quantity.image()))
                };
                Quantity::ALL.into_iter().filter(has).collect()
            }
        }
    }

    /// Files and folders that are read.
    #[must_use]
    pub fn paths(&self) -> Vec<PathBuf> {
        match &self.source {
            Source::File { path, .. } => vec![path.clone()],
            Source::Images { folders, .. } => {
                folders.iter().map(|(path, _)| path.clone()).collect()
            }
        }
    }

    /// The sinograms of a quantity, `[view][row][column]`, ready to be reconstructed: −ln of the
    /// transmission, and every pixel with a value. Says how many had none.
    ///
    /// # Errors
    /// [`Error::File`] where the quantity is not there, a file cannot be read, or a view has no pixel
    /// with a value; [`Error::Memory`], [`Error::Interrupted`].
    pub fn sinograms(
        &self,
        quantity: Quantity,
        cancel: &Cancel,
    ) -> Result<(Array3<f32>, PixelCounts)> {
        let [views, rows, columns] = self.geometry.shape();
        let values = reserve::zeroed(views * rows * columns, "sinograms")?;
        let mut all = Array3::from_shape_vec((views, rows, columns), values)
            .map_err(|error| Error::argument("sinograms", error.to_string(), "their shape"))?;
        let is_transmission =
            matches!(self.source, Source::Images { .. }) && quantity == Quantity::Mu;
        let mut preparation = Preparation::new(&self.geometry, is_transmission);
        for (view, mut image) in all.outer_iter_mut().enumerate() {
            cancel.check()?;
            match &self.source {
                Source::File { file, .. } => self.read_view(file, view, &mut image)?,
                Source::Images { folders, columns } => {
                    let has_flags = |of: &&(PathBuf, Maps)| of.1.names().any(|name| name == FLAGS);
                    let flags_of = |of: &(PathBuf, Maps)| {
                        has_flags(&of).then(|| of.1.map(FLAGS, view)).transpose()
                    };
                    let flags = folders.iter().map(flags_of).collect::<Result<Vec<_>>>()?;
                    for (to, [folder, column]) in columns.iter().enumerate() {
                        if let Some(flags) = &flags[*folder] {
                            preparation.flags_of_column(to, flags.column(*column));
                        }
                    }
                    self.read_images(quantity.image(), view, &mut image)?;
                }
            }
            preparation.view(&mut image).map_err(|problem| {
                let path = self.paths().into_iter().next().unwrap_or_default();
                Error::file(path, format!("{}: view {view} {problem}", quantity.name()), None)
            })?;
        }
        Ok((all, preparation.counts()))
    }

    /// Views and rows in which a body reaches an end of the row, `[view][row]`; `None` where the transmission is
    /// not known.
    ///
    /// # Errors
    /// [`Error::Memory`], [`Error::Interrupted`].
    pub(super) fn reaching_ends(&self, cancel: &Cancel) -> Result<Option<Array2<bool>>> {
        if !self.quantities().contains(&Quantity::Mu) {
            return Ok(None);
        }
        match self.sinograms(Quantity::Mu, cancel) {
            Ok((attenuation, _)) => Ok(Some(reaching_ends(attenuation.view()))),
            // A view without any transmission is no obstacle to a volume of δ.
            Err(Error::File { .. }) => Ok(None),
            Err(error) => Err(error),
        }
    }

    /// Reads an image of a view from every folder.
    fn read_images(
        &self,
        name: &str,
        view: usize,
        image: &mut ndarray::ArrayViewMut2<'_, f32>,
    ) -> Result<()> {
        let Source::Images { folders, columns } = &self.source else { return Ok(()) };
        let maps = folders.iter().map(|(_, maps)| maps.map(name, view));
        let maps = maps.collect::<Result<Vec<_>>>()?;
        for (to, [folder, column]) in columns.iter().enumerate() {
            image.column_mut(to).assign(&maps[*folder].column(*column));
        }
        Ok(())
    }

    fn read_view(
        &self,
        file: &ArrayFile,
        view: usize,
        image: &mut ndarray::ArrayViewMut2<'_, f32>,
    ) -> Result<()> {
        let [_, rows, columns] = self.geometry.shape();
        // Frames of a file [view][column] are the rows of one.
        let values: Vec<f32> = match file.frames() {
            (1, [lines, _]) if lines != rows => file.read(0, view..view + 1)?,
            _ => file.read(view, 0..rows)?,
        };
        let read = ndarray::ArrayView2::from_shape((rows, columns), &values);
        read.map(|read| image.assign(&read))
            .map_err(|error| Error::argument("sinograms", error.to_string(), "rows and columns"))
    }
}

/// Name of a property in which two scans of one sample differ; `None` where they agree.
fn difference(a: &GeometryFile, b: &GeometryFile) -> Option<&'static str> {
    let near = |a: &[f64], b: &[f64], least: f64| {
        a.len() == b.len() && a.iter().zip(b).all(|(a, b)| (a - b).abs() <= least)
    };
    let distances = |file: &GeometryFile| {
        [file.source_to_axis_m, file.source_to_detector_m, file.source_to_analyser_m]
    };
    let axis = |file: &GeometryFile| {
        let place = file.axis_column.and_then(|column| place_of(column, &file.columns_m));
        place.into_iter().collect::<Vec<f64>>()
    };
    match () {
        () if !near(&a.angles_rad, &b.angles_rad, 1e-9) => Some("angles"),
        () if !near(&a.rows_m, &b.rows_m, 1e-9) => Some("rows"),
        () if !near(&distances(a), &distances(b), 1e-9) => Some("distances"),
        () if !near(&axis(a), &axis(b), 1e-9) => Some("axis of rotation"),
        () if !same_motions(a, b) => Some("motions of the sample"),
        () => None,
    }
}

fn same_motions(a: &GeometryFile, b: &GeometryFile) -> bool {
    let [a, b] = [a, b].map(|file| file.sample_motions.as_deref());
    let Some((a, b)) = a.zip(b) else { return a.is_none() == b.is_none() };
    let near =
        |(a, b): (&[f64; 12], &[f64; 12])| a.iter().zip(b).all(|(a, b)| (a - b).abs() < 1e-9);
    a.len() == b.len() && a.iter().zip(b).all(near)
}
