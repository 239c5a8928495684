//! The lattice of cells: positions of beamlets in the cell plane, the rays that bound their cells, and
//! their landing points. All in f64 on the host; the device gets offsets inside an index.

use super::row_spread::RowSpread;
use beamlet_core::numbers::{self, single};
use beamlet_interface::{BeamletGeometry, Ray};
use beamlet_model::optics::{DetectorPlane, Mask, Optics};
use std::ops::Range;

/// The lattice of cells of a scene.
#[derive(Debug, Clone, PartialEq)]
pub struct Lattice {
    /// Distance of the cell plane from the source, m.
    pub plane: f64,
    /// Period in the cell plane, m.
    pub period: f64,
    /// Displacement of the lattice along x, m.
    pub offset: f64,
    /// Cells per period, about.
    pub cells: u32,
    /// Beamlets whose light may reach the detector.
    pub beamlets: Range<i64>,
    /// Beamlets among them that reach it without a deflection.
    pub direct: Range<i64>,
    /// Rows beyond a band (or the detector) whose light may reach it.
    pub halo: i64,
    /// Columns beside the detector whose light may reach it.
    pub halo_columns: i64,
    /// Rows that the spot blurs what lies at the rotation centre over, on either side.
    pub blur_rows: i64,
    /// Least blur of light at edges on the analyser, standard deviation, m.
    pub edge_blur: f64,
    /// Rows in a block that see the bars of masks under one angle
    /// (`illuminate::alike_rows`); blocks begin at multiples of it.
    pub alike_rows: u32,
    /// Apertures of masks end along z: where light of a cell is along z matters everywhere, not at the borders of
    /// rows alone.
    pub(crate) heights: bool,
    /// The same reach in columns and rows, not rounded.
    pub(super) blur: [f64; 2],
    /// How cells spread over rows.
    pub(super) row_spread: RowSpread,
    /// Distance from source to rotation centre, m.
    rotation: f64,
    /// The plane that rays are followed to.
    pub(crate) detector: DetectorPlane,
}

/// Largest distance over which the sample deflects light, in x and z on the detector, m: total reflection happens up to a
/// grazing angle of sqrt(2 delta) and deflects by twice it.
fn max_deflection(optics: &Optics, delta: f64) -> f64 {
    2.0 * (2.0 * delta.abs()).sqrt() * (optics.detector.distance - optics.rotation)
}

/// Least standard deviation of the blur at any edge on the analyser, m: of the detector mask, or
/// of pixels.
fn edge_blur(optics: &Optics) -> f64 {
    let spot = optics.spot.narrowest(0);
    let magnified = |distance: f64| spot * (distance / optics.rotation - 1.0);
    let (analyser, detector) = (optics.analyser, optics.detector.distance);
    if optics.detector_mask.is_some() {
        magnified(analyser)
    } else {
        magnified(detector) * analyser / detector
    }
}

impl Lattice {
    /// The lattice of optics around a sample whose strongest material has this delta.
    #[must_use]
    pub fn of(optics: &Optics, delta: f64) -> Self {
        let plane = optics.cell_plane;
        let (detector, pitch) = (optics.detector.distance, optics.detector.pitch);
        let openings = optics.beamlets();
        let (period, offset) = (openings.period[0], openings.offset);
        let cells = cells_of(period, openings.narrowest(0));
        let deflection = max_deflection(optics, delta);
        let spot = &optics.spot;
        let reach = spot.reach();
        let spread = |axis: usize, from: f64| reach[axis] * (detector - from) / from;
        let shift = optics.offsets.lists().iter().flatten().fold(0.0_f64, |m, f| m.max(f.abs()));
        let direct = (shift + period) * detector / plane + spread(0, plane);
        let step = period * detector / plane;
        let middle = optics.detector.half(0) - 0.5 - offset / period;
        let within = |reach: f64| {
            let half = (optics.detector.extent(0) / 2.0 + reach) / step;
            numbers::whole::<i64>((middle - half).floor())
                ..numbers::whole::<i64>((middle + half).ceil()) + 1
        };
        let beamlets = within(direct + deflection);
        let direct = within(direct);
        let blur = [0, 1].map(|axis| spread(axis, optics.rotation) / pitch[axis]);
        // Cells hold the rows' shares of the first part of the spot.
        let first = spot.parts().iter().find(|part| part.weight > 0.0);
        let first = first.map_or(0.0, |part| beamlet_model::spot::deviation(part.fwhm[1]));
        let row_blur = optics.rows_of_source(first);
        let halo = numbers::whole::<i64>((deflection / pitch[1] + blur[1]).ceil());
        Self {
            plane,
            period,
            offset,
            cells,
            beamlets,
            direct,
            halo,
            halo_columns: numbers::whole::<i64>((deflection / pitch[0] + blur[0]).ceil()),
            blur_rows: numbers::whole::<i64>(blur[1].ceil()),
            edge_blur: edge_blur(optics),
            alike_rows: 1,
            heights: optics.has_heights(),
            blur,
            row_spread: RowSpread { blur: row_blur },
            rotation: optics.rotation,
            detector: optics.detector,
        }
    }

