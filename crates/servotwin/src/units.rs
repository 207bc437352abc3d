//! The one table of units as people write them.
//!
//! System files, signals, column names, maps of logs and the advice about values in another unit read it.

use crate::text::rounded;
use crate::toml_text::{Diagnostic, Entry, NumberWithUnit};
use servotwin_model::spec::Unit;
use std::collections::BTreeMap;
use std::f64::consts::PI;
use std::sync::LazyLock;

/// A unit as it is written behind a number.
#[derive(Debug, PartialEq)]
pub struct NamedUnit {
    /// How it is typed.
    pub symbol: &'static str,
    /// The SI unit of the same dimension.
    pub unit: Unit,
    /// One of it in SI.
    pub si: f64,
    /// Zero of it in SI.
    pub offset: f64,
    /// Whether it states that a pressure is absolute.
    pub(crate) is_absolute: bool,
    /// How messages name it.
    pub spoken: &'static str,
    /// Other spellings.
    also: &'static [&'static str],
    /// Whether logs are often in it instead of SI.
    is_usual: bool,
}

const fn named(symbol: &'static str, unit: Unit, si: f64) -> NamedUnit {
    let (offset, is_absolute, is_usual) = (0.0, false, false);
    NamedUnit { symbol, unit, si, offset, is_absolute, spoken: symbol, also: &[], is_usual }
}

const fn usual(symbol: &'static str, unit: Unit, si: f64) -> NamedUnit {
    NamedUnit { is_usual: true, ..named(symbol, unit, si) }
}

/// The SI unit itself.
const fn si(unit: Unit) -> NamedUnit {
    named(word(unit), unit, 1.0)
}

const RADIAN_PER_DEGREE: f64 = PI / 180.0;

/// The standard atmosphere: zero of a gauge pressure.
pub const ATMOSPHERE_PA: f64 = 101_325.0;

/// A gauge pressure: zero is the atmosphere.
const fn gauge(symbol: &'static str, si: f64) -> NamedUnit {
    NamedUnit { offset: ATMOSPHERE_PA, ..named(symbol, Unit::Pascal, si) }
}

/// A pressure that is said to be absolute.
const fn absolute(symbol: &'static str, si: f64) -> NamedUnit {
    NamedUnit { is_absolute: true, ..named(symbol, Unit::Pascal, si) }
}

/// Days since a day that is so many days before 1970.
const fn days(symbol: &'static str, before_1970: f64) -> NamedUnit {
    NamedUnit { offset: -86_400.0 * before_1970, ..named(symbol, Unit::Second, 86_400.0) }
}

