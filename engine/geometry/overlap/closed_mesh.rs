//! Booleans of closed meshes in f64: the one place that knows the library.

use glam::DVec3;
use manifold_rust::cancel::CancelToken;
use manifold_rust::manifold::Manifold;
use manifold_rust::types::{self, BooleanEngine, MeshGLP, OpType};
use rayon::prelude::*;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use super::super::surface::{Surface, bounds_of};
use super::closing::closed;
use beamlet_core::error::{Error, Result};
use beamlet_core::watch::Task;
use beamlet_core::{numbers, reserve};

/// Peak bytes per triangle of both operands, as measured.
pub const PEAK_PER_CUT_TRIANGLE: u64 = 560;
/// Triangles above which somebody may want to cancel a boolean of clean meshes.
const SLOW: usize = 20_000;
/// Time between two looks at whether to stop.
const TICK: Duration = Duration::from_millis(50);

/// A closed mesh as the library takes it.
#[derive(Clone)]
pub(crate) struct ClosedMesh {
    mesh: Manifold,
    /// Holes that were closed.
    pub(super) holes: usize,
    /// The fast engine takes it: every edge has two triangles, and none pass through others.
    clean: bool,
}

impl ClosedMesh {
    /// Takes a surface, oriented outwards; `clean`: that is closed and passes through itself nowhere.
    /// Holes of others are closed with flat covers.
    pub(crate) fn of(surface: &Surface, clean: bool) -> Self {
        let patched;
        let (surface, holes) = if clean {
            (surface, 0)
        } else {
            patched = closed(surface);
            (&patched.0, patched.1)
        };
        let mesh = MeshGLP::<f64, u32> {
            num_prop: 3,
            vert_properties: surface.vertices.iter().flat_map(|it| it.to_array()).collect(),
            tri_verts: surface.triangles.as_flattened().to_vec(),
            ..Default::default()
        };
        // An input that the library does not expect ends one object, not the program.
        let taken = |take: fn(&MeshGLP<f64, u32>) -> Manifold| {
            catch_unwind(|| take(&mesh))
                .unwrap_or_else(|_| Manifold::make_empty(types::Error::InvalidConstruction))
        };
        if clean {
            let mesh = taken(Manifold::from_mesh_glp);
            if mesh.status() == types::Error::NoError {
                return Self { mesh, holes, clean };
            }
        }
        Self { mesh: taken(Manifold::from_mesh_glp_robust), holes, clean: false }
    }

    /// Its remainder outside `other`; `failed` makes the error of a failure.
    ///
    /// # Errors
    /// Of `failed`; [`Error::Memory`]; [`Error::Interrupted`].
    pub(crate) fn less(
        &self,
        other: &Self,
        task: Task<'_>,
        failed: impl Fn(String) -> Error,
    ) -> Result<Self> {
        self.combine(other, OpType::Subtract, task, failed)
    }

    /// Its intersection with `other`.
    ///
    /// # Errors
    /// As [`ClosedMesh::less`].
    pub(super) fn and(
        &self,
        other: &Self,
        task: Task<'_>,
        failed: impl Fn(String) -> Error,
    ) -> Result<Self> {
        self.combine(other, OpType::Intersect, task, failed)
    }

    /// Several surfaces as one, those that lie together in the list first; `clean`: as of
    /// [`ClosedMesh::of`].
    ///
    /// # Errors
    /// As [`ClosedMesh::less`].
    pub(crate) fn united(
        surfaces: &[Surface],
        clean: bool,
        task: Task<'_>,
        failed: &(impl Fn(String) -> Error + Sync),
    ) -> Result<Surface> {
        let meshes = surfaces.par_iter().map(|surface| Self::of(surface, clean)).collect();
        Self::sum(meshes, task, failed)
    }

    /// Several meshes as one, those that lie together in the list first.
    ///
    /// # Errors
    /// As [`ClosedMesh::less`].
    pub(crate) fn sum(
        mut meshes: Vec<Self>,
        task: Task<'_>,
        failed: &(impl Fn(String) -> Error + Sync),
    ) -> Result<Surface> {
        while meshes.len() > 1 {
            if task.is_cancelled() {
                return Err(Error::Interrupted);
            }
            let both = |pair: &[Self]| match pair {
                [one, other] => one.combine(other, OpType::Add, task, failed),
                _ => Ok(pair[0].clone()),
            };
            meshes = meshes.par_chunks(2).map(both).collect::<Result<_>>()?;
        }
        Ok(meshes.first().map_or_else(Surface::default, Self::surface))
    }

