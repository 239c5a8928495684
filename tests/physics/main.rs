//! Values that can be written down or traced in f64: single rays, flats, samples, spots, spectra and
//! the detector, against closed forms and the reference program.

use beamlet_reference as reference;
#[path = "../support/mod.rs"]
mod support;

mod assemblies;
mod bars;
mod bath;
mod crossings;
mod designs;
mod detector;
mod edges;
mod exact_shapes;
mod flat;
mod hard_edges;
mod heights;
mod instances;
mod leaks;
mod mask_mesh;
mod motions;
mod offsets;
mod ordered;
mod polychromatic;
mod ray_limits;
mod reference_against_closed_forms;
mod rough;
mod sample;
mod scattering;
mod source_drift;
mod spot_forms;
mod spots;
mod tapers;
mod thin_masks;
mod transport;
mod view_offsets;
mod waves;
mod worst;
