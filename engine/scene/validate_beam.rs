//! What the beam of a source has to fulfil.

use super::beam::ANODE_ANGLES;
use super::validate::{count, named, plain, positive};
use super::{Beam, Filter, SpectrumOrigin, SpectrumSpec, limits};
use crate::units::Dimension::{Angle, Energy, Length, Voltage};
use crate::{Error, Result};

pub(super) fn validate_beam(beam: &Beam) -> Result<()> {
    match beam {
        Beam::Energy(energy) => positive("source.energy", *energy, Energy),
        Beam::Spectrum(spec) => validate_spectrum(spec),
    }
}

fn validate_spectrum(spec: &SpectrumSpec) -> Result<()> {
    match &spec.origin {
        SpectrumOrigin::File { path } if path.as_os_str().is_empty() => {
            return Err(Error::scene("source.spectrum.file", "\"\"", "path of a file"));
        }
        SpectrumOrigin::File { .. } => {}
        SpectrumOrigin::Tube { anode, kvp, anode_angle, inherent_filters } => {
            let [low, high] = anode.kvp_range();
            if !(low..=high).contains(kvp) {
                return Err(Error::scene(
                    "source.spectrum.kvp",
                    Voltage.format(*kvp),
                    format!("{low} kV to {high} kV for an anode of {}", anode.name()),
                ));
            }
            let [least, most] = ANODE_ANGLES;
            if !(least..=most).contains(anode_angle) {
                return Err(Error::scene(
                    "source.spectrum.anode_angle",
                    Angle.format(*anode_angle),
                    format!("{} to {}", Angle.format(least), Angle.format(most)),
                ));
            }
            validate_filters("inherent_filters", inherent_filters)?;
        }
    }
    validate_filters("filters", &spec.filters)?;
    match spec.nodes {
        Some(nodes) => count("source.spectrum.nodes", nodes, 1, limits::NODES),
        None => Ok(()),
    }
}

fn validate_filters(list: &str, filters: &[Filter]) -> Result<()> {
    for (index, filter) in filters.iter().enumerate() {
        let key = |key: &str| format!("source.spectrum.{list}[{index}].{key}");
        named(&key("material"), &filter.material)?;
        positive(&key("thickness"), filter.thickness, Length)?;
        let allowed = "less than 1 m";
        plain(&key("thickness"), filter.thickness, filter.thickness < 1.0, allowed)?;
    }
    Ok(())
}
