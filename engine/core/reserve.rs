//! Large memory, reserved so that its lack is an error and not the end of the program.
//!
//! Buffers of one piece are made by [`zeroed`], [`filled`], [`room`] and [`collected`], and only
//! where `SPARE` bytes are left beside them: a small allocation that fails ends the program. Work
//! that takes many small allocations checks for their sum before it begins ([`ask`]). Memory that
//! a system promises, and does not have when it is used, is shown by neither.

use crate::{Error, Result};

/// Remedy where a buffer does not fit.
pub const REMEDY: &str = "end other programs, or raise the memory limit of this process";

/// Program, driver and its compiled kernels, as measured with Mesa's CPU device.
pub const PROGRAM: u64 = 138 << 20;

/// Bytes that large buffers leave to small allocations.
const SPARE: usize = 4 << 20;
/// Bytes of a buffer that counts as large.
const LARGE: usize = 1 << 16;
/// Address space that a thread may take with its first small allocation: an arena of its own (glibc).
const ARENA: usize = 64 << 20;

/// Zeros; an error names `purpose`.
///
/// # Errors
/// [`Error::Memory`].
pub fn zeroed<T: bytemuck::Zeroable>(len: usize, purpose: &str) -> Result<Vec<T>> {
    let values =
        bytemuck::allocation::try_zeroed_vec(len).map_err(|()| lacks::<T>(len, purpose))?;
    beside_spare(values, purpose)
}

/// The same value over and over; an error names `purpose`.
///
/// # Errors
/// [`Error::Memory`].
pub fn filled<T: Copy>(value: T, len: usize, purpose: &str) -> Result<Vec<T>> {
    let mut values = room(len, purpose)?;
    values.resize(len, value);
    Ok(values)
}

/// An empty buffer with capacity for `len` values; an error names `purpose`.
///
/// # Errors
/// [`Error::Memory`].
pub fn room<T>(len: usize, purpose: &str) -> Result<Vec<T>> {
    let mut values = Vec::new();
    values.try_reserve_exact(len).map_err(|_| lacks::<T>(len, purpose))?;
    beside_spare(values, purpose)
}

/// A new buffer, given back where it leaves too little beside it.
///
/// # Errors
/// [`Error::Memory`].
fn beside_spare<T>(values: Vec<T>, purpose: &str) -> Result<Vec<T>> {
    let large = values.capacity().saturating_mul(size_of::<T>()) >= LARGE;
    if large && !leaves_spare() {
        return Err(lacks::<T>(values.capacity(), purpose));
    }
    Ok(values)
}

/// The items of an iterator; an error names `purpose`.
///
/// # Errors
/// [`Error::Memory`].
pub fn collected<T>(from: impl ExactSizeIterator<Item = T>, purpose: &str) -> Result<Vec<T>> {
    let mut values = room(from.len(), purpose)?;
    values.extend(from);
    Ok(values)
}

fn lacks<T>(len: usize, purpose: &str) -> Error {
    let needed = (len as u64).saturating_mul(size_of::<T>() as u64);
    Error::Memory { purpose: purpose.into(), needed, available: None, remedy: REMEDY.into() }
}

/// True if there is memory for small allocations.
pub(crate) fn leaves_spare() -> bool {
    can_be_had(SPARE)
}

/// True if there is memory for small allocations beside another thread, which listens to Ctrl-C.
pub(crate) fn leaves_spare_beside_a_thread() -> bool {
    can_be_had(2 * SPARE)
}

/// True if this number of bytes can be allocated now. They are not written to, so that this is cheap.
fn can_be_had(bytes: usize) -> bool {
    Vec::<u8>::new().try_reserve_exact(bytes).is_ok()
}

/// Checks that `bytes`, and small allocations beside them, can be allocated now. They are freed at once.
///
/// # Errors
/// [`Error::Memory`].
pub fn ask(bytes: u64, purpose: &str, remedy: &str) -> Result<()> {
    let needed = bytes.saturating_add((ARENA + SPARE) as u64);
    if usize::try_from(needed).is_ok_and(can_be_had) {
        return Ok(());
    }
    Err(Error::Memory { purpose: purpose.into(), needed, available: None, remedy: remedy.into() })
}

/// Reserves the memory of work in many pieces, so that its lack is an error before it begins. It is freed
/// at once; an error names `purpose`.
///
/// # Errors
/// [`Error::Memory`] where they are not to be had.
pub fn require_memory(bytes: u64, purpose: &str) -> Result<()> {
    ask(bytes, purpose, REMEDY)
}

/// Bytes of the memory of this machine; `None` where the system does not say.
#[must_use]
pub fn machine_memory() -> Option<u64> {
    let text = std::fs::read_to_string("/proc/meminfo").ok()?;
    let line = text.lines().find_map(|line| line.strip_prefix("MemTotal:"))?;
    let kibibytes: u64 = line.trim().strip_suffix("kB")?.trim().parse().ok()?;
    kibibytes.checked_mul(1 << 10)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_machine_has_is_an_error_with_its_size() {
        let message = ask(1 << 60, "the moon", "look elsewhere").unwrap_err().to_string();
        assert!(message.contains("the moon needs 1099511627844 MiB; look"), "{message}");
        assert!(zeroed::<f64>(1 << 57, "a frame").is_err());
        assert!(filled(f32::NAN, 1 << 58, "a frame").is_err());
        assert_eq!(zeroed::<u32>(3, "three").unwrap(), [0; 3]);
        assert_eq!(filled(7_u8, 3, "three").unwrap(), [7; 3]);
        ask(1 << 20, "a mebibyte", "").unwrap();
    }
}
