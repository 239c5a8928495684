//! How the objects of a sample stand in each other.

use glam::DVec3;
use rayon::prelude::*;

use super::body::Body;
use super::distance::meet;
use super::search::Search;
use super::surface::{bounds_of, in_mm, near};
use super::tree::Query;
use super::watch::{LoadStep, Task};
use crate::error::{Error, Result};

/// Fills in `outside` of every component: the latest object that contains it.
///
/// # Errors
/// Surfaces of two objects that cross or touch, and an object that a later one swallows;
/// [`Error::Interrupted`].
pub(super) fn nest(bodies: &mut [Body], names: &[String], task: Task<'_>) -> Result<()> {
    let bounds: Vec<[DVec3; 2]> = bodies.iter().map(Body::bounds).collect();
    let pairs: Vec<(usize, usize)> = (0..bodies.len())
        .flat_map(|a| (a + 1..bodies.len()).map(move |b| (a, b)))
        .filter(|(a, b)| near(bounds[*a], bounds[*b], tolerance(bounds[*a], bounds[*b])))
        .collect();
    let mut neighbours = vec![Vec::new(); bodies.len()];
    for (a, b) in &pairs {
        neighbours[*a].push(*b);
        neighbours[*b].push(*a);
    }
    let searches: Vec<Option<Search>> = bodies
        .par_iter_mut()
        .zip(&neighbours)
        .map(|(body, near)| {
            let known = body.search.take();
            (!near.is_empty()).then(|| known.unwrap_or_else(|| Search::new(&body.surface)))
        })
        .collect();

    task.begin(LoadStep::Nesting, pairs.len() as u64)?;
    for (number, (a, b)) in pairs.iter().enumerate() {
        if task.is_cancelled() {
            return Err(Error::Interrupted);
        }
        task.reach(number as u64);
        let limit = tolerance(bounds[*a], bounds[*b]);
        if let Some(place) = touch((&bodies[*a], &bodies[*b]), (*a, *b), &searches, limit) {
            return Err(Error::mesh(
                format!("\"{}\" and \"{}\"", names[*a], names[*b]),
                format!(
                    "their surfaces cross, touch or come within {:.3} nm of each other; \
                     leave a gap or let one lie wholly in the other",
                    limit * 1e9
                ),
                format!("near {}", in_mm(place)),
            ));
        }
    }

    let mut outsides = Vec::with_capacity(bodies.len());
    for (object, body) in bodies.iter().enumerate() {
        let starts = first_corners(body);
        // Surfaces do not meet, so one point of a component speaks for all of it.
        let latest: Vec<Option<usize>> = starts
            .par_iter()
            .map(|point| {
                let around = |other: &&usize| {
                    near([*point; 2], bounds[**other], 0.0)
                        && searches[**other]
                            .as_ref()
                            .is_some_and(|search| search.contains(&bodies[**other].surface, *point))
                };
                neighbours[object].iter().filter(around).max().copied()
            })
            .collect();
        for (around, point) in latest.iter().zip(&starts) {
            if let Some(later) = around.filter(|around| *around > object) {
                return Err(Error::mesh(
                    format!("\"{}\"", names[object]),
                    format!(
                        "a part of it lies wholly inside \"{later}\", which is listed later and \
                         so wins: the part would vanish; list \"{later}\" first",
                        later = names[later]
                    ),
                    format!("near {}", in_mm(*point)),
                ));
            }
        }
        outsides.push(latest);
    }
    for (body, latest) in bodies.iter_mut().zip(outsides) {
        for (component, around) in body.components.iter_mut().zip(latest) {
            component.outside = around.and_then(|around| u32::try_from(around).ok());
        }
    }
    Ok(())
}

/// Surfaces nearer than this count as touching: a nanometre or, far from the origin, what f32
/// resolves on the device; less for samples of micrometres.
fn tolerance(a: [DVec3; 2], b: [DVec3; 2]) -> f64 {
    let size = |[low, high]: [DVec3; 2]| (high - low).max_element();
    let reach = |[low, high]: [DVec3; 2]| low.abs().max(high.abs()).max_element();
    let resolved = f64::from(f32::EPSILON) * reach(a).max(reach(b));
    (1e-4 * size(a).min(size(b))).min(1e-9).max(resolved)
}

/// Where the surfaces of two bodies come within `limit` of each other: always the same place.
fn touch(
    (a, b): (&Body, &Body),
    (number_a, number_b): (usize, usize),
    searches: &[Option<Search>],
    limit: f64,
) -> Option<DVec3> {
    // Fewer triangles ask, more are asked.
    let (few, many, number_many) = if a.surface.triangles.len() <= b.surface.triangles.len() {
        (a, b, number_b)
    } else {
        (b, a, number_a)
    };
    let search = searches[number_many].as_ref()?;
    let all = many.bounds();
    (0..few.surface.triangles.len()).into_par_iter().with_min_len(256).find_map_first(|triangle| {
        let corners = few.surface.corners(triangle);
        let bounds = bounds_of(corners.into_iter());
        let mut place = None;
        if near(bounds, all, limit) {
            search.near(&Query::new(corners, None, limit), |other| {
                place = meet(corners, many.surface.corners(other), limit);
                place.is_none()
            });
        }
        place
    })
}

/// A point on each component.
fn first_corners(body: &Body) -> Vec<DVec3> {
    let mut starts = vec![DVec3::NAN; body.components.len()];
    for (triangle, component) in body.triangle_component.iter().enumerate() {
        let start = &mut starts[*component as usize];
        if start.is_nan() {
            *start = body.surface.corners(triangle)[0];
        }
    }
    starts
}
