//! Iterative methods with their vectors on the device: bytes over the bus and submissions, and vectors that the
//! device has no room for.

use crate::projector::noise;
use crate::set_up::{PIXEL, grid, places, views};
use crate::support::{self, Checked};
use beamlet::ndarray::Array3;
use beamlet::reconstruct::{
    Data, Iterated, IterativeOptions, Measured, ScanGeometry, Solver, VolumeGrid, iterate,
};
use beamlet::{EngineOptions, Error, RowsControl, Traffic};

const GRID: [usize; 3] = [28, 32, 10];

/// A cone of ±8° about the middle of 12 rows, with an arm.
fn cone() -> ScanGeometry {
    let pitch = 2.0 * PIXEL;
    let rows = places(12, pitch).into_iter().rev().collect();
    let mut geometry = ScanGeometry::new([0.02, 0.04], places(40, pitch), rows, views(45));
    geometry.lever = 0.03;
    geometry
}

/// Everything that is measured, and a mask and a start of a volume.
struct Given {
    sinograms: Array3<f32>,
    weights: Array3<f32>,
    mask: Array3<bool>,
    start: Array3<f32>,
}

impl Given {
    fn new(geometry: &ScanGeometry) -> Self {
        let shape = (geometry.angles.len(), geometry.rows.len(), geometry.columns.len());
        let [x, y, z] = GRID;
        Self {
            sinograms: noise(shape, 1) + 1.5,
            weights: noise(shape, 2).mapv(|weight| weight.max(0.0)),
            mask: Array3::from_shape_fn((z, y, x), |(z, y, x)| (x + y + z) % 7 != 0),
            start: noise((z, y, x), 3),
        }
    }

    fn measured(&self, data: Data) -> Measured<'_> {
        Measured::new(data, self.sinograms.view())
            .with_weights(self.weights.view())
            .with_mask(self.mask.view())
            .with_start(self.start.view())
    }

    /// Bytes of sinograms, weights, mask, start and the volume.
    fn bytes(&self) -> u64 {
        let values = 2 * self.sinograms.len() + 3 * self.start.len();
        4 * values as u64
    }
}

fn solve(engine: &Checked, measured: &Measured<'_>, options: &IterativeOptions) -> Iterated {
    let (geometry, grid): (_, VolumeGrid) = (cone(), grid(GRID));
    iterate(engine, &geometry, measured, &grid, options, &mut RowsControl::default()).unwrap()
}

const CASES: [(Solver, Data); 3] =
    [(Solver::Cgls, Data::Refraction), (Solver::Bb, Data::DarkField), (Solver::Sirt, Data::Phase)];

fn options(solver: Solver, iterations: usize) -> IterativeOptions {
    let is_bounded = solver != Solver::Cgls;
    let usual = IterativeOptions::default().with_solver(solver).with_non_negative(is_bounded);
    usual.with_iterations(iterations)
}

/// Bytes that an iteration sends over the bus: sums of chunks of 16,384 values, 16 bytes each, for up to five
/// scalar products of volumes and sinograms with three chunks or less.
const SCALARS: u64 = 5 * 3 * 16;

#[test]
fn bytes_of_iterations_are_scalars_and_all_are_less_than_twice_the_data() {
    let engine = support::engine_with(EngineOptions::default().with_staging(true));
    let given = Given::new(&cone());
    for (solver, data) in CASES {
        let traffic = |iterations: usize| -> Traffic {
            let before = engine.profile().traffic;
            let made = solve(&engine, &given.measured(data), &options(solver, iterations));
            assert_eq!(made.residuals.len(), iterations + 1, "{solver:?} {data:?}");
            engine.profile().traffic.since(before)
        };
        // The first run makes buffers for transfers.
        traffic(1);
        let (few, many) = (traffic(3), traffic(11));
        let all = many.bytes_to_device + many.bytes_to_host;
        assert!(all <= 2 * given.bytes(), "{solver:?} {data:?}: {all} of {}", given.bytes());
        assert_eq!(many.bytes_to_device, few.bytes_to_device, "{solver:?} {data:?}");
        let more = many.bytes_to_host - few.bytes_to_host;
        assert!(more <= 8 * SCALARS, "{solver:?} {data:?}: {more} bytes of 8 iterations");
        assert_eq!(many.buffers, few.buffers, "{solver:?} {data:?}");
        // Projection, residual and gradient; one more each where a dispatch takes long on a busy machine.
        let each = (many.submissions - few.submissions) as f64 / 8.0;
        println!("measured {solver:?} {data:?}: {each} submissions of an iteration, {all} bytes");
        assert!(each <= 6.0, "{solver:?} {data:?}: {each} submissions of an iteration");
    }
}

/// Volumes of 3.6e12 voxels, and one of 2.5e9, which a buffer does not hold, whatever the device has.
#[test]
fn vectors_that_the_device_has_no_room_for_are_refused_with_their_size() {
    let engine = support::engine_with(EngineOptions::default());
    let (geometry, sinograms) = (cone(), Given::new(&cone()).sinograms);
    let measured = Measured::new(Data::Attenuation, sinograms.view());
    for size in [[60_000, 60_000, 1000], [50_000, 50_000, 1]] {
        let grid = VolumeGrid { size, voxel: [1e-7; 3], origin: [0.0; 3] };
        let options = IterativeOptions::default();
        let made =
            iterate(&engine, &geometry, &measured, &grid, &options, &mut RowsControl::default());
        let Err(Error::Memory { needed, available: Some(available), remedy, .. }) = made else {
            panic!("{size:?} voxels are refused");
        };
        let volume = size.iter().fold(4, |all, side| all * *side as u64);
        assert!(needed >= volume && needed > available, "{needed} {available}");
        assert!(remedy.contains("--voxel") && remedy.contains("fbp"), "{remedy}");
    }
}

/// Powers of two round nothing, and squares of these values are beyond the range of 32-bit numbers.
#[test]
fn the_unit_of_sinograms_changes_no_digit() {
    let engine = support::engine_with(EngineOptions::default());
    let given = Given::new(&cone());
    let usual = Measured::new(Data::Attenuation, given.sinograms.view());
    for solver in [Solver::Cgls, Solver::Bb, Solver::Sirt] {
        let options = IterativeOptions::default().with_solver(solver).with_iterations(3);
        let made = solve(&engine, &usual, &options);
        for exponent in [-70, 70] {
            let factor = 2.0_f64.powi(exponent);
            let sinograms = given.sinograms.mapv(|value| (f64::from(value) * factor) as f32);
            let other = Measured::new(Data::Attenuation, sinograms.view());
            let other = solve(&engine, &other, &options);
            let residuals: Vec<f64> = made.residuals.iter().map(|it| it * factor).collect();
            assert_eq!(other.residuals, residuals, "{solver:?} 2^{exponent}");
            let values = made.volume.values.mapv(|value| (f64::from(value) * factor) as f32);
            assert!(other.volume.values == values, "{solver:?} 2^{exponent}");
        }
    }
}
