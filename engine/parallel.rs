//! Copies of large slices by all threads: one thread alone fills memory at a fraction of its speed.

use bytemuck::Pod;
use rayon::prelude::*;

/// Bytes that a thread copies at a time.
const PART: usize = 1 << 18;

/// Slices one after another.
pub(crate) fn concat<T: Pod + Send + Sync>(slices: &[impl AsRef<[T]>]) -> Vec<T> {
    let slices = || slices.iter().map(AsRef::as_ref);
    let mut all = bytemuck::zeroed_vec(slices().map(<[T]>::len).sum());
    let mut rest = &mut all[..];
    let mut pairs = Vec::new();
    for slice in slices() {
        let (to, after) = rest.split_at_mut(slice.len());
        rest = after;
        pairs.push((to, slice));
    }
    pairs.into_par_iter().for_each(|(to, from)| copy(from, to));
    all
}

/// Copies a slice to another of the same length.
fn copy<T: Pod + Send + Sync>(from: &[T], to: &mut [T]) {
    let part = (PART / size_of::<T>().max(1)).max(1);
    if from.len() <= part {
        to.copy_from_slice(from);
    } else {
        let from = from.par_chunks(part);
        to.par_chunks_mut(part).zip(from).for_each(|(to, from)| to.copy_from_slice(from));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slices_follow_one_another() {
        let long: Vec<u32> = (0..200_000).collect();
        let all = concat(&[&long[..3], &[], &long, &[7]]);
        assert_eq!(all, [&long[..3], &long, &[7]].concat());
    }
}
