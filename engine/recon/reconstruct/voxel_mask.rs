//! Voxels that may differ from zero in iterative methods.

use super::grid::VolumeGrid;
use super::voxel_shape::VoxelShape;
use beamlet_core::array_file::{ArrayFile, Format, endings};
use beamlet_core::{Error, Result, reserve};
use ndarray::{Array3, Axis};
use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Voxels that may differ from zero in iterative methods: all others stay at zero.
#[derive(Debug, Clone, PartialEq)]
pub enum VoxelMask {
    /// Voxels whose centres lie in a shape.
    Shape(VoxelShape),
    /// Voxels whose value in a file, NPY or TIFF, `[z][y][x]` as the volume, is not 0.
    File(PathBuf),
}

impl FromStr for VoxelMask {
    type Err = Error;

    /// Reads a shape as [`VoxelShape`] has it; any other text is the path of a file.
    fn from_str(text: &str) -> Result<Self> {
        match VoxelShape::is_begun(text) {
            true => text.parse().map(Self::Shape),
            false => Ok(Self::File(text.into())),
        }
    }
}

impl VoxelMask {
    /// The file that is read; `None` for a shape.
    pub(super) fn path(&self) -> Option<&Path> {
        match self {
            Self::Shape(_) => None,
            Self::File(path) => Some(path),
        }
    }

    /// The mask as it is written on the command line, lengths in m.
    pub(super) fn words(&self) -> String {
        match self {
            Self::Shape(shape) => shape.to_string(),
            Self::File(path) => path.display().to_string(),
        }
    }

    /// Refuses a mask that does not fit a grid; no more than a plane of it is in memory.
    ///
    /// # Errors
    /// [`Error::File`] for a file that cannot be read, of another shape, with values that are not
    /// numbers, or without a voxel; [`Error::Argument`] for a shape without a voxel.
    pub(super) fn check(&self, grid: &VolumeGrid) -> Result<()> {
        match self {
            Self::Shape(shape) if shape.places(grid).next().is_none() => {
                let found = format!("{shape} without a voxel");
                Err(Error::argument("mask", found, "a shape with one voxel or more"))
            }
            Self::Shape(_) => Ok(()),
            Self::File(path) => {
                let mut any = false;
                planes(path, grid, |_, values| any |= values.iter().any(|value| *value != 0.0))?;
                match any {
                    true => Ok(()),
                    false => {
                        Err(Error::file(path, "is 0 everywhere; allowed: one voxel or more", None))
                    }
                }
            }
        }
    }

    /// The mask on a grid, `[z][y][x]`: true where a voxel may differ from zero.
    ///
    /// # Errors
    /// [`Error::File`] for a file that cannot be read or does not fit the grid; [`Error::Argument`] for a shape
    /// without a voxel; [`Error::Memory`].
    pub fn on(&self, grid: &VolumeGrid) -> Result<Array3<bool>> {
        self.check(grid)?;
        let [x, y, z] = grid.size;
        let values = reserve::zeroed(x * y * z, "a mask of voxels")?;
        let mut mask = Array3::from_shape_vec((z, y, x), values)
            .map_err(|error| Error::argument("grid", error.to_string(), "its number of voxels"))?;
        match self {
            Self::Shape(shape) => {
                shape.places(grid).for_each(|[x, y, z]| mask[[z, y, x]] = true);
            }
            Self::File(path) => planes(path, grid, |slice, values| {
                let plane = mask.index_axis_mut(Axis(0), slice);
                plane.into_iter().zip(values).for_each(|(may, value)| *may = *value != 0.0);
            })?,
        }
        Ok(mask)
    }
}

/// Hands over the planes of a file, each with its number.
fn planes(path: &Path, grid: &VolumeGrid, mut each: impl FnMut(usize, &[f32])) -> Result<()> {
    let [x, y, z] = grid.size;
    let Some(format) = Format::of(path).filter(|format| format.abilities().pages) else {
        let allowed = endings(|format| format.abilities().pages);
        let problem = format!("is not a file of a mask; allowed: {allowed}, or a shape");
        return Err(Error::file(path, problem, None));
    };
    let file = ArrayFile::open(path, format)?;
    let (found, needed) = (file.sides(), [z, y, x].map(|side| side as u64));
    if file.is_fortran() || !(found == needed || (z == 1 && found == needed[1..])) {
        let order = if file.is_fortran() { " in Fortran order" } else { "" };
        let problem =
            format!("has the shape {found:?}{order}; the volume has {needed:?}, [z][y][x]");
        return Err(Error::file(path, problem, None));
    }
    for slice in 0..z {
        let values: Vec<f32> = file.read(slice, 0..y)?;
        if let Some(at) = values.iter().position(|value| value.is_nan()) {
            let problem = format!("is NaN at x {}, y {}, z {slice}", at % x, at / x);
            return Err(Error::file(path, problem, None));
        }
        each(slice, &values);
    }
    Ok(())
}
