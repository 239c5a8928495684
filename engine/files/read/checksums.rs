//! Checksums of the views of a run, compared when the views are read.

use crate::layout;
use crate::values::hex;
use beamlet_core::{Error, Result, reserve};
use ndarray::Array3;
use rayon::prelude::*;
use sha2::{Digest, Sha256};
use std::collections::BTreeSet;
use std::path::Path;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

/// Views of up to this many bytes are kept while their rows are read one after another.
const KEPT: usize = 256 << 20;
/// Frames that are decoded side by side.
const AT_ONCE: usize = 8;

/// Views that were compared already, by name.
pub(super) type Compared = Arc<Mutex<BTreeSet<String>>>;

/// Committed checksums of the views of a stack.
#[derive(Debug)]
pub(super) struct Checksums {
    /// Name and SHA-256 of each view.
    views: Vec<[String; 2]>,
    /// Frames of a view.
    steps: usize,
    /// Shared by the stacks of a run, so that each view is compared once.
    compared: Compared,
    /// The view that was compared last, where it is not too large.
    last: Mutex<Option<(usize, Arc<Array3<f32>>)>>,
}

impl Checksums {
    pub(super) fn new(views: Vec<[String; 2]>, steps: usize, compared: &Compared) -> Self {
        let compared = Arc::clone(compared);
        Self { views, steps, compared, last: Mutex::default() }
    }

    /// The view of a frame, if it still has its checksum; whole if it was read for that and is kept.
    /// `read` reads a frame by its number over all views, `shape` is the shape of a frame.
    pub(super) fn of_frame(
        &self,
        path: &Path,
        frame: usize,
        shape: [usize; 2],
        read: impl Fn(usize) -> Result<Vec<f32>> + Sync,
    ) -> Result<Option<Arc<Array3<f32>>>> {
        let view = frame / self.steps.max(1);
        // No lock is held while frames are read: a waiting thread may take up work that needs the same
        // view. At worst two of them compare it.
        let last = lock(&self.last).clone().filter(|(number, _)| *number == view);
        if let Some((_, values)) = last {
            return Ok(Some(values));
        }
        let Some([name, recorded]) = self.views.get(view) else { return Ok(None) };
        if lock(&self.compared).contains(name) {
            return Ok(None);
        }
        let [rows, columns] = shape;
        let keeps = 4 * self.steps * rows * columns <= KEPT;
        let values = if keeps { self.steps * rows * columns } else { 0 };
        let mut values = reserve::room(values, "a view that is compared with its checksum")?;
        let mut hasher = Sha256::new();
        let numbers: Vec<usize> = (view * self.steps..(view + 1) * self.steps).collect();
        for some in numbers.chunks(AT_ONCE) {
            let frames: Vec<Vec<f32>> = some.par_iter().map(|n| read(*n)).collect::<Result<_>>()?;
            for frame in frames {
                update(&mut hasher, &frame);
                if keeps {
                    values.extend_from_slice(&frame);
                }
            }
        }
        if hex(&hasher.finalize()) != *recorded {
            let problem = format!(
                "{name} differs from its committed state: its values do not have the checksum of {}; \
                 resume the run to simulate it again",
                layout::LOG
            );
            return Err(Error::file(path, problem, None));
        }
        lock(&self.compared).insert(name.clone());
        if !keeps {
            return Ok(None);
        }
        let whole = Array3::from_shape_vec((self.steps, rows, columns), values)
            .map_err(|error| Error::file(path, format!("cannot be read: {error}"), None))?;
        let whole = Arc::new(whole);
        *lock(&self.last) = Some((view, Arc::clone(&whole)));
        Ok(Some(whole))
    }
}

/// Adds values as little-endian bytes.
fn update(hasher: &mut Sha256, values: &[f32]) {
    if cfg!(target_endian = "little") {
        hasher.update(bytemuck::cast_slice::<f32, u8>(values));
    } else {
        values.iter().for_each(|value| hasher.update(value.to_le_bytes()));
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
