//! Labels, unit and colours of a retrieved image.

use super::colour::Map;
use beamlet::cli_support::printed::with_unit;

/// Images of contrasts, in the order in which they are shown.
pub(crate) const CONTRASTS: [&str; 7] = [
    "transmission",
    "refraction",
    "refraction_z",
    "phase",
    "dark_field",
    "dark_field_z",
    "dark_field_xz",
];

/// How values of an image are shown.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Quantity {
    pub(crate) label: String,
    /// Unit of the shown numbers; empty where there is none.
    pub(crate) unit: &'static str,
    /// Shown number of one unit of the file.
    pub(crate) factor: f64,
    pub(crate) map: Map,
    /// Value of the empty beam, shown; `None` where it has none of its own.
    pub(crate) empty: Option<f64>,
}

impl Quantity {
    /// Label and unit, as on an axis.
    pub(crate) fn words(&self) -> String {
        with_unit(&self.label, self.unit)
    }

    /// Intensities of frames.
    pub(crate) fn intensity() -> Self {
        Self {
            label: "intensity (1 = open pixel)".into(),
            unit: "",
            factor: 1.0,
            map: Map::Viridis,
            empty: None,
        }
    }

    /// Detector numbers of frames.
    pub(crate) fn counts() -> Self {
        Self { label: "detector number".into(), ..Self::intensity() }
    }

    /// A retrieved image by its name; names that are not known are shown as they are.
    pub(crate) fn of_map(name: &str) -> Self {
        let empty = match name {
            "transmission" => Some(1.0),
            "refraction" | "refraction_z" | "phase" => Some(0.0),
            "dark_field" | "dark_field_z" | "dark_field_xz" => Some(0.0),
            _ => None,
        };
        let make =
            |label: &str, unit, factor, map| Self { label: label.into(), unit, factor, map, empty };
        match name {
            "transmission" => make("transmission", "", 1.0, Map::Grey),
            "refraction" => make("refraction angle", "µrad", 1e6, Map::Diverging),
            "refraction_z" => make("refraction angle along z", "µrad", 1e6, Map::Diverging),
            "phase" => make("phase: integral of δ along the beam", "nm", 1e9, Map::Grey),
            "dark_field" => make("dark field σ²", "µrad²", 1e12, Map::Inferno),
            "dark_field_z" => make("dark field σ² along z", "µrad²", 1e12, Map::Inferno),
            "dark_field_xz" => make("dark field covariance xz", "µrad²", 1e12, Map::Diverging),
            "transmission_sigma" => make("1σ of the transmission", "", 1.0, Map::Viridis),
            "refraction_sigma" => make("1σ of the refraction angle", "µrad", 1e6, Map::Viridis),
            "dark_field_sigma" => make("1σ of the dark field", "µrad²", 1e12, Map::Viridis),
            "refraction_z_sigma" => make("1σ of the refraction along z", "µrad", 1e6, Map::Viridis),
            "dark_field_z_sigma" => {
                make("1σ of the dark field along z", "µrad²", 1e12, Map::Viridis)
            }
            "dark_field_xz_sigma" => make("1σ of the covariance xz", "µrad²", 1e12, Map::Viridis),
            "flags" => make("flags (sum of bits)", "", 1.0, Map::Viridis),
            "residual_flat" => make("rms residual of the flat's fit", "", 1.0, Map::Viridis),
            "residual_sample" => make("rms residual of the sample's fit", "", 1.0, Map::Viridis),
            _ => Self::of_fit(name).unwrap_or_else(|| make(name, "", 1.0, Map::Viridis)),
        }
    }

    /// A volume by its name.
    pub(crate) fn of_volume(name: &str) -> Self {
        let make = |label: &str, unit, factor, map| Self {
            label: label.into(),
            unit,
            factor,
            map,
            empty: None,
        };
        let (known, truth) =
            name.strip_suffix("_truth").map_or((name, ""), |known| (known, ", truth"));
        match known {
            "mu" => make(&format!("attenuation µ{truth}"), "1/m", 1.0, Map::Grey),
            "delta" => make(&format!("refraction δ{truth}"), "10⁻⁹", 1e9, Map::Grey),
            "dark-field" => make("dark field per length", "µrad²/mm", 1e9, Map::Inferno),
            "labels" => make("objects", "", 1.0, Map::Viridis),
            _ => make(name, "", 1.0, Map::Viridis),
        }
    }

    /// A difference B - A of images of this quantity.
    pub(crate) fn of_difference(self) -> Self {
        let label = format!("B − A: {}", self.label);
        Self { label, map: Map::Diverging, empty: Some(0.0), ..self }
    }

    /// A parameter of the fitted curves.
    fn of_fit(name: &str) -> Option<Self> {
        let (of, parameter) =
            name.split_once('_').filter(|(of, _)| ["flat", "sample"].contains(of))?;
        let (unit, factor, map) = match parameter {
            "amplitude" | "background" => ("", 1.0, Map::Viridis),
            "centre" => ("µm", 1e6, Map::Diverging),
            "width" => ("µm", 1e6, Map::Viridis),
            _ => return None,
        };
        let label = format!("{parameter} of the {of}'s fit");
        Some(Self { label, unit, factor, map, empty: None })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signed_quantities_take_the_diverging_map() {
        for name in ["refraction", "flat_centre", "sample_centre"] {
            assert_eq!(Quantity::of_map(name).map, Map::Diverging, "{name}");
        }
        for name in ["transmission", "dark_field", "flat_width", "something"] {
            assert_ne!(Quantity::of_map(name).map, Map::Diverging, "{name}");
        }
        assert_eq!(Quantity::of_map("refraction").words(), "refraction angle [µrad]");
    }
}
