//! The curves of a retriever: where they are, and what fits them.

use super::super::beamlets::Beamlets;
use super::super::curve_model::CurveModel;
use super::super::curves::{Curve, Fits, SlitCurve};
use super::super::fitter::Fitter;
use super::super::planar::{LatticeBeamlets, LatticeDesign, StepCurves};
use super::super::shape::CurveGeometry;
use ndarray::{Array2, Axis};
use std::ops::Range;

/// Curves by design.
#[derive(Debug)]
pub(in crate::retrieve) enum Layout {
    /// A curve of slits in each pixel.
    Pixels(SlitCurves),
    /// Beamlets of slits in each row.
    Beamlets(Beamlets),
    /// A curve over steps along x and z in each pixel.
    Steps(StepCurves),
    /// Beamlets on a lattice; `None` before the first flat.
    Lattice(LatticeDesign, Option<LatticeBeamlets>),
}

/// Curves of slits over mask offsets.
#[derive(Debug)]
pub(in crate::retrieve) struct SlitCurves {
    /// Fits on the device; `None` of methods without.
    pub(super) fitter: Option<Fitter>,
    /// Masks and spot, as the curves depend on them.
    pub(in crate::retrieve) shape: CurveGeometry,
    /// The curve that is fitted, or of closed forms the nearest that there is.
    pub(in crate::retrieve) curve: CurveModel,
}

impl Layout {
    /// True for curves in two directions.
    pub(super) const fn is_planar(&self) -> bool {
        match self {
            Self::Pixels(_) | Self::Beamlets(_) => false,
            Self::Steps(_) | Self::Lattice(..) => true,
        }
    }

    /// True for beamlets on their pixels, which have no curve over mask offsets.
    pub(in crate::retrieve) const fn has_beamlets(&self) -> bool {
        match self {
            Self::Pixels(_) | Self::Steps(_) => false,
            Self::Beamlets(_) | Self::Lattice(..) => true,
        }
    }

    /// True for curves of a list of apertures, whose place depends on the pixel.
    pub(in crate::retrieve) const fn is_of_list(&self) -> bool {
        match self {
            Self::Steps(curves) => curves.is_of_list(),
            Self::Pixels(_) | Self::Beamlets(_) | Self::Lattice(..) => false,
        }
    }

    /// Offsets of the steps along z with whole periods, m; none of other curves.
    pub(in crate::retrieve) fn offsets_z(&self) -> &[f64] {
        match self {
            Self::Steps(curves) => &curves.offsets_z,
            Self::Pixels(_) | Self::Beamlets(_) | Self::Lattice(..) => &[],
        }
    }

    /// True if all rows of a frame are needed together.
    pub(super) const fn needs_whole_frames(&self) -> bool {
        matches!(self, Self::Lattice(..))
    }

    /// Beamlets of slits; `None` of other curves.
    pub(super) const fn beamlets(&self) -> Option<&Beamlets> {
        match self {
            Self::Beamlets(beamlets) => Some(beamlets),
            Self::Pixels(_) | Self::Steps(_) | Self::Lattice(..) => None,
        }
    }

    /// Curves of slits in each pixel; `None` of other curves.
    pub(in crate::retrieve) const fn slits(&self) -> Option<&SlitCurves> {
        match self {
            Self::Pixels(slits) => Some(slits),
            Self::Beamlets(_) | Self::Steps(_) | Self::Lattice(..) => None,
        }
    }

    /// The curves over mask offsets; `None` of beamlets.
    pub(in crate::retrieve) const fn curve_model(&self) -> Option<&CurveModel> {
        match self {
            Self::Pixels(slits) => Some(&slits.curve),
            Self::Steps(curves) => Some(&curves.model),
            Self::Beamlets(_) | Self::Lattice(..) => None,
        }
    }

    /// The fits on the device; `None` of methods without.
    pub(in crate::retrieve) fn fitter(&self) -> Option<&Fitter> {
        self.slits()?.fitter.as_ref()
    }

    /// Beamlets on a lattice; `None` of other curves and before the first flat.
    pub(in crate::retrieve) const fn lattice(&self) -> Option<&LatticeBeamlets> {
        match self {
            Self::Lattice(_, beamlets) => beamlets.as_ref(),
            Self::Pixels(_) | Self::Beamlets(_) | Self::Steps(_) => None,
        }
    }

    /// Bytes of a curve of the flat, and of the sample where a view has them all at once.
    pub(super) const fn bytes(&self) -> usize {
        match self {
            Self::Pixels(_) | Self::Beamlets(_) => size_of::<SlitCurve>(),
            Self::Steps(_) => size_of::<Option<Curve>>(),
            Self::Lattice(..) => 2 * size_of::<Option<Curve>>(),
        }
    }

    /// Curves of a flat of `count` places, all unknown.
    pub(super) fn unknown(&self, count: usize) -> Fits {
        match self {
            Self::Pixels(_) | Self::Beamlets(_) => Fits::Slits(vec![SlitCurve::unknown(); count]),
            Self::Steps(_) | Self::Lattice(..) => Fits::Planar(vec![None; count]),
        }
    }

    /// Rows and columns of the images of frames of these rows and columns.
    pub(super) fn shape(&self, [rows, columns]: [usize; 2]) -> [usize; 2] {
        match self {
            Self::Pixels(_) | Self::Steps(_) => [rows, columns],
            Self::Beamlets(beamlets) => [rows, beamlets.count()],
            Self::Lattice(_, beamlets) => {
                beamlets.as_ref().map_or([rows, columns], LatticeBeamlets::shape)
            }
        }
    }

    /// Size of a pixel of the images, x and z, m, of frames with pixels of this size.
    pub(super) fn pitch(&self, [x, z]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Pixels(_) | Self::Steps(_) => [x, z],
            Self::Beamlets(beamlets) => [beamlets.period(), z],
            Self::Lattice(_, beamlets) => beamlets.as_ref().map_or([x, z], |beamlets| {
                let [a, b, _] = beamlets.vectors();
                [a[0].hypot(a[1]), b[0].hypot(b[1])]
            }),
        }
    }

    /// Pixels of the images that have a chosen pixel of the frames, `[row][column]`.
    pub(super) fn touched(&self, pixels: &Array2<bool>) -> Array2<bool> {
        match self {
            Self::Pixels(_) | Self::Steps(_) | Self::Lattice(_, None) => pixels.clone(),
            Self::Beamlets(beamlets) => beamlets
                .gather(pixels.view().insert_axis(Axis(0)))
                .fold_axis(Axis(0), false, |any, chosen| *any || *chosen),
            Self::Lattice(_, Some(beamlets)) => beamlets.touched(pixels),
        }
    }

    /// Rows and columns of the images, in rectangles, whose values are all in these rows and columns of the frames.
    pub(super) fn within(&self, pixels: &[Range<usize>; 2]) -> Vec<[Range<usize>; 2]> {
        let [rows, columns] = pixels.clone();
        match self {
            Self::Pixels(_) | Self::Steps(_) | Self::Lattice(_, None) => vec![[rows, columns]],
            Self::Beamlets(beamlets) => {
                let within = beamlets.within(&columns);
                if within.is_empty() { Vec::new() } else { vec![[rows, within]] }
            }
            Self::Lattice(_, Some(beamlets)) => beamlets.within(pixels),
        }
    }
}
