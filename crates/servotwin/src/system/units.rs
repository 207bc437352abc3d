//! Units as people write them: the words of a system file, and suffixes of other units, which are recognized as slips
//! and converted.

use servotwin_model::spec::{Parameter, Unit};

/// The word for a unit in a system file: its symbol, `1` for a pure number.
pub fn word(unit: Unit) -> &'static str {
    if unit == Unit::None { "1" } else { unit.symbol() }
}

/// The unit of a word; `m2` equals `m²`.
pub fn find(text: &str) -> Option<Unit> {
    Unit::ALL.into_iter().find(|&unit| word(unit) == text || plain(word(unit)) == text)
}

/// The SI unit that a word from another unit system stands for.
pub fn meant(text: &str) -> Option<Unit> {
    let shown =
        Unit::ALL.into_iter().find(|unit| unit.shown() == text || plain(unit.shown()) == text);
    let suffix = plain(&text.to_lowercase()).replace([' ', '/'], "_");
    shown.or_else(|| FOREIGN.iter().find(|f| f.suffix == suffix).map(|f| f.unit))
}

/// The unit of a written word in SI, with factor and offset for converting a number to it.
pub fn convert(text: &str) -> Option<(Unit, f64, f64)> {
    let text = text.trim();
    if let Some(unit) = find(text) {
        return Some((unit, 1.0, 0.0));
    }
    let spelt = text.replace("°C", "c").replace('°', "deg").replace('%', "percent");
    let spelt = spelt.replace('µ', "u");
    let suffix = plain(&spelt.to_lowercase()).replace([' ', '/'], "_");
    if let Some(f) = FOREIGN.iter().find(|f| f.suffix == suffix) {
        return Some((f.unit, f.si_per_unit, f.offset));
    }
    let si = |unit: &Unit| unit.suffix().strip_prefix('_') == Some(&*suffix);
    Unit::ALL.into_iter().find(si).map(|unit| (unit, 1.0, 0.0))
}

/// Units that are common in logs instead of SI, the most common first, each with the number of units per SI unit.
fn of_logs(unit: Unit) -> &'static [(f64, &'static str)] {
    match unit {
        Unit::Pascal => &[(1e-5, "bar"), (1e-6, "MPa"), (1e-3, "kPa"), (1.450_377e-4, "psi")],
        Unit::Metre => &[(1e3, "mm"), (1e2, "cm"), (1e6, "µm"), (39.370_079, "inches")],
        Unit::Radian => &[(57.295_78, "degrees"), (1e3, "mrad")],
        Unit::Newton => &[(1e-3, "kN"), (0.224_809, "pounds")],
        Unit::Second => &[(1e3, "ms"), (1e6, "µs"), (1e9, "ns")],
        _ => &[(1e2, "%")],
    }
}

/// The likely unit of a column whose values are `ratio` times the expected ones.
pub fn other(unit: Unit, ratio: f64) -> Option<(f64, &'static str)> {
    let near = |factor: f64| (ratio / factor).ln().abs();
    let best = of_logs(unit).iter().min_by(|a, b| near(a.0).total_cmp(&near(b.0)))?;
    (near(best.0) < 0.35).then_some(*best)
}

/// The likely unit of a value outside its range: the most common unit in which it would be inside.
pub fn within(unit: Unit, value: f64, range: (f64, f64)) -> Option<(f64, &'static str)> {
    let is_inside = |factor: f64| (range.0..=range.1).contains(&(value / factor));
    of_logs(unit).iter().find(|(factor, _)| is_inside(*factor)).copied()
}

/// The accepted spellings of a unit, for messages.
pub fn spellings(unit: Unit) -> Vec<String> {
    let foreign = FOREIGN.iter().filter(|f| f.unit == unit).map(|f| f.suffix.to_owned());
    std::iter::once(word(unit).to_owned()).chain(foreign).collect()
}

/// Replaces superscripts by digits.
pub(crate) fn plain(text: &str) -> String {
    text.replace('²', "2").replace('³', "3")
}

/// A suffix outside the toolkit's SI suffixes.
struct Foreign {
    suffix: &'static str,
    unit: Unit,
    si_per_unit: f64,
    offset: f64,
}

const fn foreign(suffix: &'static str, unit: Unit, si_per_unit: f64) -> Foreign {
    Foreign { suffix, unit, si_per_unit, offset: 0.0 }
}

const RADIAN_PER_DEGREE: f64 = std::f64::consts::PI / 180.0;

