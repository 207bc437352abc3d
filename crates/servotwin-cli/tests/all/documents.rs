//! The documents of the repository: their links lead to files and headings that exist, the index lists every decision,
//! the page of faults describes every fault of the catalog, and the page of features every
//! feature.

use super::book::{anchor, links};
use super::json;
use servotwin::catalogue;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

const REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const FAULTS: &str = "Faults: ";

fn read(path: &Path) -> String {
    std::fs::read_to_string(path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))
}

/// The Markdown files of a folder, in the order of their names.
fn markdown_files(folder: &str) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(Path::new(REPOSITORY).join(folder)).expect("the folder exists");
    let paths = entries.map(|entry| entry.expect("an entry").path());
    let mut paths: Vec<_> = paths.filter(|p| p.extension().is_some_and(|e| e == "md")).collect();
    paths.sort();
    paths
}

/// The text without blocks of code, whose brackets are no links.
fn without_code(text: &str) -> String {
    let mut is_code = false;
    let mut kept = String::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            is_code = !is_code;
        } else if !is_code {
            kept += &format!("{line}\n");
        }
    }
    kept
}

/// The mistake in a link of a document, if there is one.
fn broken(document: &Path, link: &str) -> Option<String> {
    let (file, place) = link.split_once('#').unwrap_or((link, ""));
    let folder = document.parent().expect("a document stands in a folder");
    let target = if file.is_empty() { document.to_owned() } else { folder.join(file) };
    if !target.exists() {
        return Some(format!("{}: {link} leads to no file", document.display()));
    }
    let is_heading = |line: &str| line.starts_with('#') && anchor(line) == place;
    let is_found = place.is_empty()
        || target.extension().is_none_or(|e| e != "md")
        || read(&target).lines().any(is_heading);
    (!is_found).then(|| format!("{}: {link} leads to no heading", document.display()))
}

#[test]
fn every_relative_link_of_the_documents_leads_to_a_file_and_a_heading() {
    let mut documents = vec![
        Path::new(REPOSITORY).join("README.md"),
        Path::new(REPOSITORY).join("DESIGN.md"),
        Path::new(REPOSITORY).join("ARCHITECTURE.md"),
        Path::new(REPOSITORY).join("CONTRIBUTING.md"),
    ];
    for folder in ["docs", "docs/decisions"] {
        documents.extend(markdown_files(folder));
    }
    let mut checked = 0;
    let mut mistakes = vec![];
    for document in &documents {
        let text = without_code(&read(document));
        let relative = links(&text).into_iter().filter(|link| !link.starts_with("mailto:"));
        for link in relative {
            mistakes.extend(broken(document, link));
            checked += 1;
        }
    }
    assert!(mistakes.is_empty(), "{}", mistakes.join("\n"));
    assert!(checked > 100, "{checked} links");
}

#[test]
fn a_link_to_a_missing_file_or_heading_is_found() {
    let page = Path::new(REPOSITORY).join("docs/idea.md");
    assert!(
        broken(&page, "features.md#parity").is_none() && broken(&page, "../README.md").is_none()
    );
    assert!(
        broken(&page, "nowhere.md").is_some() && broken(&page, "features.md#nowhere").is_some()
    );
}

#[test]
fn the_index_lists_every_decision_once() {
    let index = read(&Path::new(REPOSITORY).join("DESIGN.md"));
    let records = markdown_files("docs/decisions");
    let listed = index.matches("](docs/decisions/").count();
    assert_eq!(listed, records.len(), "DESIGN.md must list each decision record and no other");
    for path in &records {
        let name = path.file_name().expect("a name").to_string_lossy();
        let record = read(path);
        let title = record.lines().next().unwrap_or_default().trim_start_matches("# ");
        let line = format!("- [{}](docs/decisions/{name})\n", title.replacen(':', "", 1));
        assert_eq!(index.matches(&line).count(), 1, "DESIGN.md must have the line {line}");
        let number = title.split(':').next().unwrap_or_default();
        assert!(name.starts_with(&format!("{number}-")), "{name} has the title {title}");
    }
}

/// The words in backticks of a text.
fn code(text: &str) -> impl Iterator<Item = &str> {
    text.split('`').skip(1).step_by(2)
}

