//! Formats numbers and names for reports.

use servotwin::job::outcomes::FlownSuite;
use servotwin::learn::metrics::{Rate, Tail};
use servotwin::measure::flights::{EnvironmentMetrics, HealthyMetrics};
use servotwin::run::fitted_twins::CalibrationRecords;

pub(crate) use servotwin_io::text::{spoken, three_digits};
pub(crate) use servotwin_view::document::NONE;
use servotwin_view::document::Value;

/// The environments with a false alarm: their count and the upper limit of their share.
pub(crate) fn by_environment(all: EnvironmentMetrics) -> String {
    let EnvironmentMetrics { flown, with_alarm, share_upper } = all;
    let most = three_digits(100.0 * share_upper);
    format!("in {with_alarm} of {flown} environments, at most {most} % of them (95 %)")
}

/// What healthy flights, each in an environment of its own, say of false alarms: the counts, and the rate that the tail
/// of the largest evidence gives. First all actions, then shutdowns.
fn by_environment_and_tail(healthy: &HealthyMetrics) -> Vec<String> {
    let HealthyMetrics { environments, shutdown_environments, nearness, .. } = healthy;
    let near = nearness.as_ref();
    let of_any = near.map(|near| extrapolated(&near.tail, near.largest_evidence));
    let of_off = near.map(|near| extrapolated(&near.shutdown_tail, near.largest_shutdown_evidence));
    let counts = [environments, shutdown_environments].map(|all| by_environment(*all));
    let [alarms, shutdowns] = counts;
    let lines = [
        Some(format!("false alarms {alarms}")),
        of_any,
        Some(format!("shutdowns {shutdowns}")),
        of_off,
    ];
    lines.into_iter().flatten().collect()
}

/// Healthy flights, each in an environment of its own: what was flown, and what it says of false alarms.
pub fn healthy_flights(run: &FlownSuite) -> (String, Vec<String>) {
    let (healthy, seconds) = (run.healthy(), chosen(run.longest_s()));
    let flown = format!(
        "{}: {} healthy flights of {seconds} s, each in an environment of its own (seed {}), {} not finished; {:.1} h",
        run.title(),
        run.outcomes.len(),
        run.seed,
        run.failed(),
        healthy.hours
    );
    (flown, by_environment_and_tail(&healthy))
}

/// What became of the calibration flights of twins that are fitted to plants of another structure.
pub fn fitted_twins(calibration: &CalibrationRecords) -> String {
    let CalibrationRecords { flown, rejected, with_findings } = calibration;
    format!(
        "of {flown} twins {rejected} stayed nominal, because their records were rejected; {with_findings} fits left a \
         deviation"
    )
}

/// The rate at which the largest evidence of a flight reaches its limit, by the tail of all flights.
fn extrapolated(tail: &Option<Tail>, largest: f64) -> String {
    let largest = format!("the largest evidence is {} of its limit", three_digits(largest));
    let Some(Tail { blocks, excesses, threshold, shape, probability, low, high, .. }) = tail else {
        return format!("{largest}; too few flights come near it to extrapolate a rate");
    };
    let [probability, low, high] = [probability, low, high].map(|part| three_digits(100.0 * part));
    format!(
        "{largest}; by the tail of {excesses} of {blocks} flights above {} (shape {shape:.2}), it is reached in \
         {probability} % of flights [{low} … {high}]",
        three_digits(*threshold)
    )
}

/// A share in percent: `99.84 %`.
pub fn percent(share: Option<f64>) -> String {
    share.map_or_else(|| NONE.into(), |share| format!("{:.2} %", 100.0 * share))
}

/// A rate with its interval: `99.84 % [99.67 … 99.92]`. The brackets are square because parentheses may follow.
pub(crate) fn rate(rate: Option<Rate>) -> String {
    match rate {
        Some(Rate { share: Some(share), low, high, .. }) => {
            let [share, low, high] = [share, low, high].map(|part| 100.0 * part);
            format!("{share:.2} % [{low:.2} … {high:.2}]")
        }
        _ => NONE.into(),
    }
}

/// The count of a rate: `218 of 220`.
pub fn count_of(rate: Rate) -> String {
    format!("{} of {}", rate.count, rate.of)
}

/// A share with its count: `99.10 % (218 of 220)`. Programs read its interval too.
pub fn share_of(rate: Rate) -> Value {
    Value::of(format!("{} ({})", percent(rate.share), count_of(rate)), &rate)
}