/// All known units; within a dimension the most usual comes first.
pub(crate) static TABLE: &[NamedUnit] = &[
    si(Unit::Radian),
    NamedUnit {
        spoken: "degrees",
        also: &["°", "degrees"],
        ..usual("deg", Unit::Radian, RADIAN_PER_DEGREE)
    },
    usual("mrad", Unit::Radian, 1e-3),
    usual("mm", Unit::Metre, 1e-3),
    si(Unit::Metre),
    usual("cm", Unit::Metre, 1e-2),
    NamedUnit { spoken: "µm", ..usual("um", Unit::Metre, 1e-6) },
    NamedUnit { spoken: "inches", ..usual("in", Unit::Metre, 0.0254) },
    named("km", Unit::Metre, 1e3),
    named("ft", Unit::Metre, 0.3048),
    NamedUnit { also: &["daN/cm²", "daN/cm2"], ..usual("bar", Unit::Pascal, 1e5) },
    si(Unit::Pascal),
    NamedUnit { also: &["N/mm²", "N/mm2"], ..usual("MPa", Unit::Pascal, 1e6) },
    usual("kPa", Unit::Pascal, 1e3),
    usual("psi", Unit::Pascal, 6894.757293168),
    NamedUnit { also: &["hPa"], ..named("mbar", Unit::Pascal, 1e2) },
    named("GPa", Unit::Pascal, 1e9),
    named("ksi", Unit::Pascal, 6_894_757.293_168),
    NamedUnit {
        spoken: "kgf/cm²",
        also: &["kg/cm²", "kg/cm2", "kp/cm²", "kp/cm2", "at"],
        ..named("kgf/cm2", Unit::Pascal, 98_066.5)
    },
    named("atm", Unit::Pascal, ATMOSPHERE_PA),
    NamedUnit { also: &["torr"], ..named("mmHg", Unit::Pascal, 133.322_387_415) },
    named("inHg", Unit::Pascal, 3_386.388_640_341),
    gauge("barg", 1e5),
    gauge("mbarg", 1e2),
    gauge("Pag", 1.0),
    gauge("kPag", 1e3),
    gauge("MPag", 1e6),
    gauge("psig", 6894.757293168),
    NamedUnit { also: &["kg/cm2g", "kp/cm2g", "atü"], ..gauge("kgf/cm2g", 98_066.5) },
    absolute("bara", 1e5),
    absolute("mbara", 1e2),
    absolute("Paa", 1.0),
    absolute("kPaa", 1e3),
    absolute("MPaa", 1e6),
    absolute("psia", 6894.757293168),
    NamedUnit { also: &["kg/cm2a", "kp/cm2a", "ata"], ..absolute("kgf/cm2a", 98_066.5) },
    si(Unit::Kelvin),
    NamedUnit {
        offset: 273.15,
        also: &["celsius", "deg_c", "degc"],
        ..named("°C", Unit::Kelvin, 1.0)
    },
    NamedUnit {
        offset: 459.67 / 1.8,
        also: &["fahrenheit", "deg_f", "degf"],
        ..named("°F", Unit::Kelvin, 1.0 / 1.8)
    },
    si(Unit::Newton),
    usual("kN", Unit::Newton, 1e3),
    named("daN", Unit::Newton, 10.0),
    NamedUnit { also: &["kp"], ..named("kgf", Unit::Newton, 9.806_65) },
    NamedUnit { spoken: "pounds", ..usual("lbf", Unit::Newton, 4.448_221_615_260_5) },
    si(Unit::Ampere),
    usual("mA", Unit::Ampere, 1e-3),
    si(Unit::Hertz),
    usual("kHz", Unit::Hertz, 1e3),
    si(Unit::Second),
    usual("ms", Unit::Second, 1e-3),
    NamedUnit { spoken: "µs", ..usual("us", Unit::Second, 1e-6) },
    usual("ns", Unit::Second, 1e-9),
    named("min", Unit::Second, 60.0),
    named("h", Unit::Second, 3600.0),
    NamedUnit { spoken: "days", ..usual("d", Unit::Second, 86_400.0) },
    days("excel", 25_569.0),
    days("datenum", 719_529.0),
    NamedUnit { also: &["lpm"], ..usual("L/min", Unit::CubicMetrePerSecond, 1e-3 / 60.0) },
    si(Unit::CubicMetrePerSecond),
    NamedUnit {
        also: &["gal/min"],
        ..named("gpm", Unit::CubicMetrePerSecond, 3.785_411_784e-3 / 60.0)
    },
    NamedUnit { also: &["cm³/s", "ml/s"], ..named("cm3/s", Unit::CubicMetrePerSecond, 1e-6) },
    NamedUnit { also: &["m³/h"], ..named("m3/h", Unit::CubicMetrePerSecond, 1.0 / 3600.0) },
    usual("%", Unit::None, 1e-2),
    si(Unit::None),
    usual("mm/s", Unit::MetrePerSecond, 1e-3),
    si(Unit::MetrePerSecond),
    named("km/h", Unit::MetrePerSecond, 1.0 / 3.6),
    named("kt", Unit::MetrePerSecond, 1852.0 / 3600.0),
    named("in/s", Unit::MetrePerSecond, 0.0254),
    NamedUnit { also: &["°/s"], ..usual("deg/s", Unit::RadianPerSecond, RADIAN_PER_DEGREE) },
    NamedUnit { also: &["1/min", "U/min"], ..named("rpm", Unit::RadianPerSecond, PI / 30.0) },
    si(Unit::RadianPerSecond),
    si(Unit::PerRadian),
    named("1/deg", Unit::PerRadian, 1.0 / RADIAN_PER_DEGREE),
    NamedUnit { spoken: "mm²", ..named("mm2", Unit::SquareMetre, 1e-6) },
    NamedUnit { spoken: "cm²", ..named("cm2", Unit::SquareMetre, 1e-4) },
    si(Unit::SquareMetre),
    NamedUnit { spoken: "cm³", also: &["ml"], ..named("cm3", Unit::CubicMetre, 1e-6) },
    NamedUnit { spoken: "mm³", ..named("mm3", Unit::CubicMetre, 1e-9) },
    named("L", Unit::CubicMetre, 1e-3),
    si(Unit::CubicMetre),
    NamedUnit { also: &["mm²/s", "mm2/s"], ..named("cSt", Unit::SquareMetrePerSecond, 1e-6) },
    si(Unit::SquareMetrePerSecond),
    si(Unit::Kilogram),
    named("g", Unit::Kilogram, 1e-3),
    si(Unit::KilogramSquareMetre),
    si(Unit::KilogramPerCubicMetre),
    si(Unit::NewtonMetre),
    named("kN m", Unit::NewtonMetre, 1e3),
    si(Unit::NewtonPerMetre),
    NamedUnit { also: &["N/mm"], ..named("kN/m", Unit::NewtonPerMetre, 1e3) },
    named("N/µm", Unit::NewtonPerMetre, 1e6),
    si(Unit::NewtonSecondPerMetre),
    si(Unit::NewtonMetreSecond),
    si(Unit::PerMetre),
    named("1/mm", Unit::PerMetre, 1e3),
    si(Unit::MetrePerPascal),
    named("mm/bar", Unit::MetrePerPascal, 1e-8),
    si(Unit::PerPascal),
    named("1/bar", Unit::PerPascal, 1e-5),
    si(Unit::CubicMetrePerSecondPascal),
    named("L/(min bar)", Unit::CubicMetrePerSecondPascal, 1e-8 / 60.0),
    si(Unit::PascalSecondPerCubicMetre),
    named("bar min/L", Unit::PascalSecondPerCubicMetre, 6e9),
    si(Unit::PascalSecondSquaredPerMetreToTheSixth),
    named("bar min²/L²", Unit::PascalSecondSquaredPerMetreToTheSixth, 3.6e14),
    si(Unit::PerKelvin),
    si(Unit::PerSecond),
    si(Unit::PerSecondSquared),
];

