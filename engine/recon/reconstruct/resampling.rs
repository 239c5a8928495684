//! Even columns of uneven ones.

/// Most columns made of one.
const MOST: f64 = 8.0;

/// Places of even columns on the detector, and the columns that they come from.
#[derive(Debug)]
pub(super) struct Resampling {
    pub(super) first: f64,
    pub(super) pitch: f64,
    /// Column to the left of each place, and the share of the next.
    from: Vec<(usize, f64)>,
}

impl Resampling {
    /// Of ascending places, two or more. Even ones stay as they are; others get the least distance
    /// of two of them.
    pub(super) fn of(columns: &[f64]) -> Self {
        let intervals = columns.len() - 1;
        let (first, width) = (columns[0], columns[intervals] - columns[0]);
        let mean = width / intervals as f64;
        let gaps = || columns.windows(2).map(|pair| pair[1] - pair[0]);
        if gaps().all(|gap| (gap - mean).abs() <= 1e-4 * mean) {
            let from = (0..columns.len()).map(|column| (column, 0.0)).collect();
            return Self { first, pitch: mean, from };
        }
        let least = gaps().fold(mean, f64::min).max(mean / MOST);
        let parts = beamlet_core::numbers::whole::<usize>((width / least).ceil());
        let pitch = width / parts as f64;
        let place = |n: usize| {
            let x = first + n as f64 * pitch;
            let left = columns.partition_point(|column| *column <= x).clamp(1, intervals) - 1;
            let share = (x - columns[left]) / (columns[left + 1] - columns[left]);
            (left, share.clamp(0.0, 1.0))
        };
        Self { first, pitch, from: (0..=parts).map(place).collect() }
    }

    /// Number of even columns.
    pub(super) fn len(&self) -> usize {
        self.from.len()
    }

    /// Values of a row at the even places.
    pub(super) fn values<'a>(&'a self, row: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        self.from.iter().map(|(left, share)| match row.get(left + 1) {
            Some(right) => row[*left] + share * (right - row[*left]),
            None => row[*left],
        })
    }
}