/// A rate with its interval below it; the line feed switches to small type.
pub(crate) fn stacked(value: Option<Rate>) -> String {
    rate(value).replace(" [", "\n").replace(']', "")
}

/// The interval of a rate from a bootstrap over kinds of fault: `90.50 … 95.10`.
pub(crate) fn by_kind(rate: Option<Rate>) -> String {
    let interval = rate.filter(|rate| rate.of > 0).and_then(|rate| rate.by_kind);
    interval.map_or_else(
        || NONE.into(),
        |(low, high)| format!("{:.2} … {:.2}", 100.0 * low, 100.0 * high),
    )
}

/// The change between two rates in percentage points: `+0.12`.
pub(crate) fn change(before: Option<Rate>, after: Option<Rate>) -> String {
    let shares = before.and_then(|rate| rate.share).zip(after.and_then(|rate| rate.share));
    shares.map_or_else(
        || NONE.into(),
        |(before, after)| {
            let points = format!("{:+.2}", 100.0 * (after - before));
            if points == "-0.00" { "+0.00".into() } else { points }
        },
    )
}

/// The share of a rate in percent.
pub(crate) fn share(rate: Option<Rate>) -> String {
    percent(rate.and_then(|rate| rate.share))
}

/// The share of a rate, no more precise than its count permits. A small sample gives the count itself; a larger one
/// gives percent with the decimals that a single case changes.
pub fn of_count(rate: Option<Rate>) -> String {
    match rate {
        Some(rate @ Rate { share: Some(_), of, .. }) if of < FEW => count_of(rate),
        Some(Rate { share: Some(share), of, .. }) => {
            let decimals = if of < MANY { 1 } else { 2 };
            format!("{:.decimals$} %", 100.0 * share)
        }
        _ => NONE.into(),
    }
}

/// Below this sample size a share is shown as a count.
const FEW: u64 = 20;
/// From this sample size on, a share has a second decimal.
const MANY: u64 = 1000;

/// Capitalizes the first letter.
pub(crate) fn begun(text: &str) -> String {
    let mut letters = text.chars();
    let first = letters.next().into_iter().flat_map(char::to_uppercase);
    first.chain(letters.as_str().chars()).collect()
}

/// A number from a configuration, without rounding errors in its last digits.
pub(crate) fn chosen(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

/// A feature's value or threshold in its display unit.
pub fn of_unit(value: f64, unit: &str) -> String {
    match unit {
        "of scale" => format!("{} %", three_digits(100.0 * value)),
        "" | "1" | "0 or 1" => three_digits(value),
        unit if unit.starts_with("log10") => three_digits(value),
        unit => format!("{} {unit}", three_digits(value)),
    }
}

/// The display unit of a value from [`of_unit`].
pub(crate) fn unit(unit: &str) -> &str {
    match unit {
        "of scale" => "% of scale",
        "1" => "ratio",
        unit => unit,
    }
}

/// Returns each value once, in the order of first appearance.
pub(crate) fn distinct<T: PartialEq>(values: impl IntoIterator<Item = T>) -> Vec<T> {
    values.into_iter().fold(vec![], |mut known, value| {
        if !known.contains(&value) {
            known.push(value);
        }
        known
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rates_have_their_interval() {
        let counts = [(3, 3), (19, 20), (199, 200), (1999, 2000)];
        let told = counts.map(|(count, of)| of_count(Some(Rate::new(count, of))));
        assert_eq!(told, ["3 of 3", "95.0 %", "99.5 %", "99.95 %"]);
        assert_eq!((chosen(100.0 * 3e-4), chosen(90.0)), ("0.03".into(), "90".into()));
        assert_eq!(of_unit(-0.0312, "of scale"), "-3.12 %");
        assert_eq!(rate(Some(Rate::new(99, 100))), "99.00 % [94.55 … 99.82]");
        assert_eq!(rate(None), "–");
        assert_eq!(stacked(Some(Rate::new(99, 100))), "99.00 %\n94.55 … 99.82");
        let of_kinds = Rate { by_kind: Some((0.905, 0.951)), ..Rate::new(99, 100) };
        assert_eq!(by_kind(Some(of_kinds)), "90.50 … 95.10");
        assert_eq!(by_kind(Some(Rate::new(1, 2))), "–");
        let change =
            |before, after| change(Some(Rate::new(before, 100)), Some(Rate::new(after, 100)));
        assert_eq!(
            (change(90, 91), change(91, 90), change(7, 7)),
            ("+1.00".into(), "-1.00".into(), "+0.00".into())
        );
    }
}