static FOREIGN: &[Foreign] = &[
    foreign("bar", Unit::Pascal, 1e5),
    foreign("mbar", Unit::Pascal, 1e2),
    foreign("kpa", Unit::Pascal, 1e3),
    foreign("mpa", Unit::Pascal, 1e6),
    foreign("gpa", Unit::Pascal, 1e9),
    foreign("psi", Unit::Pascal, 6894.757293168),
    Foreign { suffix: "c", unit: Unit::Kelvin, si_per_unit: 1.0, offset: 273.15 },
    Foreign { suffix: "celsius", unit: Unit::Kelvin, si_per_unit: 1.0, offset: 273.15 },
    Foreign { suffix: "deg_c", unit: Unit::Kelvin, si_per_unit: 1.0, offset: 273.15 },
    foreign("um", Unit::Metre, 1e-6),
    foreign("mm", Unit::Metre, 1e-3),
    foreign("cm", Unit::Metre, 1e-2),
    foreign("km", Unit::Metre, 1e3),
    foreign("in", Unit::Metre, 0.0254),
    foreign("ft", Unit::Metre, 0.3048),
    foreign("mm2", Unit::SquareMetre, 1e-6),
    foreign("cm2", Unit::SquareMetre, 1e-4),
    foreign("mm2_s", Unit::SquareMetrePerSecond, 1e-6),
    foreign("cst", Unit::SquareMetrePerSecond, 1e-6),
    foreign("mm3", Unit::CubicMetre, 1e-9),
    foreign("cm3", Unit::CubicMetre, 1e-6),
    foreign("ml", Unit::CubicMetre, 1e-6),
    foreign("l", Unit::CubicMetre, 1e-3),
    foreign("mm_s", Unit::MetrePerSecond, 1e-3),
    foreign("km_h", Unit::MetrePerSecond, 1.0 / 3.6),
    foreign("kt", Unit::MetrePerSecond, 1852.0 / 3600.0),
    foreign("l_min", Unit::CubicMetrePerSecond, 1e-3 / 60.0),
    foreign("g", Unit::Kilogram, 1e-3),
    foreign("kn", Unit::Newton, 1e3),
    foreign("kn_m", Unit::NewtonPerMetre, 1e3),
    foreign("n_mm", Unit::NewtonPerMetre, 1e3),
    foreign("knm", Unit::NewtonMetre, 1e3),
    foreign("deg", Unit::Radian, RADIAN_PER_DEGREE),
    foreign("degrees", Unit::Radian, RADIAN_PER_DEGREE),
    foreign("deg_s", Unit::RadianPerSecond, RADIAN_PER_DEGREE),
    foreign("per_deg", Unit::PerRadian, 1.0 / RADIAN_PER_DEGREE),
    foreign("ms", Unit::Second, 1e-3),
    foreign("us", Unit::Second, 1e-6),
    foreign("ns", Unit::Second, 1e-9),
    foreign("min", Unit::Second, 60.0),
    foreign("khz", Unit::Hertz, 1e3),
    foreign("rad_s", Unit::Hertz, 0.5 / std::f64::consts::PI),
    foreign("per_mm", Unit::PerMetre, 1e3),
    foreign("ma", Unit::Ampere, 1e-3),
    foreign("percent", Unit::None, 1e-2),
];

/// A parameter named with the suffix of another unit.
pub struct Slip {
    /// The parameter that was meant.
    pub parameter: &'static Parameter,
    /// The value in SI, if the unit of the slip is known.
    pub si: Option<f64>,
}

/// Finds the parameter whose name equals a key except for the unit at its end.
pub fn slip(key: &str, value: Option<f64>, parameters: &'static [Parameter]) -> Option<Slip> {
    let stem = |p: &Parameter| p.name.strip_suffix(p.unit.suffix()).unwrap_or(p.name);
    let candidates = parameters.iter().filter_map(|parameter| {
        let rest = key.strip_prefix(stem(parameter))?;
        // A number without any suffix is taken as SI.
        if rest.is_empty() {
            return Some((parameter, value));
        }
        // Accepts common spellings: temperature_degC.
        let suffix = &*rest.strip_prefix('_')?.to_lowercase().replace("degc", "deg_c");
        let known = FOREIGN.iter().find(|f| f.suffix == suffix && f.unit == parameter.unit);
        let si = known.zip(value).map(|(f, v)| v * f.si_per_unit + f.offset);
        let another = Unit::ALL.iter().any(|unit| unit.suffix().strip_prefix('_') == Some(suffix));
        let foreign = FOREIGN.iter().any(|f| f.suffix == suffix);
        (another || foreign).then_some((parameter, si))
    });
    let longest = candidates.max_by_key(|(parameter, _)| stem(parameter).len());
    longest.map(|(parameter, si)| Slip { parameter, si })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_outside_of_its_range_is_in_the_unit_in_which_it_is_inside() {
        let named = |unit, value, range| within(unit, value, range).map(|(_, unit)| unit);
        assert_eq!(named(Unit::Metre, -37.5, (-0.1, 0.07)), Some("mm"));
        assert_eq!(named(Unit::Pascal, 210.0, (150e5, 280e5)), Some("bar"));
        assert_eq!(named(Unit::Radian, 12.0, (-0.3, 0.3)), Some("degrees"));
        assert_eq!(named(Unit::Metre, 1e12, (-0.1, 0.1)), None);
    }
}