impl NamedUnit {
    /// Factor and offset from this unit to `unit`; `None` for another dimension. A speed of rotation is also a frequency.
    pub fn to(&self, unit: Unit) -> Option<(f64, f64)> {
        match (self.unit, unit) {
            (own, unit) if own == unit => Some((self.si, self.offset)),
            (Unit::RadianPerSecond, Unit::Hertz) => Some((self.si * (0.5 / PI), 0.0)),
            _ => None,
        }
    }

    /// The SI unit of a dimension.
    pub fn of_si(unit: Unit) -> &'static NamedUnit {
        exactly(word(unit)).expect("every unit of the model has a row")
    }

    /// Whether it is the SI unit itself.
    pub fn is_si(&self) -> bool {
        self.symbol == word(self.unit)
    }

    /// Whether it is a multiple of the SI unit, and says no more.
    pub(crate) fn is_proportional(&self) -> bool {
        self.offset == 0.0 && !self.is_absolute
    }

    /// The end of a name in it, without the `_` before: `l_min`. Empty for a pure number.
    pub(crate) fn suffix(&self) -> String {
        match self.is_si() {
            true => self.unit.suffix().trim_start_matches('_').into(),
            false => suffix_of(&self.symbol.replace("1/", "per_").replace(' ', "")),
        }
    }

    /// Its spellings, case-sensitively; `m2` equals `m²`.
    fn spelled(&self) -> Vec<String> {
        let own = [self.symbol, self.spoken].into_iter().flat_map(|own| [own.into(), plain(own)]);
        own.chain(self.also.iter().map(|also| String::from(*also))).collect()
    }

    /// The suffixes of names in this unit.
    fn suffixes(&self) -> Vec<String> {
        let also = self.also.iter().map(|also| suffix_of(also));
        std::iter::once(self.suffix()).chain(also).filter(|suffix| !suffix.is_empty()).collect()
    }
}

/// Rows by their words. A log has up to 100,000 columns, each with many parts that may be a unit.
type Index = LazyLock<BTreeMap<String, &'static NamedUnit>>;

static SPELLED: Index = LazyLock::new(|| index(NamedUnit::spelled));
static SUFFIXES: Index = LazyLock::new(|| index(NamedUnit::suffixes));

/// The first row of each word.
fn index(words: fn(&NamedUnit) -> Vec<String>) -> BTreeMap<String, &'static NamedUnit> {
    let all = TABLE.iter().flat_map(|row| words(row).into_iter().map(move |word| (word, row)));
    let mut index = BTreeMap::new();
    all.for_each(|(word, row)| {
        index.entry(word).or_insert(row);
    });
    index
}

/// The word for a unit in a system file: its symbol, `1` for a pure number.
pub const fn word(unit: Unit) -> &'static str {
    match unit {
        Unit::None => "1",
        unit => unit.symbol(),
    }
}

