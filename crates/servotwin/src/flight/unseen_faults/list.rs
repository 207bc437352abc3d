//! The unseen faults, which no training data contain: one line each in `faults.txt`.

use super::effect::{Effect, EffectKind, Who};
use crate::measure::outcome::Needed;
use std::sync::LazyLock;

/// A fault without training data.
#[derive(Debug)]
pub struct UnseenFault {
    /// The challenge set that it belongs to, as options name it.
    pub set: &'static str,
    /// The display title.
    pub title: &'static str,
    /// The strengths that are flown.
    pub(crate) strengths: Vec<f64>,
    /// The strengths in words, with their unit.
    pub(crate) strengths_in_words: &'static str,
    /// What is right after the onset.
    pub(crate) needed: Needed,
    /// The effects; without a size of its own an effect has the strength.
    effects: Vec<(Effect, Option<f64>)>,
}

/// All unseen faults. Flights are numbered in this order, so new ones stand at the end.
pub static ALL: LazyLock<Vec<UnseenFault>> = LazyLock::new(|| {
    let lines = include_str!("faults.txt").lines().filter(|line| !line.starts_with('#'));
    lines.map(|line| fault(line).unwrap_or_else(|| panic!("no fault: {line}"))).collect()
});

impl UnseenFault {
    /// The effects at a strength.
    pub(crate) fn effects(&self, strength: f64) -> impl Iterator<Item = Effect> {
        let sized = move |(effect, size): &(Effect, Option<f64>)| Effect {
            size: size.unwrap_or(strength),
            ..*effect
        };
        self.effects.iter().map(sized)
    }
}

/// The fault of a line: set, title, strengths, these in words, what is right, and the effects.
fn fault(line: &'static str) -> Option<UnseenFault> {
    let cells: Vec<&'static str> = line.split('|').map(str::trim).collect();
    let [set, title, strengths, strengths_in_words, needed, effects] = cells[..] else {
        return None;
    };
    Some(UnseenFault {
        set,
        title,
        strengths: strengths.split(' ').map(|word| word.parse().ok()).collect::<Option<_>>()?,
        strengths_in_words,
        needed: serde_json::from_value(needed.into()).ok()?,
        effects: effects.split(", ").map(effect).collect::<Option<_>>()?,
    })
}

/// An effect: whose it is, its kind, what it changes, and its size; `s` stands for the strength.
fn effect(text: &'static str) -> Option<(Effect, Option<f64>)> {
    let mut words = text.split(' ');
    let who = match words.next()? {
        "own" => Who::Own,
        "other" => Who::Other,
        "all" => Who::All,
        _ => return None,
    };
    let kind: EffectKind = serde_json::from_value(words.next()?.into()).ok()?;
    let of = words.next()?;
    let size = match words.next() {
        None | Some("s") => None,
        Some(size) => Some(size.parse().ok()?),
    };
    words.next().is_none().then_some((Effect { who, kind, of, size: 0.0 }, size))
}

/// The names of all challenge sets, in the order of [`ALL`].
pub(crate) fn set_names() -> Vec<&'static str> {
    let mut names: Vec<&str> = vec![];
    for fault in ALL.iter() {
        if !names.contains(&fault.set) {
            names.push(fault.set);
        }
    }
    names
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_is_a_fault_of_its_own() {
        let mut titles: Vec<&str> = ALL.iter().map(|fault| fault.title).collect();
        titles.sort_unstable();
        titles.dedup();
        assert_eq!((ALL.len(), titles.len(), set_names().len()), (41, 41, 8));
        let drags = ALL.iter().find(|fault| fault.title == "spool drags").unwrap();
        assert_eq!((drags.set, drags.needed), ("mechanics", Needed::Shutdown));
        let sizes = drags.strengths.iter().flat_map(|&s| drags.effects(s)).map(|own| own.size);
        assert_eq!(sizes.collect::<Vec<_>>(), [0.03, 0.1]);
    }
}
