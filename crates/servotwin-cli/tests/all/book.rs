//! The book: the program understands every command, and every short one is run, in the order of its page and in a folder
//! of the page's own. What a block `text said` shows is what the command before it printed. Its files are those that are
//! shipped, and its tables are what the program declares.
//!
//! `UPDATE=1 cargo test -p servotwin-cli --test all book` writes these tables anew.

use super::{Folder, stderr, stdout};
use servotwin::measure::{self, Measure};
use servotwin::study::Study;
use servotwin::{catalogue, format, signal, study, system};
use servotwin_diagnosis::diagnoser::Tuning;
use servotwin_diagnosis::diagnoser::tuning::{
    BASELINE_CORRECTED, Constant, WITH_TOLERANCES_COST, WRONG_ACTUATOR_COST,
};
use servotwin_diagnosis::hierarchy::Names;
use servotwin_report::vocabulary::Vocabulary;
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
pub(super) fn blocks(page: &str) -> Vec<(String, String)> {
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
pub(super) fn commands(text: &str) -> Vec<String> {
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

/// Parses a command and checks the paths that it names, without running it.
pub(super) fn is_understood(folder: &Folder, line: &str) {
    let line = line.split(" > ").next().unwrap_or_default();
    let words: Vec<&str> = line.split_whitespace().collect();
    if words[0] != "servotwin" {
        return;
    }
    let output = run(folder, &[&["--dry-run"], &words[1..]].concat());
    assert!(output.status.success(), "{line}: {}", stderr(&output));
}

/// What a page shows beside its files.
enum Shown<'p> {
    Command { line: String, is_long: bool },
    Said(&'p str),
}

/// Goes through the blocks of a page: writes its files, and visits the others, each in its place.
fn walk(folder: &Folder, blocks: &[(String, String)], mut visit: impl FnMut(Shown)) {
    for (kind, text) in blocks {
        match kind.split_once(' ').unwrap_or((kind, "")) {
            ("sh", length) => {
                for line in commands(text) {
                    visit(Shown::Command { line, is_long: length == "long" });
                }
            }
            ("text", "said") => visit(Shown::Said(text)),
            ("toml" | "csv", file) if !file.is_empty() => {
                std::fs::write(folder.file(file), text).unwrap();
            }
            _ => {}
        }
    }
}

/// The endings of files that commands read and write.
const ENDINGS: [&str; 5] = [".csv", ".toml", ".json", ".parquet", ".jsonl"];

/// The files that readers bring: their logs, maps and studies.
const OF_READERS: &[&str] = &[
    "live.md: rig.toml",
    "ground-test.md: first.csv",
    "ground-test.md: today.csv",
    "ground-test.md: my_study.toml",
    "machines.md: my_study.toml",
];

/// The files that a command takes as they are, which it must find.
fn named_inputs(line: &str) -> Vec<&str> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let is_file =
        |word: &str| ENDINGS.iter().any(|ending| word.ends_with(ending)) && !word.contains('=');
    let is_written = |before: &str| {
        [">", "--out", "--plot", "--html", "--make-map", "--template", "--events", "--checkpoint"]
            .contains(&before)
    };
    let pairs = words.windows(2).filter(|pair| is_file(pair[1]) && !is_written(pair[0]));
    pairs.map(|pair| pair[1]).collect()
}

/// Whether a file is there, is one of the page's, or comes from a command before: as an output, or in its folder.
fn is_known(folder: &Folder, before: &[String], file: &str) -> bool {
    let words = || before.iter().flat_map(|line| line.split_whitespace());
    let of_a_folder = file.split_once('/').map(|(folder, _)| folder);
    let of_init = file.strip_suffix(".toml");
    Path::new(&folder.file(file)).exists()
        || words().any(|word| word == file || Some(word) == of_a_folder || Some(word) == of_init)
        || of_a_folder == Some("out")
}

#[test]
fn every_command_of_the_book_is_understood_and_finds_its_files() {
    let (mut understood, mut unknown) = (0, vec![]);
    for name in pages() {
        let folder = Folder::new(&format!("read-{}", name.trim_end_matches(".md")));
        let mut before: Vec<String> = vec![];
        walk(&folder, &blocks(&page(&name)), |shown| {
            let Shown::Command { line, .. } = shown else { return };
            is_understood(&folder, &line);
            let missing =
                named_inputs(&line).into_iter().filter(|file| !is_known(&folder, &before, file));
            unknown.extend(missing.map(|file| format!("{name}: {file}")));
            before.push(line);
            understood += 1;
        });
    }
    assert_eq!(unknown, OF_READERS, "nothing writes these files");
    assert!(understood > 60, "{understood} commands");
}

#[test]
fn a_command_without_what_it_needs_is_not_understood() {
    let folder = Folder::new("read-wrong");
    for line in
        ["simulate --record", "simulate --step 1ms --tolerance 1e-3", "watch a.csv --html a.csv"]
    {
        let output =
            run(&folder, &[&["--dry-run"], &line.split(' ').collect::<Vec<_>>()[..]].concat());
        assert!(!output.status.success(), "{line}");
    }
    assert!(!is_known(&folder, &["servotwin fly --out a".into()], "b/c.json"));
    assert!(is_known(&folder, &["servotwin fly --out b".into()], "b/c.json"));
}

/// Runs the short commands of a page; what a block `text said` shows is what the command before it printed.
fn every_short_command_works(name: &str) {
    let folder = Folder::new(&format!("book-{}", name.trim_end_matches(".md")));
    let mut said = String::new();
    walk(&folder, &blocks(&page(name)), |shown| match shown {
        Shown::Command { line, is_long: false } => said = run_line(&folder, &line),
        Shown::Said(text) => {
            assert!(said.contains(text), "{name} shows:\n{text}\nand said is:\n{said}");
        }
        Shown::Command { .. } => {}
    });
}

/// One test for each page with commands that are run, so that pages run side by side.
macro_rules! run_pages {
    ($($test:ident: $page:literal),* $(,)?) => {
        $(#[test]
        #[ignore = "slow: ./check --all"]
        fn $test() {
            every_short_command_works($page);
        })*

        const RUN: &[&str] = &[$($page),*];
    };
}

run_pages! {
    the_commands_of_first_run_work: "first-run.md",
    the_commands_of_own_system_work: "own-system.md",
    the_commands_of_own_study_work: "own-study.md",
    the_commands_of_own_data_work: "own-data.md",
    the_commands_of_fit_work: "fit.md",
    the_commands_of_watch_work: "watch.md",
    the_commands_of_safety_work: "safety.md",
    the_commands_of_idea_work: "idea.md",
    the_commands_of_sensors_work: "sensors.md",
    the_commands_of_study_format_work: "study-format.md",
    the_commands_of_signals_work: "signals.md",
    the_commands_of_faults_work: "faults.md",
    the_commands_of_features_work: "features.md",
}

#[test]
fn every_page_with_short_commands_is_run() {
    let has_short = |name: &String| blocks(&page(name)).iter().any(|(kind, _)| kind == "sh");
    assert_eq!(pages().into_iter().filter(has_short).collect::<Vec<_>>(), RUN);
}

/// The template that a page shows beside a shipped system.
const DUAL: &str = include_str!("../../../servotwin/src/template/dual_system.toml");

/// The book shows parts of shipped files and templates as they are.
#[test]
fn what_the_book_shows_of_shipped_files_is_in_them() {
    for (name, file) in [("own-system.md", "systems"), ("own-study.md", "studies")] {
        let path = format!("{DOCS}/../{file}/press_axis.toml");
        let shipped = std::fs::read_to_string(&path).unwrap();
        let mut shown = 0;
        for (kind, text) in blocks(&page(name)) {
            if kind == "toml" {
                assert!(
                    shipped.contains(text.trim_end()) || DUAL.contains(text.trim_end()),
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

/// A link from the page of the shipped files to one of them. It is for readers on a code host; the book shows the file.
fn is_shipped(page: &str, link: &str) -> bool {
    let is_of = |folder: &str| link.starts_with(&format!("../{folder}/"));
    page == SHIPPED
        && ["systems", "studies"].iter().any(|f| is_of(f))
        && Path::new(DOCS).join(link).is_file()
}

#[test]
fn links_of_the_book_lead_into_the_book() {
    for name in pages() {
        let text = page(&name);
        for link in links(&text) {
            let whole = if link.starts_with('#') { format!("{name}{link}") } else { link.into() };
            assert!(is_in_the_book(&whole) || is_shipped(&name, link), "{name}: {link}");
        }
    }
    assert!(is_in_the_book("own-study.md") && is_in_the_book("images/report.png"));
    let outside = ["../README.md", "SUMMARY.md", "own-study.md#nowhere", "images/none.png"];
    assert!(!outside.iter().any(|link| is_in_the_book(link)));
}

/// Every shipped file is shown, and every file that is shown is there: mdBook only notes what it does not find.
#[test]
fn the_book_shows_the_shipped_files() {
    let shown = page(SHIPPED);
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

/// The page of the shipped files.
const SHIPPED: &str = "shipped-files.md";

/// Its sections: what a file is called there, its folder and its name.
const FILES: [(&str, &str, &str); 10] = [
    ("System", "systems", "aileron_dual"),
    ("System", "systems", "spring_actuator"),
    ("System", "systems", "valve_and_cylinder"),
    ("System", "systems", "press_axis"),
    ("Study", "studies", "paper"),
    ("Study", "studies", "spring_actuator"),
    ("Study", "studies", "press_axis"),
    ("Study", "studies", "liu_engine"),
    ("Study", "studies", "zema_hydraulic"),
    ("Study", "studies", "reprise"),
];

/// So many entries of a part are listed.
const LISTED: usize = 12;

/// The names of a section's entries.
#[derive(Clone, Copy, PartialEq)]
enum Entries {
    /// By the second part of the tables' names.
    Tables,
    /// By the keys.
    Keys,
    /// By the first value in each table of an array.
    FirstValues,
}

/// The contents of a TOML file, section by section.
fn contents(file: &str) -> Vec<(String, Vec<String>)> {
    let mut parts: Vec<(String, Vec<String>)> = vec![];
    let (mut current, mut entries, mut is_first) = (0, Entries::Tables, true);
    for line in file.lines() {
        let line = line.split(" #").next().unwrap_or("").trim_end();
        if let Some(head) = line.strip_prefix('[') {
            let name = head.trim_matches(['[', ']']);
            let (part, rest) = name.split_once('.').unwrap_or((name, ""));
            entries = match (head.starts_with('['), rest.is_empty()) {
                (true, _) => Entries::FirstValues,
                (false, true) => Entries::Keys,
                (false, false) => Entries::Tables,
            };
            is_first = true;
            let known = parts.iter().position(|(known, _)| known == part);
            current = known.unwrap_or(parts.len());
            if known.is_none() {
                parts.push((part.to_owned(), vec![]));
            }
            let table = rest.split('.').next().unwrap_or("").to_owned();
            if !table.is_empty() && !parts[current].1.contains(&table) {
                parts[current].1.push(table);
            }
        } else if let Some((key, value)) = line.split_once(" = ")
            && let Some((_, list)) = parts.get_mut(current)
        {
            let is_indented = key.starts_with([' ', '{']);
            match entries {
                Entries::Keys if !is_indented => list.push(key.into()),
                Entries::FirstValues if is_first => list.push(value.trim_matches('"').into()),
                _ => {}
            }
            is_first = false;
        }
    }
    parts
}

/// A section of the page of the shipped files.
fn shipped_section((word, folder, name): (&str, &str, &str)) -> String {
    let file = std::fs::read_to_string(format!("{DOCS}/../{folder}/{name}.toml")).unwrap();
    let title = file.lines().find_map(|line| line.strip_prefix("title = "));
    let title = title.map_or(String::new(), |title| format!(": {}", title.trim_matches('"')));
    let head: Vec<&str> = file.lines().take_while(|line| line.starts_with('#')).collect();
    let head = head.iter().map(|line| line.trim_start_matches('#').trim_start());
    let head = head.collect::<Vec<_>>().join("\n");
    let rows = contents(&file).into_iter().map(|(part, entries)| {
        let named = entries.iter().take(LISTED).map(|entry| format!("`{entry}`"));
        let named = named.collect::<Vec<_>>().join(", ");
        let more = match entries.len().saturating_sub(LISTED) {
            0 => String::new(),
            more => format!(" and {more} more"),
        };
        format!("| `{part}` | {named}{more} |\n")
    });
    format!(
        "## {word} {name}\n\n[`{folder}/{name}.toml`](../{folder}/{name}.toml){title}\n\n```text\n{head}\n```\n\n\
         | part | contents |\n|---|---|\n{}\n\
         <details>\n<summary>The whole file in the book; on a code host follow the link above</summary>\n\n\
         ```toml\n{{{{#include ../{folder}/{name}.toml}}}}\n```\n\n</details>\n\n",
        rows.collect::<String>()
    )
}

/// The usual constants of a diagnosis beside specimens with tolerances.
fn usual_constants() -> Vec<Constant> {
    let names = Names {
        actuators: vec!["a".into()],
        actions: vec!["off".into(), "on".into()],
        ..Names::default()
    };
    let mut usual = Tuning::usual(&names, &["off"]);
    usual.costs.same_actuator[0][2] = WITH_TOLERANCES_COST;
    usual.costs.other_actuator[0] = WRONG_ACTUATOR_COST;
    usual.constants(Some(&BASELINE_CORRECTED))
}

/// The usual constants of a diagnosis, each with a link to its source.
fn constants_table() -> String {
    let row = |constant: Constant| {
        let Constant { name, value, unit, meaning, source, .. } = &constant;
        let value = format!("{value} {unit}");
        let (value, label) = (value.trim_end(), constant.label());
        format!("| `{name}` | {value} | {label} | {meaning} | `{source}` |\n")
    };
    let rows: String = usual_constants().into_iter().map(row).collect();
    format!(
        "| constant | value | label | meaning | source in `docs/` of the repository |\n|---|---|---|---|---|\n{rows}"
    )
}

/// All measures of runs, in the words of the built-in study.
fn measures_table() -> String {
    let words = Vocabulary::of(&Study::default());
    let row = |measure: &Measure| {
        let [happened, runs] = words.describe_measure(measure, &[]);
        format!("| `{}` | {happened} | {runs} |\n", measure.name)
    };
    let rows: String = measure::all().map(row).collect();
    format!("| name | what happened | in which runs |\n|---|---|---|\n{rows}")
}

#[test]
fn every_constant_names_a_page_that_exists() {
    for Constant { name, source, .. } in usual_constants() {
        assert!(Path::new(DOCS).join(source).is_file(), "{name}: {source}");
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
        ("system-format.md", format::markdown(system::keys())),
        ("study-format.md", format::markdown(study::keys())),
        ("watch.md", format::markdown(servotwin_watch::map::keys())),
        ("signals.md", format!("```text\n{}```", signal::help())),
        (SHIPPED, FILES.map(shipped_section).concat()),
        ("tuning.md", constants_table()),
        ("results.md", measures_table()),
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
