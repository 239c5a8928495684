//! Pixels whose values are not those of one piece of sample: the silhouette of an object crosses
//! their light, so that a part of it is refracted out of the curve, or a value of the curve is off.
//!
//! Nothing in such a curve itself need be odd: half of the light turned aside leaves a Gaussian.
//! What tells is that neither the neighbours on one side nor those on the other continue to it.
//! How the limits were found, and what they catch: docs/retrieval.md.

use super::curves::Curves;
use super::flags;
use super::images::{FLAGS, Images};
use crate::numbers::single;
use ndarray::Array2;
use rayon::prelude::*;

/// Deviation from both sides from which on a pixel is flagged, and one from which on it is beside such
/// a pixel.
const LIMITS: [f64; 2] = [3.1, 2.6];
/// The same where bias is all that there is.
const LIMITS_WITHOUT_NOISE: [f64; 2] = [4.4, 4.4];
/// Deviation of the width alone, from the medians on both sides, that counts as the upper limit.
const WIDENED: f64 = 3.6;
/// Deviation of the width from the neighbourhood's, below which a pixel between two misfits is none.
const OWN: f64 = 3.0;
/// Part of the difference of two neighbours by which a line through them may miss.
const SLACK: f64 = 1.3;
/// What a Gaussian's own bias leaves between neighbours without silhouettes: of the transmission
/// and the relative width, and of the centre in widths of the flat's curve.
const BIAS: [f64; 2] = [0.002, 0.003];
/// The same where it is compared with no noise: what is smaller harms nobody.
const BIAS_WITHOUT_NOISE: [f64; 2] = [0.004, 0.008];
/// Scatter of structure below a pixel, as a part of the dark field that it makes.
const TEXTURE: f64 = 1.0;
/// Median deviation in a field that is rougher than noise.
const ROUGH: f64 = 0.8;
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
}

