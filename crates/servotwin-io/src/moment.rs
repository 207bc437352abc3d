//! Dates and times in readable form: `2026-11-21T08:15:02.5`, `21.11.2026 08:15`, `08:15:02`.

use jiff::SignedDuration;
use jiff::civil::Date;

const EPOCH: Date = Date::constant(1970, 1, 1);

/// Times above this count from 1970, s; a log from 1973 or later has such times.
pub const CALENDAR_S: f64 = 1e8;

/// A readable time: `2026-11-21 08:15:02.500` if it counts from 1970, else `12.34 s`.
///
/// A date has no zone: it is UTC, or the clock of a log without a zone.
pub fn shown(time_s: f64) -> String {
    date_of(time_s).unwrap_or_else(|| format!("{time_s:.2} s"))
}

/// A time that counts from 1970, as a date with milliseconds; `None` for any other.
pub fn date_of(time_s: f64) -> Option<String> {
    if !is_date(time_s) {
        return None;
    }
    let milliseconds = SignedDuration::from_millis((time_s * 1e3).round() as i64);
    let moment = EPOCH.at(0, 0, 0, 0).checked_add(milliseconds).ok()?;
    Some(moment.strftime("%Y-%m-%d %H:%M:%S%.3f").to_string())
}

/// Whether a time counts from 1970.
pub fn is_date(time_s: f64) -> bool {
    time_s > CALENDAR_S
}

/// Shortest and longest plausible sampling period of an actuator log, s.
pub const PERIODS_S: (f64, f64) = (1e-4, 0.1);

/// Whether this is a plausible sampling period, s.
pub fn is_period(step_s: f64) -> bool {
    (PERIODS_S.0..=PERIODS_S.1).contains(&rounded(step_s))
}

/// The time unit that makes a step a plausible sampling period, and that period, s. Of several the one nearest to
/// `period_s`. `units` holds names and lengths in s.
pub fn likely_unit(
    step: f64,
    period_s: f64,
    units: Vec<(&'static str, f64)>,
) -> Option<(&'static str, f64)> {
    let periods = units.into_iter().map(|(unit, unit_s)| (unit, rounded(step * unit_s)));
    let far = |step_s: f64| (step_s / period_s).ln().abs();
    let likely = periods.filter(|(_, step_s)| is_period(*step_s));
    likely.min_by(|one, other| far(one.1).total_cmp(&far(other.1)))
}

/// A step rounded to three digits, which removes the rounding of the times.
pub fn rounded(step_s: f64) -> f64 {
    format!("{step_s:.2e}").parse().unwrap_or(step_s)
}

/// A time in seconds: since the start of 1970, or since midnight without a date; `None` for any other text. A zone is
/// subtracted; without one, the time stays as it is. The form `11/21/2026` is rejected, because the order of month and
/// day is ambiguous.
pub fn seconds(text: &str) -> Option<f64> {
    let text = text.trim();
    match text.split_once(['T', ' ']) {
        Some((day, time)) => Some(86_400.0 * date(day)? + time_of_day(time.trim())?),
        None if text.contains(':') => time_of_day(text),
        None => Some(86_400.0 * date(text)?),
    }
}

/// Days since the start of 1970.
fn date(text: &str) -> Option<f64> {
    let parts = |mark| {
        let parts: Vec<&str> = text.split(mark).collect();
        <[&str; 3]>::try_from(parts).ok()
    };
    let [year, month, day] = match (parts('-'), parts('/'), parts('.')) {
        (Some(parts), _, _) | (_, Some(parts), _) => parts,
        (_, _, Some([day, month, year])) => [year, month, day],
        _ => return None,
    };
    if year.len() != 4 || month.len() > 2 || day.len() > 2 {
        return None;
    }
    let month = i8::try_from(number(month)?).ok()?;
    let day = i8::try_from(number(day)?).ok()?;
    let date = Date::new(i16::try_from(number(year)?).ok()?, month, day).ok()?;
    Some((date.duration_since(EPOCH).as_hours() / 24) as f64)
}

/// Seconds since midnight, UTC.
fn time_of_day(text: &str) -> Option<f64> {
    let (clock, zone_s) = split_zone(text)?;
    let mut parts = clock.split(':');
    let (hours, minutes) = (number(parts.next()?)?, number(parts.next()?)?);
    let seconds = match parts.next() {
        Some(text) if text.starts_with(|c: char| c.is_ascii_digit()) => {
            text.replace(',', ".").parse::<f64>().ok()?
        }
        Some(_) => return None,
        None => 0.0,
    };
    let sound = hours <= 24 && minutes < 60 && seconds < 61.0 && parts.next().is_none();
    sound.then(|| (3600 * hours + 60 * minutes) as f64 + seconds - zone_s)
}

/// The time without its zone, and the zone in seconds east of UTC.
fn split_zone(text: &str) -> Option<(&str, f64)> {
    if let Some(clock) = text.strip_suffix(['Z', 'z']) {
        return Some((clock, 0.0));
    }
    let Some(place) = text.rfind(['+', '-']) else {
        return Some((text, 0.0));
    };
    let (clock, zone) = text.split_at(place);
    let digits: String = zone[1..].chars().filter(|c| *c != ':').collect();
    let minutes = digits.get(2..).filter(|minutes| !minutes.is_empty()).unwrap_or("0");
    let (hours, minutes) = (number(digits.get(..2)?)?, number(minutes)?);
    let size = (3600 * hours + 60 * minutes) as f64;
    Some((clock.trim_end(), if zone.starts_with('-') { -size } else { size }))
}

fn number(text: &str) -> Option<i64> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::{seconds, shown};

    #[test]
    fn times_of_many_writers() {
        // Seconds since 1970 as `date --utc +%s` prints them.
        let cases = [
            ("1970-01-01", 0.0),
            ("2026-11-21T08:15:02.5", 1_795_248_902.5),
            ("2026-11-21 08:15:02Z", 1_795_248_902.0),
            ("2026-11-21 09:15:02+01:00", 1_795_248_902.0),
            ("2026-11-21 02:45:02-0530", 1_795_248_902.0),
            ("21.11.2026 08:15", 1_795_248_900.0),
            ("2024/02/29", 1_709_164_800.0),
            ("1969-12-31 23:59:59", -1.0),
            ("08:15:02,25", 29_702.25),
        ];
        for (text, expected) in cases {
            assert_eq!(seconds(text), Some(expected), "{text}");
        }
        for text in [
            "",
            "pump",
            "1.5",
            "12",
            "1-2-3",
            "25.13.2026",
            "12:75",
            "a:b",
            "11/21/2026",
            "2025-02-30",
        ] {
            assert_eq!(seconds(text), None, "{text}");
        }
    }

    #[test]
    fn a_date_is_shown_as_it_was_written() {
        for text in ["2025-10-26 02:59:54.010", "2026-02-28 23:59:59.999"] {
            assert_eq!(shown(seconds(text).unwrap()), text);
        }
        assert_eq!(shown(12.344), "12.34 s");
        assert_eq!(shown(f64::NAN), "NaN s");
        assert_eq!(shown(1e300), format!("{:.2} s", 1e300), "no calendar goes so far");
    }
}