/// The unit with this spelling, case-sensitively: `mA` is not `MA`.
pub fn exactly(text: &str) -> Option<&'static NamedUnit> {
    SPELLED.get(text).copied()
}

/// The unit with this spelling, or with this suffix of a name in any case.
pub fn find(text: &str) -> Option<&'static NamedUnit> {
    let text = text.trim();
    exactly(text).or_else(|| by_suffix(&suffix_of(text))).or_else(|| by_reference(text))
}

/// A pressure with a word for what its zero is: `bar (g)`, `psi gauge`, `kPa abs`.
fn by_reference(text: &str) -> Option<&'static NamedUnit> {
    let letters = |text: &str| suffix_of(text).replace(|c: char| !c.is_alphanumeric(), "");
    let text = letters(text);
    let behind = |words: [&str; 3]| words.into_iter().find_map(|word| text.strip_suffix(word));
    let gauge = behind(["gauge", "rel", "g"]).or_else(|| text.strip_suffix('ü'));
    let wanted = match gauge {
        Some(stem) => format!("{stem}g"),
        None => format!("{}a", behind(["absolute", "abs", "a"])?),
    };
    let is_of = |row: &&NamedUnit| row.unit == Unit::Pascal && !row.is_proportional();
    TABLE
        .iter()
        .filter(is_of)
        .find(|row| [row.symbol].iter().chain(row.also).any(|own| letters(own) == wanted))
}

fn by_suffix(suffix: &str) -> Option<&'static NamedUnit> {
    SUFFIXES.get(suffix).copied()
}

/// The SI unit of a word in a system file.
pub(crate) fn find_si(text: &str) -> Option<Unit> {
    exactly(text).filter(|row| row.is_si()).map(|row| row.unit)
}

/// All words that [`find_si`] knows.
pub(crate) fn spellings_of_si() -> Vec<&'static str> {
    SPELLED.iter().filter(|(_, row)| row.is_si()).map(|(word, _)| word.as_str()).collect()
}

/// The SI unit of the dimension of any unit; an empty text means a pure number.
pub(crate) fn meant(text: &str) -> Option<Unit> {
    if matches!(text.trim(), "" | "-") {
        return Some(Unit::None);
    }
    find(text).map(|row| row.unit)
}

/// Units that logs are often in instead of SI, the most usual first.
fn of_logs(unit: Unit) -> impl Iterator<Item = &'static NamedUnit> {
    TABLE.iter().filter(move |row| row.unit == unit && row.is_usual)
}

/// The units of time in logs, each with its length in s.
pub fn of_times() -> Vec<(&'static str, f64)> {
    let second = exactly(word(Unit::Second)).into_iter();
    second.chain(of_logs(Unit::Second)).map(|row| (row.symbol, row.si)).collect()
}

/// Whether inputs and sensors usually have this dimension.
pub(crate) fn is_usual(unit: Unit) -> bool {
    unit == Unit::Kelvin || typed(unit).is_some()
}

/// The unit that people usually type instead of SI.
pub(crate) fn typed(unit: Unit) -> Option<&'static NamedUnit> {
    of_logs(unit).next()
}

/// Units whose numbers differ by less than this factor are not told apart from a faulty sensor.
const LEAST_FACTOR: f64 = 2.4;
/// Largest error of the ratio between a unit and the declared one, as a share of its logarithm, and in all.
const RATIO_ERROR: (f64, f64) = (0.15, 0.35);
/// Units whose logarithms differ by less than this cannot be told apart: bar, kgf/cm² and atm. Largest error of a ratio
/// between two units of which none is declared.
const SAME: f64 = 0.05;

/// Numbers in one unit that were read in another.
#[derive(Debug, Clone, PartialEq)]
pub struct Misread {
    /// The unit that they are in. The likeliest comes first; the others cannot be told apart from it.
    pub actual: Vec<&'static NamedUnit>,
    /// The unit that they were taken for.
    pub read_as: &'static NamedUnit,
}

impl Misread {
    fn new(actual: &'static NamedUnit, read_as: &'static NamedUnit) -> Self {
        let is_same = |row: &&NamedUnit| *row != actual && (row.si / actual.si).ln().abs() < SAME;
        let actual = std::iter::once(actual).chain(rows(actual.unit).filter(is_same)).collect();
        Misread { actual, read_as }
    }

    /// What the values must be multiplied with.
    pub fn factor(&self) -> f64 {
        self.actual[0].si / self.read_as.si
    }

