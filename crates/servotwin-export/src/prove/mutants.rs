//! Mutants: an export with one small mistake, which a proof must find. A proof that finds every mistake is worth something.
//!
//! A mistake is the last digit of a number, a wrong power of two (a wrong unit), swapped branches, another feature or
//! class in the tables, or another arithmetic operator in the code.

use super::library::{Build, Objects};
use super::{HYBRID_SAMPLES, Plan, ProofEvidence, chain, compare_parts, hybrid, points, twin};
use crate::error::ExportError;
use crate::precision::Precision;
use crate::source_file::SourceFile;
use serde::Serialize;
use servotwin_diagnosis::random::Random;
use std::slice;

/// Samples through the whole chain for each mutant that the trees do not show.
const SAMPLES: u64 = 20_000;

/// Points of the twin's equations for each mutant.
const POINTS: u64 = 200;

/// Variants of the twin for each mutant, and their duration, s: many short ones, because each settles at the start.
const VARIANTS: (u64, f64) = (12, 3.0);

/// Rows of random values for each hierarchy of a mutant.
const RANDOM_ROWS: usize = 2000;

/// A mistake.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Mutant {
    /// The changed file.
    pub file: &'static str,
    /// Number of the line, from 1.
    pub line: usize,
    /// What stood there, and what stands there now.
    pub change: String,
    /// Whether the proof found it, or the compiler refused it.
    pub is_found: bool,
}

/// Which mistakes to make.
#[derive(Debug, Clone, Copy)]
pub struct Mistakes<'m> {
    /// How many.
    pub count: usize,
    /// The seed of their random places.
    pub seed: u64,
    /// The only file with mistakes; `None` for all.
    pub only: Option<&'m str>,
}

impl Mistakes<'_> {
    /// Checks that they can be made in an export of this precision.
    ///
    /// # Errors
    /// [`ExportError::Unsupported`] for single precision.
    pub fn check(&self, precision: Precision) -> Result<(), ExportError> {
        let why = "mistakes are made in double precision alone, with the same hand-written text: leave '--mutants' out";
        let can_be_made = self.count == 0 || precision == Precision::F64;
        if can_be_made { Ok(()) } else { Err(ExportError::Unsupported(why)) }
    }
}

/// A place in a text that can be changed.
struct Site {
    file: usize,
    start: usize,
    old: String,
    new: String,
}

/// Makes mistakes and tries to find each. `tell` hears how many so far.
///
/// # Errors
/// Those of [`Mistakes::check`], and as [`super::prove`] for the export without a mistake.
pub fn mutants(
    plan: &Plan,
    build: &Build,
    mistakes: Mistakes,
    tell: &mut dyn FnMut(u64),
) -> Result<Vec<Mutant>, ExportError> {
    let files = plan.files;
    mistakes.check(plan.precision)?;
    if mistakes.count == 0 {
        return Ok(Vec::new());
    }
    let objects = Objects::new(files, build, None)?;
    let kinds = sites(files, mistakes.only);
    let mut random = Random::new(mistakes.seed);
    let mut all = Vec::new();
    for number in 0..mistakes.count {
        let kind = &kinds[number % kinds.len()];
        let Site { file, start, old, new } = &kind[random.index(kind.len())];
        let SourceFile { name, text } = &files[*file];
        let changed = [&text[..*start], new, &text[start + old.len()..]].concat();
        let is_found = match objects.replace(name, &changed) {
            Ok(()) => is_found(plan, &objects, number)?,
            Err(ExportError::Refused { .. }) => true,
            Err(other) => return Err(other),
        };
        objects.replace(name, text)?;
        let line = 1 + text[..*start].matches('\n').count();
        all.push(Mutant { file: name, line, change: format!("{old} -> {new}"), is_found });
        tell(number as u64 + 1);
    }
    Ok(all)
}

fn is_found(plan: &Plan, objects: &Objects, number: usize) -> Result<bool, ExportError> {
    let compiled = objects.load(&format!("mutant_{number}.so"))?;
    let mut evidence = ProofEvidence::until(1);
    compare_parts(plan.diagnoser, (&compiled, plan.precision), RANDOM_ROWS, &mut evidence)?;
    let (compiled, all) = (slice::from_ref(&compiled), slice::from_mut(&mut evidence));
    if let Some(twin) = plan.twin.filter(|_| all[0].holds()) {
        points::compare(twin, compiled, POINTS, all)?;
        if all[0].holds() {
            twin::compare(twin, compiled, VARIANTS, all, &mut |_| ())?;
        }
    }
    if let Some(subject) = plan.subject().filter(|_| all[0].holds()) {
        hybrid::compare(&subject, compiled, HYBRID_SAMPLES, all)?;
    }
    if all[0].holds() {
        chain::compare(plan.diagnoser, compiled, SAMPLES, all, &mut |_| ())?;
    }
    Ok(!evidence.holds())
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
