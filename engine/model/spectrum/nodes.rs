//! The few energies that stand for a spectrum.
//!
//! Transmission and refraction are smooth in ln E between absorption edges, so Gauss nodes of the
//! measure `weight(E)` in ln E, apart on each side of every edge that matters, converge with
//! every node by orders. Their number grows until every probe agrees with the sum over all rows.

use std::ops::Range;

use serde::Serialize;

use super::gauss::Recurrence;
use super::known_nodes::NodesInput;
use super::probes::Probes;
use super::{Spectrum, edges};
use crate::material;
use crate::scene::{Beam, Scene, SpectrumSpec};
use beamlet_core::{Error, Result};

/// The estimated error that nodes are added for, until it is undercut.
pub const TOLERANCE: f64 = 5e-4;

/// Most nodes between two edges, where the number is chosen.
const MOST: usize = 32;

/// Energies that stand for a spectrum.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[non_exhaustive]
pub struct Nodes {
    /// Energies, keV, ascending.
    pub energies: Vec<f64>,
    /// Weights: shares of the detector's signal without sample and masks. Their sum is 1.
    pub weights: Vec<f64>,
    /// Greatest error that the nodes make in any probe (docs/spectra.md) against the sum over
    /// all rows of the spectrum: relative, below a transmission of 1 % in hundredths of the open
    /// beam.
    pub estimated_error: f64,
    /// True if their number was chosen for the accuracy, and not by the scene.
    pub chosen: bool,
}

impl Nodes {
    /// Mean energy by weight, keV.
    pub fn mean_energy(&self) -> f64 {
        self.energies.iter().zip(&self.weights).map(|(energy, weight)| energy * weight).sum()
    }
}

/// The energy nodes of a scene as its detector sees them; a single energy is one node.
///
/// # Errors
/// Spectrum files that cannot be read, materials that are unknown, are given as numbers, or
/// whose tables do not cover the spectrum.
///
/// # Example
///
/// ```no_run
/// use beamlet::{scene::Scene, spectrum};
///
/// let nodes = spectrum::nodes(&Scene::load("scene.toml")?)?;
/// for (energy, weight) in nodes.energies.iter().zip(&nodes.weights) {
///     println!("{energy} keV: {weight} of the signal");
/// }
/// # Ok::<(), beamlet::Error>(())
/// ```
pub fn nodes(scene: &Scene) -> Result<Nodes> {
    let compute = || nodes_with(scene, |energy| super::response(scene, energy));
    match NodesInput::of(scene) {
        Some(input) => input.nodes(compute),
        None => compute(),
    }
}

/// As [`nodes`], for a detector with a `response`: signal per arriving photon by energy in keV,
/// on any scale.
///
/// # Errors
/// As [`nodes`], and errors of `response`.
pub fn nodes_with(scene: &Scene, response: impl Fn(f64) -> Result<f64>) -> Result<Nodes> {
    let spec = match &scene.source.beam {
        Beam::Energy(energy) => {
            // It hardens nothing, and has to be known all the same.
            let key = "surroundings.path_material";
            material::constants_at_for(scene, &scene.path_material, *energy, key)?;
            let (energies, weights) = (vec![*energy], vec![1.0]);
            return Ok(Nodes { energies, weights, estimated_error: 0.0, chosen: true });
        }
        Beam::Spectrum(spec) => spec,
    };
    let spectrum = detected(scene, spec, |energies| {
        energies.iter().map(|energy| response(*energy)).collect()
    })?;
    let probes = Probes::of(scene, &spectrum)?;
    let mut segments = edges::segments(&spectrum, &probes)?;
    if let Some(count) = spec.nodes {
        // Fewer nodes than sides of edges: the lesser part loses its own.
        while segments.len() > count as usize {
            join_lightest(&mut segments, &spectrum.weights);
        }
    }
    let at_rows = probes.at_rows();
    let parts = segments
        .into_iter()
        .map(|rows| RowsBetweenEdges::of(&spectrum, rows, &probes, &at_rows, spec.nodes))
        .collect::<Result<Vec<_>>>()?;
    Ok(chosen(&parts, spec.nodes.map(|count| count as usize), spectrum.total()))
}

