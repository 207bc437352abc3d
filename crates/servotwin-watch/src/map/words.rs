//! Interprets the words in column names of test rigs and flight test installations, in English and German.

use servotwin::units;
use servotwin_model::spec::Unit;

/// The meaning of a column according to its name.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct ColumnMeaning {
    pub pressure: bool,
    pub position: bool,
    pub command: bool,
    /// The parts that the name mentions, each once.
    pub parts: Parts,
    /// Whether a word excludes the column: a status, a rate, a temperature.
    pub is_other: bool,
}

/// The parts that a name mentions.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Parts {
    pub chamber_a: bool,
    pub chamber_b: bool,
    pub ram: bool,
    pub spool: bool,
    pub supply: bool,
    pub back: bool,
    pub surface: bool,
}

const PRESSURE: &str = "p press pres prs pressure druck";
const POSITION: &str =
    "x pos position stroke displacement travel lvdt weg hub stellung lage auslenkung";
const COMMAND: &str = "cmd command comm demand dmd setpoint setpt reference soll sollwert sollwinkel sollweg \
    vorgabe befehl stellbefehl";
const CHAMBER_A: &str = "a cha extend extension kolbenseite boreside capside";
const CHAMBER_B: &str = "b chb retract retraction stangenseite rodside";
const RAM: &str = "ram rod piston pist cylinder cyl kolben zylinder kolbenstange";
const SPOOL: &str = "v spool spl valve vlv servovalve sv ventil schieber steuerschieber";
const SUPPLY: &str = "s supply sup suppl sply pump versorgung vorlauf zulauf speise";
const BACK: &str = "t return ret rtn tank drain ruecklauf";
const SURFACE: &str = "surface surf srf aileron ail rudder rud elevator elev flap ruder querruder klappe \
    steuerflaeche";
const OTHER: &str = "status stat valid validity flag error err fault alarm limit twin residual band temp \
    temperature temperatur rate speed velocity geschwindigkeit acc acceleration current strom \
    force kraft diff delta min max std sigma count counter";

impl ColumnMeaning {
    /// Interprets the words of a name.
    pub(super) fn of(words: &[String]) -> Self {
        let mut meaning = ColumnMeaning::default();
        words.iter().for_each(|word| meaning.add(word));
        meaning
    }

    fn add(&mut self, word: &str) {
        // A quantity's letter before the word of a part: PSUP, XRAM.
        let quantity = match word.split_at_checked(1) {
            Some(("p", rest)) if is_part(rest) => Some(("p", rest)),
            Some(("x" | "s", rest)) if rest.len() > 1 && is_part(rest) => Some(("x", rest)),
            _ => None,
        };
        let whole = all().iter().any(|list| list.split(' ').any(|known| known == word));
        match quantity {
            Some((quantity, part)) if !whole => {
                self.mark(quantity);
                self.add(part);
            }
            _ => self.mark(word),
        }
    }

    fn mark(&mut self, word: &str) {
        let is = |list: &str| list.split(' ').any(|known| speaks_of(word, known));
        self.pressure |= is(PRESSURE);
        self.position |= is(POSITION);
        self.command |= is(COMMAND);
        self.is_other |= is(OTHER);
        let parts = &mut self.parts;
        parts.chamber_a |= is(CHAMBER_A);
        parts.chamber_b |= is(CHAMBER_B);
        parts.ram |= is(RAM);
        parts.spool |= is(SPOOL);
        parts.supply |= is(SUPPLY);
        parts.back |= is(BACK);
        parts.surface |= is(SURFACE);
    }
}

fn all() -> [&'static str; 11] {
    [PRESSURE, POSITION, COMMAND, CHAMBER_A, CHAMBER_B, RAM, SPOOL, SUPPLY, BACK, SURFACE, OTHER]
}

fn is_part(word: &str) -> bool {
    let parts = [CHAMBER_A, CHAMBER_B, RAM, SPOOL, SUPPLY, BACK, SURFACE];
    parts.iter().any(|list| list.split(' ').any(|known| known == word))
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_fall_into_words_and_numbers() {
        let (found, numbers) = words("ACT1_xRamPos [mm] Rücklauf");
        assert_eq!(found, ["act", "x", "ram", "pos", "mm", "ruecklauf"]);
        assert_eq!(numbers, [1]);
    }

    #[test]
    fn letters_of_quantities_stand_before_parts() {
        let of = |name: &str| ColumnMeaning::of(&words(name).0);
        let supply = of("PSUP1");
        assert!(supply.pressure && supply.parts.supply && !supply.position);
        let ram = of("XRAM2");
        assert!(ram.position && ram.parts.ram && !ram.pressure);
        let both = of("Versorgungsdruck");
        assert!(both.pressure && both.parts.supply);
        assert!(of("Kolbenweg").position && of("Kolbenweg").parts.ram);
        let command = of("AIL_CMD");
        assert!(command.command && command.parts.surface && !command.parts.chamber_a);
        assert!(of("PSUP1_status").is_other);
    }
}