    /// Rows whose light may reach the detector.
    #[must_use]
    pub(crate) fn rows(&self) -> Range<i64> {
        -self.halo - self.blur_rows..i64::from(self.detector.pixels[1]) + self.halo + self.blur_rows
    }

    /// x of a beamlet's centre in the cell plane, m.
    #[must_use]
    pub fn centre(&self, beamlet: i64) -> f64 {
        (beamlet as f64 + 0.5 - self.detector.half(0)) * self.period + self.offset
    }

    /// Slopes along x and z of the ray of [`Self::ray`].
    pub(crate) fn slopes(&self, beamlet: i64, x: f64, row: f64) -> [f64; 2] {
        self.slopes_at(self.centre(beamlet) + x, row)
    }

    /// Slopes along x and z of the ray through x of the cell plane, m, that reaches the detector at a row coordinate.
    pub(crate) fn slopes_at(&self, x: f64, row: f64) -> [f64; 2] {
        [x / self.plane, self.detector.slope_of_row(row)]
    }

    /// The ray from the source centre through `x` of a beamlet (m, from its centre, in the cell
    /// plane) that reaches the detector at row coordinate `row` (downwards, 0 on top).
    #[must_use]
    pub fn ray(&self, beamlet: i64, x: f64, row: f64, pose: u32) -> Ray {
        let [slope_x, slope_z] = self.slopes(beamlet, x, row);
        Ray {
            x: single(slope_x * self.rotation),
            z: single(slope_z * self.rotation),
            slope_x: single(slope_x),
            slope_z: single(slope_z),
            pose,
            key: 0,
        }
    }

    /// x in the cell plane and row coordinate of the straight line from the source through a
    /// point of the beam frame (m).
    #[must_use]
    pub fn project(&self, x: f64, y: f64, z: f64) -> [f64; 2] {
        let distance = self.rotation + y;
        [x * self.plane / distance, self.detector.row_at(z, distance)]
    }

    /// Row coordinate of rays of a slope along z.
    pub(crate) fn row_of_slope(&self, slope: f64) -> f64 {
        self.detector.row_at(slope, 1.0)
    }

    /// Distance from source to rotation centre, m.
    pub(crate) const fn source(&self) -> f64 {
        self.rotation
    }

    /// Standard deviation of the blur over rows, rows.
    pub(crate) const fn row_blur(&self) -> f64 {
        self.row_spread.blur
    }

    /// True if it takes light of a line beyond the rows beside.
    pub(crate) fn has_wide_row_blur(&self) -> bool {
        self.row_spread.is_wide()
    }

    /// Shares of light spread evenly over [top, bottom] of a row that land in the row above and
    /// below, moved down by `down` rows; -1 and 0 where light lands farther off.
    #[must_use]
    pub fn row_shares(&self, top: f64, bottom: f64, down: f64) -> [f32; 2] {
        self.row_spread.shares(top, bottom, down).unwrap_or([-1.0, 0.0])
    }

    /// True if all light of an interval of a row lands in the row and the two beside it.
    pub(crate) fn lands_beside(&self, low: f64, high: f64) -> bool {
        self.row_spread.lands_beside(low, high)
    }

    /// Share of light that is even over an interval of row coordinates, and blurred, that lands in some rows.
    pub(crate) fn share_in_rows(&self, [top, bottom]: [f64; 2], rows: &Range<i64>) -> f64 {
        let before = |border: i64| self.row_spread.share_below(border as f64, top, bottom);
        before(rows.end) - before(rows.start)
    }

    /// Integrals over an interval of a row of light that falls from 1 to 0 and of light that rises from 0 to 1, as far
    /// as it lands in the row `down` rows below, moved down by `shift` rows.
    #[must_use]
    pub(crate) fn linear_in_row(&self, ends: [f64; 2], shift: f64, down: i64) -> [f64; 2] {
        let moved = ends.map(|end| end + shift);
        let below = |border: i64| self.row_spread.linear_below(border as f64, moved);
        let [before, after] = [below(down), below(down + 1)];
        [0, 1].map(|part| after[part] - before[part])
    }

