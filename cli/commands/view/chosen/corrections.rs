//! Corrections by empty beam over the frames of a scan.

use super::Chosen;
use crate::commands::pictures::Pictures;
use crate::failure::Failure;
use crate::picture::profile::{self, Panel, ProfileLine};
use crate::picture::text::joined;
use beamlet::retrieve::ViewCorrection;

/// A value with its uncertainty; NaN is unknown.
type Pair = [f64; 2];

impl Chosen<'_> {
    /// A panel for each correction, over the frames of all views; nothing where nothing was corrected.
    pub(super) fn draw_corrections(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let Some(record) = self.run.record().filter(|record| !record.corrections.is_empty()) else {
            return Ok(());
        };
        let views = &record.corrections;
        let steps = views.iter().map(|of| of.dose.len().max(of.steps.len())).max().unwrap_or(0);
        let steps = steps.max(1);
        let of_frames = |of: &dyn Fn(&ViewCorrection, usize) -> Option<Pair>| -> Vec<Pair> {
            let frames = views.iter().flat_map(|view| (0..steps).map(move |step| of(view, step)));
            frames.map(|pair| pair.unwrap_or([f64::NAN; 2])).collect()
        };
        let listed = |list: &[Option<Pair>], step: usize| list.get(step).copied().flatten();
        let panels: Vec<Panel> = [
            ("displacement (µm)", 1e6, of_frames(&|of, step| listed(&of.steps, step))),
            ("dose", 1.0, of_frames(&|of, step| listed(&of.dose, step))),
            ("α subtracted (µrad)", 1e6, of_frames(&|of, _| of.offset)),
            ("∂α/∂x (µrad/m)", 1e6, of_frames(&|of, _| of.plane.map(|plane| plane.x))),
            ("∂α/∂z (µrad/m)", 1e6, of_frames(&|of, _| of.plane.and_then(|plane| plane.z))),
            ("displacement z (µm)", 1e6, of_frames(&|of, step| listed(&of.steps_z, step))),
            ("α_z subtracted (µrad)", 1e6, of_frames(&|of, _| of.offset_z)),
            ("∂α_z/∂x (µrad/m)", 1e6, of_frames(&|of, _| of.plane_z.map(|plane| plane.x))),
            ("∂α_z/∂z (µrad/m)", 1e6, of_frames(&|of, _| of.plane_z.and_then(|plane| plane.z))),
        ]
        .into_iter()
        .filter(|(.., pairs)| pairs.iter().any(|pair| pair[0].is_finite()))
        .map(|(label, scale, pairs)| Panel {
            label: label.into(),
            lines: vec![ProfileLine {
                name: String::new(),
                values: pairs.iter().map(|pair| scale * pair[0]).collect(),
                sigma: Some(pairs.iter().map(|pair| scale * pair[1]).collect()),
            }],
            zero: label != "dose",
            flagged: Vec::new(),
            band: "± 1σ".into(),
        })
        .collect();
        let frames = views.len() * steps;
        let place = |frame: usize| match views.len() {
            1 => frame as f64,
            _ => frame as f64 / steps as f64,
        };
        let x: Vec<f64> = (0..frames).map(place).collect();
        let across = if views.len() == 1 { "mask step" } else { "view" };
        let title = joined(&["Corrections by empty beam".into(), self.run.title()]);
        let note = record.correct.join(", ");
        pictures.add("corrections", &profile::draw([&title, &note], &x, across, &panels))
    }
}
