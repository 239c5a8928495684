//! Differences between runs of a case, by class of pixel.

use super::cases::Case;
use super::classes::{Class, classes};
use crate::support::Checked;
use beamlet::internals::sampling::{Lattice, Optics, cells_of_rows};
use beamlet::internals::trace::MaterialTable;
use beamlet::scene::{Scene, Transport};
use beamlet::stack::ArraySink;
use beamlet::{Control, SamplingSummary};
use ndarray::{Array2, Array3};

/// Angle tolerance where values are compared, rad: the default.
pub(crate) const ANGLE: f64 = 10e-9;

/// Results of a run that are compared: values `[step][row][column]` of its one view, share of open beam.
#[derive(Debug)]
pub(crate) struct Run {
    pub(crate) values: Array3<f64>,
    pub(crate) sampling: Option<SamplingSummary>,
    pub(crate) rays: u64,
}

/// Runs a scene.
pub(crate) fn run(engine: &Checked, scene: &Scene) -> Run {
    let mut sink = ArraySink::new();
    let record = engine.run(scene, &mut sink, Control::default()).expect("a run");
    let stacks = sink.into_stacks().expect("stacks");
    let values = stacks.sample.index_axis_move(ndarray::Axis(0), 0).mapv(f64::from);
    Run { values, sampling: record.sampling, rays: record.tally.patch_rays }
}

/// The scene of a case with this budget.
pub(crate) fn with_budget(case: &Case, tolerance: f64, angle_tolerance: f64) -> Scene {
    let mut scene = case.scene.clone();
    scene.sampling.tolerance = Some(tolerance);
    scene.sampling.angle_tolerance = Some(angle_tolerance);
    scene
}

/// The scene of a case for its truth: a ray for each piece of a line, in order, at a tolerance.
pub(crate) fn truth_of(case: &Case, tolerance: f64) -> Scene {
    let mut scene = with_budget(case, tolerance, ANGLE);
    scene.sampling.transport = Transport::Exact;
    scene.sampling.max_rays = 1_000_000;
    scene
}

/// Errors of a class of pixels against a limit.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Errors {
    pub(crate) count: usize,
    within: usize,
    pub(crate) mean: f64,
    pub(crate) rms: f64,
    pub(crate) worst: f64,
    /// Step, row and column of the worst.
    pub(crate) place: [usize; 3],
    /// Root mean square over pixels of the error of the step where it is largest.
    pub(crate) of_pixels: f64,
}

impl Errors {
    /// Errors of the values in pixels of one class, or of all that the sample touches.
    pub(crate) fn of(
        class: Option<Class>,
        classes: &Array2<Class>,
        limit: f64,
        [got, want]: [&Array3<f64>; 2],
    ) -> Self {
        let mut errors = Self::default();
        let steps = got.dim().0;
        let (mut sum, mut squares, mut of_pixels, mut pixels) = (0.0, 0.0, 0.0, 0);
        for ((row, column), own) in classes.indexed_iter() {
            let counts = class.map_or(*own != Class::Nothing, |class| class == *own);
            if !counts {
                continue;
            }
            let mut largest = 0.0_f64;
            for step in 0..steps {
                let place = [step, row, column];
                // Angles are unknown where no light is.
                if !want[place].is_finite() {
                    continue;
                }
                let off = got[place] - want[place];
                let off = if off.is_finite() { off } else { f64::INFINITY };
                errors.count += 1;
                errors.within += usize::from(off.abs() <= limit);
                sum += off;
                squares += off * off;
                largest = largest.max(off.abs());
                if off.abs() > errors.worst {
                    (errors.worst, errors.place) = (off.abs(), place);
                }
            }
            of_pixels += largest * largest;
            pixels += 1;
        }
        let count = errors.count.max(1) as f64;
        errors.mean = sum / count;
        errors.rms = (squares / count).sqrt();
        errors.of_pixels = (of_pixels / f64::from(pixels.max(1))).sqrt();
        errors
    }

    /// The errors of both.
    pub(crate) fn with(self, other: Self) -> Self {
        let [a, b] = [self.count, other.count].map(|count| count as f64);
        let all = (a + b).max(1.0);
        let larger = if self.worst > other.worst { self } else { other };
        Self {
            count: self.count + other.count,
            within: self.within + other.within,
            mean: (a * self.mean + b * other.mean) / all,
            rms: ((a * self.rms.powi(2) + b * other.rms.powi(2)) / all).sqrt(),
            ..larger
        }
    }

    /// Share of the values within the limit.
    pub(crate) fn share(&self) -> f64 {
        self.within as f64 / self.count.max(1) as f64
    }

    /// Names of the demands of docs/developers/validation.md on a class that these errors do not fulfil.
    pub(crate) fn failures(&self, class: Class, limit: f64) -> Vec<&'static str> {
        let least = if class == Class::Silhouette { 0.95 } else { 0.99 };
        [
            (self.share() < least, "share"),
            (self.worst > 5.0 * limit, "worst"),
            (self.rms > limit / 3.0, "rms"),
        ]
        .into_iter()
        .filter_map(|(fails, what)| (fails && self.count > 0).then_some(what))
        .collect()
    }
}

/// Mean displacement on the analyser of the light that each mask step lets through the sample
/// mask, m, `[step][row][column]`; not a number where no beamlet of the pixel is traced.
pub(crate) fn displacements(engine: &Checked, scene: &Scene) -> Array3<f64> {
    let mask = scene.sample_mask.as_ref().expect("a sample mask");
    let half = 0.5 * mask.aperture;
    let lattice =
        Lattice::of(&Optics::of(scene), MaterialTable::of(scene).expect("media").strongest());
    let [columns, rows] = scene.detector.pixels.map(|n| n as usize);
    let steps = scene.scan.mask_offsets.len();
    let simulation = engine.prepare(scene).expect("a simulation");
    let cell_rows = cells_of_rows(&simulation, 0, 0..rows as i64).expect("cell rows");
    let mut light = Array3::<f64>::zeros((steps, rows, columns));
    let mut moved = light.clone();
    for cell_row in &cell_rows.cell_rows {
        let column = lattice.beamlets.start + i64::from(cell_row.column);
        let range =
            cell_row.first_cell as usize..(cell_row.first_cell + cell_row.cell_count) as usize;
        for row in
            i64::from(cell_row.row)..i64::from(cell_row.row) + i64::from(cell_row.rows.max(1))
        {
            if !(0..columns as i64).contains(&column) || !(0..rows as i64).contains(&row) {
                continue;
            }
            let height = f64::from(cell_row.bottom - cell_row.top);
            for (step, offset) in scene.scan.mask_offsets.iter().enumerate() {
                let place = [step, row as usize, column as usize];
                for cell in &cell_rows.cells[range.clone()] {
                    let [low, high] = [cell.x_low, cell.x_high].map(f64::from);
                    let [from, to] = [low.max(offset - half), high.min(offset + half)];
                    if from >= to {
                        continue;
                    }
                    let share = (0.5 * (from + to) - low) / (high - low);
                    let at = |[a, b]: [f32; 2]| f64::from(a) + f64::from(b - a) * share;
                    let passed =
                        height * (to - from) * (-at([cell.depth_low, cell.depth_high])).exp();
                    light[place] += passed;
                    moved[place] += passed * at([cell.displacement_low, cell.displacement_high]);
                }
            }
        }
    }
    moved / light
}

/// The classes of a case with their names.
pub(crate) fn classes_of(case: &Case) -> (Array2<Class>, [(Class, &'static str); 2]) {
    let named = [(Class::Interior, "interior"), (Class::Silhouette, "silhouette")];
    (classes(case), named)
}