    /// Shares of the light of a line that land in the row above and in the row below, moved down by `down` rows;
    /// nothing where light lands farther off. `parts`: intervals over which the light is linear, and what it is at
    /// their ends.
    pub(crate) fn line_shares(
        &self,
        parts: &[([f64; 2], [f64; 2])],
        down: f64,
    ) -> Option<[f32; 2]> {
        let top = parts.first()?.0[0] + down;
        let bottom = parts.last()?.0[1] + down;
        if !self.lands_beside(top, bottom) {
            return None;
        }
        let reach = self.row_spread.reach();
        let before = |border: f64| {
            let of_part = |(ends, light): &([f64; 2], [f64; 2])| {
                let [falls, rises] =
                    self.row_spread.linear_below(border, ends.map(|end| end + down));
                light[0] * falls + light[1] * rises
            };
            parts.iter().map(of_part).sum::<f64>()
        };
        let whole: f64 = parts
            .iter()
            .map(|(ends, light)| 0.5 * (ends[1] - ends[0]) * (light[0] + light[1]))
            .sum();
        let above = if top < reach { before(0.0) / whole } else { 0.0 };
        let below = if bottom > 1.0 - reach { 1.0 - before(1.0) / whole } else { 0.0 };
        Some([above, below].map(|share| single(share.clamp(0.0, 1.0))))
    }

    /// The beamlet in whose period x (m, in the cell plane) lies.
    #[must_use]
    pub fn beamlet_at(&self, x: f64) -> i64 {
        numbers::whole::<i64>(((x - self.offset) / self.period + self.detector.half(0)).floor())
    }

    /// The lattice with this many of its periods in one.
    #[must_use]
    pub(crate) fn in_groups(&self, count: u32) -> Self {
        if count == 1 {
            return self.clone();
        }
        let grouped = Self { period: self.period * f64::from(count), ..self.clone() };
        let of = |all: &Range<i64>| {
            let [low, high] =
                [all.start, all.end - 1].map(|it| grouped.beamlet_at(self.centre(it)));
            low..high + 1
        };
        let [beamlets, direct] = [of(&self.beamlets), of(&self.direct)];
        Self { beamlets, direct, ..grouped }
    }

    /// The lattice without its reach along x, rows that are alike, and width of cells, in which lattices of one walk may
    /// differ.
    pub(crate) fn without_reach(self) -> Self {
        Self { cells: 1, alike_rows: 1, beamlets: 0..0, direct: 0..0, ..self }
    }

    /// The lattice with the beamlets of another one as well, from which it differs as [`Self::without_reach`] says.
    pub(crate) fn covering(&self, other: &Self) -> Self {
        let both = |a: &Range<i64>, b: &Range<i64>| a.start.min(b.start)..a.end.max(b.end);
        Self {
            cells: self.cells.max(other.cells),
            // Powers of two.
            alike_rows: self.alike_rows.min(other.alike_rows),
            beamlets: both(&self.beamlets, &other.beamlets),
            direct: both(&self.direct, &other.direct),
            ..self.clone()
        }
    }

    /// Column of a beamlet: its place in `beamlets`.
    pub(crate) fn column(&self, beamlet: i64) -> usize {
        numbers::narrow::<usize>(beamlet - self.beamlets.start)
    }

    /// Beamlets that an interval of x in the cell plane touches.
    #[must_use]
    pub fn beamlets_of(&self, x: [f64; 2]) -> Range<i64> {
        let [first, last] = x.map(|x| self.beamlet_at(x));
        first.max(self.beamlets.start)..(last + 1).min(self.beamlets.end)
    }

    /// Table of the beamlets, in the order of `self.beamlets`.
    #[must_use]
    pub fn beamlet_geometry(&self, optics: &Optics) -> Vec<BeamletGeometry> {
        let of = |beamlet| beamlet_geometry(optics, self.centre(beamlet) / self.plane);
        self.beamlets.clone().map(of).collect()
    }
}

/// The part of the geometry that depends on the direction of a beamlet's (or pixel's) central ray alone.
pub fn beamlet_geometry(optics: &Optics, slope: f64) -> BeamletGeometry {
    let [pixel, pixel_offset] = optics.detector.column_of_slope(slope, optics.analyser);
    let off = |mask: &Option<Mask>, plane: f64| {
        mask.as_ref().map_or(0.0, |mask| mask.off_centre(slope, plane))
    };
    BeamletGeometry {
        pixel: numbers::whole::<i32>(pixel),
        pixel_offset: single(pixel_offset),
        aperture_offset: single(off(&optics.detector_mask, optics.analyser)),
        sample_offset: single(off(&optics.sample_mask, optics.cell_plane)),
        slope: single(slope),
    }
}

/// Cells of a period, about, by which memory is reckoned: two to the narrowest opening, and 6 to 64 in all.
fn cells_of(period: f64, opening: f64) -> u32 {
    numbers::whole::<u32>((2.0 * period / opening).ceil()).clamp(6, 64)
}
