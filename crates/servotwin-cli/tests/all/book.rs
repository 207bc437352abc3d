//! The book: every command of it is run, in the order of its page and in a folder of the page's own; what a block
//! `text said` shows is what the command before it has said; its files are those that are shipped; its tables are what the
//! program declares.
//!
//! `UPDATE=1 cargo test -p servotwin-cli --test all book` writes these tables anew.

use super::{Folder, stderr, stdout};
use servotwin::{catalogue, format, signal, study};
use std::path::{Component, Path};
use std::process::{Command, Output};

const DOCS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs");

/// The pages in the order of the book.
fn pages() -> Vec<String> {
    let summary = std::fs::read_to_string(format!("{DOCS}/SUMMARY.md")).unwrap();
    let link = |line: &str| {
        let (_, rest) = line.split_once("](")?;
        Some(rest.split_once(')')?.0.to_owned())
    };
    summary.lines().filter_map(link).collect()
}

fn page(name: &str) -> String {
    std::fs::read_to_string(format!("{DOCS}/{name}")).unwrap_or_else(|e| panic!("{name}: {e}"))
}

/// The blocks of a page: what stands behind the fence, and the text.
fn blocks(page: &str) -> Vec<(String, String)> {
    let mut blocks = vec![];
    let mut open: Option<(String, String)> = None;
    for line in page.lines() {
        match (line.strip_prefix("```"), &mut open) {
            (Some(kind), None) => open = Some((kind.trim().into(), String::new())),
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (None, Some((_, text))) => *text += &format!("{line}\n"),
            (None, None) => {}
        }
    }
    blocks
}

/// The commands of a block; a line that ends in a backslash goes on in the next.
fn commands(text: &str) -> Vec<String> {
    let joined = text.replace("\\\n", " ");
    let line = |line: &str| line.split(" #").next().unwrap_or("").trim().to_owned();
    joined.lines().map(line).filter(|line| !line.is_empty()).collect()
}

fn run(folder: &Folder, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_servotwin"));
    command.args(arguments).current_dir(&folder.0).output().expect("the binary can be run")
}

/// Runs a command of the book; what stands behind `>` is the file for its output. What it said.
fn run_line(folder: &Folder, line: &str) -> String {
    let (line, file) = match line.split_once(" > ") {
        Some((line, file)) => (line, Some(file.trim())),
        None => (line, None),
    };
    let words: Vec<&str> = line.split_whitespace().collect();
    assert_eq!(words[0], "servotwin", "{line}");
    let output = run(folder, &words[1..]);
    assert!(output.status.success(), "{line}: {}", stderr(&output));
    let said = stdout(&output);
    if let Some(file) = file {
        std::fs::write(folder.file(file), &said).unwrap();
    }
    said
}

/// What a command cannot be without: of one that takes minutes it is asked whether it is understood.
fn is_understood(folder: &Folder, line: &str) {
    let words: Vec<&str> = line.split_whitespace().collect();
    if words[0] != "servotwin" {
        return;
    }
    let output = run(folder, &[&words[1..], &["--help"]].concat());
    assert!(output.status.success(), "{line}: {}", stderr(&output));
}

#[test]
fn every_command_of_the_book_works() {
    let mut run = 0;
    for name in pages() {
        // The commands of this page are run by a test of their own.
        if name == "tables.md" {
            continue;
        }
        let folder = Folder::new(&format!("book-{}", name.trim_end_matches(".md")));
        let mut said = String::new();
        for (kind, text) in blocks(&page(&name)) {
            match kind.split_once(' ').unwrap_or((&kind, "")) {
                ("sh", "long") => {
                    commands(&text).iter().for_each(|line| is_understood(&folder, line))
                }
                ("sh", _) => {
                    for line in commands(&text) {
                        said = run_line(&folder, &line);
                        run += 1;
                    }
                }
                ("text", "said") => {
                    assert!(said.contains(&text), "{name} shows:\n{text}\nand said is:\n{said}");
                }
                ("toml" | "csv", file) if !file.is_empty() => {
                    std::fs::write(folder.file(file), text).unwrap();
                }
                _ => {}
            }
        }
    }
    assert!(run > 25, "{run} commands");
}

/// What the book shows of a shipped file stands there.
#[test]
fn what_the_book_shows_of_shipped_files_is_in_them() {
    for (name, file) in [("own-system.md", "systems"), ("own-study.md", "studies")] {
        let path = format!("{DOCS}/../{file}/press_axis.toml");
        let shipped = std::fs::read_to_string(&path).unwrap();
        let mut shown = 0;
        for (kind, text) in blocks(&page(name)) {
            if kind == "toml" {
                assert!(
                    shipped.contains(text.trim_end()),
                    "{name} shows what {path} lacks:\n{text}"
                );
                shown += 1;
            }
        }
        assert!(shown >= 5, "{name} shows {shown} parts");
    }
}

