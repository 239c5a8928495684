//! Kernels that a driver has made, kept on disk: some drivers take seconds for each of the large ones.
//!
//! A file belongs to one device, driver and set of kernels. Drivers check little, so one gets a
//! file only where its length, its SHA-256 and the header of Vulkan are right.

use super::failure;
use super::kernel::KernelTable;
use super::physical::{DeviceKind, Physical};
use ash::vk;
use beamlet_core::{Error, Result, folder, whole_file};
use sha2::{Digest, Sha256};
use std::fs;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};

/// Name of the environment variable of the folder, or `off`.
const FOLDER: &str = "BEAMLET_CACHE";
/// First bytes of a file.
const MAGIC: &[u8; 8] = b"blkern01";
/// Bytes of the header of Vulkan: length, version, vendor, device and the UUID of the driver.
const VULKAN_HEADER: usize = 32;
/// Largest file, bytes.
const MOST: u64 = 256 << 20;

/// Where kernels that a driver has made are kept.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
#[non_exhaustive]
pub enum KernelCache {
    /// In the folder that `BEAMLET_CACHE` names, or nowhere where it is `off`. Without it, in `beamlet` in the
    /// user's folder of caches; not for a CPU, whose driver makes them anew.
    #[default]
    User,
    /// In this folder, which is made where it is not there.
    Folder(PathBuf),
    /// Nowhere.
    Off,
}

impl KernelCache {
    /// The folder, if any.
    fn folder(&self, kind: DeviceKind) -> Option<PathBuf> {
        match self {
            Self::Off => None,
            Self::Folder(folder) => Some(folder.clone()),
            Self::User => match std::env::var_os(FOLDER).filter(|it| !it.is_empty()) {
                Some(off) if off == "off" => None,
                Some(folder) => Some(folder.into()),
                None if kind == DeviceKind::Cpu => None,
                None => user_folder().map(|folder| folder.join("beamlet")),
            },
        }
    }
}

/// The user's folder of caches.
fn user_folder() -> Option<PathBuf> {
    let absolute = |name: &str| {
        let path = PathBuf::from(std::env::var_os(name)?);
        path.is_absolute().then_some(path)
    };
    if cfg!(windows) {
        return absolute("LOCALAPPDATA");
    }
    if cfg!(target_os = "macos") {
        return absolute("HOME").map(|home| home.join("Library/Caches"));
    }
    absolute("XDG_CACHE_HOME").or_else(|| absolute("HOME").map(|home| home.join(".cache")))
}

/// The cache of an open device.
#[derive(Debug)]
pub(super) struct DeviceCache {
    pub(super) raw: vk::PipelineCache,
    file: Option<PathBuf>,
    /// Vulkan's header of this device.
    header: [u8; VULKAN_HEADER],
    /// SHA-256 of what the file had.
    kept: [u8; 32],
    /// Kernels were made that the file may lack.
    grown: AtomicBool,
}

impl DeviceCache {
    /// The cache of a device for a set of kernels, filled from its file.
    pub(super) fn open(
        raw: &ash::Device,
        physical: &Physical,
        cache: &KernelCache,
        kernels: KernelTable,
    ) -> Result<Self> {
        let header = header_of(physical);
        let folder = cache.folder(physical.description.kind);
        let file = folder.map(|folder| folder.join(file_name(physical, kernels)));
        let kept = file.as_deref().and_then(|file| read(file, &header)).unwrap_or_default();
        let make = |bytes: &[u8]| {
            let info = vk::PipelineCacheCreateInfo::default().initial_data(bytes);
            // SAFETY: the device is alive; the bytes are of this driver, by their header and check sum.
            unsafe { raw.create_pipeline_cache(&info, None) }
        };
        let made = make(&kept).or_else(|_| make(&[]));
        let raw = made.map_err(|e| failure::vulkan("making a pipeline cache", e))?;
        let kept = Sha256::digest(&kept).into();
        Ok(Self { raw, file, header, kept, grown: AtomicBool::new(false) })
    }

    /// A kernel was made.
    pub(super) fn grow(&self) {
        self.grown.store(true, Ordering::Relaxed);
    }

    /// Writes the kernels to the file where there are new ones. A failure is logged: the cache is a help.
    pub(super) fn keep(&self, raw: &ash::Device) {
        let Some(file) = self.file.as_deref().filter(|_| self.grown.load(Ordering::Relaxed)) else {
            return;
        };
        // SAFETY: the cache is of this device.
        let Ok(bytes) = (unsafe { raw.get_pipeline_cache_data(self.raw) }) else { return };
        // A driver that keeps nothing gives its header.
        let is_of_size = bytes.len() > VULKAN_HEADER && bytes.len() as u64 <= MOST / 2;
        let is_new = <[u8; 32]>::from(Sha256::digest(&bytes)) != self.kept;
        if !is_of_size || !bytes.starts_with(&self.header) || !is_new {
            return;
        }
        if let Err(e) = write(file, &bytes) {
            log::debug!("the kernels are not kept: {e}");
        }
    }
}

