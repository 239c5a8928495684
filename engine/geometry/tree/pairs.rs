//! Pairs of triangles that come near each other, leaf by leaf.

use super::super::surface::{Surface, bounds_of};
use super::{LEAF, NONE, Query, Tree, outwards, slab};
use arrayvec::ArrayVec;
use glam::{DVec3, Vec3};

/// Leaves that are compared with another at a time.
const REACHED: usize = 64;

/// A leaf that triangles of another came to.
struct Reached<'a> {
    /// Which of them, bit by bit.
    by: u8,
    /// True if it comes after theirs, or is the same.
    later: bool,
    members: &'a [u32],
    boxes: ArrayVec<[DVec3; 2], LEAF>,
}

/// Triangles of a leaf, each with a search of its own.
struct Searches<'a> {
    surface: &'a Surface,
    /// The triangles.
    own: &'a [u32],
    queries: &'a [Query],
    /// Those that the visit ended.
    ended: [bool; LEAF],
    /// A fan comes together in vertices that all of a leaf have, which [`Query::reaches`] leaves
    /// out: only those triangles are looked for among earlier leaves as well.
    hubs: [u32; 3],
}

impl Tree {
    /// Calls `visit` with triangles of one of the [`Tree::leaves`] and others that come within
    /// `margin` of them, until it returns false. Of all leaves every pair is visited; some of those
    /// with a vertex in common twice.
    ///
    /// Two triangles with one common vertex intersect beyond it only if the opposite side of one hits the
    /// other, so in leaves of long thin triangles only these sides are searched: thousands of triangles
    /// of a fan share one vertex.
    ///
    /// `start`: what [`Tree::start`] gives for the leaf and its neighbours.
    pub(in super::super) fn pairs(
        &self,
        surface: &Surface,
        leaf: u32,
        start: &[u32],
        margin: f64,
        visit: impl FnMut(u32, u32) -> bool,
    ) {
        let node = &self.nodes[leaf as usize];
        // One thin triangle among others has a long box, which the leaf would look through.
        let thin = |one: &u32| slab::across(surface.corners(*one as usize)).is_some();
        if node.band.is_none() && !self.members(node).iter().any(thin) {
            self.pairs_of_leaf(surface, leaf, start, margin, visit);
        } else {
            self.pairs_of_each(surface, leaf, start, margin, visit);
        }
    }

    /// Pairs of a leaf without thin triangles: one search serves all of them.
    fn pairs_of_leaf(
        &self,
        surface: &Surface,
        leaf: u32,
        start: &[u32],
        margin: f64,
        mut visit: impl FnMut(u32, u32) -> bool,
    ) {
        let node = &self.nodes[leaf as usize];
        let own = self.members(node);
        let bounds = |one: u32| bounds_of(surface.corners(one as usize).into_iter());
        let boxes: Vec<[Vec3; 2]> = own.iter().map(|one| outwards(bounds(*one), margin)).collect();
        let corners = own.iter().flat_map(|one| surface.corners(*one as usize));
        let query = Query::of_leaf(node, corners.collect(), margin);
        self.walk(
            start,
            leaf,
            |node| query.reaches(node),
            |other, members| {
                let same = std::ptr::eq(node, other);
                members.iter().enumerate().all(|(k, second)| {
                    let [low, high] = outwards(bounds(*second), 0.0);
                    let ones = own.iter().zip(&boxes).take(if same { k } else { own.len() });
                    ones.filter(|(_, it)| it[0].cmple(high).all() && low.cmple(it[1]).all())
                        .all(|(first, _)| visit(*first, *second))
                })
            },
        );
    }

    /// Pairs of a leaf with thin triangles: each has a search of its own, but they reach about the
    /// same leaves, whose triangles are fetched once.
    fn pairs_of_each(
        &self,
        surface: &Surface,
        leaf: u32,
        start: &[u32],
        margin: f64,
        mut visit: impl FnMut(u32, u32) -> bool,
    ) {
        let node = &self.nodes[leaf as usize];
        let own = self.members(node);
        let query = |first: &u32| {
            let vertices = surface.triangles[*first as usize];
            Query::new(surface.corners(*first as usize), Some(vertices), margin)
        };
        let queries: ArrayVec<Query, LEAF> = own.iter().map(query).collect();
        let hubs = node.band.as_ref().map_or([NONE; 3], |band| band.shared);
        let mut searches = Searches { surface, own, queries: &queries, ended: [false; LEAF], hubs };
        let mut reached = ArrayVec::<Reached<'_>, REACHED>::new();
        let fan = hubs.iter().any(|hub| *hub != NONE);
        self.walk(
            start,
            if fan { 0 } else { leaf },
            |node| queries.iter().any(|query| query.reaches(node)),
            |other, members| {
                let by =
                    queries.iter().rev().fold(0, |by, it| by << 1 | u8::from(it.reaches(other)));
                let corners = |second: &u32| surface.corners(*second as usize).into_iter();
                let boxes = members.iter().map(|second| bounds_of(corners(second))).collect();
                // Leaves come after the nodes before them.
                reached.push(Reached { by, later: other.next >= node.next, members, boxes });
                !reached.is_full() || searches.compare(&mut reached, &mut visit)
            },
        );
        searches.compare(&mut reached, &mut visit);
    }
}

impl Searches<'_> {
    /// Visits the triangles of the leaves that were reached, and forgets these; whether any search
    /// goes on.
    fn compare(
        &mut self,
        reached: &mut ArrayVec<Reached<'_>, REACHED>,
        visit: &mut impl FnMut(u32, u32) -> bool,
    ) -> bool {
        for (number, (first, query)) in self.own.iter().zip(self.queries).enumerate() {
            let of_it = reached.iter().filter(|leaf| leaf.by & 1 << number != 0);
            let mut others = of_it
                .flat_map(|leaf| leaf.members.iter().zip(&leaf.boxes).map(|it| (leaf.later, it)));
            self.ended[number] = self.ended[number]
                || !others.all(|(later, (second, bounds))| {
                    let in_fan = || {
                        let others = self.surface.triangles[*second as usize];
                        others.iter().any(|vertex| self.hubs.contains(vertex))
                    };
                    second == first
                        || !query.meets_box(*bounds)
                        || !(later || in_fan())
                        || query.is_apart(&self.surface.corners(*second as usize))
                        || visit(*first, *second)
                });
        }
        reached.clear();
        !self.ended[..self.own.len()].iter().all(|ended| *ended)
    }
}
