//! Words that stand for a choice of the engine.

use beamlet::Backend;
use beamlet::retrieve::{Method, Weights};
use beamlet::stack::Format;
use clap::ValueEnum;
use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};

/// `--format`
pub(crate) fn format() -> impl TypedValueParser<Value = Format> {
    let value = |format: Format| {
        let abilities = format.abilities();
        PossibleValue::new(abilities.name).help(abilities.summary)
    };
    let named = |name: String| {
        let has = |format: &Format| format.abilities().name == name;
        Format::ALL.into_iter().find(has).unwrap_or_default()
    };
    PossibleValuesParser::new(Format::ALL.map(value)).map(named)
}

/// `--method`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum MethodName {
    /// Gaussian on a background by least squares; 4 steps or more
    Gaussian,
    /// Gaussian without background through 3 steps
    ThreeStep,
    /// Curve of the masks without background through 2 steps: no dark field
    TwoStep,
    /// Area, centroid and variance of curves that reach zero within the scan
    Moments,
    /// Triangle, for small spots and apertures of one projected width
    Triangle,
    /// The curve of the masks, blurred: without the bias of a Gaussian
    ExactCurve,
    /// Blurred box per beamlet, integrated over neighbouring pixels: single mask
    Beamlet,
}

impl From<MethodName> for Method {
    fn from(name: MethodName) -> Self {
        match name {
            MethodName::Gaussian => Self::Gaussian,
            MethodName::ThreeStep => Self::ThreeStep,
            MethodName::TwoStep => Self::TwoStep,
            MethodName::Moments => Self::Moments,
            MethodName::Triangle => Self::Triangle,
            MethodName::ExactCurve => Self::ExactCurve,
            MethodName::Beamlet => Self::Beamlet,
        }
    }
}

/// `--weights`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum WeightsName {
    /// Equal weights
    None,
    /// For counts, from the fit: the maximum of the Poisson likelihood
    Poisson,
}

impl From<WeightsName> for Weights {
    fn from(name: WeightsName) -> Self {
        match name {
            WeightsName::None => Self::None,
            WeightsName::Poisson => Self::Poisson,
        }
    }
}

/// `--backend`
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub(crate) enum BackendName {
    /// The faster one on this scene
    Auto,
    /// The driver's acceleration structures
    RayQuery,
    /// The tree of beamlet, in a compute shader
    Bvh,
}

impl BackendName {
    /// `None` leaves the choice to the engine.
    pub(crate) fn choice(self) -> Option<Backend> {
        match self {
            Self::Auto => None,
            Self::RayQuery => Some(Backend::RayQuery),
            Self::Bvh => Some(Backend::Bvh),
        }
    }
}
