//! The table of an anode, as tests/tables/tube.py lays it out.

use super::grid::GridPlace;
use beamlet_core::interpolation::log_log;
use beamlet_core::numbers::single;

/// Lines grow about as this power of the voltage above their edge; the remaining factor is smooth.
const GROWTH: f64 = 1.6;

pub(super) struct TubeTable {
    /// kV.
    pub(super) voltages: Vec<f64>,
    /// Degrees.
    pub(crate) angles: Vec<f64>,
    /// Photon energy over voltage.
    pub(super) ratios: Vec<f64>,
    /// Depths as parts of the electrons' range.
    pub(super) depths: Vec<f64>,
    /// Range of the electrons by voltage, cm.
    pub(super) ranges: Vec<f64>,
    /// Energies, keV, each edge twice, and attenuation of the target, 1/cm.
    attenuation: [Vec<f64>; 2],
    /// Continuum, [voltage][angle][ratio][depth].
    values: Vec<f32>,
    pub(super) shells: Vec<Shell>,
}

/// Lines that fill one shell.
pub(super) struct Shell {
    /// Voltage below which there are none, kV.
    edge: f64,
    /// Voltages above the edge, kV.
    excesses: Vec<f64>,
    energies: Vec<f64>,
    /// [excess][angle][line].
    values: Vec<f64>,
    angles: usize,
}

impl TubeTable {
    /// `None` where the bytes are not such a table.
    pub(super) fn read(bytes: &[u8]) -> Option<Self> {
        let mut bytes = RemainingBytes(bytes);
        let [voltages, angles, ratios, depths, rows, shells] = bytes.counts()?;
        let read = |bytes: &mut RemainingBytes<'_>, count| bytes.numbers(count);
        let (voltages, angles) = (read(&mut bytes, voltages)?, read(&mut bytes, angles)?);
        let (ratios, depths) = (read(&mut bytes, ratios)?, read(&mut bytes, depths)?);
        let ranges = read(&mut bytes, voltages.len())?;
        let attenuation = [read(&mut bytes, rows)?, read(&mut bytes, rows)?];
        let [low, step] = read(&mut bytes, 2)?.try_into().ok()?;
        let count = voltages.len() * angles.len() * ratios.len() * depths.len();
        let values = bytes.take(2 * count)?.chunks_exact(2).map(|pair| {
            let code = u16::from_le_bytes([pair[0], pair[1]]);
            let value = single((low + step * f64::from(code)).exp());
            if code == u16::MAX { 0.0 } else { value }
        });
        let values = values.collect();
        let shell = |_| Shell::read(&mut bytes, angles.len());
        let shells = (0..shells).map(shell).collect::<Option<_>>()?;
        let whole = bytes.0.is_empty();
        whole.then_some(Self {
            voltages,
            angles,
            ratios,
            depths,
            ranges,
            attenuation,
            values,
            shells,
        })
    }

    /// Attenuation of the target, 1/cm, linear in the logarithms.
    pub(super) fn attenuation(&self, energy: f64) -> f64 {
        let [energies, values] = &self.attenuation;
        let above = energies.partition_point(|known| *known <= energy).clamp(1, values.len() - 1);
        let point = |index: usize| [energies[index], values[index]];
        log_log(energy, point(above - 1), point(above))
    }

    /// Continuum at a depth of the table, linear between its other entries.
    pub(super) fn source(
        &self,
        voltage: GridPlace,
        angle: GridPlace,
        ratio: GridPlace,
        depth: usize,
    ) -> f64 {
        let at = |v: usize, a: usize, r: usize| {
            let row = (v * self.angles.len() + a) * self.ratios.len() + r;
            f64::from(self.values[row * self.depths.len() + depth])
        };
        voltage.between(|v| angle.between(|a| ratio.between(|r| at(v, a, r)))).max(0.0)
    }
}

impl Shell {
    fn read(bytes: &mut RemainingBytes<'_>, angles: usize) -> Option<Self> {
        let edge = *bytes.numbers(1)?.first()?;
        let [excesses, lines] = bytes.counts()?;
        let excesses = bytes.numbers(excesses)?;
        let energies = bytes.numbers(lines)?;
        let values = bytes.numbers(excesses.len() * angles * lines)?;
        Some(Self { edge, excesses, energies, values, angles })
    }

    /// Energy, keV, and photons of each line at a voltage, kV.
    pub(super) fn lines(&self, kvp: f64, angle: GridPlace) -> Vec<(f64, f64)> {
        if kvp <= self.edge {
            return Vec::new();
        }
        // Nearer to the edge than the table the growth law alone holds.
        let excess = kvp - self.edge;
        let place = GridPlace::of(&self.excesses, excess.max(self.excesses[0]));
        let line = |(line, energy): (usize, &f64)| {
            let at = |e: usize, a: usize| {
                self.values[(e * self.angles + a) * self.energies.len() + line]
            };
            let value = place.between(|e| angle.between(|a| at(e, a)));
            (*energy, value * excess.powf(GROWTH))
        };
        self.energies.iter().enumerate().map(line).collect()
    }
}

/// The unread bytes.
struct RemainingBytes<'a>(&'a [u8]);

impl<'a> RemainingBytes<'a> {
    fn take(&mut self, count: usize) -> Option<&'a [u8]> {
        let (head, tail) = self.0.split_at_checked(count)?;
        self.0 = tail;
        Some(head)
    }

    fn counts<const N: usize>(&mut self) -> Option<[usize; N]> {
        let mut counts = [0; N];
        for count in &mut counts {
            *count = u32::from_le_bytes(self.take(4)?.try_into().ok()?) as usize;
        }
        Some(counts)
    }

    fn numbers(&mut self, count: usize) -> Option<Vec<f64>> {
        let number = |eight: &[u8]| Some(f64::from_le_bytes(eight.try_into().ok()?));
        self.take(count.checked_mul(8)?)?.chunks_exact(8).map(number).collect()
    }
}
