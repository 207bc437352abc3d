//! The diagnosis at work: how fast, how sure and how often wrong it is while an aircraft flies, and
//! against which limits.

use crate::evaluation::score::Rate;
use crate::figure::Figure;
use crate::figure::lines::{Curve, Lines};
use crate::flight::judge::{ClassMerit, Latency, Merit, STRONG};
use crate::job::flights::FlightResults;
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{NONE, bracketed, chosen, number, percent, spoken, stacked};
use crate::report::{Material, Section};

/// See the module.
pub struct Flights;

/// The share of faults that a limit on latency is about.
const SHARE: f64 = 0.95;

impl Section for Flights {
    fn id(&self) -> &'static str {
        "flights"
    }

    fn title(&self) -> &'static str {
        "The diagnosis at work"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let Some(results) = material.flights else {
            return;
        };
        page.text(&about(results));
        page.table(
            &limits(results),
            "What the study file asks of the diagnosis at work, and what was \
            measured. “Met” is said only where the interval is on the right side of the limit.",
        );
        page.note(&sizes(results));
        page.heading("How soon a fault is isolated");
        page.text(&format!(
            "A fault is visible once windows leave the bands, not by chance but all along; it is \
             isolated when the right command for the right actuator is raised. The curves show which \
             share of the visible faults of intensity {STRONG} and more is isolated how long after the \
             onset. What is never isolated is why a curve stays below 100 %."
        ));
        page.beside(|page| {
            for merit in &results.merits {
                let name = format!("flights_latency_{}", merit.setting);
                let caption = format!(
                    "Setting {}: visible faults of intensity {STRONG} and more that are isolated, by the \
                     time since the onset.",
                    merit.setting
                );
                page.figure(&name, latencies(merit), &caption);
            }
        });
        for merit in &results.merits {
            page.table(&by_command(merit), &format!(
                "Setting {}: what became of the flights, by what should have been commanded. Shares are \
                 of the visible faults, with 95 % intervals from drawing kinds of fault at their \
                 intensities; times are the median, and below it 95 % and the longest of those that \
                 were isolated.",
                merit.setting
            ));
        }
        page.heading("By the way in which a fault begins");
        page.table(&by_onset(results), &format!(
            "Shutdown faults of intensity {STRONG} and more. A drift reaches its intensity in 4 s; an \
             intermittent fault is there for 1 s and away for 1 s."
        ));
        page.heading("False alarms against latency");
        trade(results, page);
        wrong_kinds(results, page);
    }
}

fn about(results: &FlightResults) -> String {
    let windows: Vec<String> =
        results.windows_s.iter().map(|&w| format!("{} s", chosen(w))).collect();
    format!(
        "Here the twin flies along, and the diagnosis runs sample by sample, with windows of {} that slide. \
         A fault begins during the flight. A command is raised only when the evidence for it beats every \
         other explanation in a sequential test, and once an actuator is off the other can never be \
         switched off. Trees, committee and bands were learned in other flights, of other commands, \
         specimens and weather. The settings differ in the specimen: with noise only, the specimen is \
         exactly its twin (as if the twin had been fitted to it); in the realistic setting it has its \
         tolerances and the twin knows nothing of them.",
        windows.join(" and ")
    )
}

