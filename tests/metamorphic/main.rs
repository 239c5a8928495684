//! Random scenes compared with themselves, changed in ways whose effect on the stacks is known:
//! mirrored, turned, sampled finer, traced in order, made of facets, on the other backend, in bands, about another
//! axis of rotation (with rough surfaces). `parts` compares random thin parts with an integration in f64.
//!
//! A failure prints its seed and its scene. `BEAMLET_SEED=17` repeats it and looks for the smallest
//! scene that fails; `BEAMLET_SEED=1-300` takes these seeds in place of the CI seeds, `BEAMLET_RELATION=origin` this
//! relation of all of them.

#![allow(clippy::expect_used, clippy::print_stdout, reason = "tests, which print their figures")]

mod audits;
mod case;
mod compare;
mod draws;
mod parts;
mod relations;
mod rows;
mod runs;
mod samples;
mod seeds;
mod set_ups;
mod shrink;
#[path = "../support/mod.rs"]
mod support;

use beamlet::Backend;
use case::Case;
use compare::{Limits, largest};
use ndarray::Array4;
use relations::{RELATIONS, Relation};
use runs::{difference, folder, run};
use seeds::{seeds_or, walk};
use std::time::Instant;
use support::backends;

/// Seeds of CI and the relations that each takes, some of those that it takes by [`is_taken`] where it is asked for: every
/// shape but the torus, whose facets take long to trace, 0 to 2 masks that do and do not leak, apertures that end along z,
/// instances, nested bodies, one energy and a tube, spots of two Gaussians, borders of pixels in apertures.
const CASES: [(u64, &[Relation]); 9] = [
    (5, &[Relation::MirroredInZ, Relation::Bands]),
    (12, &[Relation::MirroredInX, Relation::Random]),
    (15, &[Relation::Turned, Relation::Origin]),
    (44, &[Relation::Facets, Relation::Finer]),
    (47, &[Relation::Turned, Relation::Backend]),
    (53, &[Relation::Exact]),
    (78, &[Relation::Facets]),
    (134, &[Relation::MirroredInX]),
    (155, &[Relation::MirroredInZ]),
];
/// A sample that changes no pixel by this share of open beam is not seen.
const SEEN: f32 = 0.01;

/// The seeds of `BEAMLET_SEED`, or the seeds of CI.
fn seeds() -> Vec<u64> {
    seeds_or(CASES.map(|(seed, _)| seed))
}

/// True if seeds or a relation are named.
fn is_asked_for() -> bool {
    ["BEAMLET_SEED", "BEAMLET_RELATION"].into_iter().any(|name| std::env::var_os(name).is_some())
}

/// True if a seed takes this relation. A seed of `BEAMLET_SEED` takes a half of most: more scenes find more than more
/// relations of one scene. Random rays are slow, and few scenes suffice.
fn is_taken(relation: Relation, seed: u64) -> bool {
    if relation == Relation::Backend && !backends().contains(&Backend::RayQuery) {
        return false;
    }
    if let Ok(name) = std::env::var("BEAMLET_RELATION") {
        return name == relation.to_string();
    }
    if !is_asked_for() {
        return CASES.iter().any(|(of, relations)| *of == seed && relations.contains(&relation));
    }
    match relation {
        Relation::MirroredInX | Relation::Finer | Relation::Facets => seed.is_multiple_of(2),
        Relation::MirroredInZ
        | Relation::Turned
        | Relation::Exact
        | Relation::Backend
        | Relation::Bands => !seed.is_multiple_of(2),
        Relation::Origin => seed.is_multiple_of(3),
        Relation::Random => seed.is_multiple_of(12),
    }
}

/// Findings of a seed.
#[derive(Default)]
struct Outcome {
    failed: Vec<String>,
    seen: bool,
    /// The difference of each relation, in limits.
    ratios: [f64; RELATIONS.len()],
}

