//! Columns of evenly spread rays.

use crate::sampling::Opening;
use beamlet_core::numbers;

/// Borders of columns, m: of about `count`, as wide as one another over those parts of the period that
/// lie in an opening, and wider where bars let a share `leak` of the light through. A part that gets no
/// light is one column. `half`: half the period.
pub(super) fn columns(openings: &[Opening], half: f32, leak: f32, count: u32) -> Vec<f32> {
    let seen = seen(openings);
    let open: f32 = seen.iter().map(|[low, high]| high - low).sum();
    let width = (open + leak * (2.0 * half - open).max(0.0)) / count as f32;
    let parts = |[low, high]: [f32; 2], width: f32| {
        numbers::whole::<u32>(f64::from(((high - low) / width).round().max(1.0)))
    };
    let mut borders = vec![-half];
    let dark = |borders: &mut Vec<f32>, high: f32| {
        let low = borders[borders.len() - 1];
        let count = if leak > 0.0 { parts([low, high], width / leak) } else { 1 };
        borders.extend((1..=count).map(|i| part([low, high], i - 1, count)[1]));
    };
    for [low, high] in seen {
        let first = borders[borders.len() - 1];
        // No sliver at the border of the period.
        let low = if low - first > 0.5 * width { low } else { first };
        if low > first {
            dark(&mut borders, low);
        }
        let parts = parts([low, high], width);
        borders.extend((1..=parts).map(|i| part([low, high], i - 1, parts)[1]));
    }
    let last = borders.len() - 1;
    if half - borders[last] > 0.5 * width {
        dark(&mut borders, half);
    } else {
        borders[last] = half;
    }
    borders
}

/// Intervals of x that openings show together; they do not touch.
pub(in crate::lines) fn seen(openings: &[Opening]) -> Vec<[f32; 2]> {
    let mut sorted: Vec<[f32; 2]> = openings.iter().map(|opening| opening.x).collect();
    sorted.sort_unstable_by(|a, b| a[0].total_cmp(&b[0]));
    let mut seen: Vec<[f32; 2]> = Vec::new();
    for [low, high] in sorted {
        match seen.last_mut() {
            Some(last) if low <= last[1] => last[1] = last[1].max(high),
            _ => seen.push([low, high]),
        }
    }
    seen
}

/// Part of an interval that is cut in `count` equal ones.
pub(super) fn part(range: [f32; 2], index: u32, count: u32) -> [f32; 2] {
    let at = |i: u32| {
        if i == count {
            range[1]
        } else {
            range[0] + (range[1] - range[0]) * (i as f32 / count as f32)
        }
    };
    [at(index), at(index + 1)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_cover_the_period_and_are_even_where_it_is_open() {
        let opening = |low, high| Opening { step: 0, x: [low, high] };
        let openings = [opening(-20e-6, -5e-6), opening(-10e-6, 5e-6), opening(30e-6, 40e-6)];
        let borders = columns(&openings, 50e-6, 0.0, 35);
        let ends = [borders[0], borders[borders.len() - 1]];
        assert_eq!(ends.map(f32::to_bits), [-50e-6_f32, 50e-6].map(f32::to_bits));
        let widths: Vec<f32> = borders.windows(2).map(|pair| pair[1] - pair[0]).collect();
        // 35 of 1 um, and the gaps before, between and behind them.
        let even = widths.iter().filter(|width| (**width - 1e-6).abs() < 1e-9).count();
        assert_eq!([even, widths.len()], [35, 38]);
        // Where bars let a quarter of the light through columns are four times as wide.
        let borders = columns(&openings, 50e-6, 0.25, 205);
        let widths: Vec<f32> = borders.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let count = |low: f32, high: f32| {
            widths.iter().filter(|width| (low..high).contains(*width)).count()
        };
        assert_eq!([count(0.24e-6, 0.26e-6), count(0.9e-6, 1.1e-6)], [140, 65]);
        assert_eq!(widths.len(), 205);
    }
}
