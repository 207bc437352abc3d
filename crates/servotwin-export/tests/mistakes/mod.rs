//! Exports with one small mistake each, which a proof must find. A proof that finds every mistake is worth something.
//!
//! A mistake is the last digit of a number, a wrong power of two (a wrong unit), swapped branches, another feature or
//! class in the tables, or another arithmetic operator in the code.

use servotwin_diagnosis::random::Random;
use servotwin_export::prove::{Build, Plan, ProofEvidence, prove};
use servotwin_export::{ExportError, SourceFile};

/// A mistake.
#[derive(Debug, PartialEq, Eq)]
pub struct Mistake {
    /// The changed file.
    pub file: &'static str,
    /// Number of the line, from 1.
    pub line: usize,
    /// What stood there, and what stands there now.
    pub change: String,
}

/// A place in a text that can be changed.
struct Site {
    file: usize,
    start: usize,
    old: String,
    new: String,
}

/// Makes this many mistakes at random places, in all files or only in one, and proves the export with each.
/// Returns those that the proof did not find.
pub fn not_found(plan: &Plan, (count, seed): (usize, u64), only: Option<&str>) -> Vec<Mistake> {
    let kinds = sites(plan.files, only);
    let mut random = Random::new(seed);
    let mut missed = Vec::new();
    for number in 0..count {
        let kind = &kinds[number % kinds.len()];
        let Site { file, start, old, new } = &kind[random.index(kind.len())];
        let mut files = plan.files.to_vec();
        let SourceFile { name, text } = &mut files[*file];
        let mistake = Mistake {
            file: name,
            line: 1 + text[..*start].matches('\n').count(),
            change: format!("{old} -> {new}"),
        };
        text.replace_range(*start..start + old.len(), new);
        let plan = Plan { files: &files, ..*plan };
        match prove(&plan, &[Build::new("gcc -O0")], &mut |_, _| ()) {
            Ok(proven) if proven.iter().all(ProofEvidence::holds) => missed.push(mistake),
            Ok(_) | Err(ExportError::Refused { .. }) => {}
            Err(other) => panic!("{mistake:?}: {other}"),
        }
    }
    missed
}

/// All places, by kind of mistake; a kind without places is left out.
fn sites(files: &[SourceFile], only: Option<&str>) -> Vec<Vec<Site>> {
    let (mut kinds, mut operators) = (Vec::new(), Vec::new());
    for (file, SourceFile { name, text }) in files.iter().enumerate() {
        if only.is_some_and(|only| only != *name) {
            continue;
        }
        match *name {
            "servotwin_tables.c" => kinds.extend(sites_of_tables(file, text)),
            name if name.ends_with(".c") && name != "main.c" => {
                operators.push(sites_of_code(file, text));
            }
            _ => {}
        }
    }
    kinds.extend(operators);
    kinds.retain(|kind| !kind.is_empty());
    kinds
}

/// The items of all arrays whose name ends thus, with their places.
fn items<'t>(text: &'t str, ending: &'t str) -> impl Iterator<Item = (usize, &'t str)> + 't {
    let starts = text.match_indices(ending).filter_map(move |(at, _)| {
        let opened = at + text[at..].find('{')? + 1;
        let is_array = text[at + ending.len()..].starts_with('[');
        let closed = opened + text[opened..].find('}')?;
        is_array.then_some((opened, closed))
    });
    starts
        .flat_map(move |(opened, closed)| {
            let body = &text[opened..closed];
            body.split_inclusive(',').scan(opened, |at, part| {
                let start = *at + part.len() - part.trim_start().len();
                *at += part.len();
                Some((start, part.trim().trim_end_matches(',')))
            })
        })
        .filter(|(_, item)| !item.is_empty())
}

