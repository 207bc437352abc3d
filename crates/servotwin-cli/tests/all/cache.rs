//! Compiled equations are kept, found again, and never change a result.

use super::{Folder, stderr, stdout};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// Runs the binary with a cache of its own.
fn servotwin(folder: &Folder, compiler: Option<&str>, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_servotwin"));
    command.env("SERVOTWIN_CACHE", folder.file("cache")).args(arguments);
    if let Some(compiler) = compiler {
        command.env("SERVOTWIN_CC", compiler);
    }
    command.output().expect("the binary can be run")
}

/// A run and its bytes.
fn simulated(folder: &Folder, compile: &str) -> Vec<u8> {
    let out = folder.file("run.csv");
    let run = ["simulate", "spring_actuator", "--command", "step:size=5deg", "--duration", "1s"];
    let output =
        servotwin(folder, None, &[&run[..], &["--out", &out, "--compile", compile]].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    std::fs::read(out).unwrap()
}

fn libraries(folder: &Folder) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder.file("cache")).into_iter().flatten();
    entries.map(|entry| entry.unwrap().path()).collect()
}

#[test]
#[ignore = "slow: ./check --all"]
fn compiled_equations_are_kept_and_change_no_result() {
    let folder = Folder::new("cache");
    let uncompiled = simulated(&folder, "never");
    assert!(libraries(&folder).is_empty());
    assert!(simulated(&folder, "only") == uncompiled);
    let kept = libraries(&folder);
    assert!(!kept.is_empty());
    assert!(simulated(&folder, "only") == uncompiled, "found again");
    assert_eq!(libraries(&folder).len(), kept.len());
    // A damaged library is not loaded, but made anew.
    let damage = |path: &Path| {
        let mut content = std::fs::read(path).unwrap();
        content.truncate(content.len() / 2);
        std::fs::write(path, content).unwrap();
    };
    kept.iter().for_each(|path| damage(path));
    assert!(simulated(&folder, "only") == uncompiled, "made anew");
    let shown = stdout(&servotwin(&folder, None, &["tools", "cache"]));
    assert!(shown.contains(&format!("{} libraries", kept.len())), "{shown}");
    let cleared = stdout(&servotwin(&folder, None, &["tools", "cache", "--clear"]));
    assert!(cleared.ends_with(&format!("{} removed\n", kept.len())), "{cleared}");
    assert!(libraries(&folder).is_empty());
}

#[test]
fn a_run_that_may_only_be_compiled_ends_where_that_fails() {
    let folder = Folder::new("only");
    let run = ["simulate", "spring_actuator", "--command", "step:size=5deg", "--compile", "only"];
    let output = servotwin(&folder, Some("/no/such/compiler"), &run);
    assert_eq!(output.status.code(), Some(1));
    let told = stderr(&output);
    assert!(told.contains("'/no/such/compiler' does not start"), "{told}");
    assert_eq!(told.trim_end().lines().count(), 1, "{told}");
}

#[cfg(unix)]
#[test]
#[ignore = "slow: ./check --all"]
fn a_folder_that_others_can_change_is_no_cache() {
    use std::os::unix::fs::{PermissionsExt, chown};
    let folder = Folder::new("open-cache");
    std::fs::create_dir(folder.file("cache")).unwrap();
    let allow = |mode: u32| {
        let permissions = std::fs::Permissions::from_mode(mode);
        std::fs::set_permissions(folder.file("cache"), permissions).unwrap();
    };
    for mode in [0o777, 0o775] {
        allow(mode);
        simulated(&folder, "only");
        assert!(libraries(&folder).is_empty(), "{mode:o}");
    }
    allow(0o755);
    // Only root can give a folder away.
    if chown(folder.file("cache"), Some(12_345), None).is_ok() {
        simulated(&folder, "only");
        assert!(libraries(&folder).is_empty(), "of another user");
    }
}
