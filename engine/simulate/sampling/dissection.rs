//! Pieces of a rectangle: the overlay of its facets. In each piece the same facets are crossed by
//! all rays, so that the first order is exact: displacement is constant, optical depth linear.
//! Silhouettes and folds need no more than that.

use super::facet_means::{EDGE_ON, FacetMeans, result_of};
use super::layout::stand;
use super::patch::{Patch, middle};
use super::patch_facet::{Overlap, PatchFacet};
use super::piece::Piece;
use super::polygon::{Area, AreaMoments, CuttingLine, NEAR, Polygon, Side};
use super::row_spread::{Crossed, PieceRows};
use super::sheets::{Met, flags};
use arrayvec::ArrayVec;
use beamlet_core::numbers::single;

/// Rectangles with more facets are split instead: an overlay takes time by the square of them.
pub(super) const MOST_FACETS: usize = 32;
/// Most regions while facets are laid over one another.
const MOST_REGIONS: usize = 256;
/// Most facets over a region, beside those that fill the rectangle.
const MOST_LAYERS: usize = 12;
/// Difference between a triangle and the interval of its variance.
const TRIANGLE: f64 = 0.6;
/// Pieces are taken to be at least as wide and high as this share of the rectangle.
const THINNEST: f64 = 1e-3;
/// Pieces with less light than this fraction of the first-order remainder of a rectangle have no displacement if
/// their landing row is unknown.
const NOTHING: f64 = 1e-2;
/// Largest share of the rectangle that is left out: pieces that are edge-on or not in balance.
const SLIVER: f64 = 1e-5;
/// Pieces fill the rectangle to this.
const WHOLE: f64 = 1e-7;

/// A region while facets are laid over one another.
#[derive(Debug, Clone)]
struct Region {
    polygon: Polygon,
    facets: ArrayVec<u32, MOST_LAYERS>,
}

