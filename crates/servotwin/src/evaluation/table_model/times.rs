//! Times written as text: `2026-11-21T08:15:02.5`, `21.11.2026 08:15`, `08:15:02`.

/// A point in time in seconds: since the beginning of 1970, or since midnight where there is no
/// date; `None` for any other text. A zone is taken into account, without one the time is taken as it
/// stands. A month before a day (`11/21/2026`) is not understood: it cannot be told from a day before
/// a month.
pub fn seconds(text: &str) -> Option<f64> {
    let text = text.trim();
    match text.split_once(['T', ' ']) {
        Some((day, time)) => Some(86_400.0 * date(day)? + time_of_day(time.trim())?),
        None if text.contains(':') => time_of_day(text),
        None => Some(86_400.0 * date(text)?),
    }
}

/// Days since the beginning of 1970.
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
    let (year, month, day) = (number(year)?, number(month)?, number(day)?);
    let sound = (1..=12).contains(&month) && (1..=31).contains(&day);
    sound.then(|| days(year, month, day) as f64)
}

/// Days since the beginning of 1970 of a Gregorian date; years begin in March, so that the day that
/// is not always there is the last one.
fn days(year: i64, month: i64, day: i64) -> i64 {
    let year = if month <= 2 { year - 1 } else { year };
    let day_of_year = (153 * ((month + 9) % 12) + 2) / 5 + day - 1;
    let leap_days = year.div_euclid(4) - year.div_euclid(100) + year.div_euclid(400);
    365 * year + leap_days + day_of_year - 719_468
}

/// Seconds since midnight in the zone of zero.
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

/// The time without its zone, and the zone in seconds east of zero.
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
    use super::seconds;

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
        for text in ["", "pump", "1.5", "12", "1-2-3", "25.13.2026", "12:75", "a:b", "11/21/2026"] {
            assert_eq!(seconds(text), None, "{text}");
        }
    }
}
