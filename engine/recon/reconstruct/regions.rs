//! Means of regions of a volume.

use super::grid::{Volume, VolumeGrid};
use beamlet_core::numbers::whole;
use beamlet_core::units::Dimension;
use beamlet_core::{Error, Result};
use std::fmt::{self, Write};
use std::ops::Range;
use std::str::FromStr;

/// A region with a name; lengths in m, coordinates of the volume.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Region {
    /// Name in tables.
    pub name: String,
    /// Its voxels are those whose centres lie in it.
    pub shape: RegionShape,
}

/// Shape of a region, m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum RegionShape {
    /// Along z, without ends: x and y of its axis, radius.
    Cylinder([f64; 3]),
    /// x, y, z of its centre, radius.
    Sphere([f64; 4]),
    /// x, y, z of its centre, and its sides along them.
    Box([f64; 6]),
}

/// Values of a volume in a region.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct RegionMean {
    /// Name of the region.
    pub name: String,
    /// Voxels in it.
    pub voxels: u64,
    /// Mean of their values, in the unit of the volume.
    pub mean: f64,
    /// Standard deviation of single voxels about the mean. It is no uncertainty of the mean: noise of
    /// voxels is correlated.
    pub deviation: f64,
    /// Least and largest value.
    pub range: [f64; 2],
}

const ALLOWED: &str = "cylinder:X,Y,RADIUS (along z), sphere:X,Y,Z,RADIUS or \
                       box:X,Y,Z,WIDTH,DEPTH,HEIGHT, lengths with units as in cylinder:1 mm,0 mm,2 mm";

/// Names of the shapes.
const SHAPES: [&str; 3] = ["cylinder", "sphere", "box"];

impl RegionShape {
    /// True if a text begins as a shape does, and not as the name of a file.
    pub(super) fn is_begun(text: &str) -> bool {
        text.split_once(':').is_some_and(|(kind, _)| SHAPES.contains(&kind.trim()))
    }

    /// Voxels of a grid whose centres lie in the shape, each as its x, y and z, by a search of a box
    /// about it.
    pub(super) fn places(self, grid: &VolumeGrid) -> impl Iterator<Item = [usize; 3]> {
        let grid = *grid;
        let [x, y, z] = self.within(&grid);
        let all = z.flat_map(move |z| {
            let x = x.clone();
            y.clone().flat_map(move |y| x.clone().map(move |x| [x, y, z]))
        });
        all.filter(move |[x, y, z]| self.holds(grid.centre((*z, *y, *x))))
    }

    /// Voxels along x, y and z of a box that holds the shape.
    fn within(self, grid: &VolumeGrid) -> [Range<usize>; 3] {
        let about = |centre: f64, half: f64| [centre - half, centre + half];
        let ends = match self {
            Self::Cylinder([a, b, radius]) => {
                [about(a, radius), about(b, radius), [f64::NEG_INFINITY, f64::INFINITY]]
            }
            Self::Sphere([a, b, c, radius]) => [a, b, c].map(|centre| about(centre, radius)),
            Self::Box([a, b, c, width, depth, height]) => {
                [about(a, width / 2.0), about(b, depth / 2.0), about(c, height / 2.0)]
            }
        };
        [0, 1, 2].map(|axis| {
            let at = |place: f64| (place - grid.origin[axis]) / grid.voxel[axis];
            let clamped = |at: f64| whole::<usize>(at.clamp(0.0, grid.size[axis] as f64));
            let [low, high] = ends[axis];
            clamped(at(low).floor())..clamped(at(high).ceil() + 1.0)
        })
    }

    /// True if a point lies in the shape, m.
    #[must_use]
    pub fn holds(&self, [x, y, z]: [f64; 3]) -> bool {
        match *self {
            Self::Cylinder([a, b, radius]) => (x - a).hypot(y - b) <= radius,
            Self::Sphere([a, b, c, radius]) => (x - a).hypot(y - b).hypot(z - c) <= radius,
            Self::Box([a, b, c, width, depth, height]) => {
                [(x - a, width), (y - b, depth), (z - c, height)]
                    .iter()
                    .all(|(from, side)| from.abs() <= side / 2.0)
            }
        }
    }
}

