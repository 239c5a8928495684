//! Ctrl-C: the first ends the run cleanly, so that it can be resumed; the second ends at once.

use std::io::Write;
use std::sync::atomic::{AtomicBool, Ordering};

/// Exit code of an interrupted run: 128 + SIGINT, as shells have it.
pub(crate) const EXIT_CODE: u8 = 130;

/// Set by Ctrl-C (and by a termination signal); the engine looks at it between dispatches.
pub(crate) static CANCELLED: AtomicBool = AtomicBool::new(false);

/// Starts to listen. Where that is impossible Ctrl-C ends the process as it always does.
pub(crate) fn listen() {
    let listening = ctrlc::set_handler(|| {
        if CANCELLED.swap(true, Ordering::SeqCst) {
            std::process::exit(EXIT_CODE.into());
        }
        let _ = writeln!(std::io::stderr(), "\nstopping; press Ctrl-C again to stop at once");
    });
    if let Err(error) = listening {
        log::warn!("Ctrl-C will not end the run cleanly: {error}");
    }
}