/// Vulkan's header of the data of a device.
fn header_of(physical: &Physical) -> [u8; VULKAN_HEADER] {
    let mut header = [0; VULKAN_HEADER];
    let [vendor, device] = physical.vendor_and_device;
    let length = 32;
    for (place, word) in header.chunks_exact_mut(4).zip([length, 1_u32, vendor, device]) {
        place.copy_from_slice(&word.to_le_bytes());
    }
    header[16..].copy_from_slice(&physical.cache_uuid);
    header
}

/// Name of the file of a device, its driver and a set of kernels.
fn file_name(physical: &Physical, kernels: KernelTable) -> String {
    let mut hash = Sha256::new();
    hash.update(header_of(physical));
    hash.update(&physical.description.driver);
    for (name, words) in kernels {
        hash.update(name);
        hash.update(bytemuck::cast_slice::<u32, u8>(words));
    }
    let start =
        hash.finalize().iter().take(16).map(|byte| format!("{byte:02x}")).collect::<String>();
    format!("{start}.kernels")
}

/// The bytes of a file for the bytes of a driver.
fn whole(bytes: &[u8]) -> Vec<u8> {
    let length = (bytes.len() as u64).to_le_bytes();
    [&MAGIC[..], &length, Sha256::digest(bytes).as_slice(), bytes].concat()
}

/// The bytes of the driver in a file, if they are whole and of this device.
fn content<'b>(file: &'b [u8], header: &[u8; VULKAN_HEADER]) -> Option<&'b [u8]> {
    let (length, rest) = file.strip_prefix(&MAGIC[..])?.split_first_chunk::<8>()?;
    let (sum, bytes) = rest.split_first_chunk::<32>()?;
    let is_whole = bytes.len() as u64 == u64::from_le_bytes(*length)
        && Sha256::digest(bytes).as_slice() == sum;
    (is_whole && bytes.starts_with(header)).then_some(bytes)
}

/// The bytes of the driver in a file; nothing where it is not there, damaged or foreign.
fn read(path: &Path, header: &[u8; VULKAN_HEADER]) -> Option<Vec<u8>> {
    let is_file = fs::symlink_metadata(path).is_ok_and(|it| it.is_file() && it.len() <= MOST);
    if !is_file || !path.parent().is_some_and(is_private) {
        return None;
    }
    let bytes = fs::read(path).ok()?;
    let found = content(&bytes, header).map(<[u8]>::to_vec);
    if found.is_none() {
        log::debug!("{}: not kernels of this device, or damaged: ignored", path.display());
    }
    found
}

/// Writes the bytes of a driver.
fn write(path: &Path, bytes: &[u8]) -> Result<()> {
    let parent = path.parent().unwrap_or(path);
    make_private(parent)?;
    if !is_private(parent) {
        return Err(Error::file(parent, "others may write to this folder of kernels", None));
    }
    whole_file::write_file(path, &whole(bytes))
}

/// Makes a folder that only the user reaches, where it is not there.
fn make_private(path: &Path) -> Result<()> {
    if path.is_dir() {
        return Ok(());
    }
    folder::make_all(path.parent().unwrap_or(path))?;
    let mut builder = fs::DirBuilder::new();
    #[cfg(unix)]
    std::os::unix::fs::DirBuilderExt::mode(&mut builder, 0o700);
    builder.create(path).map_err(|e| Error::file(path, "cannot be made", Some(e)))
}

/// True if only the user reaches a folder.
fn is_private(path: &Path) -> bool {
    #[cfg(unix)]
    {
        use std::os::unix::fs::MetadataExt;
        fs::metadata(path).is_ok_and(|it| it.is_dir() && it.mode() & 0o077 == 0)
    }
    #[cfg(not(unix))]
    path.is_dir()
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEADER: [u8; VULKAN_HEADER] = [7; VULKAN_HEADER];

    fn data() -> Vec<u8> {
        HEADER.iter().copied().chain(0..200).collect()
    }

    #[test]
    fn a_file_is_read_as_it_was_written() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cache").join("a.kernels");
        assert_eq!(read(&path, &HEADER), None);
        write(&path, &data()).unwrap();
        assert_eq!(read(&path, &HEADER), Some(data()));
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            let mode = |mode| {
                fs::set_permissions(path.parent().unwrap(), fs::Permissions::from_mode(mode))
                    .unwrap();
            };
            assert!(is_private(path.parent().unwrap()));
            // Others could have put it there.
            mode(0o770);
            assert_eq!(read(&path, &HEADER), None);
            assert!(write(&path, &data()).is_err());
            mode(0o700);
        }
    }

    #[test]
    fn no_damaged_or_foreign_byte_reaches_a_driver() {
        let file = whole(&data());
        assert_eq!(content(&file, &HEADER), Some(&data()[..]));
        for at in 0..file.len() {
            let mut damaged = file.clone();
            damaged[at] ^= 0x10;
            assert_eq!(content(&damaged, &HEADER), None, "byte {at}");
            assert_eq!(content(&file[..at], &HEADER), None, "{at} bytes");
        }
        assert_eq!(content(&[&file[..], &[0]].concat(), &HEADER), None);
        let mut other = HEADER;
        other[9] ^= 1;
        assert_eq!(content(&file, &other), None);
    }
}
