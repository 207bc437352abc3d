//! Interprets the words in column names of test rigs and flight test installations, in English and German.

use servotwin::units;
use servotwin_model::spec::Unit;

/// What a word of a column's name speaks of.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Topic {
    Pressure,
    Position,
    Command,
    ChamberA,
    ChamberB,
    Ram,
    Spool,
    Supply,
    Return,
    Surface,
    /// What excludes the column: a status, a rate, a temperature.
    Other,
}

/// The words for each topic; those from `ChamberA` to `Surface` are parts.
const WORDS: [(Topic, &str); 11] = [
    (Topic::Pressure, "p press pres prs pressure druck"),
    (
        Topic::Position,
        "x pos position stroke displacement travel lvdt weg hub stellung lage auslenkung",
    ),
    (
        Topic::Command,
        "cmd command comm demand dmd setpoint setpt reference soll sollwert sollwinkel \
         sollweg vorgabe befehl stellbefehl",
    ),
    (Topic::ChamberA, "a cha extend extension kolbenseite boreside capside"),
    (Topic::ChamberB, "b chb retract retraction stangenseite rodside"),
    (Topic::Ram, "ram rod piston pist cylinder cyl kolben zylinder kolbenstange"),
    (Topic::Spool, "v spool spl valve vlv servovalve sv ventil schieber steuerschieber"),
    (Topic::Supply, "s supply sup suppl sply pump versorgung vorlauf zulauf speise"),
    (Topic::Return, "t return ret rtn tank drain ruecklauf"),
    (
        Topic::Surface,
        "surface surf srf aileron ail rudder rud elevator elev flap ruder querruder klappe \
         steuerflaeche",
    ),
    (
        Topic::Other,
        "status stat valid validity flag error err fault alarm limit twin residual band temp \
         temperature temperatur rate speed velocity geschwindigkeit acc acceleration current \
         strom force kraft diff delta min max std sigma count counter",
    ),
];

fn is_part(word: &str) -> bool {
    WORDS[3..10].iter().any(|(_, list)| list.split(' ').any(|known| known == word))
}

/// What the words of a name speak of.
pub(super) fn topics(words: &[String]) -> Vec<Topic> {
    words.iter().flat_map(|word| topics_of(word)).collect()
}

fn topics_of(word: &str) -> Vec<Topic> {
    let is_whole = WORDS.iter().any(|(_, list)| list.split(' ').any(|known| known == word));
    // A quantity's letter before the word of a part: PSUP, XRAM.
    let (quantity, part) = match word.split_at_checked(1) {
        Some(("p", rest)) if !is_whole && is_part(rest) => (Some(Topic::Pressure), rest),
        Some(("x" | "s", rest)) if !is_whole && rest.len() > 1 && is_part(rest) => {
            (Some(Topic::Position), rest)
        }
        _ => (None, word),
    };
    let speaks = |list: &str| list.split(' ').any(|known| speaks_of(part, known));
    let spoken = WORDS.iter().filter(|(_, list)| speaks(list)).map(|(topic, _)| *topic);
    quantity.into_iter().chain(spoken).collect()
}

/// Whether a word is a known one or a compound with it: Versorgungsdruck, Kolbenweg.
fn speaks_of(word: &str, known: &str) -> bool {
    let is_end = known.len() == 3 && matches!(known, "weg" | "hub") && word.ends_with(known);
    word == known
        || is_end
        || (known.len() >= 4 && word.len() > known.len() && word.contains(known))
}

/// The words of a name in lower case, and its numbers. A name is split between letters and digits, before capitals, and
/// at all other characters.
pub(super) fn words(name: &str) -> (Vec<String>, Vec<u32>) {
    let (mut words, mut current): (Vec<String>, String) = (vec![], String::new());
    let mut last: Option<char> = None;
    for character in name.chars() {
        let begins = last.is_some_and(|last| {
            last.is_ascii_digit() != character.is_ascii_digit()
                || (last.is_lowercase() && character.is_uppercase())
        });
        if begins || !character.is_alphanumeric() {
            words.extend(Some(std::mem::take(&mut current)).filter(|word| !word.is_empty()));
        }
        if character.is_alphanumeric() {
            character.to_lowercase().for_each(|c| match c {
                'ä' => current += "ae",
                'ö' => current += "oe",
                'ü' => current += "ue",
                'ß' => current += "ss",
                c => current.push(c),
            });
        }
        last = Some(character);
    }
    words.extend(Some(current).filter(|word| !word.is_empty()));
    let numbers = words.iter().filter_map(|word| word.parse().ok()).collect();
    words.retain(|word| !word.starts_with(|c: char| c.is_ascii_digit()));
    (words, numbers)
}

/// Longer names are not understood, bytes.
pub(super) const LONGEST: usize = 256;

/// A name reduced to lowercase letters and digits.
pub(super) fn key(name: &str) -> String {
    name.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect()
}

/// A unit with its spelling.
pub(super) type Named<'n> = (Unit, &'n str);

/// Parses a known unit, with its text.
pub(super) fn known(text: &str) -> Option<Named<'_>> {
    let text = text.trim();
    units::find(text).map(|row| (row.unit, text))
}

/// All ways to split a column's name into a name and a unit: the unit in brackets, or behind `_`, a blank or a point.
/// The whole name comes last.
pub(super) fn splits(name: &str) -> Vec<(&str, Option<Named<'_>>)> {
    let mut found = vec![];
    let trimmed = name.trim();
    if let Some(inner) = trimmed.strip_suffix([']', ')'])
        && let Some(open) = inner.rfind(['[', '('])
    {
        let unit = known(&inner[open + 1..]);
        found.push((&inner[..open], unit));
    }
    for (place, mark) in trimmed.match_indices(['_', ' ', '.', '/']) {
        if let Some(unit) = known(&trimmed[place + mark.len()..]) {
            found.push((&trimmed[..place], Some(unit)));
        }
    }
    found.push((trimmed, None));
    found
}
