//! Dates and times in readable form: `2026-11-21T08:15:02.5`, `20261121T081502.5`, `21.11.2026 08:15`,
//! `21-Nov-2026 8:15:02 AM`, `08:15:02`, `325:08:15:02.5` with the day of the year, `15:02.5` in minutes.
//!
//! A [`Clock`] decides by the first time of a log what all of its times mean.

use crate::text::rounded;
use jiff::SignedDuration;
use jiff::civil::Date;

const EPOCH: Date = Date::constant(1970, 1, 1);

/// Times above this count from 1970, s; a log from 1973 or later has such times.
const CALENDAR_S: f64 = 1e8;

/// A readable time: `2026-11-21 08:15:02.500` if it counts from 1970, else `12.34 s`.
///
/// A date is shown on the clock of its log ([`Clock`]).
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
    (PERIODS_S.0..=PERIODS_S.1).contains(&rounded(step_s, 3))
}

/// The time unit that makes a step a plausible sampling period, and that period, s. Of several the one nearest to
/// `period_s`. `units` holds names and lengths in s.
pub fn likely_unit(
    step: f64,
    period_s: f64,
    units: Vec<(&'static str, f64)>,
) -> Option<(&'static str, f64)> {
    let periods = units.into_iter().map(|(unit, unit_s)| (unit, rounded(step * unit_s, 3)));
    let far = |step_s: f64| (step_s / period_s).ln().abs();
    let likely = periods.filter(|(_, step_s)| is_period(*step_s));
    likely.min_by(|one, other| far(one.1).total_cmp(&far(other.1)))
}

/// One day, s.
pub const DAY_S: f64 = 86_400.0;

/// A time as it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Moment {
    /// Seconds since the start of 1970, or since midnight without a date, on the clock as written.
    pub clock_s: f64,
    /// The offset of this clock from UTC, s; `None` if the text has none.
    pub zone_s: Option<f64>,
    /// Whether the text has a date.
    pub has_date: bool,
    /// After this time the clock begins anew, s: a day, an hour for minutes, or a year for its days.
    turn_s: f64,
}

impl Moment {
    /// Reads a text; `None` if it is no time. The forms `11/21/2026` and `21-11-2026` are rejected, because the order
    /// of month and day is not known ([`refusal`]).
    pub fn read(text: &str) -> Option<Self> {
        let text = short(text)?;
        let plain = extended(text);
        let (day, time) = split(plain.as_deref().unwrap_or(text));
        let (days, (seconds, zone_s), turn_s) = match (day_of_year(text), minutes(text)) {
            (Some((days, time)), _) => (days, time_of_day(time)?, 365.0 * DAY_S),
            (None, Some(seconds)) => (0.0, (seconds, None), 3600.0),
            (None, None) => {
                (day.map_or(Some(0.0), date)?, time.map_or(Some((0.0, None)), time_of_day)?, DAY_S)
            }
        };
        let has_date = day.is_some();
        Some(Moment { clock_s: DAY_S * days + seconds, zone_s, has_date, turn_s })
    }

    /// The same time on another clock; unchanged if this text has no zone.
    pub fn on_clock(&self, zone_s: f64) -> f64 {
        self.clock_s - self.zone_s.map_or(0.0, |own_s| own_s - zone_s)
    }
}

/// The clock of a log: the first time decides its zone, and a time of day goes on behind midnight.
#[derive(Debug, Clone, PartialEq)]
pub struct Clock {
    /// The zone of the first text; `None` before it.
    zone_s: Option<Option<f64>>,
    last: f64,
}

impl Default for Clock {
    fn default() -> Self {
        Clock { zone_s: None, last: f64::NAN }
    }
}

impl Clock {
    /// Reads a text as seconds on the clock of the first one; `None` if it is no time.
    pub fn read(&mut self, text: &str) -> Option<f64> {
        let moment = Moment::read(text)?;
        let zone_s = *self.zone_s.get_or_insert(moment.zone_s);
        let time_s = zone_s.map_or(moment.clock_s, |zone_s| moment.on_clock(zone_s));
        self.last =
            if moment.has_date { time_s } else { time_s + self.turns(time_s, moment.turn_s) };
        Some(self.last)
    }