    /// Mean thickness, m: twice the volume over the area; 0 of nothing.
    pub(super) fn thickness(&self) -> f64 {
        let (volume, area) = (self.mesh.volume(), self.mesh.surface_area());
        if area > 0.0 { 2.0 * volume / area } else { 0.0 }
    }

    fn combine(
        &self,
        other: &Self,
        operation: OpType,
        task: Task<'_>,
        failed: impl Fn(String) -> Error,
    ) -> Result<Self> {
        for operand in [self, other] {
            if operand.mesh.status() != types::Error::NoError {
                return Err(failed(operand.mesh.status().to_str().to_lowercase()));
            }
        }
        let triangles = self.mesh.num_tri() + other.mesh.num_tri();
        let needed = PEAK_PER_CUT_TRIANGLE.saturating_mul(triangles as u64);
        reserve::ask(needed, "cutting objects that overlap", reserve::REMEDY)?;
        let clean = self.clean && other.clean;
        let engine = if clean { BooleanEngine::Exact } else { BooleanEngine::Robust };
        let token = CancelToken::new();
        let work = || {
            catch_unwind(AssertUnwindSafe(|| {
                self.mesh.boolean_with_engine_and_token(
                    &other.mesh,
                    operation,
                    engine,
                    Some(&token),
                )
            }))
        };
        let made = if clean && triangles < SLOW { work() } else { watched(work, &token, task) };
        let made = made.map_err(|_| failed("the boolean operation failed".to_owned()))?;
        match made.status() {
            types::Error::NoError => Ok(Self { mesh: made, holes: self.holes, clean }),
            types::Error::Cancelled => Err(Error::Interrupted),
            status => Err(failed(status.to_str().to_lowercase())),
        }
    }

    /// Its triangles, in an order of their own: the library's depends on what else runs.
    pub(super) fn surface(&self) -> Surface {
        let mesh: MeshGLP<f64, u32> = self.mesh.get_mesh_glp(-1);
        let positions = mesh.vert_properties.as_chunks::<3>().0;
        let mut order: Vec<u32> = (0..numbers::count(positions.len())).collect();
        let key = |vertex: &u32| positions[*vertex as usize].map(|it| it + 0.0);
        order.sort_by(|a, b| {
            let (a, b) = (key(a), key(b));
            let parts = a.iter().zip(&b).map(|(a, b)| a.total_cmp(b));
            parts.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then)
        });
        let mut rank = vec![0_u32; order.len()];
        for (place, vertex) in (0..).zip(&order) {
            rank[*vertex as usize] = place;
        }
        let merged = |vertex: u32| rank.get(vertex as usize).copied().unwrap_or_default();
        let mut triangles: Vec<[u32; 3]> = mesh
            .tri_verts
            .as_chunks::<3>()
            .0
            .iter()
            .map(|corners| {
                let [a, b, c] = corners.map(merged);
                // The least corner first, the turn as it was.
                if a < b && a < c {
                    [a, b, c]
                } else if b < c {
                    [b, c, a]
                } else {
                    [c, a, b]
                }
            })
            .collect();
        triangles.sort_unstable();
        let vertices = order.iter().map(|it| DVec3::from_array(positions[*it as usize])).collect();
        Surface::new(vertices, triangles)
    }
}

/// Does `work` while somebody looks whether to stop it.
fn watched<T: Send>(work: impl FnOnce() -> T, token: &CancelToken, task: Task<'_>) -> T {
    let finished = AtomicBool::new(false);
    thread::scope(|scope| {
        let look = || {
            while !finished.load(Ordering::Acquire) {
                if task.is_cancelled() {
                    token.cancel();
                    return;
                }
                thread::park_timeout(TICK);
            }
        };
        // Without memory for a thread it goes on unwatched.
        let watcher = thread::Builder::new().spawn_scoped(scope, look).ok();
        let made = work();
        finished.store(true, Ordering::Release);
        if let Some(watcher) = &watcher {
            watcher.thread().unpark();
        }
        made
    })
}

/// Rounds places to 1e-11 of the size, so that faces which coincide but for rounding leave no slit
/// between them.
pub(crate) fn snap(surfaces: &mut [Surface]) {
    let [low, high] = bounds_of(surfaces.iter().flat_map(|it| it.vertices.iter().copied()));
    let size = low.abs().max(high.abs()).max_element();
    let step = libm::exp2(libm::floor(libm::log2(size)) - 36.0);
    for vertex in surfaces.iter_mut().flat_map(|it| &mut it.vertices) {
        *vertex = (*vertex / step).round() * step;
    }
}
