//! Apertures that end along z, for the device.

use crate::sampling::{LandingEdges, LitHeights, ViewContext};
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::RefinedHeights;
use std::sync::Arc;

/// Apertures of both masks along z on the device.
#[derive(Debug)]
pub(super) struct Heights {
    lit: Option<LitHeights>,
    landing: Option<LandingEdges>,
    record: Buffer,
    _lists: [Buffer; 2],
}

impl Heights {
    /// The apertures of a view; `None` of slits.
    pub(super) fn new(device: &Arc<Device>, view: &ViewContext<'_>) -> Result<Option<Self>> {
        if !view.lattice.heights {
            return Ok(None);
        }
        let lit = LitHeights::of(view.optics);
        let landing = LandingEdges::of(view.optics);
        let tops = lit.as_ref().map_or_else(Vec::new, |lit| in_period(&lit.tops, lit.period));
        let edges = landing.as_ref().map_or_else(Vec::new, |it| in_period(&it.edges, it.period));
        // A buffer is not empty.
        let upload = |name: &str, list: &[f32]| {
            device.upload(name, if list.is_empty() { &[0.0] } else { list })
        };
        let lists = [upload("apertures along z", &tops)?, upload("edges along z", &edges)?];
        let record = RefinedHeights {
            tops: lists[0].address(),
            edges: lists[1].address(),
            top_count: numbers::count(tops.len()),
            edge_count: numbers::count(edges.len()),
            period: lit.as_ref().map_or(1.0, |lit| single(lit.period)),
            height: lit.as_ref().map_or(1.0, |lit| single(lit.height.min(lit.period))),
            edge_period: landing.as_ref().map_or(1.0, |it| single(it.period)),
            unused: 0,
        };
        let record = device.upload("heights of refinement", &[record])?;
        Ok(Some(Self { lit, landing, record, _lists: lists }))
    }

    pub(super) fn address(&self) -> u64 {
        self.record.address()
    }

    /// Place of the upper end of a row in a period of the sample mask and of the detector mask, rows.
    pub(super) fn places(&self, row: i32) -> [f32; 2] {
        let place = |period: f64| single(f64::from(row).rem_euclid(period));
        let of_edges = self.landing.as_ref().map(|it| place(it.period));
        [self.lit.as_ref().map(|lit| place(lit.period)), of_edges].map(Option::unwrap_or_default)
    }
}

/// Places in a period from 0 on, ascending.
fn in_period(places: &[f64], period: f64) -> Vec<f32> {
    let mut places: Vec<f32> =
        places.iter().map(|place| single(place.rem_euclid(period))).collect();
    places.sort_unstable_by(f32::total_cmp);
    places.dedup();
    places
}
