//! Doubts about the size of a run: output and memory beyond this machine.

use super::Work;
use super::display::bytes;
use beamlet_core::{folder, reserve};
use std::path::Path;

/// Warnings of output beyond the free space of the disk of the present folder, and of a peak beyond the memory of the
/// machine.
pub(super) fn warnings(work: &Work) -> Vec<String> {
    let of = |free: Option<u64>, needed: u64, text: &dyn Fn(String, String) -> String| {
        free.filter(|free| needed > *free).map(|free| text(bytes(needed), bytes(free)))
    };
    let disk = of(folder::free_space(Path::new(".")), work.output_bytes, &|needed, free| {
        format!("the output of {needed} exceeds the free space of the disk of this folder, {free}")
    });
    let memory = of(reserve::machine_memory(), work.memory.peak_bytes, &|needed, all| {
        format!(
            "the peak of {needed} of memory exceeds the memory of this machine, {all}: a smaller --memory-limit \
             makes smaller bands"
        )
    });
    disk.into_iter().chain(memory).collect()
}
