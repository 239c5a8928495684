//! Tables of a view that stay on the device: beamlets, openings of the sample mask, and windows.

use super::heights::Heights;
use crate::sampling::{Response, ViewContext};
use beamlet_core::Result;
use beamlet_core::numbers::{self, single};
use beamlet_gpu::{Buffer, Device};
use beamlet_interface::{MaskOpening, RefinedColumn, RefinedRow, WindowTable};
use std::ops::Range;
use std::sync::Arc;

/// Tables of the mask offsets of a view.
#[derive(Debug)]
pub(super) struct Tables {
    pub(super) columns: Buffer,
    openings: Option<Buffer>,
    pub(super) opening_count: u32,
    windows: Option<Buffer>,
    pub(super) window_count: u32,
    /// Largest width that a step opens, m.
    pub(super) open_width: f32,
    /// Apertures that end along z.
    heights: Option<Heights>,
    /// Light behind the sample under a spectrum.
    hardening: Option<Buffer>,
    _values: Vec<Buffer>,
}

/// The nearest f32, and what is left.
fn in_two(value: f64) -> [f32; 2] {
    let near = single(value);
    [near, single(value - f64::from(near))]
}

impl Tables {
    pub(super) fn new(device: &Arc<Device>, view: &ViewContext<'_>) -> Result<Self> {
        let (lattice, response) = (view.lattice, view.response);
        let rotation = view.optics.rotation;
        let column = |(index, beamlet): (usize, i64)| {
            let slope = lattice.centre(beamlet) / lattice.plane;
            let ([slope_near, slope_rest], [x, x_rest]) = (in_two(slope), in_two(slope * rotation));
            RefinedColumn {
                slope: slope_near,
                slope_rest,
                x,
                x_rest,
                landing: response.landings(index),
                mask_offset: response.mask_offset[index],
                shadow: response.shadow[index],
            }
        };
        let columns: Vec<RefinedColumn> = (0..).zip(lattice.beamlets.clone()).map(column).collect();
        let openings: Vec<MaskOpening> = response
            .openings
            .iter()
            .map(|opening| MaskOpening {
                step: opening.step,
                low: opening.x[0],
                high: opening.x[1],
                period: response.pattern,
            })
            .collect();
        let mut values = Vec::new();
        let mut windows = Vec::new();
        for kind in &response.windows {
            let numbers = kind.numbers();
            let buffer = device.upload("windows on the analyser", &numbers)?;
            windows.push(WindowTable {
                values: buffer.address(),
                count: numbers::count(numbers.len()),
                is_sharp: kind.is_sharp().into(),
                period: kind.period,
                share: kind.share,
            });
            values.push(buffer);
        }
        Ok(Self {
            columns: device.upload("beamlets of patches", &columns)?,
            opening_count: numbers::count(openings.len()),
            openings: table(device, "openings by mask step", &openings)?,
            window_count: numbers::count(windows.len()),
            windows: table(device, "kinds of windows", &windows)?,
            open_width: widest(response, single(lattice.period)),
            heights: Heights::new(device, view)?,
            hardening: table(device, "optical depths of a spectrum", response.hardening.table())?,
            _values: values,
        })
    }

    /// Address of the apertures that end along z; 0 of slits.
    pub(super) fn heights(&self) -> u64 {
        self.heights.as_ref().map_or(0, Heights::address)
    }

    /// Addresses of the openings, the windows, and the optical depths of a spectrum; 0: none.
    pub(super) fn addresses(&self) -> [u64; 3] {
        [&self.openings, &self.windows, &self.hardening].map(address)
    }

    /// Rows of the detector, as rays and masks need them.
    pub(super) fn rows(&self, view: &ViewContext<'_>, rows: Range<i32>) -> Vec<RefinedRow> {
        let detector = &view.lattice.detector;
        let row = |row: i32| {
            let slope = detector.slope_of_row(row.into());
            let ([slope, slope_rest], [z, z_rest]) =
                (in_two(slope), in_two(slope * view.optics.rotation));
            let places = self.heights.as_ref().map(|heights| heights.places(row));
            let [lit_place, landing_place] = places.unwrap_or_default();
            RefinedRow { slope, slope_rest, z, z_rest, lit_place, landing_place }
        };
        rows.map(row).collect()
    }
}

/// A table on the device; none where it is empty.
pub(super) fn table<T: bytemuck::Pod>(
    device: &Arc<Device>,
    name: &str,
    table: &[T],
) -> Result<Option<Buffer>> {
    (!table.is_empty()).then(|| device.upload(name, table)).transpose()
}

/// Address of a table; 0 of none.
pub(super) fn address(table: &Option<Buffer>) -> u64 {
    table.as_ref().map_or(0, Buffer::address)
}

/// Largest width that a step opens, m: of a period at most, the mean of the periods of all shifts.
fn widest(response: &Response, period: f32) -> f32 {
    let of_step = |step: &[crate::sampling::Opening]| -> f32 {
        step.iter().map(|opening| opening.x[1] - opening.x[0]).sum()
    };
    let steps = response.openings.chunk_by(|a, b| a.step == b.step).map(of_step);
    let share = period / response.pattern;
    steps.reduce(f32::max).map_or(period, |width| (width * share).min(period))
}
