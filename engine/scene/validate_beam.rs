//! What the beam of a source has to fulfil.

use super::beam::ANODE_ANGLES;
use super::validate::{Faults, count, named, plain, positive};
use super::{Beam, Filter, SpectrumOrigin, SpectrumSpec, limits};
use crate::Error;
use crate::units::Dimension::{Angle, Energy, Length, Voltage};

pub(super) fn validate_beam(beam: &Beam, faults: &mut Faults) {
    match beam {
        Beam::Energy(energy) => faults.note(positive("source.energy", *energy, Energy)),
        Beam::Spectrum(spec) => validate_spectrum(spec, faults),
    }
}

fn validate_spectrum(spec: &SpectrumSpec, faults: &mut Faults) {
    match &spec.origin {
        SpectrumOrigin::File { path } if path.as_os_str().is_empty() => {
            faults.add(Error::scene("source.spectrum.file", "\"\"", "path of a file"));
        }
        SpectrumOrigin::File { .. } => {}
        SpectrumOrigin::Tube { anode, kvp, anode_angle, inherent_filters } => {
            let [low, high] = anode.kvp_range();
            if !(low..=high).contains(kvp) {
                faults.add(Error::scene(
                    "source.spectrum.kvp",
                    Voltage.format(*kvp),
                    format!("{low} kV to {high} kV for an anode of {}", anode.name()),
                ));
            }
            let [least, most] = ANODE_ANGLES;
            if !(least..=most).contains(anode_angle) {
                faults.add(Error::scene(
                    "source.spectrum.anode_angle",
                    Angle.format(*anode_angle),
                    format!("{} to {}", Angle.format(least), Angle.format(most)),
                ));
            }
            validate_filters("inherent_filters", inherent_filters, faults);
        }
    }
    validate_filters("filters", &spec.filters, faults);
    if let Some(nodes) = spec.nodes {
        faults.note(count("source.spectrum.nodes", nodes, 1, limits::NODES));
    }
}

fn validate_filters(list: &str, filters: &[Filter], faults: &mut Faults) {
    for (index, filter) in filters.iter().enumerate() {
        let key = |key: &str| format!("source.spectrum.{list}[{index}].{key}");
        faults.note(named(&key("material"), &filter.material));
        let thickness = positive(&key("thickness"), filter.thickness, Length);
        let below = filter.thickness < 1.0;
        let thin = || plain(&key("thickness"), filter.thickness, below, "less than 1 m");
        faults.note(thickness.and_then(|()| thin()));
    }
}
