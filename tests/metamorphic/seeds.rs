//! Seeds of random scenes.

use std::sync::Mutex;

/// The seeds of `BEAMLET_SEED`, or others.
pub(crate) fn seeds_or(others: impl IntoIterator<Item = u64>) -> Vec<u64> {
    let Ok(text) = std::env::var("BEAMLET_SEED") else { return others.into_iter().collect() };
    let (first, last) = text.split_once('-').unwrap_or((&text, &text));
    let number = |it: &str| it.parse().expect("BEAMLET_SEED is a number or a range such as 1-300");
    (number(first)..=number(last)).collect()
}

/// Results of seeds, two at a time: one leaves processors idle.
pub(crate) fn walk<T: Send>(seeds: Vec<u64>, of: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let queue = Mutex::new(seeds);
    let next = || queue.lock().expect("seeds").pop();
    let part = || std::iter::from_fn(next).map(&of).collect::<Vec<T>>();
    std::thread::scope(|scope| {
        let parts = [0; 2].map(|_| scope.spawn(part));
        parts.into_iter().flat_map(|it| it.join().expect("results of seeds")).collect()
    })
}