/// Rows of the spectrum behind filters and path, with their signal in the detector as weights. `responses`: to photons of
/// energies in keV.
pub(super) fn detected(
    scene: &Scene,
    spec: &SpectrumSpec,
    responses: impl FnOnce(&[f64]) -> Result<Vec<f64>>,
) -> Result<Spectrum> {
    let mut spectrum = Spectrum::after_filters(scene, spec)?.significant();
    let responses = responses(&spectrum.energies_kev)?;
    spectrum.weights.iter_mut().zip(responses).for_each(|(weight, response)| *weight *= response);
    let spectrum = spectrum.significant();
    if spectrum.energies_kev.is_empty() {
        let allowed = "energies above thresholds and where the absorber absorbs";
        return Err(Error::scene(
            "source.spectrum",
            "no energy that the detector responds to",
            allowed,
        ));
    }
    Ok(spectrum)
}

fn join_lightest(segments: &mut Vec<Range<usize>>, weights: &[f64]) {
    let weight = |rows: &Range<usize>| weights[rows.clone()].iter().sum::<f64>();
    let lightest = (0..segments.len())
        .min_by(|a, b| weight(&segments[*a]).total_cmp(&weight(&segments[*b])))
        .unwrap_or(0);
    let into = if lightest == 0 { 1 } else { lightest - 1 };
    let [a, b] = [&segments[lightest.min(into)], &segments[lightest.max(into)]];
    let joined = a.start..b.end;
    segments[lightest.min(into)] = joined;
    segments.remove(lightest.max(into));
}

/// The rows between two edges.
struct RowsBetweenEdges {
    recurrence: Recurrence,
    /// Error of each probe with 1, 2, ... nodes: [count - 1][probe], times the total weight.
    errors: Vec<Vec<f64>>,
}

impl RowsBetweenEdges {
    fn of(
        spectrum: &Spectrum,
        rows: Range<usize>,
        probes: &Probes<'_>,
        at_rows: &[Vec<f64>],
        wanted: Option<u32>,
    ) -> Result<Self> {
        let points: Vec<f64> =
            spectrum.energies_kev[rows.clone()].iter().map(|energy| energy.ln()).collect();
        let weights = &spectrum.weights[rows.clone()];
        let most = wanted.map_or(MOST, |count| count as usize);
        let recurrence = Recurrence::of(&points, weights, most);
        let sum = |values: &[Vec<f64>], weights: &[f64]| {
            let mut sums = vec![0.0; values.first().map_or(0, Vec::len)];
            for (row, weight) in values.iter().zip(weights) {
                sums.iter_mut().zip(row).for_each(|(sum, value)| *sum += weight * value);
            }
            sums
        };
        let exact = sum(&at_rows[rows], weights);
        let mut errors = Vec::new();
        for count in 1..=recurrence.most() {
            let (energies, weights): (Vec<f64>, Vec<f64>) =
                recurrence.nodes(count).into_iter().map(|(x, w)| (x.exp(), w)).unzip();
            let found = sum(&probes.at(&energies)?, &weights);
            errors.push(
                exact.iter().zip(found).map(|(exact, found)| (exact - found).abs()).collect(),
            );
        }
        Ok(Self { recurrence, errors })
    }

    fn worst(&self, count: usize) -> f64 {
        self.errors[count - 1].iter().fold(0.0, |worst, error| error.max(worst))
    }
}

/// Gives the next node to the part with the largest error, until all probes together are within the
/// tolerance, or the wanted number is reached.
fn chosen(parts: &[RowsBetweenEdges], wanted: Option<usize>, total: f64) -> Nodes {
    let mut counts = vec![1; parts.len()];
    let error = |counts: &[usize]| {
        let probes = parts.first().map_or(0, |part| part.errors[0].len());
        let sum = |probe: usize| -> f64 {
            parts.iter().zip(counts).map(|(part, count)| part.errors[count - 1][probe]).sum()
        };
        // Errors of parts may cancel, but not by design.
        (0..probes).map(sum).fold(0.0, f64::max) / total
    };
    loop {
        let enough = match wanted {
            Some(wanted) => counts.iter().sum::<usize>() >= wanted,
            None => error(&counts) <= TOLERANCE,
        };
        let next = (0..parts.len())
            .filter(|part| counts[*part] < parts[*part].recurrence.most())
            .max_by(|a, b| parts[*a].worst(counts[*a]).total_cmp(&parts[*b].worst(counts[*b])));
        match next {
            Some(next) if !enough => counts[next] += 1,
            _ => break,
        }
    }
    let mut pairs: Vec<(f64, f64)> = parts
        .iter()
        .zip(&counts)
        .flat_map(|(part, count)| part.recurrence.nodes(*count))
        .map(|(x, weight)| (x.exp(), weight / total))
        .collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (energies, weights) = pairs.into_iter().unzip();
    Nodes { energies, weights, estimated_error: error(&counts), chosen: wanted.is_none() }
}