    /// Continues numbers behind midnight, if they begin anew within a minute of it; `day` is a day in their unit.
    pub fn number(&mut self, value: f64, day: f64) -> f64 {
        let turned = value + self.turns(value, day);
        let is_midnight =
            (0.0..day).contains(&value) && (turned - self.last).abs() < day * (60.0 / DAY_S);
        let found = if turned > value && is_midnight { turned } else { value };
        if found.is_finite() {
            self.last = found;
        }
        found
    }

    /// The whole days that bring a value nearest to the last one.
    fn turns(&self, value: f64, day: f64) -> f64 {
        let days = ((self.last - value) / day).round();
        if days.is_nan() { 0.0 } else { days * day }
    }

    /// The offset of this clock from UTC, s; `None` before the first text, or if it has no zone.
    pub fn zone_s(&self) -> Option<f64> {
        self.zone_s.flatten()
    }
}

/// A zone in words: `UTC+02:00`.
pub fn zone_in_words(zone_s: f64) -> String {
    let minutes = (zone_s.abs() / 60.0).round() as u32;
    let sign = if zone_s < 0.0 { '-' } else { '+' };
    match minutes {
        0 => "UTC".into(),
        _ => format!("UTC{sign}{:02}:{:02}", minutes / 60, minutes % 60),
    }
}

/// A time in seconds, UTC if the text has a zone; `None` for any other text.
pub fn seconds(text: &str) -> Option<f64> {
    Moment::read(text).map(|moment| moment.on_clock(0.0))
}

/// Why a text that looks like a time is none.
pub fn refusal(text: &str) -> Option<&'static str> {
    let (day, time) = split(short(text)?);
    let parts: Vec<&str> = day?.split(['/', '-']).collect();
    let is_number = |part: &&str| !part.is_empty() && number(part).is_some();
    let is_year_last = parts.len() == 3 && parts[0].len() <= 2 && parts[2].len() >= 2;
    if is_year_last && parts.iter().all(is_number) {
        return Some("the order of day and month is not known: write dates as 2026-11-21");
    }
    let is_zone = |time: &str| {
        time_of_day(time).is_none() && time.ends_with(|c: char| c.is_ascii_alphabetic())
    };
    let is_zone = date(day?).is_some() && time.is_some_and(is_zone);
    is_zone.then_some("this zone is not known: write its offset (+01:00) or UTC")
}

/// The text without blanks around it; `None` if it is too long for a time, because a cell may hold megabytes.
fn short(text: &str) -> Option<&str> {
    const LONGEST: usize = 64;
    Some(text.trim()).filter(|text| text.len() <= LONGEST)
}

/// A date without separators in the usual form: `20261121T081502.5Z` becomes `2026-11-21T08:15:02.5Z`.
fn extended(text: &str) -> Option<String> {
    let (day, time) = text.split_once(['T', ' '])?;
    let is_digits = |text: &str| text.bytes().all(|byte| byte.is_ascii_digit());
    let (hours, rest) = (time.get(..2)?, time.get(4..)?);
    let is_basic = day.len() == 8 && is_digits(day) && time.get(..6).is_some_and(is_digits);
    is_basic.then(|| {
        format!("{}-{}-{}T{hours}:{}:{rest}", &day[..4], &day[4..6], &day[6..], &time[2..4])
    })
}

/// The days before the day of an unknown year, and the time of day: `325:08:15:02.5`.
fn day_of_year(text: &str) -> Option<(f64, &str)> {
    let (day, time) = text.split_once(':').filter(|(day, _)| day.len() == 3)?;
    let day =
        number(day).filter(|day| (1..=366).contains(day) && time.matches(':').count() == 2)?;
    Some(((day - 1) as f64, time))
}

/// The seconds of a time in minutes and seconds: the fraction shows that the second number is one of seconds.
fn minutes(text: &str) -> Option<f64> {
    let (minutes, seconds) = text.split_once(':')?;
    let seconds = seconds.replace(',', ".");
    let (whole, _) = seconds.split_once('.').filter(|(whole, _)| whole.len() == 2)?;
    let minutes = number(minutes).filter(|_| (1..=3).contains(&minutes.len()))?;
    let sound = number(whole).is_some_and(|whole| whole < 60);
    sound.then(|| Some(60.0 * minutes as f64 + seconds.parse::<f64>().ok()?))?
}

