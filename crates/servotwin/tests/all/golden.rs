//! Broken files and what is said of each.

use servotwin_io::files::{read_text, write_atomically};
use std::fmt::Display;
use std::path::{Path, PathBuf};

/// Asserts that `parse(text, name)` refuses each TOML file of a folder of this crate with the words of the
/// `.expected` file beside it, and that there are at least so many. With `UPDATE=1` the expected files are written.
pub fn assert_mistakes<E: Display>(
    folder: &str,
    at_least: usize,
    parse: impl Fn(&str, &str) -> Result<(), E>,
) {
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join(folder))
            .unwrap_or_else(|error| panic!("{folder}: {error}"))
            .map(|entry| entry.expect("an entry").path())
            .filter(|path| path.extension().is_some_and(|e| e == "toml"))
            .collect();
    files.sort();
    assert!(files.len() >= at_least, "{folder} has {} files", files.len());
    let update = std::env::var_os("UPDATE").is_some();
    let mut wrong = Vec::new();
    for path in files {
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        let text = read_text(&path).expect("readable");
        let found = match parse(&text, &name) {
            Ok(()) => "no mistake was found".to_owned(),
            Err(error) => error.to_string(),
        };
        let golden = path.with_extension("expected");
        if update {
            write_atomically(&golden, |out| out.write_all(found.as_bytes())).expect("written");
        }
        let expected = read_text(&golden).unwrap_or_default();
        if found != expected {
            wrong.push(format!("--- {name}: expected\n{expected}\n--- found\n{found}\n"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
