//! Pixels whose values do not belong to one piece of sample: the silhouette of an object crosses their
//! light, so that a part of it is refracted out of the curve, or a value of the curve is off.
//!
//! Such a curve may look normal: half of the deflected light leaves a Gaussian. A pixel is suspect if it
//! fits a smooth continuation from neither side. The rules and their results: docs/retrieval.md.

use super::curves::Curves;
use super::flags;
use super::images::{FLAGS, Images};
use beamlet_core::numbers::single;
use ndarray::Array2;
use rayon::prelude::*;

/// Limits that decide between noise, bias and misfits.
struct Limits {
    /// Deviation from both sides from which on a pixel is flagged, and one from which on it is beside
    /// such a pixel.
    deviations: [f64; 2],
    /// Deviation that suffices at a step of the transmission along the slits, and the bend that is
    /// such a step: light is refracted along the slits there, which no curve shows.
    step: [f64; 2],
    /// The same for pixels with values between their neighbours'.
    smooth_step: [f64; 2],
    /// Deviation of the width from the neighbourhood's, below which a pixel between two misfits, or
    /// with values between its neighbours', is none.
    own: f64,
    /// Standard deviations by which a value may lie beyond those of its neighbours and is still one
    /// between them.
    between: f64,
    /// Bias of a Gaussian between neighbours without silhouettes: of the transmission and the relative
    /// width, and of the centre in widths of the flat's curve.
    bias: [f64; 2],
}

const OF_COUNTS: Limits = Limits {
    deviations: [3.4, 2.8],
    step: [1.0, 6.0],
    smooth_step: [2.0, 20.0],
    own: 2.0,
    between: 3.0,
    bias: [0.0025, 0.0025],
};
/// With bias alone: smaller deviations harm nobody.
const WITHOUT_NOISE: Limits = Limits {
    deviations: [4.4, 4.4],
    step: [f64::INFINITY; 2],
    smooth_step: [f64::INFINITY; 2],
    own: 3.0,
    between: 1.0,
    bias: [0.004, 0.008],
};
/// Part of the difference of two neighbours by which a line through them may miss: of the
/// transmission, which has steps, and of centre and width.
const SLACK: [f64; 2] = [1.3, 1.0];
/// Deviation from lines through medians, as a part of one from lines through pixels, and their bias:
/// medians follow bent silhouettes less.
const OF_MEDIANS: [f64; 2] = [0.7, 2.0];
/// Scatter of structure below a pixel, as a part of the dark field that it makes.
const TEXTURE: f64 = 1.0;
/// Median deviation in a field that is rougher than noise.
const ROUGH: f64 = 0.9;
/// Neighbours of a side are looked for so far, past pixels without an answer.
const REACH: isize = 4;
/// Residual over the median of the neighbours' from which on a pixel is flagged, at noise without
/// end; fewer steps scatter more.
const RESIDUAL: f64 = 2.0;
/// Residual over the amplitude that counts where there is no noise.
const LEAST_RESIDUAL: f64 = 0.0047;
/// Standard deviations at which the residual of noise stands 1 time in 20,000.
const RARE: f64 = 3.9;

/// A quantity in units of the flat's curve: `[row][column]`, with its 1 sigma (0 without noise).
struct Field {
    values: Array2<f64>,
    sigma: Array2<f64>,
    bias: f64,
    slack: f64,
    /// Medians of three values of a column, and of a row: along a silhouette, for what is across it.
    medians: [Array2<f64>; 2],
}

/// Inputs of the decision about misfits beside the images.
#[derive(Debug, Clone, Copy)]
pub(super) struct Noise {
    /// Variance of a value over its mean; `None` for values without noise.
    pub(super) gain: Option<f64>,
    /// Standard deviation of a value without light.
    pub(super) read_noise: f64,
    /// Values of a curve.
    pub(super) steps: usize,
}

/// Sets the flag of misfits in the images of a view.
pub(super) fn mark(images: &mut Images, flat: &Curves, angle_per_shift: f64, noise: Noise) {
    let Some(width) = median(flat.width.iter().map(|width| f64::from(*width)).collect()) else {
        return;
    };
    let names = ["transmission", "refraction", "dark_field"];
    if let Some(marked) = found(images, names, angle_per_shift.abs() * width, noise) {
        flag(images, &marked);
    }
}

