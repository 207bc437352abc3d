//! Temporary names that identify their process, and removal of the files of killed processes.
//!
//! A name is `servotwin-MARK-PID-…`. The mark identifies a boot of a kernel and a PID namespace. So a process of
//! another host, of another container or from before a restart never counts as dead. Systems without a mark (other than
//! Linux) remove nothing.

use std::fs;
use std::io;
use std::path::Path;
use tempfile::TempDir;

/// The prefix of every temporary name; a dot precedes it beside results.
const PREFIX: &str = "servotwin-";

/// The prefix of this process's temporary names.
pub(crate) fn own_prefix() -> String {
    format!("{PREFIX}{}-{}-", mark().unwrap_or_default(), std::process::id())
}

/// A hash of the kernel's boot and this process's PID namespace, in 16 hexadecimal digits.
fn mark() -> Option<String> {
    let boot = fs::read_to_string("/proc/sys/kernel/random/boot_id").ok()?;
    let numbers = fs::read_link("/proc/self/ns/pid").ok()?;
    let text = format!("{boot}{}", numbers.display());
    // FNV-1a: not for secrets.
    let add = |hash: u64, byte: u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    Some(format!("{:016x}", text.bytes().fold(0xcbf2_9ce4_8422_2325, add)))
}

/// Whether the process of a temporary name still runs; `None` if this process cannot know.
fn is_running(name: &str) -> Option<bool> {
    let own = format!("{PREFIX}{}-", mark()?);
    let process: u32 = name.strip_prefix(own.as_str())?.split('-').next()?.parse().ok()?;
    Some(Path::new("/proc").join(process.to_string()).exists())
}

/// Whether a name belongs to an ended process of this toolkit.
fn is_abandoned(name: &str) -> bool {
    is_running(name) == Some(false)
}

/// Whether a running process of this machine owns a temporary file beside results.
pub(crate) fn is_being_written(name: &str) -> bool {
    let own = name.strip_prefix('.').and_then(|name| name.strip_suffix(".tmp"));
    own.and_then(is_running) == Some(true)
}

/// Removes temporary files of ended processes beside results. Ignores errors.
pub fn remove_abandoned_files(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let name = entry.file_name().to_string_lossy().into_owned();
        let own = name.strip_prefix('.').and_then(|name| name.strip_suffix(".tmp"));
        // The type of the entry itself, without following links.
        let is_file = entry.file_type().is_ok_and(|kind| kind.is_file());
        if is_file && own.is_some_and(is_abandoned) {
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Removes folders for temporary files of ended processes, if they belong to this user. Ignores errors.
fn remove_abandoned_folders(folder: &Path) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let data = fs::symlink_metadata(entry.path());
        let is_ours = data.is_ok_and(|data| data.is_dir() && belongs_to_us(&data));
        if is_ours && is_abandoned(&entry.file_name().to_string_lossy()) {
            let _ = fs::remove_dir_all(entry.path());
        }
    }
}

/// A folder for temporary files that nobody else can read or guess, removed on drop. A later program removes those of
/// killed ones.
///
/// # Errors
/// The folder for temporary files cannot be written.
pub fn temporary_folder() -> io::Result<TempDir> {
    let parent = std::env::temp_dir();
    remove_abandoned_folders(&parent);
    let prefix = own_prefix();
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix);
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o700));
    builder.tempdir_in(parent)
}

/// Whether only this user can change what is in a folder: it belongs to no other, and neither its group nor everybody
/// can write into it.
#[cfg(unix)]
pub fn is_private(folder: &Path) -> bool {
    use std::os::unix::fs::PermissionsExt;
    let is_closed = |data: &fs::Metadata| data.permissions().mode() & 0o022 == 0;
    fs::metadata(folder).is_ok_and(|data| data.is_dir() && belongs_to_us(&data) && is_closed(&data))
}

#[cfg(not(unix))]
pub(crate) fn is_private(folder: &Path) -> bool {
    folder.is_dir()
}

#[cfg(unix)]
fn belongs_to_us(data: &fs::Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    fs::metadata("/proc/self").is_ok_and(|own| own.uid() == data.uid())
}

#[cfg(not(unix))]
fn belongs_to_us(_: &fs::Metadata) -> bool {
    false
}

#[cfg(all(test, target_os = "linux"))]
mod tests {
    use super::*;

    /// The process number of an ended process.
    fn ended() -> u32 {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child.id()
    }

    #[test]
    fn only_what_a_dead_process_has_left_is_removed_and_no_link_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let outside = tempfile::tempdir().unwrap();
        fs::write(outside.path().join("kept"), "kept").unwrap();
        let (mark, dead) = (mark().unwrap(), ended());
        let name = |mark: &str, process: u32| format!("servotwin-{mark}-{process}-0");
        let names = [
            name(&mark, dead),
            name(&mark, std::process::id()),
            name("0123456789abcdef", dead),
            format!("other-{mark}-{dead}-0"),
            format!("servotwin-{mark}-x-0"),
        ];
        for name in &names {
            fs::write(folder.path().join(format!(".{name}.tmp")), "").unwrap();
            fs::create_dir(folder.path().join(name)).unwrap();
        }
        let link = |name: String| {
            std::os::unix::fs::symlink(outside.path(), folder.path().join(name)).unwrap();
        };
        link(format!("servotwin-{mark}-{dead}-1"));
        link(format!(".servotwin-{mark}-{dead}-1.tmp"));
        link(format!("{}/inside", names[0]));
        remove_abandoned_files(folder.path());
        remove_abandoned_folders(folder.path());
        for (place, name) in names.iter().enumerate() {
            let is_kept = place > 0;
            assert_eq!(folder.path().join(name).exists(), is_kept, "{name}");
            assert_eq!(folder.path().join(format!(".{name}.tmp")).exists(), is_kept, "{name}");
        }
        assert!(folder.path().join(format!("servotwin-{mark}-{dead}-1")).is_symlink());
        assert!(folder.path().join(format!(".servotwin-{mark}-{dead}-1.tmp")).is_symlink());
        assert!(outside.path().join("kept").exists());
    }
}
