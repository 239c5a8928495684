//! A rectangle of a patch, and the rule that gives its result.

use beamlet_interface::{FLAG_DRAWN, FLAG_NOT_FINITE, FLAG_REFLECTED, RayResult};

/// The axis along which a rectangle is split.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::sampling) enum Axis {
    X,
    Z,
}

/// Slopes of optical depth and displacement along x (per m) and z (per row).
#[derive(Debug, Clone, Copy, Default)]
pub(in crate::sampling) struct Slopes {
    pub(in crate::sampling) depth: [f32; 2],
    pub(in crate::sampling) displacement: [f32; 2],
    /// Slopes of the displacement along z on the detector, where apertures end along z; else 0.
    pub(in crate::sampling) landing: [f32; 2],
}

/// Residual of the best linear model of a rectangle.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::sampling) struct Residuals {
    /// Slopes along x which the fit has, of displacement and optical depth.
    pub(in crate::sampling) slope: f32,
    pub(in crate::sampling) slope_depth: f32,
    /// Displacement on the detector along z at both ends of z, m.
    pub(in crate::sampling) ends_z: [f32; 2],
    /// Rise of the optical depth over its height by the fit, and standard deviation from that line.
    pub(in crate::sampling) rise: f32,
    pub(in crate::sampling) bow: f32,
    /// Light that crosses the upper and the lower border of the row, where the rectangle touches them.
    pub(in crate::sampling) borders: [Option<Border>; 2],
    /// Standard deviations from the fit: of the optical depth, and of the displacement along x
    /// and z, m.
    pub(in crate::sampling) depth: f32,
    pub(in crate::sampling) displacement: f32,
    pub(in crate::sampling) displacement_z: f32,
    /// Standard deviation of the displacement along x by its slope over z, m.
    pub(in crate::sampling) across: f32,
    /// Most that the displacement along x and z of any ray leaves the fit, m.
    pub(in crate::sampling) farthest: [f32; 2],
    /// Axis along which facets with outstanding displacement are narrower, relative to the rectangle.
    pub(in crate::sampling) narrower: Axis,
}

/// Light of a rectangle near a border of the row.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::sampling) struct Border {
    /// Its displacement on the detector along z, m.
    pub(in crate::sampling) landing: f32,
    /// Its density beside the mean over the rectangle.
    pub(in crate::sampling) light: f32,
}

impl Border {
    /// Mean over rectangles side by side, each with its width.
    pub(in crate::sampling) fn mean(parts: impl Iterator<Item = (f32, Self)>) -> Option<Self> {
        let (mut width, mut landing, mut light) = (0.0, 0.0, 0.0);
        for (own, border) in parts {
            width += own;
            landing += own * border.landing;
            light += own * border.light;
        }
        (width > 0.0).then(|| Self { landing: landing / width, light: light / width })
    }
}

/// Displacements of all rays of a rectangle to first order, along x and z, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::sampling) struct AllRays {
    pub(in crate::sampling) mean: [f32; 2],
    /// Slope over x of that along x, and its standard deviation by the slope over z.
    pub(in crate::sampling) slope: f32,
    pub(in crate::sampling) across: f32,
    /// Standard deviations from the linear model that fits best, and the farthest.
    pub(in crate::sampling) deviation: [f32; 2],
    pub(in crate::sampling) farthest: [f32; 2],
}

impl AllRays {
    /// From a mean and its residual.
    pub(in crate::sampling) fn new(mean: &RayResult, left: &Residuals) -> Self {
        Self {
            mean: [mean.displacement_x, mean.displacement_z],
            slope: left.slope,
            across: left.across,
            deviation: [left.displacement, left.displacement_z],
            farthest: left.farthest,
        }
    }
}

/// Result of a rectangle from its facets.
#[derive(Debug, Clone, Copy)]
pub(in crate::sampling) enum Mean {
    /// The linear model that fits it best, to first order: means over all its rays.
    Fit(RayResult, Residuals),
    /// A silhouette crosses it. Mean number of crossings of its rays.
    Silhouette { crossings: f32 },
    /// The first order is not enough, or the facets are not sound.
    Unknown,
}

/// Rule of quadrature that gives the result of a rectangle (docs/developers/sampling.md, "The four rules").
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::sampling) enum Rule {
    /// The ray through its centre, with the facets' bounds on all its rays.
    Rays(Option<AllRays>),
    /// The linear model that fits its facets best.
    Means(Residuals),
    /// Pieces that its facets cut it into: the first of them in the patch, and their end.
    Overlay([u32; 2]),
    /// One of the rays that are spread evenly over the patch.
    Even,
}

/// A rectangle and its result.
#[derive(Debug, Clone, Copy)]
pub(in crate::sampling) struct Node {
    /// From the beamlet's centre in the cell plane at the middle of the row, m.
    pub(in crate::sampling) x: [f32; 2],
    /// Share of the row, downwards.
    pub(in crate::sampling) z: [f32; 2],
    pub(in crate::sampling) result: RayResult,
    pub(in crate::sampling) rule: Rule,
    /// Mean number of crossings of all its rays, where a silhouette crosses it and it is known.
    pub(super) crossings: Option<f32>,
    /// Place of its facets in the list of the patch.
    pub(super) facets: [u32; 2],
}

impl Node {
    pub(in crate::sampling) fn new(x: [f32; 2], z: [f32; 2], result: RayResult) -> Self {
        Self { x, z, result, rule: Rule::Rays(None), crossings: None, facets: [0; 2] }
    }

    /// Centre (x, z).
    pub(in crate::sampling) fn centre(&self) -> [f32; 2] {
        [0.5 * (self.x[0] + self.x[1]), 0.5 * (self.z[0] + self.z[1])]
    }

    pub(in crate::sampling) fn width(&self) -> f32 {
        self.x[1] - self.x[0]
    }

    pub(in crate::sampling) fn height(&self) -> f32 {
        self.z[1] - self.z[0]
    }

    /// True if coordinates lie in it.
    pub(in crate::sampling) fn holds(&self, [x, z]: [f32; 2]) -> bool {
        x >= self.x[0] && x < self.x[1] && z >= self.z[0] && z < self.z[1]
    }

    /// Share of its rays that cross other surfaces than its own ray, at least.
    pub(in crate::sampling) fn hidden(&self) -> f32 {
        let off = |mean: f32| (0.5 * (mean - self.result.crossings as f32).abs()).min(1.0);
        self.crossings.map_or(0.0, off)
    }

    /// True if a silhouette is known to cross it.
    pub(in crate::sampling) fn has_silhouette(&self) -> bool {
        self.crossings.is_some()
    }
}

/// True if two rays crossed the same components in the same way: results between them may be interpolated.
pub(in crate::sampling) fn alike(a: &RayResult, b: &RayResult) -> bool {
    a.signature == b.signature
        && (a.flags ^ b.flags) & FLAG_REFLECTED == 0
        && (a.flags | b.flags) & FLAG_NOT_FINITE == 0
}

/// True if a ray drew its normal at a rough surface: another at the same place may go elsewhere.
pub(in crate::sampling) fn is_drawn(result: &RayResult) -> bool {
    result.flags & FLAG_DRAWN != 0
}

/// True if no silhouette lies between two rays. Rays that draw their normals may reflect or not on one
/// surface: any two that cross the sample are alike.
pub(in crate::sampling) fn no_silhouette_between(a: &RayResult, b: &RayResult) -> bool {
    if is_drawn(a) || is_drawn(b) {
        return (a.crossings == 0) == (b.crossings == 0);
    }
    alike(a, b)
}