impl FacetMeans<'_> {
    /// The pieces of a rectangle, `list` being the facets that may touch it; nothing where they
    /// are too many or the facets are not sound.
    pub(super) fn pieces(
        &self,
        patch: &Patch,
        list: &[u32],
        x: [f32; 2],
        z: [f32; 2],
    ) -> Option<Vec<Piece>> {
        if list.len() > MOST_FACETS {
            return None;
        }
        let all = patch.facets.as_ref()?;
        let [centre, half] = middle(x, z);
        let whole = Area::of_rectangle(centre, half).area;
        let rectangle = Polygon::rectangle(half);
        let mut regions = vec![Region { polygon: rectangle, facets: ArrayVec::new() }];
        let mut filling = Vec::new();
        for index in list {
            let facet = &all[*index as usize];
            match facet.overlap(centre, half) {
                Overlap::None => {}
                Overlap::All => filling.push(*index),
                Overlap::Part => {
                    let area = Area::within(&facet.corners, centre, half).area;
                    if area > EDGE_ON * whole {
                        lay(facet, *index, centre, half, &mut regions)?;
                    }
                }
            }
        }
        // Regions with the same facets are one piece; what none covers need not hang together.
        regions.sort_by(|a, b| a.facets.cmp(&b.facets));
        let mut pieces = Vec::new();
        let (mut covered, mut left_out) = (0.0, 0.0);
        let same = |a: &Region, b: &Region| a.facets == b.facets && !a.facets.is_empty();
        for group in regions.chunk_by(same) {
            let mut moments = AreaMoments::NONE;
            for region in group {
                let area = region.polygon.area();
                if area.area > 0.0 {
                    moments.add(&region.polygon, &area);
                }
            }
            covered += moments.area;
            let facets = filling.iter().chain(&group[0].facets);
            let facets: ArrayVec<&PatchFacet, { 2 * MOST_FACETS }> =
                facets.map(|index| &all[*index as usize]).collect();
            let polygons = || group.iter().map(|region| &region.polygon);
            let sized = moments.area > EDGE_ON * whole;
            let piece =
                sized.then(|| self.piece(patch, &facets, (&moments, polygons), [centre, half]));
            match piece.flatten() {
                Some(piece) => pieces.push(piece),
                // Facets seen edge-on are dropped; the facets that balance them are as thin.
                None => left_out += moments.area,
            }
        }
        // The other pieces fill the place of those that are left out.
        let fills = left_out <= SLIVER * whole && (covered - whole).abs() <= WHOLE * whole;
        if pieces.is_empty() || !fills {
            return None;
        }
        let mut order: Vec<usize> = (0..pieces.len()).collect();
        stand(&mut pieces, &mut order, x, z);
        pieces.iter_mut().for_each(|piece| piece.move_down(z));
        Some(pieces)
    }

    /// The piece that these facets cover; nothing where they do not balance.
    fn piece<'p, I: Iterator<Item = &'p Polygon>>(
        &self,
        patch: &Patch,
        facets: &[&PatchFacet],
        (moments, polygons): (&AreaMoments, impl Fn() -> I),
        [centre, rectangle]: [[f64; 2]; 2],
    ) -> Option<Piece> {
        let (from_centre, [xx, zz]) = moments.about_centroid();
        let centroid = [centre[0] + from_centre[0], centre[1] + from_centre[1]];
        let mut met = Met::default();
        let mut numbers = [0.0; 5];
        let (mut rise, mut error, mut share) = ([0.0; 2], 0.0, 1.0_f64);
        for facet in facets {
            let added = self.added(patch, facet, centroid);
            for (sum, number) in numbers.iter_mut().zip(added.numbers) {
                *sum += number;
            }
            rise = [rise[0] + added.rise[0], rise[1] + added.rise[1]];
            error += added.error();
            share = share.min(added.share);
            met.add(self.steps[facet.component as usize].hash, facet.front, 1);
        }
        // Mean light over z, as for an interval.
        let rise_z = rise[1].abs() * (3.0 * zz).sqrt();
        numbers[0] -= log_sinhc(rise_z).min(numbers[0].max(0.0));
        let finite = numbers.iter().chain(&rise).all(|number| number.is_finite());
        if met.balance != 0 || !finite {
            return None;
        }
        let light = moments.area * self.weight * (-numbers[0]).exp();
        let dark = error > self.far && light < NOTHING * self.light;
        if dark {
            numbers[1..].fill(0.0);
        }
        let result = result_of(numbers, met.signature, flags(share), met.crossings);
        let by_ray = !dark
            && share < 1.0
            && (self.strict
                || error > self.far
                || error > self.displacement && light * error * self.steepest > self.light);
        let interval = |axis: usize, variance: f64| {
            let [low, high] = moments.reach[axis];
            let own = [from_centre[axis] - low, high - from_centre[axis]];
            let least = THINNEST * rectangle[axis];
            let half = (3.0 * variance).sqrt().max(least);
            let unlike: f64 = own.iter().map(|own| (own / half - 1.0).abs()).sum();
            (half.min(own[0]).min(own[1]).max(least), single((unlike / 2.0 / TRIANGLE).min(1.0)))
        };
        let (_, outline_x) = interval(0, xx);
        let (high, outline_z) = interval(1, zz);
        let whole = [centroid[1] - high, centroid[1] + high];
        let down = -f64::from(result.landing_z(self.gap)) / self.row_pitch;
        Some(Piece {
            x: [0.0; 2],
            z: [0.0; 2],
            share: single(0.25 * moments.area / (rectangle[0] * rectangle[1])),
            centroid: centroid.map(single),
            bounds: std::array::from_fn(|axis| {
                moments.reach[axis].map(|at| single(centre[axis] + at))
            }),
            variance: single(xx),
            result,
            rows: self.rows_of(moments, polygons, [whole, [centre[1], rise[1]]], down),
            outline: [outline_x, outline_z],
            slope_depth: single(rise[0]),
            by_ray,
        })
    }

    /// Light of a piece that crosses the borders of its row after a displacement by `down` rows. `whole`:
    /// its interval; polygons are relative to `centre`; optical depth changes by `rise` per row.
    fn rows_of<'p, I: Iterator<Item = &'p Polygon>>(
        &self,
        moments: &AreaMoments,
        polygons: impl Fn() -> I,
        [whole, [centre, rise]]: [[f64; 2]; 2],
        down: f64,
    ) -> PieceRows {
        let [low, high] = moments.reach[1];
        let steepest = 1.0 / (high - low).max(f64::MIN_POSITIVE);
        let fall = -rise.clamp(-steepest, steepest);
        let border = |side: usize| {
            let towards = if side == 0 { -1.0 } else { 1.0 };
            let inner = |z: f64| if side == 0 { z + down } else { 1.0 - z - down };
            let mut crossed = Crossed::default();
            for polygon in polygons() {
                let corners = polygon.corners().iter().map(|[x, z]| [*x, inner(centre + z)]);
                self.lattice.row_spread.add_crossed(corners, &mut crossed);
            }
            // Light changes along z.
            let own = inner(0.5 * (whole[0] + whole[1]));
            let per_distance = towards * fall;
            let brighter = per_distance * (own * crossed.light - crossed.by_distance);
            let share = ((crossed.light + brighter) / moments.area).clamp(0.0, 1.0);
            (share, towards * crossed.rise / moments.area)
        };
        let [above, below] = [border(0), border(1)];
        let (_, [_, variance]) = moments.about_centroid();
        PieceRows {
            whole,
            centroid: 0.5 * (whole[0] + whole[1]) + fall * variance,
            down,
            shares: [above.0, below.0],
            rises: [above.1, below.1],
        }
    }
}