/// What decides about misfits beside the images.
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
    let unit = angle_per_shift.abs() * width;
    let (limits, [bias, bias_of_centre]) = match noise.gain {
        Some(_) => (LIMITS, BIAS),
        None => (LIMITS_WITHOUT_NOISE, BIAS_WITHOUT_NOISE),
    };
    let field = |name: &str, unit: f64, bias: f64| -> Option<Field> {
        let values = images.get(name)?.mapv(|value| f64::from(value) / unit);
        let sigma = images.get(&format!("{name}_sigma")).filter(|_| noise.gain.is_some());
        let sigma = match sigma {
            Some(sigma) => medians(&sigma.mapv(|value| f64::from(value) / unit), 1, 1),
            None => Array2::zeros(values.dim()),
        };
        Some(Field { values, sigma, bias })
    };
    let Some(transmission) = field("transmission", 1.0, bias) else { return };
    let Some(centre) = field("refraction", unit, bias_of_centre) else { return };
    let width = field("dark_field", 2.0 * unit * unit, bias);
    let mut marked = edges(&transmission, &centre, width.as_ref(), limits);
    if let Some(residuals) = residuals(images, noise) {
        let rare = rare_residuals(&residuals, noise);
        marked.zip_mut_with(&rare, |marked, rare| *marked |= rare);
    }
    if let Some(bits) = images.get_mut(FLAGS) {
        bits.zip_mut_with(&marked, |bits, marked| {
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
    limits: [f64; 2],
) -> Array2<bool> {
    let shape = transmission.values.dim();
    let [rows, columns] = window(shape);
    let usual_width = width.map(|width| medians(&width.values, rows, columns));
    // Structure below a pixel scatters from pixel to pixel.
    let texture = |at| {
        let usual = usual_width.as_ref().map_or(0.0, |usual| usual[at]);
        if usual > 0.0 { TEXTURE * usual } else { 0.0 }
    };
    // Across the slits and along them.
    let deviations = by_pixel(shape, |at| {
        let texture = texture(at);
        let of_centre = (2.0 * TEXTURE * texture).sqrt();
        let side = |step: [isize; 2]| {
            let width = width.map_or(0.0, |width| width.deviation(at, step, texture));
            let centre = centre.deviation(at, step, of_centre);
            transmission.deviation(at, step, texture).hypot(centre).hypot(width)
        };
        [side([0, -1]).min(side([0, 1])), side([-1, 0]).min(side([1, 0]))]
    });
    let rough = medians(&deviations.mapv(|[across, along]| across.max(along)), rows, columns);
    // What is rougher than noise has larger limits.
    let share = |at: (usize, usize), deviation: f64| deviation / (rough[at] / ROUGH).max(1.0);
    let shares = by_pixel(shape, |at| {
        let widened = width.map_or(0.0, |width| width.beyond_both_sides(at, texture(at)));
        let [across, along] = deviations[at];
        share(at, across.max(along).max(widened * LIMITS[0] / WIDENED))
    });
    let marked = along_silhouettes(&shares, limits);
    let (Some(width), Some(usual)) = (width, usual_width) else { return marked };
    // Beside a misfit on either side nothing but the pixel's own curve tells.
    by_pixel(shape, |at| {
        let is_marked = |step| near(&marked, at, step, 1).is_some_and(|marked| *marked);
        let between = |[a, b]: [[isize; 2]; 2], other: f64| {
            is_marked(a) && is_marked(b) && share(at, other) <= limits[0]
        };
        let [across, along] = deviations[at];
        let alone = between([[0, -1], [0, 1]], along) || between([[-1, 0], [1, 0]], across);
        let own = (width.values[at] - usual[at]).abs() / width.sigma[at].hypot(width.bias);
        marked[at] && !(alone && own < OWN)
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
    /// How far the value of a pixel is from those that its neighbours to one side continue to:
    /// between the next one and the line through the next two. In standard deviations; 0 where
    /// there is none to compare with.
    fn deviation(&self, at: (usize, usize), step: [isize; 2], texture: f64) -> f64 {
        let value = |k: isize| near(&self.values, at, step, k).copied();
        let mut known = (1..=REACH).map_while(value).filter(|value| value.is_finite());
        let (own, Some(next)) = (self.values[at], known.next()) else { return 0.0 };
        let slope = next - known.next().unwrap_or(next);
        let [low, high] = [next.min(next + slope), next.max(next + slope)];
        let off = (low - own).max(own - high) - SLACK * slope.abs();
        self.in_deviations(at, off, 2.0, texture)
    }

    /// How far the value of a pixel is beyond the medians of the two columns on either side, in standard
    /// deviations.
    fn beyond_both_sides(&self, at: (usize, usize), texture: f64) -> f64 {
        let side = |columns: [isize; 2]| {
            let rows = [-1, 0, 1].into_iter();
            let places = rows.flat_map(|down| columns.map(|right| [down, right]));
            median(places.filter_map(|step| near(&self.values, at, step, 1).copied()).collect())
        };
        let sides = [side([-1, -2]), side([1, 2])];
        let [low, high] = [f64::min, f64::max]
            .map(|of| sides.into_iter().flatten().reduce(of).unwrap_or(f64::NAN));
        let own = self.values[at];
        // A median of six has a sixth of the variance.
        self.in_deviations(at, (low - own).max(own - high), 7.0 / 6.0, texture)
    }

    /// A difference in standard deviations, of which noise has so many variances of a value.
    /// What has no answer, or an uncertainty that is not known, is not judged.
    fn in_deviations(&self, at: (usize, usize), off: f64, variances: f64, texture: f64) -> f64 {
        let sigma = self.sigma[at];
        let noise = variances * sigma * sigma + texture * texture + self.bias * self.bias;
        if off > 0.0 && noise.is_finite() { off / noise.sqrt() } else { 0.0 }
    }
}

/// What stands `count` steps from a place.
fn near<T>(
    image: &Array2<T>,
    (row, column): (usize, usize),
    [down, right]: [isize; 2],
    count: isize,
) -> Option<&T> {
    let row = row.checked_add_signed(count * down)?;
    image.get((row, column.checked_add_signed(count * right)?))
}

/// Squares of what the fits leave, over the variance that counts have; without noise over the
/// square of the amplitude. `None` where the method leaves nothing.
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

/// Residuals that stand out among their neighbours'.
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
pub(super) fn median(mut values: Vec<f64>) -> Option<f64> {
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
