//! The layout of the code: modules of a crate depend on each other in one direction, leaves depend on nothing above them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

type Edges = BTreeMap<String, BTreeSet<String>>;

fn crates() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
    let mut found: Vec<_> =
        fs::read_dir(root).unwrap().map(|entry| entry.unwrap().path()).collect();
    found.retain(|path| path.join("src").is_dir());
    found.sort();
    found
}

pub(super) fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut found = vec![];
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        match path.is_dir() {
            true => found.extend(sources(&path)),
            false if path.extension().is_some_and(|ending| ending == "rs") => found.push(path),
            false => {}
        }
    }
    found
}

/// The code of a file without comments and without its modules of tests.
fn code(path: &Path) -> String {
    let text = fs::read_to_string(path).unwrap();
    let mut kept = String::new();
    let mut lines = text.lines();
    while let Some(line) = lines.next() {
        if line == "#[cfg(test)]" {
            // A module in this file ends with the first brace at the margin, one in another file with its declaration.
            for inner in lines.by_ref() {
                if inner == "}" || inner.starts_with("mod ") && inner.ends_with(';') {
                    break;
                }
            }
            continue;
        }
        kept += line.split("//").next().unwrap();
        kept.push('\n');
    }
    kept
}

/// The first names of all paths behind a prefix, those in a list included.
fn names_behind(code: &str, prefix: &str) -> Vec<String> {
    let name = |text: &str| {
        text.trim_start()
            .chars()
            .take_while(|c| c.is_alphanumeric() || *c == '_')
            .collect::<String>()
    };
    let mut found = vec![];
    for (at, _) in code.match_indices(prefix) {
        let is_whole = !code[..at].ends_with(|c: char| c.is_alphanumeric() || "_:".contains(c));
        let rest = &code[at + prefix.len()..];
        if !is_whole {
            continue;
        }
        let Some(list) = rest.strip_prefix('{') else {
            found.push(name(rest));
            continue;
        };
        let mut depth = 0;
        let mut begins = true;
        for (place, letter) in list.char_indices() {
            if begins && depth == 0 {
                found.push(name(&list[place..]));
            }
            begins = letter == ',';
            match letter {
                '{' => depth += 1,
                '}' if depth == 0 => break,
                '}' => depth -= 1,
                _ => {}
            }
        }
    }
    found
}

/// The top module that each top module of a crate uses.
fn edges(sources_folder: &Path) -> Edges {
    let root = ["lib.rs", "main.rs"].map(|name| sources_folder.join(name));
    let declared = fs::read_to_string(root.iter().find(|file| file.exists()).unwrap()).unwrap();
    let modules: BTreeSet<String> = declared
        .lines()
        .filter_map(|line| {
            let line = line.trim_start_matches("pub ").trim_start_matches("pub(crate) ");
            line.strip_prefix("mod ")?.strip_suffix(';')
        })
        .map(str::to_owned)
        .collect();
    let mut found = Edges::new();
    for path in sources(sources_folder) {
        let inside = path.strip_prefix(sources_folder).unwrap().to_str().unwrap().to_owned();
        if root.contains(&path) || inside.contains("tests") {
            continue;
        }
        let parts: Vec<&str> = inside.trim_end_matches(".rs").split('/').collect();
        let depth = parts.len() - usize::from(parts.last() == Some(&"mod"));
        let code = code(&path);
        let mut used = names_behind(&code, "crate::");
        used.extend(names_behind(&code, &"super::".repeat(depth)));
        let own = parts[0];
        used.retain(|name| modules.contains(name) && name != own);
        found.entry(own.to_owned()).or_default().extend(used);
    }
    found
}

/// A way from a module back to itself.
fn cycle(edges: &Edges) -> Option<Vec<String>> {
    fn walk(at: &str, way: &mut Vec<String>, done: &mut BTreeSet<String>, edges: &Edges) -> bool {
        if let Some(first) = way.iter().position(|known| known == at) {
            way.drain(..first);
            way.push(at.to_owned());
            return true;
        }
        if !done.insert(at.to_owned()) {
            return false;
        }
        way.push(at.to_owned());
        let is_found =
            edges.get(at).is_some_and(|next| next.iter().any(|to| walk(to, way, done, edges)));
        if !is_found {
            way.pop();
        }
        is_found
    }
    let mut done = BTreeSet::new();
    edges.keys().find_map(|from| {
        let mut way = vec![];
        walk(from, &mut way, &mut done, edges).then_some(way)
    })
}

#[test]
fn modules_of_a_crate_have_no_cycle() {
    let mut counted = 0;
    for folder in crates() {
        let edges = edges(&folder.join("src"));
        counted += edges.values().map(BTreeSet::len).sum::<usize>();
        assert_eq!(cycle(&edges), None, "{}", folder.display());
    }
    assert!(counted > 200, "only {counted} uses were found: the test reads the code no more");
}

#[test]
fn a_cycle_is_found() {
    let edge = |from: &str, to: &str| (from.to_owned(), BTreeSet::from([to.to_owned()]));
    let edges = Edges::from([edge("a", "b"), edge("b", "c"), edge("c", "b")]);
    assert_eq!(cycle(&edges), Some(["b", "c", "b"].map(str::to_owned).to_vec()));
    let code = "use crate::{self, table::{Column, Table}, files};\nuse super::map::Map;";
    assert_eq!(names_behind(code, "crate::"), ["self", "table", "files"]);
    assert_eq!(names_behind(code, "super::"), ["map"]);
}

#[test]
fn leaves_depend_on_nothing_above_them() {
    let allowed: [(&str, &[&str]); 6] = [
        ("servotwin-io", &[]),
        ("servotwin-model", &[]),
        ("servotwin-diagnosis", &[]),
        ("servotwin-learning", &["servotwin-diagnosis"]),
        ("servotwin-view", &["servotwin-io", "servotwin-model"]),
        (
            "servotwin",
            &[
                "servotwin-io",
                "servotwin-model",
                "servotwin-diagnosis",
                "servotwin-learning",
                "servotwin-view",
            ],
        ),
    ];
    for (name, allowed) in allowed {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name).join("Cargo.toml");
        let text = fs::read_to_string(file).unwrap();
        let section = text.split("[dependencies]").nth(1).unwrap().split("\n[").next().unwrap();
        let used = section.lines().filter_map(|line| line.strip_suffix(".workspace = true"));
        for used in used.filter(|used| used.starts_with("servotwin")) {
            assert!(allowed.contains(&used), "{name} depends on {used}");
        }
    }
}
