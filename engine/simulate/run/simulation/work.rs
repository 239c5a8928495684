//! The run in progress: bands of rows, traced and illuminated in groups, handed to the sink.

mod mean;
mod share;

use super::Simulation;
use super::light::{Light, LitRows, Pose, Seconds};
use crate::detector::Frame;
use crate::run::{Control, Progress, ViewProgress};
use beamlet_core::cancel::Cancel;
use beamlet_core::tally::Tally;
use beamlet_core::{Result, numbers};
use beamlet_files::Sink;
use beamlet_model::scene::{Exposure, Scan};
use mean::Mean;
use ndarray::Array3;
use share::Share;
use std::ops::Range;
use std::time::Instant;

/// The run in progress.
pub(super) struct ViewWork<'s> {
    /// Designs that are lit together.
    designs: &'s [Simulation],
    /// The first design, whose bands and poses are those of all.
    simulation: &'s Simulation,
    light: Box<dyn Light + 's>,
    /// Counts besides those of the light.
    tally: Tally,
    /// Seconds besides those of the light.
    seconds: Seconds,
    rows_done: u64,
    rows_total: u64,
    share: Share,
    cancel: Cancel,
}

impl<'s> ViewWork<'s> {
    /// Work on views of designs with one sample and one lattice.
    pub(super) fn new(
        designs: &'s [Simulation],
        views: &[Exposure],
        cancel: &Cancel,
    ) -> Result<Self> {
        let simulation = &designs[0];
        let grid = simulation.detector.grid();
        let lit_views = views.iter().filter(|view| !view.is_dark()).count();
        let blank = views.iter().filter(|view| view.is_flat()).count();
        let poses = blank + (lit_views - blank) * simulation.scene.scan.poses_of_view();
        let rows: usize = simulation.bands().map(|rows| grid.own_rows(&rows).len()).sum();
        Ok(Self {
            designs,
            simulation,
            light: Simulation::light(designs, cancel)?,
            tally: Tally::default(),
            seconds: Seconds::default(),
            rows_done: 0,
            rows_total: (poses * rows) as u64,
            share: Share::new([blank, lit_views - blank], !simulation.sample.is_empty()),
            cancel: cancel.clone(),
        })
    }

    /// Computes a view and hands it to the sink of each design.
    pub(super) fn view(
        &mut self,
        view: Exposure,
        sinks: &mut [&mut dyn Sink],
        control: &mut Control<'_>,
    ) -> Result<()> {
        // The largest of a view are its own.
        (self.tally.most_patch_rays, self.tally.worst_error) = (0, 0);
        if view.is_dark() {
            return self.dark(view, sinks);
        }
        let halo = self.simulation.lattice.halo;
        let poses = self.poses(view);
        let groups = poses.iter().flat_map(|_| self.simulation.bands()).map(|band| {
            let lit = self.simulation.detector.grid().lit_rows(&band);
            i64::from(lit.start) - halo..i64::from(lit.end) + halo
        });
        let shadow = self.simulation.shadow_rows(&poses[0].shadows);
        self.share.begin(!view.is_flat(), shadow, groups);
        self.report(view, control)?;
        for band in self.simulation.bands() {
            let mut means: Vec<Mean> = self.designs.iter().map(|_| Mean::of(poses.len())).collect();
            for pose in &poses {
                let intensities = self.lit_band(pose, &band, control)?;
                means.iter_mut().zip(intensities).for_each(|(mean, own)| mean.add(own));
            }
            for ((design, mean), sink) in self.designs.iter().zip(means).zip(&mut *sinks) {
                let mut intensities = mean.finish();
                scale(&design.scene.scan, view, &mut intensities);
                self.write(design, view, &band, &intensities, &mut **sink)?;
            }
        }
        Ok(())
    }

    /// Hands a band of a design to its sink, with its counts.
    fn write(
        &mut self,
        design: &Simulation,
        view: Exposure,
        band: &Range<u32>,
        intensities: &Array3<f32>,
        sink: &mut dyn Sink,
    ) -> Result<()> {
        let begin = Instant::now();
        let counts = design.detector.counts(view, band, intensities.view(), &self.cancel)?;
        self.seconds.noise += begin.elapsed().as_secs_f64();
        let begin = Instant::now();
        sink.write(view, band.clone(), intensities.view())?;
        self.seconds.write += begin.elapsed().as_secs_f64();
        counts.map_or(Ok(()), |frame| self.write_counts(view, band, &frame, sink))
    }

    /// Hands the detector numbers of a band to its sink.
    fn write_counts(
        &mut self,
        view: Exposure,
        band: &Range<u32>,
        frame: &Frame,
        sink: &mut dyn Sink,
    ) -> Result<()> {
        self.tally.saturated += frame.clipped.high;
        self.tally.clipped_at_zero += frame.clipped.low;
        let begin = Instant::now();
        sink.write_counts(view, band.clone(), frame.numbers.view())?;
        self.seconds.write += begin.elapsed().as_secs_f64();
        Ok(())
    }

