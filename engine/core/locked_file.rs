//! Files that are locked while they are open.

use std::fs::{File, TryLockError};
use std::ops::{Deref, DerefMut};

/// A file and its lock, which ends with this value.
///
/// Closing the file is not enough: a lock belongs to every copy of an open file, and a program that
/// another thread starts has one for a moment, between `fork` and `exec`.
#[derive(Debug)]
pub struct LockedFile(File);

impl LockedFile {
    /// For one writer; `None` where another has the file. File systems without locks have none.
    pub fn exclusive(file: File) -> Option<Self> {
        let held = matches!(file.try_lock(), Err(TryLockError::WouldBlock));
        (!held).then_some(Self(file))
    }

    /// For any number of readers; `None` where a writer has the file.
    pub fn shared(file: File) -> Option<Self> {
        let held = matches!(file.try_lock_shared(), Err(TryLockError::WouldBlock));
        (!held).then_some(Self(file))
    }
}

impl Drop for LockedFile {
    fn drop(&mut self) {
        let _ = self.0.unlock();
    }
}

impl Deref for LockedFile {
    type Target = File;

    fn deref(&self) -> &File {
        &self.0
    }
}

impl DerefMut for LockedFile {
    fn deref_mut(&mut self) -> &mut File {
        &mut self.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_ends_though_a_copy_of_the_file_is_open() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let open = || File::options().read(true).write(true).open(file.path()).unwrap();
        let locked = LockedFile::exclusive(open()).unwrap();
        let copy = locked.try_clone().unwrap();
        assert!(LockedFile::shared(open()).is_none());
        drop(locked);
        let [one, other] = [(); 2].map(|()| LockedFile::shared(open()).unwrap());
        assert!(LockedFile::exclusive(open()).is_none());
        drop((one, other));
        assert!(LockedFile::exclusive(open()).is_some());
        drop(copy);
    }
}
