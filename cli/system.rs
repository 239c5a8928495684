//! Settings of the process, before it has other threads.

/// Lets writes beyond the limit of file sizes (`ulimit -f`) fail with an error, which names the file; the system would end
/// the process.
#[cfg(unix)]
pub(crate) fn let_large_writes_fail() {
    // SAFETY: to ignore a signal runs no code of ours, and no other thread has been started.
    unsafe { libc::signal(libc::SIGXFSZ, libc::SIG_IGN) };
}

/// Other systems have no such signal.
#[cfg(not(unix))]
pub(crate) const fn let_large_writes_fail() {}

/// Limits the heaps of glibc to one for each processor, and at least two; else it makes eight for each, and each keeps what
/// was freed in it. Runs on two processors have a peak that is a tenth lower, in the same time. `MALLOC_ARENA_MAX`, where
/// set, has the last word.
#[cfg(all(target_os = "linux", target_env = "gnu"))]
pub(crate) fn limit_heaps() {
    let processors = std::thread::available_parallelism().map_or(1, std::num::NonZero::get);
    if let Ok(heaps) = i32::try_from(processors.max(2))
        && std::env::var_os("MALLOC_ARENA_MAX").is_none()
    {
        // SAFETY: the call sets a number behind a lock.
        unsafe { libc::mallopt(libc::M_ARENA_MAX, heaps) };
    }
}

/// Other allocators have no such setting.
#[cfg(not(all(target_os = "linux", target_env = "gnu")))]
pub(crate) const fn limit_heaps() {}
