//! Retrieved images, and rows of them over all views.

use super::Chosen;
use crate::args::ViewOfRun;
use crate::commands::pictures::Pictures;
use crate::failure::Failure;
use crate::picture::image::{self, Grid, ImagePlot, Key};
use crate::picture::quantity::{CONTRASTS, Quantity};
use crate::picture::scale::{Scale, pixels};
use crate::picture::text::{capital, joined};
use crate::subject::{row_number, trusted};
use ndarray::Array2;

/// Values of an image or a sinogram, with what decides its scale.
struct Values {
    name: String,
    quantity: Quantity,
    /// `[row][column]`, in the unit of the picture.
    values: Array2<f64>,
    sigma: Option<Array2<f64>>,
    /// Pixels that may set the scale; `None`: all.
    trusted: Option<Vec<bool>>,
    /// Why pixels are flagged, in words.
    flag_words: String,
}

impl Chosen<'_> {
    pub(super) fn draw_retrieved(
        &self,
        pictures: &mut Pictures,
        asked: &ViewOfRun,
    ) -> Result<(), Failure> {
        let grid = match self.run.beamlets() {
            Some(_) => {
                let name = self.names(asked).into_iter().next().unwrap_or_default();
                let columns = self.run.image(&name, self.view)?.ncols();
                self.grid.clone().of_beamlets(columns)
            }
            None => self.grid.clone(),
        };
        let flags = self.run.flags(self.view)?;
        for name in self.names(asked) {
            let quantity = Quantity::of_map(&name);
            let read = |name: &str| -> Result<Array2<f64>, Failure> {
                let map = self.run.image(name, self.view)?;
                Ok(map.mapv(|value| f64::from(value) * quantity.factor))
            };
            let values = Values {
                values: read(&name)?,
                sigma: self.run.sigma_of(&name).map(|sigma| read(&sigma)).transpose()?,
                trusted: flags.as_ref().and_then(|flags| trusted(&flags.flagged)),
                flag_words: flags
                    .as_ref()
                    .map_or_else(String::new, |flags| self.run.words_of_flags(flags)),
                name,
                quantity,
            };
            let title = capital(&values.quantity.label);
            let note = joined(&[self.run.title(), self.at_view(), self.run.method_words()]);
            let file = format!("{}_view_{:04}", values.name, self.view);
            self.draw_values(pictures, file, &grid, &values, [title, note])?;
        }
        Ok(())
    }

    /// Names of the images to draw.
    fn names(&self, asked: &ViewOfRun) -> Vec<String> {
        if !asked.maps.is_empty() {
            return asked.maps.clone();
        }
        let there: Vec<&str> = self.run.images().map_or(Vec::new(), |maps| maps.names().collect());
        let contrasts = CONTRASTS.iter().filter(|name| there.contains(name));
        contrasts.map(|name| (*name).to_owned()).collect()
    }

    fn draw_values(
        &self,
        pictures: &mut Pictures,
        file: String,
        grid: &Grid,
        image: &Values,
        [title, note]: [String; 2],
    ) -> Result<(), Failure> {
        let quantity = &image.quantity;
        let scale = self.scale(&image.name, quantity, image.values.iter(), || own_scale(image));
        let lost = image.values.iter().filter(|value| !value.is_finite()).count();
        let lost = match lost {
            0 => String::new(),
            count => format!("{} without a result (violet)", pixels(count)),
        };
        let mut below = vec![image.flag_words.clone()];
        below.push(joined(&[scale.words_beyond(quantity.unit), lost]));
        below.retain(|line| !line.is_empty());
        let plot = ImagePlot {
            values: image.values.view(),
            quantity,
            key: Key::Scale(scale),
            title,
            note,
            below,
        };
        pictures.add(file, &image::draw(grid, &plot))
    }

    pub(super) fn draw_sinograms(
        &self,
        pictures: &mut Pictures,
        asked: &ViewOfRun,
    ) -> Result<(), Failure> {
        let [_, _, _, columns] = self.run.shape();
        let views = self.run.views();
        let angles: Vec<f64> = self.run.angles().iter().map(|angle| angle.to_degrees()).collect();
        let grid = self.grid.clone().of_views(&angles, views);
        // Rows of pixels; beamlets have none.
        let names = match self.run.maps() {
            Some(_) => self.names(asked),
            None => Vec::new(),
        };
        let row = row_number(self.row)?;
        let plain = |name: &str, quantity, values| Values {
            name: name.into(),
            quantity,
            values,
            sigma: None,
            trusted: None,
            flag_words: String::new(),
        };
        let file = |name: &str| format!("sinogram_{name}_row_{:04}", self.row);
        if names.is_empty() {
            let mut values = Array2::zeros((views, columns));
            for (view, mut line) in values.outer_iter_mut().enumerate() {
                let frames = self.run.fitted_rows(Some(view), row..row + 1)?;
                line.assign(&frames.slice(ndarray::s![self.step, 0, ..]).mapv(f64::from));
            }
            let note = joined(&[self.run.title(), self.at_step()]);
            let words = [format!("Sinogram of row {row}"), note];
            let values = plain("intensity", self.run.fitted_quantity(), values);
            return self.draw_values(pictures, file("intensity"), &grid, &values, words);
        }
        let mut flagged = Array2::from_elem((views, columns), false);
        for view in 0..views {
            if let Some(flags) = self.run.flags(view)? {
                flagged.row_mut(view).assign(&flags.flagged.row(self.row));
            }
        }
        for name in names {
            let quantity = Quantity::of_map(&name);
            let read = |name: &str| -> Result<Array2<f64>, Failure> {
                let mut values = Array2::zeros((views, columns));
                for (view, mut line) in values.outer_iter_mut().enumerate() {
                    let map = self.run.map(name, view)?;
                    line.assign(&map.row(self.row).mapv(|v| f64::from(v) * quantity.factor));
                }
                Ok(values)
            };
            let mut values = plain(&name, quantity.clone(), read(&name)?);
            values.sigma = self.run.sigma_of(&name).map(|sigma| read(&sigma)).transpose()?;
            let count = flagged.iter().filter(|flagged| **flagged).count();
            if count > 0 {
                values.flag_words = format!("flagged: {}", pixels(count));
                values.trusted = trusted(&flagged);
            }
            let title = format!("Sinogram of row {row}: {}", quantity.label);
            let words = [title, joined(&[self.run.title(), self.run.method_words()])];
            self.draw_values(pictures, file(&name), &grid, &values, words)?;
        }
        Ok(())
    }
}

/// The scale of the pixels that may set it.
fn own_scale(image: &Values) -> Scale {
    let of = |values: &Array2<f64>| -> Vec<f64> {
        let is_trusted = |at: usize| image.trusted.as_ref().is_none_or(|trusted| trusted[at]);
        let all = values.iter().enumerate();
        all.filter(|(at, _)| is_trusted(*at)).map(|(_, value)| *value).collect()
    };
    let sigma = image.sigma.as_ref().map(of);
    let Quantity { map, empty, .. } = image.quantity;
    let own = Scale::of(map, &of(&image.values), empty, sigma.as_deref());
    // What lies beyond is counted over all pixels, flagged ones too.
    Scale::between(own.map, [own.low, own.high], image.values.iter().copied())
}
