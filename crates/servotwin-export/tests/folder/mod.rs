//! An export on disk: what has changed in it, and what an export does not replace. Nothing is compiled.

use super::{toy, twin};
use crate::rig;
use servotwin::learn::model_file;
use servotwin::study::Reaction;
use servotwin_export::FolderComparison;
use servotwin_export::folder::ExportFolder;
use servotwin_export::{ExportedReaction, ExportedTwin};
use servotwin_model::solver::SolverSettings;
use std::fs;
use std::path::{Path, PathBuf};

/// An export with a reaction, and the diagnoser's file.
fn exported<'p>(path: &Path, twin: &ExportedTwin<'p>) -> (ExportFolder, PathBuf, ExportedTwin<'p>) {
    let reaction = Reaction { switches_off: true, inputs: vec![(0, 0.0)], ..Reaction::default() };
    let reaction = ExportedReaction { actuator: 1, action: 0, detail: None, reaction };
    let twin = ExportedTwin { reactions: vec![reaction], ..twin.clone() };
    let (file, folder) = (path.join("diagnoser.json"), ExportFolder::new(&path.join("export")));
    model_file::write(&file, &*toy::diagnoser()).unwrap();
    folder.write((&toy::diagnoser(), &file), (&twin, Path::new("rig"))).unwrap();
    (folder, file, twin)
}

fn compared(folder: &ExportFolder, file: &Path, twin: &ExportedTwin) -> FolderComparison {
    let description = folder.description().unwrap();
    folder.compare(&description, (&toy::diagnoser(), file), (twin, Path::new("rig"))).unwrap()
}

/// Replaces a text in a file.
fn change(path: &Path, old: &str, new: &str) {
    let text = fs::read_to_string(path).unwrap();
    assert!(text.contains(old), "{} has no {old}", path.display());
    fs::write(path, text.replacen(old, new, 1)).unwrap();
}

#[test]
fn every_change_of_a_folder_is_named() {
    let temporary = tempfile::tempdir().unwrap();
    let program = rig::actuator();
    let twin = twin(&program, SolverSettings::of_runs());
    let (folder, file, twin) = exported(temporary.path(), &twin);
    let path = |name: &str| temporary.path().join("export").join(name);
    let whole = compared(&folder, &file, &twin);
    assert!(whole.differences.is_empty() && whole.not_compared.is_empty(), "{whole:#?}");

    let sizes = fs::read_to_string(path("servotwin_sizes.h")).unwrap();
    let hash = folder.description().unwrap().diagnoser_sha256;
    assert!(sizes.contains(&format!("SERVOTWIN_DIAGNOSER_SHA256 \"{hash}\"")), "{sizes}");
    assert!(sizes.contains("#define SERVOTWIN_ACTION_CHANGE_MODE 1\n"), "{sizes}");

    let swapped = ("\"shut_down\",\n    \"change_mode\"", "\"change_mode\",\n    \"shut_down\"");
    let changes = [
        ("servotwin_tables.c", swapped.0, swapped.1),
        ("servotwin_sizes.h", "SHUT_DOWN 0", "SHUT_DOWN 2"),
        (
            "servotwin_twin_tables.c",
            "{ 1, 0, -1, true, true, 0, 1 }",
            "{ 0, 0, -1, true, true, 0, 1 }",
        ),
        ("servotwin_hybrid.c", "[parameter] = value", "[parameter] = -value"),
        ("main.c", "COLUMNS)", "COLUMNS - 1)"),
        ("servotwin_equations.h", "/* x^exponent", "/* x^ exponent"),
        ("servotwin_exact.h", "/*", "\u{feff}/*"),
        ("servotwin_math.h", "\n", "\r\n"),
    ];
    for (name, old, new) in changes {
        change(&path(name), old, new);
    }
    fs::remove_file(path("servotwin_twin.c")).unwrap();
    fs::write(path("more.c"), "").unwrap();
    let mut description = folder.description().unwrap();
    description.version += "1";
    let kept = description.files_sha256.remove("servotwin_real.h");
    fs::write(path("export.json"), serde_json::to_string(&description).unwrap()).unwrap();
    let changed = compared(&folder, &file, &twin);
    let all: Vec<String> = changed.differences.iter().map(ToString::to_string).collect();
    let missing = ["servotwin_twin.c", "exported by", "SHA-256 of servotwin_real.h"];
    for name in changes.iter().map(|(name, ..)| *name).chain(missing) {
        assert_eq!(all.iter().filter(|what| what.contains(name)).count(), 1, "{name}: {all:#?}");
    }
    assert!(kept.is_some() && all.len() == changes.len() + missing.len(), "{all:#?}");
    assert_eq!(changed.not_compared, ["more.c: no file of the export"]);
}

#[test]
fn an_export_that_cannot_be_read_or_keeps_a_certificate_is_not_replaced() {
    let temporary = tempfile::tempdir().unwrap();
    let program = rig::actuator();
    let twin = twin(&program, SolverSettings::of_runs());
    let (folder, file, twin) = exported(temporary.path(), &twin);
    let path = |name: &str| temporary.path().join("export").join(name);
    let again = || {
        let written = folder.write((&toy::diagnoser(), &file), (&twin, Path::new("rig")));
        written.map_err(|error| error.to_string())
    };
    fs::write(path("main.c"), "mine").unwrap();
    fs::create_dir(path("proof.json")).unwrap();
    let error = again().unwrap_err();
    assert!(error.contains("proof.json"), "{error}");
    fs::remove_dir(path("proof.json")).unwrap();
    let text = fs::read_to_string(path("export.json")).unwrap();
    for damaged in ["", "{}", &text[..text.len() / 2]] {
        fs::write(path("export.json"), damaged).unwrap();
        let error = again().unwrap_err();
        assert!(error.contains("export.json: this describes no export"), "{error}");
    }
    assert_eq!(fs::read_to_string(path("main.c")).unwrap(), "mine");
    fs::write(path("export.json"), text).unwrap();
    assert!(again().is_ok());
    assert_ne!(fs::read_to_string(path("main.c")).unwrap(), "mine");
    // After a failure on the way the folder names itself what was begun, and can be written again.
    let mut earlier = folder.description().unwrap();
    earlier.version = "0".into();
    fs::write(path("export.json"), serde_json::to_string(&earlier).unwrap()).unwrap();
    fs::remove_file(path("main.c")).unwrap();
    fs::create_dir(path("main.c")).unwrap();
    assert!(again().unwrap_err().contains("main.c"));
    assert_ne!(folder.description().unwrap().version, "0");
    fs::remove_dir(path("main.c")).unwrap();
    assert!(again().is_ok());
}
