//! Apertures that end along z, for the device.

use super::tables::{address, table};
use crate::sampling::{EdgesAlongZ, LitHeights, ViewContext};
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::RefinedHeights;
use std::sync::Arc;

/// Apertures of both masks along z on the device.
#[derive(Debug)]
pub(super) struct Heights {
    lit: Option<LitHeights>,
    landing: Option<EdgesAlongZ>,
    record: Buffer,
    _lists: [Option<Buffer>; 2],
}

impl Heights {
    /// The apertures of a view; `None` of slits.
    pub(super) fn new(device: &Arc<Device>, view: &ViewContext<'_>) -> Result<Option<Self>> {
        if !view.lattice.heights {
            return Ok(None);
        }
        let lit = LitHeights::of(view.optics, view.response.list);
        let landing = EdgesAlongZ::landing(view.optics);
        let tops = lit.as_ref().map_or_else(Vec::new, |lit| in_period(&lit.tops, lit.period));
        let edges = landing.as_ref().map_or_else(Vec::new, |it| in_period(&it.edges, it.period));
        let lists =
            [table(device, "apertures along z", &tops)?, table(device, "edges along z", &edges)?];
        let [tops_at, edges_at] = lists.each_ref().map(address);
        let record = RefinedHeights {
            tops: tops_at,
            edges: edges_at,
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