impl FromStr for RegionShape {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused =
            |problem: String| Error::argument("shape", format!("{text:?}{problem}"), ALLOWED);
        let (kind, list) = text.split_once(':').ok_or_else(|| refused(String::new()))?;
        let lengths = list
            .split(',')
            .map(|word| {
                Dimension::Length.parse(word).map_err(|error| refused(format!(": {error}")))
            })
            .collect::<Result<Vec<f64>>>()?;
        match (kind.trim(), lengths.as_slice()) {
            ("cylinder", &[x, y, radius]) if radius > 0.0 => Ok(Self::Cylinder([x, y, radius])),
            ("sphere", &[x, y, z, radius]) if radius > 0.0 => Ok(Self::Sphere([x, y, z, radius])),
            ("box", &[x, y, z, a, b, c]) if a > 0.0 && b > 0.0 && c > 0.0 => {
                Ok(Self::Box([x, y, z, a, b, c]))
            }
            _ => Err(refused(String::new())),
        }
    }
}

impl fmt::Display for RegionShape {
    /// Writes the shape as it is read, lengths in m.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (name, lengths): (_, &[f64]) = match self {
            Self::Cylinder(lengths) => (SHAPES[0], lengths),
            Self::Sphere(lengths) => (SHAPES[1], lengths),
            Self::Box(lengths) => (SHAPES[2], lengths),
        };
        let lengths: Vec<String> = lengths.iter().map(|length| format!("{length} m")).collect();
        write!(f, "{name}:{}", lengths.join(","))
    }
}

impl FromStr for Region {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let refused = |problem: &str| {
            let allowed = format!("NAME=SHAPE, where SHAPE is {ALLOWED}");
            Error::argument("region", format!("{text:?}{problem}"), allowed)
        };
        let (name, shape) = text.split_once('=').ok_or_else(|| refused(""))?;
        let shape = shape.parse()?;
        let name = name.trim();
        if name.is_empty() || name.contains([',', '"', '\n']) {
            return Err(refused(": a name of one or more characters, without commas"));
        }
        Ok(Self { name: name.to_owned(), shape })
    }
}

impl fmt::Display for Region {
    /// Writes the region as it is read, lengths in m.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.name, self.shape)
    }
}

impl Region {
    /// Mean and spread of a volume in the region.
    ///
    /// # Errors
    /// [`Error::Argument`] where no voxel has its centre in the region.
    pub fn mean(&self, volume: &Volume) -> Result<RegionMean> {
        let (mut voxels, mut sum, mut squares) = (0_u64, 0.0, 0.0);
        let mut range = [f64::INFINITY, f64::NEG_INFINITY];
        for [x, y, z] in self.shape.places(&volume.grid) {
            let value = f64::from(volume.values[[z, y, x]]);
            (voxels, sum) = (voxels + 1, sum + value);
            squares += value * value;
            range = [range[0].min(value), range[1].max(value)];
        }
        self.refuse_empty(voxels, &volume.grid)?;
        let mean = sum / voxels as f64;
        let deviation = (squares / voxels as f64 - mean * mean).max(0.0).sqrt();
        Ok(RegionMean { name: self.name.clone(), voxels, mean, deviation, range })
    }

    /// Refuses a region without a voxel of a grid, before any work is done.
    ///
    /// # Errors
    /// [`Error::Argument`].
    pub fn check(&self, grid: &VolumeGrid) -> Result<()> {
        let has = self.shape.places(grid).next().is_some();
        self.refuse_empty(u64::from(has), grid)
    }

    fn refuse_empty(&self, voxels: u64, grid: &VolumeGrid) -> Result<()> {
        if voxels > 0 {
            return Ok(());
        }
        let [x, y, z] =
            grid.ends().map(|[low, high]| format!("{:.4} to {:.4} mm", low * 1e3, high * 1e3));
        let found = format!("{:?} without a voxel", self.name);
        Err(Error::argument(
            "region",
            found,
            format!("regions that hold the centre of a voxel; centres are at x {x}, y {y}, z {z}"),
        ))
    }
}