/// How many sections of the page describe a fault, by kind of component and name of the fault.
fn described_faults(page: &str) -> BTreeMap<(&str, &str), usize> {
    let mut described = BTreeMap::new();
    for group in
        page.lines().filter_map(|line| line.strip_prefix(FAULTS)).flat_map(|l| l.split(';'))
    {
        let (kinds, names) = group.split_once(": ").expect("kinds, a colon, faults");
        for kind in code(kinds) {
            for name in code(names) {
                *described.entry((kind, name)).or_default() += 1;
            }
        }
    }
    described
}

#[test]
fn every_fault_of_the_catalog_has_a_section_with_four_answers() {
    let page = read(&Path::new(REPOSITORY).join("docs/faults.md"));
    let mut described = described_faults(&page);
    for spec in catalogue::all() {
        for fault in spec.faults {
            let count = described.remove(&(spec.kind, fault.name));
            assert_eq!(count, Some(1), "docs/faults.md: sections of {} {}", spec.kind, fault.name);
        }
    }
    assert!(
        described.is_empty(),
        "docs/faults.md describes faults that do not exist: {described:?}"
    );
    let parts = ["What it does.", "Why it matters.", "How it shows.", "When it does not show."];
    for section in page.split("\n### ").skip(1) {
        let title = section.lines().next().unwrap_or_default();
        assert_eq!(section.matches(FAULTS).count(), 1, "{title}");
        for part in parts {
            assert_eq!(section.matches(&format!("**{part}** ")).count(), 1, "{title}: {part}");
        }
    }
}

/// The words of a feature's name that stand for a sensor, its role or its actuator.
const PLACEHOLDERS: [&str; 4] = ["SENSOR", "OTHER", "QUANTITY", "NUMBER"];

/// Whether a name has the parts of a pattern between its placeholders.
fn fits(pattern: &str, name: &str) -> bool {
    let pattern = PLACEHOLDERS.iter().fold(pattern.to_owned(), |all, word| all.replace(word, "*"));
    let Some((begin, others)) = pattern.split_once('*') else { return pattern == name };
    let Some(mut rest) = name.strip_prefix(begin) else { return false };
    for part in others.split('*') {
        let Some(place) = rest.rfind(part) else { return false };
        rest = &rest[place + part.len()..];
    }
    rest.is_empty()
}

#[test]
fn a_pattern_fits_the_names_that_it_stands_for() {
    assert!(fits("rms_SENSOR_over_OTHER", "rms_p_a_1_over_x_v_1"));
    assert!(fits("mean_gap", "mean_gap") && !fits("mean_gap", "mean_gap_2"));
    assert!(!fits("crest_SENSOR", "gain_p_a_1"));
}

#[test]
fn every_listed_feature_fits_one_pattern_of_its_family_and_every_pattern_a_feature() {
    let page = read(&Path::new(REPOSITORY).join("docs/features.md"));
    let mut rows = vec![];
    for section in page.split("\n## ").skip(1) {
        let family = section.lines().next().unwrap_or_default();
        for line in section.lines().filter(|line| line.starts_with("| `")) {
            let cells: Vec<&str> = line.split(" | ").collect();
            rows.push((family, cells[0].trim_matches(['|', ' ', '`']), cells[1]));
        }
    }
    let listed = json(&["--json", "features"]);
    let families = listed.as_object().expect("families").iter();
    let listed: Vec<_> = families
        .filter_map(|(family, own)| Some((family.as_str(), own["features"].as_array()?)))
        .flat_map(|(family, own)| own.iter().map(move |feature| (family, feature)))
        .collect();
    assert!(listed.len() > 100, "{}", listed.len());
    let mut used = vec![0; rows.len()];
    for (family, feature) in listed {
        let text = |key: &str| feature[key].as_str().expect("a text");
        let (name, unit) = (text("name"), text("unit"));
        assert!(!text("meaning").is_empty(), "{name}");
        let is_of = |row: &(&str, &str, &str)| row.0 == family && fits(row.1, name);
        let found: Vec<usize> = (0..rows.len()).filter(|&row| is_of(&rows[row])).collect();
        assert_eq!(found.len(), 1, "docs/features.md: patterns of {name} in {family}");
        assert_eq!(rows[found[0]].2, unit, "docs/features.md: the unit of {name}");
        used[found[0]] += 1;
    }
    for (row, used) in rows.iter().zip(used) {
        assert!(used > 0, "docs/features.md: no feature fits {row:?}");
    }
}