/// What is asked for, setting by setting.
fn limits(results: &FlightResults) -> Grid {
    let mut grid = Grid::new([
        ("", Side::Left),
        ("setting", Side::Left),
        ("limit", Side::Right),
        ("measured", Side::Right),
        ("", Side::Left),
    ]);
    let limits = &results.limits;
    for merit in &results.merits {
        let Merit { setting, in_time, healthy, .. } = merit;
        let mut push = |title: &str, limit: String, measured: String, verdict: &str| {
            let row = vec![title.into(), setting.clone(), limit, measured, verdict.into()];
            if [MET, ""].contains(&verdict) { grid.push(row) } else { grid.push_strong(row) }
        };
        push(
            &format!("visible shutdown faults of intensity {STRONG} and more, isolated in time"),
            format!("{} % within {} s", chosen(100.0 * SHARE), chosen(merit.limit_s)),
            stacked(Some(*in_time)),
            match in_time {
                rate if rate.of == 0 => NOT_SHOWN,
                rate if rate.low >= SHARE => MET,
                rate if rate.high < SHARE => MISSED,
                rate if rate.share.is_some_and(|share| share < SHARE) => PROBABLY_MISSED,
                _ => NOT_SHOWN,
            },
        );
        let limit = format!("within {} s", chosen(merit.limit_s));
        push(
            "of them left any band by then",
            limit.clone(),
            stacked(Some(merit.visible_in_time)),
            "",
        );
        let since = stacked(Some(merit.in_time_since_visible));
        push("of them isolated, counted from when they were visible", limit, since, "");
        let strong = strong(merit)
            .find(|class| merit.onsets.iter().any(|(_, onset)| onset.command == class.command));
        if let Some(class) = strong {
            let of = class.visible.count;
            let isolated = class.isolation.as_ref().map_or(0, |latency| latency.flights);
            push(
                "the same faults, never shut down",
                NONE.into(),
                stacked(Some(Rate::new(of - isolated, of))),
                "",
            );
        }
        push(
            "false alarms per flight hour",
            number(limits.false_alarms_per_h),
            format!(
                "{} in {:.1} h\nat most {} per hour (95 %)",
                healthy.alarms,
                healthy.hours,
                number(healthy.alarms_per_h_upper)
            ),
            match healthy {
                h if h.alarms_per_h_upper <= limits.false_alarms_per_h => MET,
                h if h.alarms_per_h > limits.false_alarms_per_h => MISSED,
                _ => NOT_SHOWN,
            },
        );
        push(
            "shutdowns of a healthy actuator, nothing being wrong",
            "0".into(),
            format!("{} in {:.1} h", healthy.shutdowns, healthy.hours),
            none_allowed(healthy.shutdowns as f64, 0.0),
        );
        let wrong = merit.wrong_shutdowns;
        push(
            "shutdowns of the wrong actuator, all trained faults",
            number(limits.wrong_shutdowns),
            format!("{wrong} in {} flights\n{}", merit.flights, at_most(wrong, merit.flights)),
            none_allowed(wrong as f64, limits.wrong_shutdowns),
        );
        let foreign = results.foreign.iter().find(|other| other.setting == *setting);
        if let Some((wrong, of)) = foreign.map(|foreign| foreign.shutdowns_healthy()) {
            push(
                "shutdowns of a healthy actuator, faults never trained on",
                number(limits.wrong_shutdowns),
                format!("{wrong} in {of} flights\n{}", at_most(wrong, of)),
                none_allowed(wrong as f64, limits.wrong_shutdowns),
            );
        }
    }
    grid
}

const MET: &str = "met";
const MISSED: &str = "missed";
const PROBABLY_MISSED: &str = "missed, within the interval";
const NOT_SHOWN: &str = "not shown: too few flights";

fn none_allowed(count: f64, limit: f64) -> &'static str {
    if count <= limit { MET } else { MISSED }
}

/// The upper end of a share's interval, in words.
pub(super) fn at_most(count: u64, of: u64) -> String {
    let rate = Rate::new(count, of);
    format!("at most {:.2} % (95 %)", 100.0 * rate.high)
}

