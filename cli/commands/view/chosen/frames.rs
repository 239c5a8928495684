//! Frames without and with the sample, on one scale.

use super::Chosen;
use crate::commands::pictures::Pictures;
use crate::failure::Failure;
use crate::picture::image::{self, ImagePlot, Key};
use crate::picture::quantity::Quantity;
use crate::picture::scale::Scale;
use crate::picture::text::joined;
use beamlet::stack::StackFile;
use ndarray::Array2;

/// Frames of one kind.
struct Pair {
    /// Prefix of file names.
    prefix: &'static str,
    /// Name in `--range`.
    name: &'static str,
    quantity: Quantity,
    flat: Array2<f64>,
    sample: Array2<f64>,
}

impl Chosen<'_> {
    pub(super) fn draw_frames(&self, pictures: &mut Pictures) -> Result<(), Failure> {
        let mut pairs = Vec::new();
        if let Some([flat, sample]) = self.run.frames() {
            pairs.push(self.pair("", "intensity", Quantity::intensity(), [flat, sample])?);
            if let Some([flat, sample]) = self.run.counts()? {
                pairs.push(self.pair("counts_", "counts", Quantity::counts(), [&flat, &sample])?);
            }
        } else {
            let quantity = self.run.fitted_quantity();
            let name = if quantity == Quantity::intensity() { "intensity" } else { "counts" };
            let [flat, sample] = [self.fitted_frame(None)?, self.fitted_frame(Some(self.view))?];
            pairs.push(Pair { prefix: "", name, quantity, flat, sample });
        }
        pairs.iter().try_for_each(|pair| self.draw_pair(pictures, pair))
    }

    fn pair(
        &self,
        prefix: &'static str,
        name: &'static str,
        quantity: Quantity,
        [flat, sample]: [&StackFile; 2],
    ) -> Result<Pair, Failure> {
        let frame = |stack: &StackFile, view| -> Result<Array2<f64>, Failure> {
            Ok(stack.frame(view, self.step, 0..stack.row_count())?.mapv(f64::from))
        };
        let (flat, sample) = (frame(flat, 0)?, frame(sample, self.view)?);
        Ok(Pair { prefix, name, quantity, flat, sample })
    }

    /// A frame of measured stacks.
    fn fitted_frame(&self, view: Option<usize>) -> Result<Array2<f64>, Failure> {
        let frames = self.run.fitted_rows(view, 0..self.run.row_count())?;
        match self.step < frames.shape()[0] {
            true => Ok(frames.index_axis(ndarray::Axis(0), self.step).mapv(f64::from)),
            false => {
                let problem = format!(
                    "--step {}: a view has {} mask steps, counted from 0",
                    self.step,
                    frames.shape()[0]
                );
                Err(Failure::Usage(problem))
            }
        }
    }

    fn draw_pair(&self, pictures: &mut Pictures, pair: &Pair) -> Result<(), Failure> {
        let Pair { prefix, name, quantity, flat, sample } = pair;
        let values = [flat, sample].map(|frame| frame.iter().copied().collect::<Vec<f64>>());
        // One scale, so that the two can be compared.
        let scale = self.scale(name, quantity, values.iter().flatten(), || {
            Scale::of_frames(quantity.map, &values[0], &values[1])
        });
        let kind = match *name {
            "counts" => {
                format!(", {}s", quantity.label.split(' ').take(2).collect::<Vec<_>>().join(" "))
            }
            _ => String::new(),
        };
        let (view, step) = (self.view, self.step);
        for (file, title, frame, note) in [
            (
                format!("{prefix}flat_step_{step:03}"),
                "Flat",
                flat,
                joined(&[self.run.title(), self.at_step()]),
            ),
            (
                format!("{prefix}sample_view_{view:04}_step_{step:03}"),
                "With the sample",
                sample,
                joined(&[self.run.title(), self.at_view(), self.at_step()]),
            ),
        ] {
            let own = Scale::between(scale.map, [scale.low, scale.high], frame.iter().copied());
            let words = own.words_beyond(quantity.unit);
            let plot = ImagePlot {
                values: frame.view(),
                quantity,
                key: Key::Scale(own),
                title: format!("{title}{kind}"),
                note,
                below: if words.is_empty() { Vec::new() } else { vec![words] },
            };
            pictures.add(file, &image::draw(&self.grid, &plot))?;
        }
        Ok(())
    }
}