/// Means of regions as CSV: one line for each region.
///
/// # Errors
/// [`Error::Argument`] where a region has no voxel.
pub fn region_table(regions: &[Region], volume: &Volume) -> Result<String> {
    let mut text =
        String::from("region,quantity,unit,voxels,mean,standard_deviation,least,largest\n");
    for region in regions {
        let RegionMean { name, voxels, mean, deviation, range: [least, largest] } =
            region.mean(volume)?;
        let (quantity, unit) = (volume.quantity.name(), volume.quantity.unit());
        let _ = writeln!(
            text,
            "{name},{quantity},{unit},{voxels},{mean:e},{deviation:e},{least:e},{largest:e}"
        );
    }
    Ok(text)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reconstruct::Quantity;
    use ndarray::Array3;

    fn volume() -> Volume {
        let grid = VolumeGrid { size: [4, 3, 2], voxel: [1e-3; 3], origin: [-1.5e-3, -1e-3, 0.0] };
        let values = Array3::from_shape_fn((2, 3, 4), |(z, y, x)| (100 * z + 10 * y + x) as f32);
        Volume::new(grid, Quantity::Mu, values)
    }

    fn mean(text: &str) -> Result<RegionMean> {
        text.parse::<Region>()?.mean(&volume())
    }

    #[test]
    fn regions_hold_the_voxels_whose_centres_lie_in_them() {
        // y = 0 and x = ±0.5 mm, in both slices.
        let of = mean("a=cylinder:0 mm, 0 mm, 0.6 mm").unwrap();
        assert_eq!(
            (of.voxels, of.range.map(f64::to_bits)),
            (4, [11.0_f64, 112.0].map(f64::to_bits))
        );
        assert!((of.mean - (11.0 + 12.0 + 111.0 + 112.0) / 4.0).abs() < 1e-9);
        assert!((of.deviation - 50.0_f64.hypot(0.5)).abs() < 1e-9);
        let one = mean("a=sphere:0.5 mm,0 mm,1 mm,0.1 mm").unwrap();
        assert_eq!(one.range.map(f64::to_bits), [112.0_f64.to_bits(); 2]);
        assert_eq!(mean("a=box:0 mm,1 mm,0 mm,4 mm,1 um,1 um").unwrap().voxels, 4);
        let table = region_table(&["a=sphere:0.5 mm,0 mm,1 mm,0.1 mm".parse().unwrap()], &volume());
        assert!(table.unwrap().ends_with("\na,mu,1/m,1,1.12e2,0e0,1.12e2,1.12e2\n"));
    }

    #[test]
    fn regions_are_read_as_they_are_written() {
        for text in [
            "a b=cylinder:0.3 um,-1 mm,0.6 mm",
            "c=sphere:0 m,1 mm,2 mm,0.1 mm",
            "d=box:1 mm,2 mm,3 mm,4 mm,5 mm,6 mm",
        ] {
            let region: Region = text.parse().unwrap();
            assert_eq!(region.to_string().parse::<Region>().unwrap(), region);
        }
    }

    #[test]
    fn regions_that_cannot_be_are_refused_with_the_reason() {
        for (text, word) in [
            ("rod", "NAME=SHAPE"),
            ("rod=cube:1 mm", "cylinder:X,Y,RADIUS"),
            ("rod=cylinder:1 mm,1 mm", "cylinder:X,Y,RADIUS"),
            ("rod=cylinder:1 mm,1 mm,0 mm", "cylinder:X,Y,RADIUS"),
            ("rod=cylinder:1,1 mm,1 mm", "without a unit"),
            ("=cylinder:1 mm,1 mm,1 mm", "one or more characters"),
            ("rod=cylinder:20 mm,0 mm,1 mm", "x -1.5000 to 1.5000 mm"),
        ] {
            let message = mean(text).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
        let region: Region = "rod=sphere:0 mm,0 mm,9 mm,1 mm".parse().unwrap();
        assert!(region.check(&volume().grid).is_err());
    }
}