/// Misfits by the images of transmission, refraction and dark field along one axis. `unit`: angle of a shift by
/// the width of the flat's curve.
pub(super) fn found(
    images: &Images,
    names: [&str; 3],
    unit: f64,
    noise: Noise,
) -> Option<Array2<bool>> {
    let limits = if noise.gain.is_some() { OF_COUNTS } else { WITHOUT_NOISE };
    let [bias, bias_of_centre] = limits.bias;
    let field = |name: &str, unit: f64, bias: f64, slack: f64| -> Option<Field> {
        let values = images.get(name)?.mapv(|value| f64::from(value) / unit);
        let sigma = images.get(&format!("{name}_sigma")).filter(|_| noise.gain.is_some());
        let sigma = match sigma {
            Some(sigma) => medians(&sigma.mapv(|value| f64::from(value) / unit), 1, 1),
            None => Array2::zeros(values.dim()),
        };
        let medians = [medians(&values, 1, 0), medians(&values, 0, 1)];
        Some(Field { values, sigma, bias, slack, medians })
    };
    let [transmission, centre, width] = names;
    let transmission = field(transmission, 1.0, bias, SLACK[0])?;
    let centre = field(centre, unit, bias_of_centre, SLACK[1])?;
    let width = field(width, 2.0 * unit * unit, bias, SLACK[1]);
    let mut marked = edges(&transmission, &centre, width.as_ref(), &limits);
    if let Some(residuals) = residuals(images, noise) {
        let rare = rare_residuals(&residuals, noise);
        marked.zip_mut_with(&rare, |marked, rare| *marked |= rare);
    }
    Some(marked)
}

/// Adds the flag of misfits to these pixels.
pub(super) fn flag(images: &mut Images, marked: &Array2<bool>) {
    if let Some(bits) = images.get_mut(FLAGS) {
        bits.zip_mut_with(marked, |bits, marked| {
            if *marked {
                *bits += single(f64::from(flags::MISFIT));
            }
        });
    }
}

/// Pixels to which neither side continues.
fn edges(
    transmission: &Field,
    centre: &Field,
    width: Option<&Field>,
    limits: &Limits,
) -> Array2<bool> {
    let shape = transmission.values.dim();
    let [rows, columns] = window(shape);
    let width = width.map(|width| (width, medians(&width.values, rows, columns)));
    // Structure below a pixel scatters from pixel to pixel. Half a standard deviation is the noise of a
    // median.
    let texture = |at| {
        let of = |(width, usual): &(&Field, Array2<f64>)| usual[at] - 0.5 * width.sigma[at];
        (TEXTURE * width.as_ref().map_or(0.0, of)).max(0.0)
    };
    // Across the slits and along them.
    let deviations = by_pixel(shape, |at| {
        let texture = texture(at);
        let of_centre = (2.0 * TEXTURE * texture).sqrt();
        let side = |step: [isize; 2]| {
            let transmission = transmission.deviations(at, step, texture);
            let centre = centre.deviations(at, step, of_centre);
            let width = width.as_ref().map(|(width, _)| width.deviations(at, step, texture));
            let width = width.unwrap_or_default();
            [0, 1].map(|kind| transmission[kind].hypot(centre[kind]).hypot(width[kind]))
        };
        let lesser = |[a, b]: [[f64; 2]; 2]| a[0].min(b[0]).max(OF_MEDIANS[0] * a[1].min(b[1]));
        [lesser([[0, -1], [0, 1]].map(side)), lesser([[-1, 0], [1, 0]].map(side))]
    });
    let rough = medians(&deviations.mapv(|[across, along]| across.max(along)), rows, columns);
    // Structure rougher than noise has larger limits.
    let share = |at: (usize, usize), deviation: f64| deviation / (rough[at] / ROUGH).max(1.0);
    // Deviation of the width from the neighbourhood's.
    let widened = |at| {
        let of = |(width, usual): &(&Field, Array2<f64>)| {
            (width.values[at] - usual[at]).abs() / width.sigma[at].hypot(width.bias)
        };
        width.as_ref().map_or(f64::INFINITY, of)
    };
    let shares = by_pixel(shape, |at| {
        let [across, along] = deviations[at];
        let share = share(at, across.max(along));
        // One smooth piece, though neither side alone continues to it: faces that begin beside it.
        let is_smooth = widened(at) < limits.own
            && [transmission, centre].iter().all(|field| field.is_between(at, limits.between));
        let [deviation, bend] = if is_smooth { limits.smooth_step } else { limits.step };
        if share > deviation && transmission.bend_along_slits(at) > bend {
            f64::INFINITY
        } else if is_smooth {
            0.0
        } else {
            share
        }
    });
    let marked = along_silhouettes(&shares, limits.deviations);
    // Between two misfits only the pixel's own curve decides.
    by_pixel(shape, |at| {
        let is_marked = |step| near(&marked, at, step, 1).is_some_and(|marked| *marked);
        let between = |[a, b]: [[isize; 2]; 2], other: f64| {
            is_marked(a) && is_marked(b) && share(at, other) <= limits.deviations[0]
        };
        let [across, along] = deviations[at];
        let alone = between([[0, -1], [0, 1]], along) || between([[-1, 0], [1, 0]], across);
        marked[at] && !(alone && widened(at) < limits.own)
    })
}

