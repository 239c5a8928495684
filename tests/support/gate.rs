//! A gate in the way of the program: a call on a file that waits until the test lets it go on.
//!
//! A test that needs another process in a certain state holds it there. Amounts of work and pauses
//! reach that state on one machine and miss it on another.

use std::fs::{self, File, OpenOptions};
use std::io::{BufRead, BufReader, ErrorKind, Read};
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStderr, Command, Output, Stdio};
use std::time::Duration;
use tempfile::TempDir;

/// Makes a library of this source for `LD_PRELOAD`, in the folder for the files of tests.
pub(crate) fn preloaded(name: &str, source: &str) -> PathBuf {
    let folder = super::leftovers();
    let place = tempfile::tempdir_in(&folder).expect("a folder");
    let (code, made) = (place.path().join("code.c"), place.path().join("made.so"));
    fs::write(&code, source).expect("the code is written");
    let mut compiler = Command::new("cc");
    compiler.args(["-shared", "-fPIC", "-O1", "-o"]).args([&made, &code]).arg("-ldl");
    assert!(compiler.status().expect("a compiler").success(), "{name} is no C");
    // In one step: other tests may load it meanwhile.
    let library = folder.join(name).with_extension("so");
    fs::rename(made, &library).expect("the library is moved");
    library
}

/// Call at which the program waits.
#[derive(Debug, Clone, Copy)]
pub(crate) enum Gate<'a> {
    /// After a sync of a file with the first text in its path and the second in its content.
    Synced(&'a str, &'a str),
    /// Before a read of a file with this text in its path, from this byte or a later one.
    Read(&'a str, u64),
    /// Before a write to a file with this text in its path.
    Write(&'a str),
}

/// The program at a gate.
#[derive(Debug)]
pub(crate) struct Held {
    child: Child,
    stderr: BufReader<ChildStderr>,
    said: String,
    /// Open as long as the gate is closed.
    pipe: File,
    _place: TempDir,
}

impl Held {
    /// Starts the program and waits until it is at the gate.
    #[track_caller]
    pub(crate) fn at(gate: Gate<'_>, mut command: Command) -> Self {
        let place = tempfile::tempdir().expect("a folder");
        let pipe = place.path().join("gate");
        assert!(Command::new("mkfifo").arg(&pipe).status().expect("mkfifo").success());
        for (name, value) in variables(gate, &pipe) {
            command.env(name, value);
        }
        let mut child =
            command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().expect("it starts");
        let Some(pipe) = reached(&pipe, || child.try_wait().expect("a child").is_some()) else {
            let output = child.wait_with_output().expect("its output");
            panic!("it ended before it reached {gate:?}: {output:?}");
        };
        let stderr = BufReader::new(child.stderr.take().expect("its stderr"));
        Self { child, stderr, said: String::new(), pipe, _place: place }
    }

    /// Waits for `count` lines on stderr with this word, and returns the lines so far.
    #[track_caller]
    pub(crate) fn lines(&mut self, word: &str, count: usize) -> &str {
        while self.said.lines().filter(|line| line.contains(word)).count() < count {
            let length = self.stderr.read_line(&mut self.said).expect("a line");
            assert!(length > 0, "{count} lines with {word:?}: {}", self.said);
        }
        &self.said
    }

    /// Interrupts it, and waits until it knows: it says so, unless it is quiet.
    #[track_caller]
    pub(crate) fn interrupt(&mut self) {
        signal(&self.child, "-INT");
        self.lines("stopping; press Ctrl-C again", 1);
    }

    /// Ends it at once.
    pub(crate) fn kill(mut self) -> Output {
        self.child.kill().expect("it is there");
        self.ends()
    }

    /// Opens the gate and waits for the end.
    pub(crate) fn ends(self) -> Output {
        let Self { child, mut stderr, mut said, pipe, _place } = self;
        drop(pipe);
        stderr.read_to_string(&mut said).expect("the rest of its stderr");
        let output = child.wait_with_output().expect("its output");
        Output { stderr: said.into_bytes(), ..output }
    }
}

/// Variables of a program with a gate.
pub(crate) fn variables(gate: Gate<'_>, pipe: &Path) -> [(&'static str, String); 5] {
    use std::sync::OnceLock;
    static LIBRARY: OnceLock<PathBuf> = OnceLock::new();
    let library = LIBRARY.get_or_init(|| preloaded("gate", include_str!("gate.c")));
    let (call, file, at) = match gate {
        Gate::Synced(file, text) => ("sync", file, text.to_owned()),
        Gate::Read(file, byte) => ("read", file, byte.to_string()),
        Gate::Write(file) => ("write", file, String::new()),
    };
    let text = |path: &Path| path.to_str().expect("a path of UTF-8").to_owned();
    [
        ("LD_PRELOAD", text(library)),
        ("BEAMLET_GATE", call.to_owned()),
        ("BEAMLET_GATE_FILE", file.to_owned()),
        ("BEAMLET_GATE_AT", at),
        ("BEAMLET_GATE_PIPE", text(pipe)),
    ]
}

/// Opens the pipe of a gate once a program waits there; `None` where the program ended before.
pub(crate) fn reached(pipe: &Path, mut has_ended: impl FnMut() -> bool) -> Option<File> {
    let nonblocking = rustix::fs::OFlags::NONBLOCK.bits().cast_signed();
    loop {
        // Before the look at the pipe: what ended has not come there since.
        let ended = has_ended();
        match OpenOptions::new().write(true).custom_flags(nonblocking).open(pipe) {
            Ok(open) => return Some(open),
            Err(error) if error.kind() == ErrorKind::NotFound => panic!("no pipe: {error}"),
            Err(_) if ended => return None,
            // Nobody reads it yet.
            Err(_) => std::thread::sleep(Duration::from_millis(1)),
        }
    }
}

/// Sends a signal to a program of the test that was not waited for.
#[track_caller]
pub(crate) fn signal(child: &Child, name: &str) {
    // The shell's own: a bare machine has no program of that name.
    let kill = format!("kill {name} {}", child.id());
    assert!(Command::new("sh").args(["-c", &kill]).status().expect("a shell").success());
}

/// Waits until the program handles a signal by its number, or ends.
pub(crate) fn until_handled(child: &mut Child, number: u32) {
    let status = format!("/proc/{}/status", child.id());
    let is_handled = || {
        let text = fs::read_to_string(&status).unwrap_or_default();
        let mask = text.lines().find_map(|line| line.strip_prefix("SigCgt:")).map(str::trim);
        let mask = mask.and_then(|mask| u64::from_str_radix(mask, 16).ok());
        mask.is_some_and(|mask| mask >> (number - 1) & 1 == 1)
    };
    while !is_handled() && child.try_wait().expect("a child").is_none() {
        std::thread::sleep(Duration::from_millis(1));
    }
}
