//! Shapes of voxels, by their centres.

use super::grid::VolumeGrid;
use beamlet_core::numbers::whole;
use beamlet_core::units::Dimension;
use beamlet_core::{Error, Result};
use std::fmt;
use std::ops::Range;
use std::str::FromStr;

/// Shape of voxels whose centres lie in it, m.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum VoxelShape {
    /// Along z, without ends: x and y of its axis, radius.
    Cylinder([f64; 3]),
    /// x, y, z of its centre, radius.
    Sphere([f64; 4]),
    /// x, y, z of its centre, and its sides along them.
    Box([f64; 6]),
}

const ALLOWED: &str = "cylinder:X,Y,RADIUS (along z), sphere:X,Y,Z,RADIUS or \
                       box:X,Y,Z,WIDTH,DEPTH,HEIGHT, lengths with units as in cylinder:1 mm,0 mm,2 mm";

/// Names of the shapes.
const SHAPES: [&str; 3] = ["cylinder", "sphere", "box"];

impl VoxelShape {
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

impl FromStr for VoxelShape {
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

impl fmt::Display for VoxelShape {
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

#[cfg(test)]
mod tests {
    use super::*;

    /// Number of voxels of a grid of 4 × 3 × 2 mm.
    fn count(text: &str) -> Result<usize> {
        let grid = VolumeGrid { size: [4, 3, 2], voxel: [1e-3; 3], origin: [-1.5e-3, -1e-3, 0.0] };
        Ok(text.parse::<VoxelShape>()?.places(&grid).count())
    }

    #[test]
    fn shapes_hold_the_voxels_whose_centres_lie_in_them() {
        // y = 0 and x = ±0.5 mm, in both slices.
        assert_eq!(count("cylinder:0 mm, 0 mm, 0.6 mm").unwrap(), 4);
        assert_eq!(count("sphere:0.5 mm,0 mm,1 mm,0.1 mm").unwrap(), 1);
        assert_eq!(count("box:0 mm,1 mm,0 mm,4 mm,1 um,1 um").unwrap(), 4);
        assert_eq!(count("cylinder:20 mm,0 mm,1 mm").unwrap(), 0);
    }

    #[test]
    fn shapes_are_read_as_they_are_written() {
        for text in [
            "cylinder:0.3 um,-1 mm,0.6 mm",
            "sphere:0 m,1 mm,2 mm,0.1 mm",
            "box:1 mm,2 mm,3 mm,4 mm,5 mm,6 mm",
        ] {
            let shape: VoxelShape = text.parse().unwrap();
            assert_eq!(shape.to_string().parse::<VoxelShape>().unwrap(), shape);
        }
    }

    #[test]
    fn shapes_that_cannot_be_are_refused_with_the_reason() {
        for (text, word) in [
            ("cube:1 mm", "cylinder:X,Y,RADIUS"),
            ("cylinder:1 mm,1 mm", "cylinder:X,Y,RADIUS"),
            ("cylinder:1 mm,1 mm,0 mm", "cylinder:X,Y,RADIUS"),
            ("cylinder:1,1 mm,1 mm", "without a unit"),
        ] {
            let message = count(text).unwrap_err().to_string();
            assert!(message.contains(word), "{message}");
        }
    }
}