/// Holds a seed to its relations.
fn hold(seed: u64) -> Outcome {
    let start = Instant::now();
    let case = samples::case(seed);
    let mut outcome = Outcome::default();
    let first = match run(&case, Backend::Bvh) {
        Ok(first) => first,
        Err(error) => {
            println!("FAILED seed {seed}: {error}\n{}", case.text(&folder(), &format!("{seed}")));
            outcome.failed.push(format!("seed {seed}: {error}"));
            return outcome;
        }
    };
    outcome.seen = first.contrast() > SEEN;
    let design = if case.scene.has_heights() { "apertures end along z, " } else { "" };
    let mut figures = format!("{design}contrast {:.2}", first.contrast());
    for (relation, ratio) in RELATIONS.into_iter().zip(&mut outcome.ratios) {
        if !is_taken(relation, seed) {
            continue;
        }
        let what = match difference(relation, &case, &first) {
            // Seeds of CI have relations that apply to them.
            Ok(None) if !is_asked_for() => "nothing is compared".into(),
            Ok(None) => continue,
            Ok(Some(found)) => {
                *ratio = found.ratio();
                figures += &format!(", {relation} {:.1e}", found.amount());
                if found.ratio() <= 1.0 {
                    continue;
                }
                found.to_string()
            }
            Err(error) => error,
        };
        report(seed, relation, &case, &what);
        outcome.failed.push(format!("seed {seed}, {relation}: {what}"));
    }
    println!("seed {seed}, {:.1} s: {figures}", start.elapsed().as_secs_f64());
    outcome
}

/// Prints what failed and how to repeat it; of a single seed the smallest scene that fails, too.
fn report(seed: u64, relation: Relation, case: &Case, what: &str) {
    println!("FAILED seed {seed}, {relation}: {what}");
    println!("repeat: BEAMLET_SEED={seed} cargo test --release --test metamorphic -- --nocapture");
    let name = format!("seed {seed} {relation}");
    println!("--- scene\n{}---", case.text(&folder(), &name));
    if seeds().len() > 1 {
        return;
    }
    let found = |it: &Case| {
        let found = run(it, Backend::Bvh).and_then(|first| difference(relation, it, &first));
        found.ok().flatten().filter(|found| found.ratio() > 1.0)
    };
    let smallest = shrink::shrunk(case, &|it| found(it).is_some());
    if let Some(found) = found(&smallest) {
        println!("--- smallest scene: {found}\n{}---", smallest.text(&folder(), &name));
    }
}

#[test]
fn random_scenes_keep_their_relations() {
    let outcomes = walk(seeds(), hold);
    for (k, relation) in RELATIONS.iter().enumerate() {
        let worst = outcomes.iter().fold(0.0_f64, |most, it| most.max(it.ratios[k]));
        println!("measured {relation}: {worst:.2} of the limit");
    }
    let failed: Vec<&str> = outcomes.iter().flat_map(|it| &it.failed).map(String::as_str).collect();
    let seen = outcomes.iter().filter(|it| it.seen).count();
    println!("{} seeds, {seen} samples seen, {} failed", outcomes.len(), failed.len());
    assert!(failed.is_empty(), "{}", failed.join("\n"));
    assert!(outcomes.len() == 1 || 2 * seen > outcomes.len(), "most samples are not seen");
}

#[test]
fn a_changed_pixel_is_a_difference() {
    let limits = Limits { sample: 5e-4, flat: 1e-6, rays: None };
    let stack = Array4::from_elem((1, 2, 3, 4), 0.25_f32);
    let found = |changed: &Array4<f32>, of| largest(of, [&stack, changed], &limits).ratio();
    assert!(found(&stack, "sample") <= 0.0);
    let mut changed = stack.clone();
    changed[[0, 1, 2, 3]] += 6e-4;
    assert!(found(&changed, "sample") > 1.0);
    changed[[0, 1, 2, 3]] = 0.25 + 2e-6;
    assert!(found(&changed, "sample") < 1.0);
    assert!(found(&changed, "flat") > 1.0);
    changed[[0, 1, 2, 3]] = f32::NAN;
    assert!(found(&changed, "sample") > 1.0);
}
