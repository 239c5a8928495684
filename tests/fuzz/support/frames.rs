//! Reads stacks of any format, and holds them to what they promise.

use beamlet::stack::StackFile;
use std::path::Path;

/// Values and frames that are read of a stack; larger ones are opened only.
const VALUES: usize = 1 << 20;
const FRAMES: usize = 64;

/// Opens a stack and reads it: whole views, and frames in halves, are the same values.
pub fn read_stack(path: &Path) {
    let Ok(stack) = StackFile::open(path) else { return };
    let [views, steps, rows, columns] = stack.shape();
    assert!([views, steps, rows, columns].iter().all(|side| *side > 0));
    let size = [steps, rows, columns].iter().try_fold(views, |n, side| n.checked_mul(*side));
    if size.is_none_or(|size| size > VALUES) || views * steps > FRAMES {
        return;
    }
    let rows = u32::try_from(rows).expect("rows are counted in 32 bits");
    for view in 0..views {
        let Ok(whole) = stack.view(view) else { continue };
        for step in 0..steps {
            for part in [0..rows / 2, rows / 2..rows] {
                let first = part.start as usize;
                let half = stack.frame(view, step, part).expect("it was read as part of its view");
                for ((row, column), value) in half.indexed_iter() {
                    let of_view = whole[[step, first + row, column]];
                    assert_eq!(value.to_bits(), of_view.to_bits(), "{view} {step} {row} {column}");
                }
            }
        }
    }
    assert!(stack.view(views).is_err() && stack.frame(0, 0, 0..rows + 1).is_err());
    if let Ok(cut) = stack.with_steps(1) {
        assert_eq!(cut.shape()[1], 1);
    }
}