/// Numbers, branches, features and classes of the tables.
fn sites_of_tables(file: usize, text: &str) -> Vec<Vec<Site>> {
    let changed = |ending: &str, change: &dyn Fn(&str) -> Option<String>| {
        changed_items(file, items(text, ending), change)
    };
    let next =
        |item: &str| Some(format!("{}", item.trim_end_matches('U').parse::<u32>().ok()? + 1));
    vec![
        changed("_thresholds", &last_digit),
        changed("_values", &last_digit),
        changed("_probabilities", &last_digit),
        changed("_thresholds", &power_of_two),
        changed("_values", &power_of_two),
        changed("_features", &next),
        swapped_branches(file, items(text, "_left"), items(text, "_right")),
        first_words(file, text, ("servotwin_sensors[", ";", "{ "), &power_of_two),
        changed("_decisions", &other_decision),
    ]
}

/// Items that a change makes to something else.
fn changed_items<'t>(
    file: usize,
    items: impl Iterator<Item = (usize, &'t str)>,
    change: &dyn Fn(&str) -> Option<String>,
) -> Vec<Site> {
    let site = |(start, item): (usize, &str)| {
        Some(Site { file, start, old: item.into(), new: change(item)? })
    };
    items.filter_map(site).collect()
}

/// The other of two decisions.
fn other_decision(item: &str) -> Option<String> {
    Some(if item == "0" { "1".into() } else { "0".into() })
}

/// Pairs of different children: `left` gets what `right` has. The arrays of one stage follow each other.
fn swapped_branches<'t>(
    file: usize,
    left: impl Iterator<Item = (usize, &'t str)>,
    right: impl Iterator<Item = (usize, &'t str)>,
) -> Vec<Site> {
    let pairs = left.zip(right).filter(|(a, b)| a.1 != b.1);
    let swapped = |((start, old), (_, new)): ((usize, &str), (usize, &str))| Site {
        file,
        start,
        old: old.into(),
        new: new.into(),
    };
    pairs.map(swapped).collect()
}

/// The first number of each entry of an array of structs.
fn first_words(
    file: usize,
    text: &str,
    (name, end, before): (&str, &str, &str),
    change: &dyn Fn(&str) -> Option<String>,
) -> Vec<Site> {
    let Some(at) = text.find(name) else { return Vec::new() };
    let end = at + text[at..].find(end).unwrap_or(0);
    let entries = text[at..end].match_indices(before).map(|(place, _)| at + place + before.len());
    let sites = entries.filter_map(|start| {
        let old = &text[start..start + text[start..].find(',')?];
        Some(Site { file, start, old: old.into(), new: change(old)? })
    });
    sites.collect()
}

/// A hexadecimal literal with another last digit.
fn last_digit(literal: &str) -> Option<String> {
    let (digits, exponent) = literal.split_once('p')?;
    let digit = digits.chars().last()?.to_digit(16)?;
    let other = char::from_digit(digit ^ 1, 16)?;
    (digits.len() > 4).then(|| format!("{}{other}p{exponent}", &digits[..digits.len() - 1]))
}

/// A hexadecimal literal times two.
fn power_of_two(literal: &str) -> Option<String> {
    let (digits, exponent) = literal.split_once('p')?;
    let exponent: i32 = exponent.parse().ok()?;
    (digits.len() > 4).then(|| format!("{digits}p{:+}", exponent + 1))
}

/// The first arithmetic operator of each kind in each statement that computes a number. Guards (`least`) are left out: only
/// numbers that do not occur would show a mistake in them.
fn sites_of_code(file: usize, text: &str) -> Vec<Site> {
    let is_statement = |line: &str| {
        ["double", "servotwin_real"].into_iter().any(|number| {
            line.trim_start().starts_with(&format!("const {number} "))
                && !line.contains(&format!("{number} *"))
                && !line.contains(&format!("{number} least"))
        })
    };
    let mut sites = Vec::new();
    let mut begin = 0;
    for line in text.split_inclusive('\n') {
        for (old, new) in [(" + ", " - "), (" - ", " + "), (" * ", " / "), (" / ", " * ")] {
            let at = line.find(old).filter(|_| is_statement(line));
            sites.extend(at.map(|at| Site {
                file,
                start: begin + at,
                old: old.into(),
                new: new.into(),
            }));
        }
        begin += line.len();
    }
    sites
}