    /// Poses of the sample in a view, each with its shadows; one without any for a flat.
    fn poses(&self, view: Exposure) -> Vec<Pose> {
        let Exposure::Sample(number) = view else {
            return vec![Pose { view, index: 0, shadows: Vec::new() }];
        };
        let count = numbers::count(self.simulation.scene.scan.poses_of_view());
        (number * count..(number + 1) * count).map(|index| self.simulation.pose(index)).collect()
    }

    /// Intensities of a band at one pose of the sample, of each design.
    fn lit_band(
        &mut self,
        pose: &Pose,
        band: &Range<u32>,
        control: &mut Control<'_>,
    ) -> Result<Vec<Array3<f32>>> {
        let detector = &self.simulation.detector;
        let lit = detector.grid().lit_rows(band);
        self.light.begin(&lit, pose.view)?;
        self.add_light(pose, &lit, &detector.grid().own_rows(band), control)?;
        let begin = Instant::now();
        let light = self.light.intensities()?.into_iter().zip(self.designs);
        let intensities = light.map(|(light, design)| {
            design.detector.intensities(pose.view, band, light, &self.cancel)
        });
        let intensities = intensities.collect::<Result<Vec<_>>>()?;
        self.seconds.detect += begin.elapsed().as_secs_f64();
        Ok(intensities)
    }

    /// Dark frames need no light.
    fn dark(&mut self, view: Exposure, sinks: &mut [&mut dyn Sink]) -> Result<()> {
        for (design, sink) in self.designs.iter().zip(sinks) {
            let Some(noise) = design.detector.noise() else { continue };
            for band in design.bands() {
                let begin = Instant::now();
                let frame = noise.dark(view.index(), band.clone(), &self.cancel)?;
                self.seconds.noise += begin.elapsed().as_secs_f64();
                self.write_counts(view, &band, &frame, &mut **sink)?;
            }
        }
        Ok(())
    }

    /// Adds the light of one band, in groups of rows small enough to stop between them. `own`: rows that
    /// no other band counts.
    fn add_light(
        &mut self,
        pose: &Pose,
        band: &Range<u32>,
        own: &Range<u32>,
        control: &mut Control<'_>,
    ) -> Result<()> {
        let [band, own] = [band, own].map(|rows| i64::from(rows.start)..i64::from(rows.end));
        let halo = self.simulation.lattice.halo;
        let group =
            (self.simulation.memory.rays_at_once / self.light.items_of_row(pose).max(1)).max(1);
        let group = i64::try_from(group).unwrap_or(i64::MAX / 2);
        let mut row = band.start - halo;
        while row < band.end + halo {
            // Groups end at the borders of the band, so that its own counts stay separate.
            let borders = [band.start, own.start, own.end, band.end];
            let border = borders.into_iter().find(|b| *b > row).unwrap_or(band.end + halo);
            let lit = LitRows { rows: row..border.min(row + group), band: band.clone() };
            row = lit.rows.end;
            let Self { light, share, rows_done, rows_total, .. } = self;
            let mut report = |rays, part| {
                if let Some(progress) = control.progress.as_mut() {
                    progress(Progress::Views(ViewProgress {
                        rows_done: *rows_done,
                        rows_total: *rows_total,
                        view: pose.view,
                        rays,
                        share: share.with(&lit.rows, part),
                    }));
                }
            };
            let tally = light.add(pose, &lit, &mut report)?;
            if own.contains(&lit.rows.start) {
                self.tally = self.tally + tally;
                self.rows_done += numbers::narrow::<u64>(lit.rows.end - lit.rows.start);
            }
            self.share.finish(&lit.rows);
            self.report(pose.view, control)?;
        }
        Ok(())
    }

    fn report(&mut self, view: Exposure, control: &mut Control<'_>) -> Result<()> {
        self.cancel.check()?;
        if let Some(progress) = control.progress.as_mut() {
            progress(Progress::Views(ViewProgress {
                rows_done: self.rows_done,
                rows_total: self.rows_total,
                view,
                rays: self.light.tally().rays,
                share: self.share.with(&(0..0), 0.0),
            }));
        }
        Ok(())
    }

    /// Seconds by stage so far.
    pub(super) fn seconds(&self) -> Seconds {
        let Seconds { trace, illuminate, .. } = self.light.seconds();
        Seconds { trace, illuminate, ..self.seconds }
    }

    pub(super) fn tally(&self) -> Tally {
        self.light.tally() + self.tally
    }
}

/// Gives the frames of a view the light that they have over the nominal one.
fn scale(scan: &Scan, view: Exposure, intensities: &mut Array3<f32>) {
    let Some(view) = scan.view_of_errors(view) else { return };
    if scan.errors.intensities.is_empty() {
        return;
    }
    for (step, mut frame) in intensities.outer_iter_mut().enumerate() {
        let light = scan.intensity(view, step);
        frame.mapv_inplace(|y| numbers::single(light * f64::from(y)));
    }
}
