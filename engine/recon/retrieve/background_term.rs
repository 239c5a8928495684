//! Background of the model of a curve.

use super::equations::{UNKNOWNS, Valued};

/// Background of the model of a curve.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum BackgroundTerm {
    /// An unknown.
    #[default]
    Free,
    /// This times the area of the curve, 1/m or 1/m2.
    PerArea(f64),
    /// This value.
    Value(f64),
}

impl BackgroundTerm {
    /// Number of unknowns of a curve of `unknowns` with its background.
    pub(super) const fn unknowns(self, unknowns: usize) -> usize {
        match self {
            Self::Free => unknowns,
            Self::PerArea(_) | Self::Value(_) => unknowns - 1,
        }
    }

    /// Unknowns that keep their value, with the background unless it is an unknown.
    pub(super) fn held(self, mut held: [bool; UNKNOWNS]) -> [bool; UNKNOWNS] {
        held[UNKNOWNS - 1] = self != Self::Free;
        held
    }

    /// Value and slopes where the background follows from the light.
    pub(super) fn tied(self, mut valued: Valued) -> Valued {
        if let Self::PerArea(share) = self {
            valued[1] += share;
        }
        valued
    }

    /// The background of a curve of this area; `None` where it is an unknown.
    pub(super) fn of_area(self, area: f64) -> Option<f64> {
        match self {
            Self::Free => None,
            Self::PerArea(share) => Some(share * area),
            Self::Value(value) => Some(value),
        }
    }
}