    /// `to be in mm, not m` or, where nobody declared the second unit, `to be inches read as mm`, with what to do.
    pub(crate) fn in_words(&self, declared: &NamedUnit) -> (String, String) {
        let actual: Vec<&str> = self.actual.iter().map(|unit| unit.spoken).collect();
        let (actual, read_as) = (actual.join(" or "), self.read_as.spoken);
        match self.read_as == declared {
            true => (
                format!("to be in {actual}, not {read_as}"),
                "give the unit in a map file, which --make-map writes".into(),
            ),
            false => (
                format!("to be {actual} read as {read_as}"),
                format!("factor = {} in a map file undoes it", rounded(self.factor(), 6)),
            ),
        }
    }
}

/// How a column may have been misread whose values, in the `declared` unit, are `ratio` times what is expected; `None`
/// if no unit fits, or if a faulty sensor might show the ratio.
pub fn misread(declared: &'static NamedUnit, ratio: f64) -> Option<Misread> {
    let nearest = |all: Vec<Misread>, most: fn(f64) -> f64| {
        let error = |misread: &Misread| (ratio * misread.factor()).ln().abs();
        let fits = all.into_iter().filter(|misread| {
            let factor = misread.factor().ln().abs();
            factor > LEAST_FACTOR.ln() && error(misread) < most(factor)
        });
        fits.min_by(|a, b| error(a).total_cmp(&error(b)))
    };
    let wide = |factor: f64| (RATIO_ERROR.0 * factor).min(RATIO_ERROR.1);
    let unusual = || rows(declared.unit).map(|row| Misread::new(row, declared)).collect();
    let of_declared = |row| Misread::new(row, declared);
    nearest(usual_rows(declared.unit).map(of_declared).collect(), wide)
        .or_else(|| nearest(unusual(), wide))
        .or_else(|| nearest(pairs(declared.unit), |_| SAME))
}

/// The ways in which a column may have been misread, those with the `declared` unit first.
pub fn misreadings(declared: &'static NamedUnit) -> Vec<Misread> {
    let mut found: Vec<Misread> = vec![];
    let of_declared = usual_rows(declared.unit).map(|row| Misread::new(row, declared));
    for misread in of_declared.chain(pairs(declared.unit)) {
        let is_same = |other: &Misread| (other.factor() / misread.factor()).ln().abs() < SAME;
        if misread.factor().ln().abs() > LEAST_FACTOR.ln() && !found.iter().any(is_same) {
            found.push(misread);
        }
    }
    found
}

/// All pairs of usual units of a dimension.
fn pairs(unit: Unit) -> Vec<Misread> {
    usual_rows(unit)
        .flat_map(|row| usual_rows(unit).map(move |other| Misread::new(row, other)))
        .collect()
}

/// The units of a dimension whose zero is that of SI.
fn rows(unit: Unit) -> impl Iterator<Item = &'static NamedUnit> {
    TABLE.iter().filter(move |row| row.unit == unit && row.is_proportional())
}

fn usual_rows(unit: Unit) -> impl Iterator<Item = &'static NamedUnit> {
    rows(unit).filter(|row| row.is_usual || row.is_si())
}

/// The most usual unit in which a value lies within an SI range, if it is outside as long as it is read in the
/// `declared` unit.
pub fn within(declared: &NamedUnit, si: f64, range: (f64, f64)) -> Option<&'static NamedUnit> {
    let value = (si - declared.offset) / declared.si;
    let is_inside = |row: &&NamedUnit| (range.0..=range.1).contains(&(value * row.si));
    let usual = TABLE.iter().filter(|row| row.unit == declared.unit);
    usual.filter(|row| row.is_usual || row.is_si()).find(|row| *row != declared && is_inside(row))
}

/// How numbers for a unit may be written, for messages: SI first.
pub fn spellings(unit: Unit) -> Vec<String> {
    let others = TABLE.iter().filter(|row| row.unit == unit && !row.is_si());
    std::iter::once(word(unit)).chain(others.map(|row| row.symbol)).map(str::to_owned).collect()
}

/// Without superscripts and Greek letters.
pub(crate) fn plain(text: &str) -> String {
    text.replace('²', "2").replace('³', "3").replace(['µ', 'μ'], "u")
}

/// A unit as a suffix of a name.
fn suffix_of(text: &str) -> String {
    let text = text.replace("°C", "c").replace('°', "deg").replace('%', "percent");
    plain(&text.to_lowercase()).replace([' ', '/'], "_")
}

