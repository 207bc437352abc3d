//! The nearest known name to a mistyped one, for helpful error messages.

use std::fmt;
use strsim::levenshtein;

/// The candidate nearest to `word`, if it is near enough.
///
/// Candidates that begin with the word come first, then those that contain it, the shortest first. Otherwise up to a
/// third of the word's letters may differ, or two in a short word. Case does not count, and the first of equally near
/// candidates wins.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let lower = word.to_lowercase();
    let candidates: Vec<&str> = candidates.into_iter().collect();
    completed(&lower, &candidates).or_else(|| mistyped(&lower, &candidates))
}

/// The shortest candidate that contains the word.
fn completed<'a>(word: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let parts = |least: usize, is_part: fn(&str, &str) -> bool| {
        let own = candidates.iter().filter(|one| is_part(&one.to_lowercase(), word));
        own.min_by_key(|one| one.len()).filter(|_| word.chars().count() >= least).copied()
    };
    // Two or three letters occur in too many names.
    parts(3, |name, word| name.starts_with(word))
        .or_else(|| parts(4, |name, word| name.contains(word)))
}

fn mistyped<'a>(lower: &str, candidates: &[&'a str]) -> Option<&'a str> {
    let letters = lower.chars().count();
    let limit = (letters / 3).max(2);
    candidates
        .iter()
        .map(|candidate| (levenshtein(lower, &candidate.to_lowercase()), *candidate))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, candidate)| {
            // Two edits turn any two-letter name into any other, which is no useful advice.
            *distance <= limit && *distance < candidate.chars().count().max(letters)
        })
        .map(|(_, candidate)| candidate)
}

/// A name that a system or table does not have.
#[derive(Clone, Debug, PartialEq)]
pub struct UnknownName {
    /// What the name refers to, for the message.
    pub what: &'static str,
    /// The given name.
    pub given: String,
    /// The possible names.
    pub known: Vec<String>,
}

impl UnknownName {
    /// Whether there is neither a similar name nor a short list.
    pub fn is_long(&self) -> bool {
        self.known.len() > 20 && self.nearest().is_none()
    }

    /// The most similar known name.
    pub fn nearest(&self) -> Option<&str> {
        nearest(&self.given, self.known.iter().map(String::as_str))
    }
}

impl fmt::Display for UnknownName {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        let UnknownName { what, given, known } = self;
        write!(out, "the system has no {what} '{given}'")?;
        match self.nearest() {
            Some(name) => write!(out, "; did you mean '{name}'?"),
            None if known.is_empty() => write!(out, "; it has none at all"),
            None if known.len() <= 20 => write!(out, "; it has: {}", known.join(", ")),
            None => write!(out, "; it has {}", known.len()),
        }
    }
}

impl std::error::Error for UnknownName {}
