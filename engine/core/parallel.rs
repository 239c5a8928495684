//! Threads that share work, and copies of large slices by all of them: one alone fills memory at a
//! fraction of its speed.

use crate::{Error, Result, reserve};
use bytemuck::Pod;
use rayon::prelude::*;
use std::error::Error as _;
use std::num::NonZero;
use std::sync::OnceLock;
use std::sync::atomic::{AtomicU32, Ordering};

/// Stack of a thread as Rust sets it, bytes.
const STACK: u64 = 2 << 20;

/// Largest effective value of `RAYON_NUM_THREADS`.
const MOST: usize = 1024;

/// Process that first started threads; 0 before.
static PROCESS: AtomicU32 = AtomicU32::new(0);

/// True in a fork of the process that started threads: it has none of them, and its device is that of its parent.
pub fn is_fork() -> bool {
    ![0, std::process::id()].contains(&PROCESS.load(Ordering::Relaxed))
}

/// Refuses work in a fork of a process that worked: it would wait for threads that it does not have.
fn refuse_fork() -> Result<()> {
    let own = std::process::id();
    match PROCESS.compare_exchange(0, own, Ordering::Relaxed, Ordering::Relaxed) {
        Err(first) if first != own => Err(Error::device(
            "the engine",
            format!("process {own} is a fork of process {first}, which used it"),
            "work in the process that opened it, or in new processes, in Python those of \
             multiprocessing.get_context(\"spawn\")",
        )),
        _ => Ok(()),
    }
}

/// Number of threads in the environment, as `rayon` reads it; `None` if it leaves the number to the
/// machine.
fn asked() -> Option<usize> {
    let number = |name| std::env::var(name).ok()?.parse().ok();
    let names = ["RAYON_NUM_THREADS", "RAYON_RS_NUM_CPUS"];
    names.into_iter().find_map(number).filter(|number| *number > 0)
}

/// True if libraries may start threads of their own: they read the same environment and start any
/// number.
pub(crate) fn is_bounded() -> bool {
    asked().is_none_or(|asked| asked <= MOST)
}

/// Starts the threads that work is shared among, where the program has not done so: one for each
/// that the machine runs at once, or the number in `RAYON_NUM_THREADS`, 1024 at most. Work that
/// needs threads starts them; a program that has to know early whether there is room for them
/// calls this first.
///
/// # Errors
/// [`Error::Device`] in a fork of a process that started them. [`Error::Memory`] where the system has no room for them, or next to none beside them.
pub fn start_threads() -> Result<()> {
    /// True if there are threads. A pool that failed once stays so: rayon tries once.
    static STARTED: OnceLock<bool> = OnceLock::new();
    refuse_fork()?;
    let started = STARTED.get_or_init(|| {
        let mut threads = rayon::ThreadPoolBuilder::new();
        if let Some(asked) = asked().filter(|asked| *asked > MOST) {
            log::warn!("RAYON_NUM_THREADS is {asked}; {MOST} threads are started");
            threads = threads.num_threads(MOST);
        }
        // Without a source it says that there is a pool already, as is right.
        threads.build_global().err().is_none_or(|it| it.source().is_none())
    });
    if *started && reserve::leaves_spare_beside_a_thread() {
        return Ok(());
    }
    let of_machine = || std::thread::available_parallelism().map_or(1, NonZero::get);
    let threads = asked().unwrap_or_else(of_machine).min(MOST) as u64;
    Err(Error::Memory {
        purpose: format!("{threads} threads"),
        needed: threads * STACK,
        available: None,
        remedy:
            "raise the limits of memory or of the number of processes, or lower RAYON_NUM_THREADS"
                .into(),
    })
}

/// Bytes that a thread copies at a time.
const PART: usize = 1 << 18;

/// Slices one after another.
pub fn concat<T: Pod + Send + Sync>(slices: &[impl AsRef<[T]>]) -> Vec<T> {
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
