//! The built-in X-ray tube: the model "casim" of SpekPy 2.5 by its tables (tests/tables/tube.py
//! makes them and describes their layout).
//!
//! The continuum is tabulated before its way out of the target: photons by energy and depth, in
//! units in which it varies slowly with the tube voltage (energy over voltage, depth over the
//! range of the electrons). Self-absorption, which jumps at the edges of the target, is applied
//! here at the requested energy, with the attenuation that SpekPy uses for it. Lines are
//! tabulated behind the target, as a multiple of a power of the voltage above their edge.

use beamlet_core::numbers;
use std::sync::OnceLock;

use super::Spectrum;
use crate::scene::{ANODE_ANGLES, Anode};
use beamlet_core::units::Dimension::{Angle, Voltage};
use beamlet_core::{Error, Result};

mod grid;
mod table;

use grid::GridPlace;
use table::TubeTable;

/// Electrons of 1 mA in 1 s.
const ELECTRONS: f64 = 1e-3 / 1.602_176_634e-19;

/// Photons per steradian and mA s of a row of weight 1: the largest value of the table, of which SpekPy's photons per
/// electron were divided, times the electrons (`python tests/tables/tube.py scale` prints it).
pub(super) const fn output(anode: Anode) -> f64 {
    let photons_per_electron = match anode {
        Anode::Tungsten => 0.009_389_777_057_789_102,
        Anode::Molybdenum => 0.001_478_324_351_240_609_1,
    };
    photons_per_electron * ELECTRONS
}

/// Width of the rows, keV, and the least energy of the model.
const WIDTH: f64 = 0.25;
const LEAST: f64 = 1.0;

pub(super) fn spectrum(anode: Anode, kvp: f64, anode_angle: f64) -> Result<Spectrum> {
    let [low, high] = anode.kvp_range();
    if !(low..=high).contains(&kvp) {
        let allowed = format!("{low} kV to {high} kV for an anode of {}", anode.name());
        return Err(Error::scene("source.spectrum.kvp", Voltage.rounded(kvp), allowed));
    }
    let [least, most] = ANODE_ANGLES;
    if !(least..=most).contains(&anode_angle) {
        let allowed = format!("{} to {}", Angle.rounded(least), Angle.rounded(most));
        let found = Angle.rounded(anode_angle);
        return Err(Error::scene("source.spectrum.anode_angle", found, allowed));
    }
    let table = table(anode)?;
    let angle = GridPlace::of(&table.angles, anode_angle.to_degrees());
    let mut rows = continuum(table, kvp, anode_angle, angle);
    for shell in &table.shells {
        for (energy, photons) in shell.lines(kvp, angle) {
            rows.push((energy, photons));
        }
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut spectrum = Spectrum { energies_kev: Vec::new(), weights: Vec::new() };
    for (energy, photons) in rows {
        match (spectrum.energies_kev.last(), spectrum.weights.last_mut()) {
            (Some(last), Some(weight)) if energy - last < 1e-9 => *weight += photons,
            _ => {
                spectrum.energies_kev.push(energy);
                spectrum.weights.push(photons);
            }
        }
    }
    Ok(spectrum)
}

fn table(anode: Anode) -> Result<&'static TubeTable> {
    static TUNGSTEN: OnceLock<Option<TubeTable>> = OnceLock::new();
    static MOLYBDENUM: OnceLock<Option<TubeTable>> = OnceLock::new();
    let (cell, bytes): (_, &[u8]) = match anode {
        Anode::Tungsten => (&TUNGSTEN, include_bytes!("tungsten.bin")),
        Anode::Molybdenum => (&MOLYBDENUM, include_bytes!("molybdenum.bin")),
    };
    cell.get_or_init(|| TubeTable::read(bytes)).as_ref().ok_or_else(|| {
        Error::scene(
            "source.spectrum.anode",
            anode.name(),
            "tungsten or molybdenum; the tables of this build are damaged: build again",
        )
    })
}

/// Bremsstrahlung behind the target: energy, keV, and photons of each row.
fn continuum(table: &TubeTable, kvp: f64, anode_angle: f64, angle: GridPlace) -> Vec<(f64, f64)> {
    let voltage = GridPlace::of(&table.voltages, kvp);
    let range = voltage.between_logs(|index| table.ranges[index]);
    let count = numbers::whole::<usize>(((kvp - LEAST) / WIDTH).ceil());
    let width = (kvp - LEAST) / count as f64;
    let row = |index: usize| {
        let energy = LEAST + (index as f64 + 0.5) * width;
        // The way out of the target from the depth 1, in ranges.
        let escape = table.attenuation(energy) * range / anode_angle.sin();
        let ratio = GridPlace::of(&table.ratios, energy / kvp);
        let at = |depth: usize| {
            let source = table.source(voltage, angle, ratio, depth);
            source * (-escape * table.depths[depth]).exp()
        };
        let depths = table.depths.windows(2).enumerate();
        let emitted: f64 = depths
            .map(|(index, ends)| (at(index) + at(index + 1)) / 2.0 * (ends[1] - ends[0]))
            .sum();
        // The table holds energy * range * photons per keV and cm: the range cancels.
        (energy, emitted / energy * width)
    };
    (0..count).map(row).collect()
}