fn sizes(results: &FlightResults) -> String {
    let FlightResults { learn, judge, is_full, .. } = results;
    let judged = results.merits.first();
    let size = format!(
        "Learned in {} environments, with {} flights of every fault; judged in {} other environments, \
         with {} flights with a fault and {:.1} healthy hours in each setting.",
        learn.environments,
        learn.repeats,
        judge.environments,
        judged.map_or(0, |merit| merit.flights),
        judged.map_or(0.0, |merit| merit.healthy.hours),
    );
    let failed = |merit: &Merit| merit.failed + merit.failed_to_learn;
    let size = match results.merits.iter().map(failed).sum::<u64>() {
        0 => size,
        failed => format!(
            "{size} Left out are {failed} flights that could not be simulated to their end, {} of them to \
             learn from.",
            results.merits.iter().map(|merit| merit.failed_to_learn).sum::<u64>()
        ),
    };
    match is_full {
        true => format!("{size} These are the full sizes of the study."),
        false => format!(
            "{size} These are the small sizes, which an ordinary run has time for. The full ones: \
             servotwin flights --full --out FOLDER, then servotwin report FOLDER."
        ),
    }
}

/// The classes of all intensities, or the strong ones: they stand one after the other.
fn strong(merit: &Merit) -> impl Iterator<Item = &ClassMerit> {
    let half = merit.classes.len() / 2;
    merit.classes[half..].iter()
}

fn latencies(merit: &Merit) -> Figure {
    let mut lines = Lines::new("", "time since the onset / s", "isolated / % of visible");
    lines.x_log = true;
    lines.y_range = Some((0.0, 100.0));
    for class in strong(merit) {
        let points = class.isolation.iter().flat_map(|latency| &latency.by_s);
        let points = points.map(|&(time_s, share)| (time_s, 100.0 * share)).collect();
        lines = lines.with(Curve::new(spoken(&class.command), points));
    }
    lines.draw()
}

/// The median of a latency, and below it what is longer.
fn times(latency: &Option<Latency>) -> String {
    latency.as_ref().map_or(NONE.into(), |latency| {
        let Latency { median_s, p95_s, longest_s, .. } = latency;
        format!("{median_s:.2} s\n{p95_s:.2} s\n{longest_s:.2} s")
    })
}

fn by_command(merit: &Merit) -> Grid {
    let mut grid = Grid::new([
        ("command", Side::Left),
        ("intensity", Side::Left),
        ("visible", Side::Right),
        ("isolated", Side::Right),
        ("another command", Side::Right),
        ("wrong actuator", Side::Right),
        ("silent", Side::Right),
        ("until visible", Side::Right),
        ("until isolated", Side::Right),
        ("from visible to isolated", Side::Right),
    ]);
    for class in &merit.classes {
        let [low, high] = class.intensities;
        let count =
            |rate: &Rate| format!("{} of {}\n{}", rate.count, rate.of, stacked(Some(*rate)));
        grid.push(vec![
            spoken(&class.command),
            format!("{} … {}", chosen(low), chosen(high)),
            count(&class.visible),
            count(&class.isolated),
            count(&class.other_command),
            count(&class.wrong_actuator),
            count(&class.silent),
            times(&class.detection),
            times(&class.isolation),
            times(&class.isolation_since_visible),
        ]);
    }
    grid
}

fn by_onset(results: &FlightResults) -> Grid {
    let mut grid = Grid::new([
        ("begins", Side::Left),
        ("setting", Side::Left),
        ("visible", Side::Right),
        ("isolated", Side::Right),
        ("silent", Side::Right),
        ("until isolated: median, 95 %", Side::Right),
        ("wrong actuator off", Side::Right),
    ]);
    for merit in &results.merits {
        for (name, class) in &merit.onsets {
            let isolation = class.isolation.as_ref();
            grid.push(vec![
                name.clone(),
                merit.setting.clone(),
                format!("{} of {}", class.visible.count, class.visible.of),
                stacked(Some(class.isolated)),
                stacked(Some(class.silent)),
                isolation.map_or(NONE.into(), |l| format!("{:.2} s, {:.2} s", l.median_s, l.p95_s)),
                class.wrong_shutdown.to_string(),
            ]);
        }
    }
    grid
}