/// The date and the time of day of a text.
fn split(text: &str) -> (Option<&str>, Option<&str>) {
    let Some(colon) = text.find(':') else { return (Some(text), None) };
    match text[..colon].rfind(['T', ' ']) {
        Some(place) => (Some(text[..place].trim_end()), Some(text[place + 1..].trim())),
        None => (None, Some(text)),
    }
}

/// The forms of dates, in the words of `strftime`.
const DATES: [&str; 11] = [
    "%Y-%m-%d",
    "%Y/%m/%d",
    "%Y %m %d",
    "%d.%m.%Y",
    "%d-%b-%Y",
    "%d %b %Y",
    "%b %d, %Y",
    "%d-%B-%Y",
    "%d %B %Y",
    "%B %d, %Y",
    "%b %d %Y",
];

/// Days since the start of 1970.
fn date(text: &str) -> Option<f64> {
    let date = DATES.iter().find_map(|form| Date::strptime(form, text).ok())?;
    // Years have four digits.
    (date.year() >= 1000).then(|| (date.duration_since(EPOCH).as_hours() / 24) as f64)
}

/// Seconds since midnight as written, and the zone.
fn time_of_day(text: &str) -> Option<(f64, Option<f64>)> {
    let text = text.to_ascii_uppercase();
    let (clock, zone_s) = split_zone(&text)?;
    let half = |marks: [&str; 2]| marks.into_iter().find_map(|mark| clock.strip_suffix(mark));
    let (clock, noon) = match (half(["AM", "A.M."]), half(["PM", "P.M."])) {
        (Some(clock), _) => (clock.trim_end(), Some(0)),
        (_, Some(clock)) => (clock.trim_end(), Some(12)),
        _ => (clock, None),
    };
    let mut parts = clock.split(':');
    let (hours, minutes) = (number(parts.next()?)?, number(parts.next()?)?);
    let hours = match noon {
        Some(noon) => (1..=12).contains(&hours).then_some(hours % 12 + noon)?,
        None => hours,
    };
    let seconds = match parts.next() {
        Some(text) if text.starts_with(|c: char| c.is_ascii_digit()) => {
            text.replace(',', ".").parse::<f64>().ok()?
        }
        Some(_) => return None,
        None => 0.0,
    };
    // Some loggers write a colon before the milliseconds or microseconds.
    let fraction = match parts.next() {
        Some(text) if matches!(text.len(), 3 | 6) && seconds.fract() == 0.0 => {
            number(text)? as f64 / f64::powi(10.0, text.len() as i32)
        }
        Some(_) => return None,
        None => 0.0,
    };
    let sound = hours <= 24 && minutes < 60 && seconds < 61.0 && parts.next().is_none();
    sound.then(|| ((3600 * hours + 60 * minutes) as f64 + seconds + fraction, zone_s))
}

/// The time without its zone, and the zone in seconds east of UTC.
fn split_zone(text: &str) -> Option<(&str, Option<f64>)> {
    let without = |text: &'_ str| {
        ["UTC", "GMT", "Z"].iter().find_map(|word| text.strip_suffix(word).map(str::len))
    };
    if let Some(length) = without(text) {
        return Some((text[..length].trim_end(), Some(0.0)));
    }
    let Some(place) = text.rfind(['+', '-']) else {
        return Some((text, None));
    };
    let (clock, zone) = text.split_at(place);
    let clock = &clock[..without(clock).unwrap_or(clock.len())];
    let digits: String = zone[1..].chars().filter(|c| *c != ':').collect();
    let minutes = digits.get(2..).filter(|minutes| !minutes.is_empty()).unwrap_or("0");
    let (hours, minutes) = (number(digits.get(..2)?)?, number(minutes)?);
    let size = (3600 * hours + 60 * minutes) as f64;
    Some((clock.trim_end(), Some(if zone.starts_with('-') { -size } else { size })))
}

fn number(text: &str) -> Option<i64> {
    text.bytes().all(|b| b.is_ascii_digit()).then(|| text.parse().ok())?
}
