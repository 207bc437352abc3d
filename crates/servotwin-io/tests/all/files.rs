//! Writing is all or nothing, and failures say which file and why.

use std::fs;
use std::io::{self, Write};

use crate::folder::Folder;
use servotwin_io::files::{
    AtomicFile, FileError, create_folder, open, read_bytes, read_text, read_toml, write_atomically,
};

#[test]
fn a_committed_file_is_there_and_nothing_else() {
    let folder = Folder::new("commit");
    write_atomically(folder.file("a.txt"), |out| out.write_all(b"one")).unwrap();
    write_atomically(folder.file("a.txt"), |out| out.write_all(b"two")).unwrap();
    assert_eq!(read_text(folder.file("a.txt")).unwrap(), "two");
    assert_eq!(folder.names(), ["a.txt"]);
}

#[test]
fn an_error_leaves_the_old_file() {
    let folder = Folder::new("error");
    fs::write(folder.file("a.txt"), "old").unwrap();
    let failed = write_atomically(folder.file("a.txt"), |out| {
        out.write_all(b"half")?;
        Err(io::ErrorKind::StorageFull.into())
    });
    let message = failed.unwrap_err().to_string();
    assert!(message.ends_with("a.txt: the disk is full"), "{message}");
    assert_eq!(read_text(folder.file("a.txt")).unwrap(), "old");
    assert_eq!(folder.names(), ["a.txt"]);
}

#[test]
fn a_panic_leaves_the_old_file() {
    let folder = Folder::new("panic");
    fs::write(folder.file("a.txt"), "old").unwrap();
    let target = folder.file("a.txt");
    let thread = std::thread::spawn(move || {
        let mut file = AtomicFile::create(target).unwrap();
        file.write_all(&[b'x'; 100_000]).unwrap();
        panic!("on purpose, to see the file removed");
    });
    assert!(thread.join().is_err());
    assert_eq!(read_text(folder.file("a.txt")).unwrap(), "old");
    assert_eq!(folder.names(), ["a.txt"]);
}

#[test]
fn a_missing_folder_is_named() {
    let folder = Folder::new("missing");
    let error = AtomicFile::create(folder.file("no/such/a.txt")).unwrap_err();
    assert!(matches!(error, FileError::MissingFolder { .. }));
    let message = error.to_string();
    assert!(message.contains("no/such does not exist"), "{message}");
}

#[test]
fn a_folder_is_no_file_and_a_file_no_folder() {
    let folder = Folder::new("kinds");
    let error = AtomicFile::create(&folder.0).unwrap_err();
    assert!(matches!(error, FileError::IsFolder { .. }));
    fs::write(folder.file("a"), "").unwrap();
    let error = AtomicFile::create(folder.file("a/b")).unwrap_err();
    assert!(matches!(error, FileError::NotFolder { .. }), "{error}");
    assert!(matches!(create_folder(folder.file("a")), Err(FileError::NotFolder { .. })));
    create_folder(folder.file("b/c")).unwrap();
    create_folder(folder.file("b/c")).unwrap();
    assert!(matches!(read_bytes(folder.file("z")), Err(FileError::Missing { .. })));
}

#[test]
fn a_read_only_file_is_respected() {
    let folder = Folder::new("readonly");
    let path = folder.file("a.txt");
    fs::write(&path, "old").unwrap();
    let mut permissions = fs::metadata(&path).unwrap().permissions();
    permissions.set_readonly(true);
    fs::set_permissions(&path, permissions).unwrap();
    let error = write_atomically(&path, |out| out.write_all(b"new")).unwrap_err();
    assert!(error.to_string().ends_with("read-only, it cannot be written"), "{error}");
    assert_eq!(read_text(&path).unwrap(), "old");
}

/// A folder without write permission refuses; to root it refuses nothing, and the file appears.
#[cfg(unix)]
#[test]
fn a_read_only_folder_is_denied_or_written_by_root() {
    use std::os::unix::fs::PermissionsExt;
    let folder = Folder::new("readonly-folder");
    let inner = folder.file("inner");
    fs::create_dir(&inner).unwrap();
    fs::set_permissions(&inner, fs::Permissions::from_mode(0o555)).unwrap();
    let written = write_atomically(inner.join("a.txt"), |out| out.write_all(b"new"));
    fs::set_permissions(&inner, fs::Permissions::from_mode(0o755)).unwrap();
    match written {
        Ok(()) => assert_eq!(read_text(inner.join("a.txt")).unwrap(), "new"),
        Err(error) => assert!(error.to_string().ends_with("permission denied"), "{error}"),
    }
}

/// Devices are written through, never replaced; `/dev/full` is a disk that is always full.
#[cfg(target_os = "linux")]
#[test]
fn devices_are_written_directly_and_a_full_disk_is_named() {
    use std::os::unix::fs::FileTypeExt;
    write_atomically("/dev/null", |out| out.write_all(b"x")).unwrap();
    assert!(fs::metadata("/dev/null").unwrap().file_type().is_char_device());
    let error = write_atomically("/dev/full", |out| out.write_all(&[0; 100_000])).unwrap_err();
    assert_eq!(error.to_string(), "/dev/full: the disk is full");
}