/// The same flights with other rates asked for.
fn trade(results: &FlightResults, page: &mut Page) {
    page.text(
        "The sequential test is told how many false alarms are allowed, and takes the time that this \
         needs. The same flights, with several rates asked for:",
    );
    let mut lines = Lines::new("", "false alarms asked for, per hour", "time since the onset / s");
    lines.x_log = true;
    let mut grid = Grid::new([
        ("setting", Side::Left),
        ("asked for, per hour", Side::Right),
        ("false alarms measured", Side::Right),
        ("isolated: median, 95 %", Side::Right),
        ("never isolated", Side::Right),
        ("wrong actuator off", Side::Right),
    ]);
    for merit in &results.merits {
        let isolated =
            merit.trade.iter().filter_map(|p| Some((p.asked_per_h, p.isolation.as_ref()?)));
        let mut isolated: Vec<(f64, &Latency)> = isolated.collect();
        isolated.sort_by(|a, b| a.0.total_cmp(&b.0));
        let curve = |name: &str, of: fn(&Latency) -> f64| {
            let points = isolated.iter().map(|(asked, latency)| (*asked, of(latency))).collect();
            Curve::new(format!("{}, {name}", merit.setting), points)
        };
        lines = lines.with(curve("median", |l| l.median_s)).with(curve("95 %", |l| l.p95_s));
        for point in &merit.trade {
            let healthy = &point.healthy;
            let isolation = point.isolation.as_ref();
            grid.push(vec![
                merit.setting.clone(),
                number(point.asked_per_h),
                format!(
                    "{} in {:.1} h\nat most {} per hour (95 %)",
                    healthy.alarms,
                    healthy.hours,
                    number(healthy.alarms_per_h_upper)
                ),
                isolation.map_or(NONE.into(), |l| format!("{:.2} s, {:.2} s", l.median_s, l.p95_s)),
                stacked(Some(point.missed)),
                point.wrong_shutdowns.to_string(),
            ]);
        }
    }
    let caption = format!(
        "How long the isolation of visible shutdown faults of intensity {STRONG} and more takes, by the \
         rate of false alarms that is asked for."
    );
    page.figure("flights_trade", lines.draw(), &caption);
    page.table(&grid, "The same in numbers; latencies are of the faults that were isolated.");
}

fn wrong_kinds(results: &FlightResults, page: &mut Page) {
    let kinds = results.merits.iter().flat_map(|merit| {
        let name = |(kind, count): &(String, u64)| {
            format!("{} ({count}, {})", spoken(kind), merit.setting)
        };
        merit.wrong_kinds.iter().map(name).collect::<Vec<_>>()
    });
    let kinds: Vec<String> = kinds.collect();
    if !kinds.is_empty() {
        page.note(&format!(
            "Kinds of fault that switched the wrong actuator off: {}.",
            kinds.join(", ")
        ));
    }
}

/// The finding for the first screen: one sentence for the hardest setting.
pub(super) fn finding(results: &FlightResults) -> Option<String> {
    let merit = results.merits.last()?;
    let foreign = results.foreign.iter().find(|other| other.setting == merit.setting);
    let foreign = foreign.map(|foreign| foreign.shutdowns_healthy());
    let foreign = foreign.map_or(String::new(), |(wrong, of)| {
        format!(" and {wrong} of {of} flights with faults that were never trained on")
    });
    let missed = merit.in_time.share.is_some_and(|share| share < SHARE);
    Some(format!(
        "In flights in which a fault begins, {} of the visible shutdown faults of intensity {STRONG} and \
         more are isolated within {} s{} ({} have left any band by then); a healthy actuator is shut down in {} of {} flights with \
         trained faults{foreign}. False alarms: {} in {:.1} healthy hours (95 %: at most {} \
         per hour).",
        bracketed(Some(merit.in_time)),
        chosen(merit.limit_s),
        if missed { ", which misses the limit of 95 %" } else { "" },
        percent(merit.visible_in_time.share),
        merit.wrong_shutdowns,
        merit.flights,
        merit.healthy.alarms,
        merit.healthy.hours,
        number(merit.healthy.alarms_per_h_upper),
    ))
}