/// Pixels beyond the limit, and those beyond the lower one that such a pixel above or below leads to:
/// silhouettes go on from row to row, noise does not (thresholds with hysteresis, Canny 1986).
fn along_silhouettes(deviations: &Array2<f64>, [limit, lower]: [f64; 2]) -> Array2<bool> {
    let mut marked = deviations.mapv(|deviation| deviation > limit);
    let (rows, columns) = marked.dim();
    let mut ends: Vec<(usize, usize)> =
        marked.indexed_iter().filter_map(|(at, marked)| marked.then_some(at)).collect();
    while let Some((row, column)) = ends.pop() {
        let beside = |at: usize, end: usize| at.saturating_sub(1)..(at + 2).min(end);
        for at in beside(row, rows)
            .filter(|near| *near != row)
            .flat_map(|row| beside(column, columns).map(move |column| (row, column)))
        {
            if !marked[at] && deviations[at] > lower {
                marked[at] = true;
                ends.push(at);
            }
        }
    }
    marked
}

impl Field {
    /// How far the value of a pixel is from what continues to it from one side: through pixels, and
    /// through medians along a silhouette, which have less noise. In standard deviations; 0 where
    /// there is none to compare with.
    fn deviations(&self, at: (usize, usize), step: [isize; 2], texture: f64) -> [f64; 2] {
        let medians = &self.medians[usize::from(step[0] != 0)];
        // Variances of a pixel and its neighbour, or of a pixel and a median of three.
        let of_pixels = self.in_deviations(at, self.off(at, step, &self.values), 2.0, texture, 1.0);
        let off = self.off(at, step, medians);
        [of_pixels, self.in_deviations(at, off, 1.5, texture, OF_MEDIANS[1])]
    }

    /// How far the value of a pixel is beyond the next one and the line through the next two.
    fn off(&self, at: (usize, usize), step: [isize; 2], side: &Array2<f64>) -> f64 {
        let value = |k: isize| near(side, at, step, k).copied();
        let mut known = (1..=REACH).map_while(value).filter(|value| value.is_finite());
        let (own, Some(next)) = (self.values[at], known.next()) else { return 0.0 };
        let slope = next - known.next().unwrap_or(next);
        let [low, high] = [next.min(next + slope), next.max(next + slope)];
        (low - own).max(own - high) - self.slack * slope.abs()
    }

    /// The value is one between those to the left and right, and between those above and below.
    fn is_between(&self, at: (usize, usize), within: f64) -> bool {
        let own = self.values[at];
        let miss = within * self.sigma[at].hypot(self.bias);
        [[0, 1], [1, 0]].into_iter().all(|step| {
            let [a, b] = [-1, 1].map(|k| near(&self.values, at, step, k).copied());
            let (Some(a), Some(b)) = (a, b) else { return true };
            a.min(b) - miss <= own && own <= a.max(b) + miss
        })
    }

    /// Second difference of the values above, at and below a pixel, in standard deviations.
    fn bend_along_slits(&self, at: (usize, usize)) -> f64 {
        let value = |k: isize| near(&self.values, at, [1, 0], k).copied();
        let (Some(above), Some(below)) = (value(-1), value(1)) else { return 0.0 };
        let bend = (above - 2.0 * self.values[at] + below).abs();
        self.in_deviations(at, bend, 6.0, 0.0, 1.0)
    }

    /// A difference in standard deviations, of which noise has so many variances of a value.
    /// What has no answer, or an uncertainty that is not known, is not judged.
    fn in_deviations(
        &self,
        at: (usize, usize),
        off: f64,
        variances: f64,
        texture: f64,
        biases: f64,
    ) -> f64 {
        let (sigma, bias) = (self.sigma[at], biases * self.bias);
        let noise = variances * sigma * sigma + texture * texture + bias * bias;
        if off > 0.0 && noise.is_finite() { off / noise.sqrt() } else { 0.0 }
    }
}

