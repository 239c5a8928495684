//! Instances of an object: many copies of one shape or mesh.

use std::f64::consts::PI;
use std::path::PathBuf;

/// Highest fill of parallel fibres.
pub(crate) const PARALLEL_FIBRE_FILL: f64 = 0.5;
/// Highest fill of fibres of random direction; long ones jam far below it.
pub(crate) const RANDOM_FIBRE_FILL: f64 = 0.35;
/// Highest fill of spheres.
pub(crate) const SPHERE_FILL: f64 = 0.35;

/// Places of the copies of an object's shape or mesh. The object's own placement applies to all of them
/// as a group.
#[derive(Debug, Clone, PartialEq)]
pub enum Instances {
    /// A CSV file of positions, rotations and scales, relative to the scene's directory.
    File(PathBuf),
    /// A random arrangement without overlap.
    Packing(Packing),
}

/// A random arrangement of copies of a shape in a region. No two overlap, and each lies wholly
/// inside the region.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub struct Packing {
    /// Kind of the bodies.
    pub kind: PackingKind,
    /// Where.
    pub region: PackingRegion,
    /// How many.
    pub amount: PackingAmount,
    /// Standard deviation of ln d of the diameters d, 0 to 0.5; the diameter of the shape is their median. 0:
    /// all are equal.
    pub diameter_spread: f64,
    /// Least distance between two surfaces, and between a surface and the wall of the region, m.
    pub gap: f64,
    /// Seed of the arrangement.
    pub seed: u64,
}

impl Packing {
    /// A packing of equal copies with the smallest gap that the device resolves, seed 1.
    #[must_use]
    pub const fn new(kind: PackingKind, region: PackingRegion, amount: PackingAmount) -> Self {
        Self { kind, region, amount, diameter_spread: 0.0, gap: 0.0, seed: 1 }
    }
}

/// Bodies of a packing.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PackingKind {
    /// Cylinders along z, side by side.
    ParallelFibres,
    /// Cylinders of uniformly random directions.
    RandomFibres,
    /// Spheres.
    Spheres,
}

impl PackingKind {
    /// Its word in scene files.
    #[must_use]
    pub const fn word(self) -> &'static str {
        match self {
            Self::ParallelFibres => "parallel-fibres",
            Self::RandomFibres => "random-fibres",
            Self::Spheres => "spheres",
        }
    }

    /// Highest fill.
    #[must_use]
    pub(crate) const fn most_fill(self) -> f64 {
        match self {
            Self::ParallelFibres => PARALLEL_FIBRE_FILL,
            Self::RandomFibres => RANDOM_FIBRE_FILL,
            Self::Spheres => SPHERE_FILL,
        }
    }
}

/// The region of a packing: centred on the object's origin, upright along z.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PackingRegion {
    /// Box.
    Box {
        /// Edge lengths along x, y, z, m.
        size: [f64; 3],
    },
    /// Cylinder along z.
    Cylinder {
        /// Radius, m.
        radius: f64,
        /// Height, m.
        height: f64,
    },
    /// Sphere.
    Sphere {
        /// Radius, m.
        radius: f64,
    },
}

impl PackingRegion {
    /// Volume, m³.
    #[must_use]
    pub fn volume(&self) -> f64 {
        match *self {
            Self::Box { size } => size.into_iter().product(),
            Self::Cylinder { radius, height } => PI * radius * radius * height,
            Self::Sphere { radius } => 4.0 / 3.0 * PI * radius.powi(3),
        }
    }
}

/// How much a packing holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum PackingAmount {
    /// Share of the region's volume; for parallel fibres, of the cross-section that they can occupy.
    Fill(f64),
    /// Number of copies.
    Count(u32),
}