#[cfg(unix)]
#[test]
fn behind_a_link_the_file_is_replaced_and_permissions_stay() {
    use std::os::unix::fs::{PermissionsExt, symlink};
    let folder = Folder::new("link");
    fs::write(folder.file("real"), "old").unwrap();
    fs::set_permissions(folder.file("real"), fs::Permissions::from_mode(0o640)).unwrap();
    symlink(folder.file("real"), folder.file("link")).unwrap();
    write_atomically(folder.file("link"), |out| out.write_all(b"new")).unwrap();
    assert_eq!(read_text(folder.file("real")).unwrap(), "new");
    assert!(fs::symlink_metadata(folder.file("link")).unwrap().is_symlink());
    let mode = fs::metadata(folder.file("real")).unwrap().permissions().mode();
    assert_eq!(mode & 0o777, 0o640);
}

#[cfg(unix)]
#[test]
fn behind_a_dangling_link_the_file_appears_where_the_link_leads() {
    use std::os::unix::fs::symlink;
    let folder = Folder::new("dangling");
    symlink("second", folder.file("first")).unwrap();
    symlink(folder.file("real"), folder.file("second")).unwrap();
    write_atomically(folder.file("first"), |out| out.write_all(b"new")).unwrap();
    assert_eq!(fs::read(folder.file("real")).unwrap(), b"new");
    for link in ["first", "second"] {
        assert!(fs::symlink_metadata(folder.file(link)).unwrap().is_symlink(), "{link}");
    }
    symlink("round", folder.file("round")).unwrap();
    assert!(write_atomically(folder.file("round"), |out| out.write_all(b"new")).is_ok());
}

#[cfg(target_os = "linux")]
#[test]
fn a_file_without_end_is_refused() {
    let message = read_text("/dev/zero").unwrap_err().to_string();
    assert_eq!(message, "/dev/zero: this is a device, a regular file is needed");
    let folder = Folder::new("endless");
    let sparse = |name: &str, length: u64| {
        fs::File::create(folder.file(name)).unwrap().set_len(length).unwrap();
        folder.file(name)
    };
    assert_eq!(read_toml(sparse("longest", 1 << 20)).unwrap().len(), 1 << 20);
    let refusal = |error: FileError| error.to_string().split_once(": ").unwrap().1.to_owned();
    let told = refusal(read_toml(sparse("longer", (1 << 20) + 1)).unwrap_err());
    assert_eq!(told, "longer than 1 MiB, the limit for such a file");
}

#[test]
fn text_must_be_text() {
    let folder = Folder::new("text");
    fs::write(folder.file("a.txt"), b"one\ntwo \xff\n").unwrap();
    let message = read_text(folder.file("a.txt")).unwrap_err().to_string();
    assert!(message.ends_with("line 2 is not UTF-8 text"), "{message}");
    fs::write(folder.file("b.txt"), "\u{feff}one").unwrap();
    assert_eq!(read_text(folder.file("b.txt")).unwrap(), "one");
}

#[test]
fn the_nearest_name_is_suggested_only_when_near() {
    use servotwin_io::nearest::nearest;
    let names = ["pressure_a_pa", "pressure_b_pa", "stroke_m"];
    assert_eq!(nearest("presure_b_pa", names), Some("pressure_b_pa"));
    assert_eq!(nearest("Stroke_M", names), Some("stroke_m"));
    assert_eq!(nearest("temperature_k", names), None);
    assert_eq!(nearest("ab", ["xy"]), None);
    // What was typed is a part of what is meant.
    let parameters = ["controller.mode", "controller.gain_per_m", "valve.gain_limit"];
    assert_eq!(nearest("controller.gain", parameters), Some("controller.gain_per_m"));
    assert_eq!(nearest("gain_per_m", parameters), Some("controller.gain_per_m"));
}

#[test]
#[cfg(target_os = "linux")]
fn a_read_never_waits_for_a_file_of_the_kernel() {
    use std::os::fd::AsRawFd;
    let folder = Folder::new("files-waiting");
    let file = open(folder.write("a.toml", "")).unwrap();
    let about = read_text(format!("/proc/self/fdinfo/{}", file.as_raw_fd())).unwrap();
    let flags = about.lines().find_map(|line| line.strip_prefix("flags:")).unwrap();
    let flags = i32::from_str_radix(flags.trim(), 8).unwrap();
    assert_ne!(flags & 0o4000, 0, "O_NONBLOCK: {about}");
    let waits = FileError::from_io("kmsg".as_ref(), std::io::ErrorKind::WouldBlock.into());
    assert_eq!(waits.to_string(), "kmsg: this is a file without an end, a regular file is needed");
}
