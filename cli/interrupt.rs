//! Signals. Ctrl-C: the first ends the work cleanly, so that it can be resumed; the second ends at once.

use beamlet::Cancel;
use std::io::Write;
use std::sync::LazyLock;
use std::thread;
use std::time::Duration;

/// Exit code of an interrupted run: 128 + SIGINT, as shells have it.
pub(crate) const EXIT_CODE: u8 = 130;

/// Time to end cleanly. Whatever does not look at its [`Cancel`] by then (a driver, a disk) is ended as
/// by a second signal: a run is whole at any moment.
const GRACE: Duration = Duration::from_secs(10);

/// Set by Ctrl-C, and by a termination signal.
static CANCEL: LazyLock<Cancel> = LazyLock::new(Cancel::default);

/// Ends the process. Libraries tidy up as it exits, and may wait for what hangs: a second later
/// it ends without that.
fn end() -> ! {
    let _ = thread::Builder::new().spawn(|| {
        thread::sleep(Duration::from_secs(1));
        std::process::abort();
    });
    std::process::exit(EXIT_CODE.into())
}

/// Starts to listen, and gives what Ctrl-C ends from now on. Where that is impossible Ctrl-C ends the
/// process as it always does.
pub(crate) fn listen() -> Cancel {
    let listening = ctrlc::set_handler(|| {
        if CANCEL.is_cancelled() {
            end();
        }
        CANCEL.cancel();
        // Quiet: errors alone.
        if log::max_level() >= log::LevelFilter::Warn {
            let _ = writeln!(std::io::stderr(), "\nstopping; press Ctrl-C again to stop at once");
        }
        let _ = thread::Builder::new().spawn(|| {
            thread::sleep(GRACE);
            let seconds = GRACE.as_secs();
            let _ = writeln!(
                std::io::stderr(),
                "interrupted; a driver or disk did not respond within {seconds} s"
            );
            end();
        });
    });
    if let Err(error) = listening {
        log::warn!("Ctrl-C will not end the run cleanly: {error}");
    }
    CANCEL.clone()
}
