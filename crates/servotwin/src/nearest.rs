//! The nearest known name to a mistyped one, for error messages that help.

/// The candidate nearest to `word`, if near enough to be what was meant.
///
/// Near enough is a third of the word's letters, and two in a short word; case does not count.
/// Of equally near candidates the first is taken.
pub fn nearest<'a>(word: &str, candidates: impl IntoIterator<Item = &'a str>) -> Option<&'a str> {
    let limit = (word.chars().count() / 3).max(2);
    let lower = word.to_lowercase();
    candidates
        .into_iter()
        .map(|candidate| (distance(&lower, &candidate.to_lowercase()), candidate))
        .min_by_key(|(distance, _)| *distance)
        .filter(|(distance, candidate)| {
            // Two edits can turn any two-letter name into any other: that is no hint.
            *distance <= limit && *distance < candidate.chars().count().max(word.chars().count())
        })
        .map(|(_, candidate)| candidate)
}

/// The Levenshtein distance: the least number of letters inserted, removed or replaced.
pub fn distance(left: &str, right: &str) -> usize {
    let right: Vec<char> = right.chars().collect();
    let mut row: Vec<usize> = (0..=right.len()).collect();
    for (line, letter) in left.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = line + 1;
        for (place, other) in right.iter().enumerate() {
            let replaced = diagonal + usize::from(letter != *other);
            diagonal = row[place + 1];
            row[place + 1] = replaced.min(diagonal + 1).min(row[place] + 1);
        }
    }
    row[right.len()]
}
