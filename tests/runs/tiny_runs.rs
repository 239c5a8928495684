//! Whole runs of tiny scenes with keys at the ends of their ranges: 60 seeds, or the number in `BEAMLET_TINY_RUNS`.

#[expect(unreachable_pub, reason = "the fuzz target has the same file")]
#[path = "../fuzz/support/tiny_run.rs"]
mod tiny_run;

use std::panic::{AssertUnwindSafe, catch_unwind};

#[test]
fn tiny_runs_end_with_light_or_an_error() {
    let engine = tiny_run::engine();
    let count = std::env::var("BEAMLET_TINY_RUNS").ok().and_then(|count| count.parse().ok());
    let (mut found, mut lit) = (Vec::new(), 0);
    let count = count.unwrap_or(60);
    for seed in 0..count {
        let scene = tiny_run::scene_of(&tiny_run::drawn(seed));
        let run = || tiny_run::run(&engine, &scene);
        match catch_unwind(AssertUnwindSafe(run)) {
            Ok(has_light) => lit += u64::from(has_light),
            Err(_) => found.push(format!("seed {seed}: {scene}")),
        }
    }
    assert!(4 * lit > count, "{lit} of {count} runs end with light");
    assert!(found.is_empty(), "{} runs failed:\n{}", found.len(), found.join("\n"));
}
