//! What goes to terminals and pipes: text whose control and bidirectional characters, which come
//! from names of files and scenes, are escaped; and a stdout whose reader may leave.

use beamlet::cli_support::printed;
use std::io::{self, Write};

/// A writer that escapes what terminals obey, as `\u001b`; line breaks and tabs stay.
#[derive(Debug)]
pub(crate) struct Printed<W> {
    inner: W,
    /// Bytes of a character that is not whole yet.
    rest: Vec<u8>,
}

impl<W: Write> Printed<W> {
    pub(crate) const fn new(inner: W) -> Self {
        Self { inner, rest: Vec::new() }
    }
}

impl<W: Write> Write for Printed<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.rest.extend_from_slice(bytes);
        let whole = match std::str::from_utf8(&self.rest) {
            Err(error) if error.error_len().is_none() => error.valid_up_to(),
            _ => self.rest.len(),
        };
        let text = String::from_utf8_lossy(&self.rest[..whole]).into_owned();
        self.rest.drain(..whole);
        self.inner.write_all(printed::lines(&text).as_bytes())?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.inner.flush()
    }
}

/// Results on stdout. After the reader of a pipe has left, results are dropped without an error:
/// the command still finds its answer, which is its exit code.
#[derive(Debug)]
pub(crate) struct Results<W> {
    inner: W,
    /// The reader has left.
    closed: bool,
}

impl<W: Write> Results<W> {
    pub(crate) const fn new(inner: W) -> Self {
        Self { inner, closed: false }
    }

    /// `done` while there is a reader; `nothing` once there is none.
    fn unless_closed<T>(
        &mut self,
        nothing: T,
        done: impl FnOnce(&mut W) -> io::Result<T>,
    ) -> io::Result<T> {
        if self.closed {
            return Ok(nothing);
        }
        match done(&mut self.inner) {
            Err(error) if error.kind() == io::ErrorKind::BrokenPipe => {
                self.closed = true;
                Ok(nothing)
            }
            done => done,
        }
    }
}

impl<W: Write> Write for Results<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.unless_closed(bytes.len(), |inner| inner.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.unless_closed((), Write::flush)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn characters_that_come_in_parts_are_whole_and_those_of_terminals_are_escaped() {
        let mut out = Printed::new(Vec::new());
        for byte in "σ² \u{1b}[2J\u{202e}ok\n".bytes() {
            out.write_all(&[byte]).unwrap();
        }
        out.write_all(b"\xff.\n").unwrap();
        let text = String::from_utf8(out.inner).unwrap();
        assert_eq!(text, "σ² \\u001b[2J\\u202eok\n\u{fffd}.\n");
    }
}