/// What a page's heading is called in links, by mdBook and by repositories.
pub(super) fn anchor(heading: &str) -> String {
    let letter = |c: char| match c {
        ' ' => Some('-'),
        c if c.is_alphanumeric() || "_-".contains(c) => Some(c.to_ascii_lowercase()),
        _ => None,
    };
    heading.trim_start_matches('#').trim().chars().filter_map(letter).collect()
}

/// A page of the book, or a file that mdBook copies because it lies among the pages. Nothing else is
/// there: what a link out of the folder leads to, only a repository has.
fn is_in_the_book(link: &str) -> bool {
    let (file, place) = link.split_once('#').unwrap_or((link, ""));
    if Path::new(file).components().any(|part| !matches!(part, Component::Normal(_))) {
        return false;
    }
    if !file.ends_with(".md") {
        return Path::new(DOCS).join(file).is_file();
    }
    let headings = |page: &str| page.lines().any(|l| l.starts_with('#') && anchor(l) == place);
    pages().iter().any(|page| page == file) && (place.is_empty() || headings(&page(file)))
}

/// What a page links to, and the pictures it shows, beside other sites.
pub(super) fn links(page: &str) -> Vec<&str> {
    let places = page.match_indices("](").map(|(place, _)| &page[place + 2..]);
    places.filter_map(|rest| rest.split(')').next()).filter(|link| !link.contains("://")).collect()
}

#[test]
fn links_of_the_book_lead_into_the_book() {
    for name in pages() {
        let text = page(&name);
        for link in links(&text) {
            let whole = if link.starts_with('#') { format!("{name}{link}") } else { link.into() };
            assert!(is_in_the_book(&whole), "{name}: {link}");
        }
    }
    assert!(is_in_the_book("own-study.md") && is_in_the_book("images/report.png"));
    let outside = ["../README.md", "SUMMARY.md", "own-study.md#nowhere", "images/none.png"];
    assert!(!outside.iter().any(|link| is_in_the_book(link)));
}

/// Every shipped file is shown, and every file that is shown is there: mdBook only notes what it does not find.
#[test]
fn the_book_shows_the_shipped_files() {
    let shown = page("shipped-files.md");
    for folder in ["systems", "studies"] {
        for file in std::fs::read_dir(format!("{DOCS}/../{folder}")).unwrap() {
            let name = file.unwrap().file_name();
            let line = format!("{{{{#include ../{folder}/{}}}}}", name.display());
            assert!(shown.lines().any(|l| l == line), "{line} is not in shipped-files.md");
        }
    }
    for line in shown.lines() {
        if let Some(rest) = line.strip_prefix("{{#include ") {
            assert!(Path::new(DOCS).join(rest.trim_end_matches("}}")).is_file(), "{line}");
        }
    }
}

/// A page with the text between its marks replaced.
fn with(page: &str, generated: &str) -> String {
    let (begin, end) = ("<!-- generated -->\n", "<!-- end -->");
    let (before, rest) = page.split_once(begin).expect("a mark");
    let (_, after) = rest.split_once(end).expect("a mark");
    format!("{before}{begin}\n{}\n{end}{after}", generated.trim())
}

#[test]
fn tables_of_the_book_are_what_is_declared() {
    let pages = [
        ("components.md", catalogue::book()),
        ("study-format.md", format::markdown(study::keys())),
        ("signals.md", format!("```text\n{}```", signal::help())),
    ];
    for (name, generated) in pages {
        let found = page(name);
        let wanted = with(&found, &generated);
        if std::env::var_os("UPDATE").is_some() {
            std::fs::write(format!("{DOCS}/{name}"), &wanted).unwrap();
        } else {
            assert_eq!(found, wanted, "UPDATE=1 cargo test -p servotwin-cli --test all book");
        }
    }
}

/// A source that a component names is a name and a year, and stands with both in the list of references.
#[test]
fn every_source_of_a_component_is_among_the_references() {
    let references = page("references.md");
    let mut named = 0;
    for spec in catalogue::all() {
        let prose = catalogue::prose(spec.kind).replace('\n', " ");
        let (_, sources) = prose.rsplit_once("Source: ").expect("the model's contract");
        let words: Vec<&str> = sources.split([' ', ',', ';', ':', '.']).collect();
        let is_year =
            |word: &str| word.len() == 4 && word.parse().is_ok_and(|n| (1800..2100).contains(&n));
        for pair in words.windows(2).filter(|pair| is_year(pair[1])) {
            let source = pair.join(" ");
            assert!(references.contains(&format!("{source} |")), "{}: {source}", spec.kind);
            named += 1;
        }
    }
    assert!(named > 10, "{named}");
}