/// The value `count` steps from a place.
fn near<T>(
    image: &Array2<T>,
    (row, column): (usize, usize),
    [down, right]: [isize; 2],
    count: isize,
) -> Option<&T> {
    let row = row.checked_add_signed(count * down)?;
    image.get((row, column.checked_add_signed(count * right)?))
}

/// Squares of the residuals, over the variance of counts; without noise over the square of the amplitude.
/// `None` for methods without residuals.
fn residuals(images: &Images, noise: Noise) -> Option<Array2<f64>> {
    let [residual, amplitude, background] =
        ["residual_sample", "sample_amplitude", "sample_background"].map(|name| images.get(name));
    let (residual, amplitude, background) = (residual?, amplitude?, background?);
    let squares = by_pixel(residual.dim(), |at| {
        let [residual, amplitude, background] =
            [residual, amplitude, background].map(|image| f64::from(image[at]));
        let variance = match noise.gain {
            // The mean of a curve is about half its height.
            Some(gain) => {
                let mean = (0.5 * amplitude + background).max(0.1 * amplitude);
                gain * mean + noise.read_noise * noise.read_noise
            }
            None => amplitude * amplitude,
        };
        residual * residual / variance
    });
    (noise.steps > 4 && squares.iter().any(|square| *square > 0.0)).then_some(squares)
}

/// Residuals far above their neighbours'.
fn rare_residuals(squares: &Array2<f64>, noise: Noise) -> Array2<bool> {
    // Few of the steps, those at the peak, have most of the variance.
    let freedom = 0.5 * (noise.steps - 4) as f64;
    // Reduced chi squared, by Wilson and Hilferty.
    let quantile =
        |z: f64| (1.0 - 2.0 / (9.0 * freedom) + z * (2.0 / (9.0 * freedom)).sqrt()).powi(3);
    let factor = match noise.gain {
        Some(_) => (quantile(RARE) / quantile(0.0)).max(RESIDUAL * RESIDUAL),
        None => RESIDUAL * RESIDUAL,
    };
    let least = match noise.gain {
        Some(_) => quantile(RARE),
        None => LEAST_RESIDUAL * LEAST_RESIDUAL,
    };
    let [rows, columns] = window(squares.dim());
    let usual = medians(squares, rows, columns);
    by_pixel(squares.dim(), |at| squares[at] > (factor * usual[at]).max(least))
}

/// Reach of a neighbourhood in rows and columns; images of few rows have wide ones.
const fn window((rows, _): (usize, usize)) -> [usize; 2] {
    match rows {
        // A reach of 3 skips the row itself: there have to be others.
        0..=3 => [rows.saturating_sub(1), 9],
        4..=6 => [3, 9],
        _ => [3, 3],
    }
}

/// Medians of the finite values about each pixel: of all up to one pixel away, of every second one
/// farther. NaN where there are none.
fn medians(values: &Array2<f64>, rows: usize, columns: usize) -> Array2<f64> {
    let (height, breadth) = values.dim();
    by_pixel(values.dim(), |(row, column)| {
        let line = |at: usize, reach: usize, end: usize| {
            let step = if reach > 1 { 2 } else { 1 };
            (0..=2 * reach)
                .step_by(step)
                .filter_map(move |k| (at + k).checked_sub(reach).filter(|at| *at < end))
        };
        let near = line(row, rows, height).flat_map(|row| {
            line(column, columns, breadth).map(move |column| values[[row, column]])
        });
        median(near.filter(|value| value.is_finite()).collect()).unwrap_or(f64::NAN)
    })
}

/// The middle one of the finite values.
pub fn median(mut values: Vec<f64>) -> Option<f64> {
    values.retain(|value| value.is_finite());
    let middle = values.len() / 2;
    (middle < values.len()).then(|| *values.select_nth_unstable_by(middle, f64::total_cmp).1)
}

/// An image, computed pixel by pixel.
fn by_pixel<T: Default + Clone + Send>(
    (rows, columns): (usize, usize),
    of: impl Fn((usize, usize)) -> T + Sync,
) -> Array2<T> {
    let mut image = Array2::from_elem((rows, columns), T::default());
    if let Some(values) = image.as_slice_mut() {
        let all = values.par_iter_mut().enumerate();
        all.for_each(|(at, value)| *value = of((at / columns, at % columns)));
    }
    image
}