/// A key that was named with the suffix of another unit.
pub(crate) struct Slip {
    /// The key that was meant.
    pub(crate) name: &'static str,
    unit: Unit,
    /// The value in SI, where the unit of the slip is known.
    si: Option<f64>,
}

impl Slip {
    /// The mistake, with what to write instead.
    pub(crate) fn mistake(&self, key: &str) -> Diagnostic {
        let (right, symbol) = (self.name, self.unit.symbol());
        let message = match right.strip_suffix(self.unit.suffix()) {
            _ if self.unit == Unit::None => {
                format!("'{key}' has a unit, but {right} is a pure number")
            }
            Some(bare) if bare == key => {
                format!("'{key}' lacks its unit: the parameter is {right}, in {symbol}")
            }
            _ => format!("'{key}' is not in SI: the parameter is {right}, in {symbol}"),
        };
        let value = self.si.map_or("…".into(), |si| NumberWithUnit(si, "").to_string());
        Diagnostic::new(message).with_help(format!("write: {right} = {value}"))
    }
}

/// The key that was meant by one that has its name but for the unit at its end; `keys` have names and units.
pub(crate) fn slip(
    entry: &Entry,
    keys: impl Iterator<Item = (&'static str, Unit)>,
) -> Option<Slip> {
    let value = entry.number().filter(|number| number.is_finite());
    let stem = |name: &'static str, unit: Unit| name.strip_suffix(unit.suffix()).unwrap_or(name);
    let candidates = keys.filter_map(|(name, unit)| {
        let rest = entry.key.strip_prefix(stem(name, unit))?;
        // Without any suffix, the number is taken as meant in SI.
        if rest.is_empty() {
            return Some(Slip { name, unit, si: value });
        }
        let row = by_suffix(&rest.strip_prefix('_')?.to_lowercase())?;
        let si = row.to(unit).zip(value).map(|((factor, offset), value)| value * factor + offset);
        Some(Slip { name, unit, si })
    });
    candidates.max_by_key(|slip| stem(slip.name, slip.unit).len())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_spelling_of_a_row_finds_this_row_and_no_other() {
        for row in TABLE {
            let own = [row.symbol, row.spoken].into_iter().chain(row.also.iter().copied());
            let typed: Vec<String> = own.flat_map(|text| [text.to_owned(), plain(text)]).collect();
            for text in typed.iter().chain([&row.suffix()]).filter(|text| !text.is_empty()) {
                assert_eq!(find(text), Some(row), "{text}");
                let others = TABLE.iter().filter(|other| *other != row);
                let twins: Vec<_> = others.filter(|other| other.spelled().contains(text)).collect();
                assert_eq!(twins, [] as [&NamedUnit; 0], "{text}");
            }
            let twins =
                TABLE.iter().filter(|other| other.suffixes().contains(&row.suffix())).count();
            assert_eq!(twins, usize::from(!row.suffix().is_empty()), "suffix of {}", row.symbol);
        }
    }

    #[test]
    fn every_row_becomes_si_and_back() {
        for row in TABLE {
            let (factor, offset) = row.to(row.unit).unwrap();
            assert!(factor > 0.0 && factor.is_finite() && offset.is_finite(), "{}", row.symbol);
            for value in [-40.0, 0.0, 1.0, 123.456] {
                let back = ((value * factor + offset) - offset) / factor;
                let rounding = 1e-15 * (offset / factor).abs();
                assert!((back - value).abs() < 1e-12 + rounding, "{value} {}", row.symbol);
            }
            let is_one = (factor, offset) == (1.0, 0.0) && !row.is_absolute;
            assert_eq!(row.is_si(), is_one, "{}", row.symbol);
        }
    }

    #[test]
    fn every_unit_of_the_model_has_one_row_and_so_has_what_reports_show_it_in() {
        for unit in Unit::ALL {
            assert_eq!(TABLE.iter().filter(|row| row.unit == unit && row.is_si()).count(), 1);
            assert_eq!(find_si(word(unit)), Some(unit));
            if unit == Unit::None {
                continue;
            }
            let row = find(unit.shown()).unwrap_or_else(|| panic!("{} is no row", unit.shown()));
            let (factor, offset) = row.to(unit).unwrap();
            let back = unit.to_shown(300.0) * factor + offset;
            assert!((back / 300.0 - 1.0).abs() < 1e-12, "{} {back}", unit.shown());
        }
    }
}