/// Logarithm of sinh(x) / x, for x of 0 or more.
fn log_sinhc(x: f64) -> f64 {
    if x < 1e-2 {
        return x * x / 6.0;
    }
    x - (2.0 * x / (1.0 - libm::exp(-2.0 * x))).ln()
}

/// Lays a facet over regions, and cuts those that it covers a part of; nothing where they become
/// too many.
fn lay(
    facet: &PatchFacet,
    index: u32,
    centre: [f64; 2],
    half: [f64; 2],
    regions: &mut Vec<Region>,
) -> Option<()> {
    let lines = facet.edges.map(|[a, b, c]| CuttingLine {
        numbers: [a, b, a * centre[0] + b * centre[1] + c],
        near: NEAR * (a.abs() * half[0] + b.abs() * half[1]),
    });
    for number in 0..regions.len() {
        let sides = lines.map(|line| regions[number].polygon.side(&line));
        if sides.contains(&Side::Outside) {
            continue;
        }
        let (mut rest, mut disjoint) = (regions[number].polygon.clone(), false);
        let mut outside = ArrayVec::<Polygon, 3>::new();
        for line in &lines {
            match rest.side(line) {
                Side::Inside => {}
                Side::Outside => disjoint = true,
                Side::Across => outside.push(rest.split(line)),
            }
        }
        if disjoint {
            continue;
        }
        let facets = regions[number].facets.clone();
        let part = |polygon: Polygon| Region { polygon, facets: facets.clone() };
        regions.extend(outside.into_iter().map(part));
        regions[number].polygon = rest;
        regions[number].facets.try_push(index).ok()?;
    }
    (regions.len() <= MOST_REGIONS).then_some(())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn facet(corners: [[f64; 2]; 3]) -> PatchFacet {
        let mut facet = PatchFacet::flat(corners);
        facet.set_edges();
        facet
    }

    fn regions_of(facets: &[PatchFacet]) -> Vec<Region> {
        let (centre, half) = ([0.3, 0.5], [1.0, 0.5]);
        let mut regions =
            vec![Region { polygon: Polygon::rectangle(half), facets: ArrayVec::new() }];
        for (index, facet) in (0..).zip(facets) {
            lay(facet, index, centre, half, &mut regions).expect("few regions");
        }
        regions
    }

    fn area_where(regions: &[Region], of: impl Fn(&[u32]) -> bool) -> f64 {
        regions.iter().filter(|r| of(&r.facets)).map(|r| r.polygon.area().area).sum()
    }

    /// Two sheets of two facets each that cross one another, and a wedge over a corner: areas
    /// against the closed form, to rounding.
    #[test]
    fn regions_are_what_facets_share() {
        let sheet = |flip: bool| {
            let [a, b, c, d] = [[-0.7, 0.0], [1.3, 0.0], [1.3, 1.0], [-0.7, 1.0]];
            if flip {
                [facet([a, b, c]), facet([a, c, d])]
            } else {
                [facet([a, b, d]), facet([b, c, d])]
            }
        };
        let [p, q] = sheet(true);
        let [r, s] = sheet(false);
        let regions = regions_of(&[p, q, r, s]);
        assert!((area_where(&regions, |_| true) - 2.0).abs() < 1e-12);
        // Two diagonals cut a rectangle into four triangles of the same area.
        for pair in [[0, 2], [0, 3], [1, 2], [1, 3]] {
            let area = area_where(&regions, |facets| facets == pair);
            assert!((area - 0.5).abs() < 1e-12, "{pair:?} {area}");
        }
        let corner = facet([[-0.7, 0.0], [0.3, 0.0], [-0.7, 0.5]]);
        let regions = regions_of(&[corner]);
        assert!((area_where(&regions, |facets| facets == [0]) - 0.25).abs() < 1e-12);
        assert!((area_where(&regions, <[u32]>::is_empty) - 1.75).abs() < 1e-12);
    }

    /// A facet that touches a rectangle only beyond its edges leaves it whole.
    #[test]
    fn a_facet_beside_a_region_does_not_cut_it() {
        let regions = regions_of(&[facet([[-2.0, -0.6], [-0.9, 0.5], [-2.0, 1.6]])]);
        assert_eq!(regions.len(), 1);
    }

    /// The mean of e^-depth over an interval that depth rises over by 2 x is e^-depth sinhc(x).
    #[test]
    fn the_logarithm_of_the_mean_light_is_that_of_its_sum() {
        for x in [1e-3, 0.0099, 0.0101, 0.5, 3.0, 40.0] {
            let steps = 200_000;
            let at = |i: i32| (2.0 * (f64::from(i) + 0.5) / f64::from(steps) - 1.0) * x;
            let mean = (0..steps).map(|i| at(i).exp()).sum::<f64>() / f64::from(steps);
            assert!((log_sinhc(x) - mean.ln()).abs() < 1e-8, "{x}");
        }
    }
}
