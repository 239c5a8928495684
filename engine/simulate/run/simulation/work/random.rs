//! Rows whose rays are random.

use super::ViewWork;
use crate::illuminate::RandomBatch;
use crate::sampling::{ProjectedBounds, touches_pixel};
use beamlet_core::{Result, numbers};
use beamlet_interface::Pixel;
use beamlet_model::optics::Optics;
use beamlet_model::scene::Exposure;
use std::ops::Range;
use std::time::Instant;

impl ViewWork<'_> {
    pub(super) fn random_rows(
        &mut self,
        optics: &Optics,
        view: Exposure,
        projected_bounds: &[ProjectedBounds],
        rows: &Range<i64>,
    ) -> Result<()> {
        if !self.random {
            return Ok(());
        }
        let begin = Instant::now();
        let detector_rows = 0..i64::from(optics.detector.pixels[1]);
        let detector_columns = 0..i64::from(optics.detector.pixels[0]);
        let (mut met, mut missed) = (Vec::new(), Vec::new());
        for row in rows.clone() {
            for column in self.pixel_columns.clone() {
                let inside = detector_rows.contains(&row) && detector_columns.contains(&column);
                let pixel = Pixel {
                    column: numbers::narrow::<i32>(column),
                    row: numbers::narrow::<i32>(row),
                    table: numbers::narrow::<u32>(column - self.pixel_columns.start),
                };
                let lattice = &self.simulation.lattice;
                if touches_pixel(projected_bounds, lattice, [column, row]) {
                    met.push(pixel);
                } else if inside {
                    missed.push(pixel);
                }
            }
        }
        let pose = match view {
            Exposure::Flat(_) | Exposure::Dark(_) => 0,
            Exposure::Sample(_) => self.pose,
        };
        for (pixels, empty) in [(&met, false), (&missed, true)] {
            if !pixels.is_empty() {
                let job = RandomBatch { pixels, pose, empty };
                for (node, light) in self.lights.iter().enumerate() {
                    self.cancel.check()?;
                    self.tracer.set_node(Some(node));
                    self.random_light.add(&mut self.tracer, light, &self.sums, job)?;
                }
            }
        }
        self.seconds.trace += begin.elapsed().as_secs_f64();
        Ok(())
    }
}
