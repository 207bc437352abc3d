//! The watchdog of a live source: it reports *no data* and heartbeats by the wall clock.
//!
//! The results of the diagnosis depend only on the times of samples. The watchdog reads the wall clock and only writes
//! [`Notice`]s; nothing of it reaches the twin or the diagnosis.
//!
//! Data means a period with a value from a column. A sender that repeats one time forever sends rows but no data. If
//! the program itself was suspended (a laptop that slept), the stream is not blamed: each check counts for at most
//! `LONGEST_CHECK`.

use serde::Serialize;
use servotwin::live::observer::{DiagnosisState, Phase};
use std::time::{Duration, Instant, SystemTime};

/// The losses of a sink.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct SinkLoss {
    /// The file, socket or stream.
    pub sink: String,
    /// How many samples and notices it did not receive.
    pub lost: u64,
    /// Why it receives nothing any more, if it failed.
    pub failure: Option<String>,
    /// Whether the user requested a file that is now incomplete.
    #[serde(skip)]
    pub is_file: bool,
}

/// The most time that one check counts for; between two checks, a source is read for 0.2 s.
const LONGEST_CHECK: Duration = Duration::from_millis(1000);

/// When a source counts as silent, and how often the watch sends a heartbeat.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct WatchdogRules {
    /// A source or column without data for this long counts as silent.
    pub no_data_after: Duration,
    /// The time between two heartbeats; `None` disables them.
    pub heartbeat: Option<Duration>,
}

impl WatchdogRules {
    /// The usual rules for a sampling period, s: ten periods may pass without data, and at least the usual time.
    pub fn of_period(period_s: f64) -> Self {
        let usual = WatchdogRules::default();
        let ten_periods = Duration::try_from_secs_f64(10.0 * period_s);
        let no_data_after = usual.no_data_after.max(ten_periods.unwrap_or_default());
        WatchdogRules { no_data_after, ..usual }
    }
}

impl Default for WatchdogRules {
    /// No data after 2 s, a heartbeat every 10 s.
    fn default() -> Self {
        let heartbeat = Some(Duration::from_secs(10));
        WatchdogRules { no_data_after: Duration::from_secs(2), heartbeat }
    }
}

/// A notice of the watch besides the diagnosis, timed by the wall clock.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Notice {
    /// The event, flattened into the notice.
    #[serde(flatten)]
    pub event: WatchEvent,
    /// The wall clock, UTC: `2026-11-25T17:05:37.123Z`.
    pub wall_time: String,
    /// The time of the last sample, s; `None` before the first.
    pub time_s: Option<f64>,
    /// The wall time since the last data, s.
    pub silent_s: f64,
    /// The current state: `no_data` while the source is silent, otherwise that of the diagnosis.
    pub state: DiagnosisState,
    /// The phase of the alarm; it is kept while the source is silent.
    pub phase: Phase,
}

/// An event in a watch.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
pub enum WatchEvent {
    /// The source has sent no data for too long.
    NoData,
    /// The source sends data again.
    DataAgain,
    /// A column has had no value for too long, while others continue.
    ChannelNoData {
        /// The input or sensor.
        channel: String,
    },
    /// A column has values again.
    ChannelDataAgain {
        /// The input or sensor.
        channel: String,
    },
    /// A sink failed and receives nothing any more.
    SinkFailed {
        /// The file or socket.
        sink: String,
        /// The reason.
        reason: String,
    },
    /// The values of the source are hardly those of its map.
    Implausible {
        /// Since when, and why.
        reason: String,
    },
    /// The values of the source contradict its map. Ignore every finding and action since `from_s`, even one that still
    /// stands.
    Contradicted {
        /// Since when, and why.
        reason: String,
        /// Since when, s; `None` for the beginning.
        from_s: Option<f64>,
    },
    /// The watch is alive.
    Heartbeat {
        /// How many lines, rows, datagrams or messages arrived.
        frames: u64,
        /// How many periods were passed on.
        samples: u64,
        /// The losses of all sinks so far.
        sinks: Vec<SinkLoss>,
    },
}

impl Notice {
    /// A line of text; `None` for a heartbeat.
    pub fn words(&self) -> Option<String> {
        let silent_s = self.silent_s;
        Some(match &self.event {
            WatchEvent::NoData => format!("no data: the source is silent for {silent_s:.1} s"),
            WatchEvent::DataAgain if self.state.is_judgement() => {
                format!("data again after {silent_s:.1} s: {}", self.state.words())
            }
            WatchEvent::DataAgain => format!("data again after {silent_s:.1} s"),
            WatchEvent::ChannelNoData { channel } => {
                format!("no data of {channel} for {silent_s:.1} s")
            }
            WatchEvent::ChannelDataAgain { channel } => {
                format!("data of {channel} again after {silent_s:.1} s")
            }
            WatchEvent::SinkFailed { sink, reason } => {
                let reason = without_name(sink, reason);
                format!("{sink} failed and gets nothing more ({reason}); the watch goes on")
            }
            WatchEvent::Implausible { reason } => reason.clone(),
            WatchEvent::Contradicted { reason, .. } => {
                format!("{reason}; no finding and no action since then counts")
            }
            WatchEvent::Heartbeat { .. } => return None,
        })
    }
}

/// The reason of a failure without the sink's name: file errors begin with it.
pub fn without_name<'r>(sink: &str, reason: &'r str) -> &'r str {
    reason.strip_prefix(sink).and_then(|rest| rest.strip_prefix(": ")).unwrap_or(reason)
}

/// The wall clock, UTC, in milliseconds.
pub(crate) fn wall_time() -> String {
    let now = jiff::Timestamp::try_from(SystemTime::now());
    now.map_or_else(|_| String::new(), |now| format!("{now:.3}"))
}

/// How long something has been without data.
#[derive(Debug, Clone, Copy, Default)]
struct Silence {
    lasts: Duration,
    is_reported: bool,
}

impl Silence {
    /// Adds time without data; returns whether the silence must be reported now.
    fn add(&mut self, time: Duration, limit: Duration) -> bool {
        self.lasts += time;
        let is_due = self.lasts >= limit && !self.is_reported;
        self.is_reported |= is_due;
        is_due
    }

    /// Ends the silence because data arrived; returns its duration if it was reported.
    fn end(&mut self) -> Option<Duration> {
        let Silence { lasts, is_reported } = std::mem::take(self);
        is_reported.then_some(lasts)
    }
}

/// Counts how long the source and its columns have been silent.
#[derive(Debug, Clone)]
pub(super) struct Watchdog {
    rules: WatchdogRules,
    source: Silence,
    channels: Vec<Channel>,
    last_check: Instant,
    since_beat: Duration,
    /// The reported silences: their number, and the total duration of those that are over.
    pub silences: Silences,
}

/// An input or a sensor.
#[derive(Debug, Clone)]
pub(super) struct Channel {
    id: String,
    /// How much longer it may be silent than the source; `None` without a column.
    allowance: Option<Duration>,
    silence: Silence,
}

impl Channel {
    pub(super) fn new(id: &str, allowance: Option<Duration>) -> Self {
        Channel { id: id.to_owned(), allowance, silence: Silence::default() }
    }
}

/// What the watchdog reports, and how long the silence lasts or lasted.
pub(super) type Alert = (WatchEvent, Duration);

/// The silences of a live watch.
#[derive(Debug, Clone, Default, PartialEq, Serialize)]
pub struct Silences {
    /// How often the source was silent.
    pub source: u64,
    /// Their total duration, s.
    pub source_s: f64,
    /// How often a channel was silent while others continued.
    pub channels: u64,
}

impl Watchdog {
    /// Starts the clock.
    pub(crate) fn new(rules: WatchdogRules, channels: Vec<Channel>, now: Instant) -> Self {
        let (source, since_beat) = (Silence::default(), Duration::ZERO);
        let silences = Silences::default();
        Watchdog { rules, source, channels, last_check: now, since_beat, silences }
    }

    /// Whether the source counts as silent.
    pub(crate) fn is_silent(&self) -> bool {
        self.source.is_reported
    }

    /// How long the source has been silent.
    pub(crate) fn silent(&self) -> Duration {
        self.source.lasts
    }

    /// Takes the values of a period; NaN means missing. Appends the ended silences to `found`.
    pub(crate) fn note_data(&mut self, values: &[f64], found: &mut Vec<Alert>) {
        if values.iter().all(|value| value.is_nan()) {
            return;
        }
        if let Some(lasted) = self.source.end() {
            self.silences.source_s += lasted.as_secs_f64();
            found.push((WatchEvent::DataAgain, lasted));
        }
        for (channel, value) in self.channels.iter_mut().zip(values) {
            if !value.is_nan()
                && let Some(lasted) = channel.silence.end()
            {
                found.push((WatchEvent::ChannelDataAgain { channel: channel.id.clone() }, lasted));
            }
        }
    }

    /// Checks the wall clock, and returns whether a heartbeat is due. Appends new silences to `found`.
    pub(crate) fn check(&mut self, now: Instant, found: &mut Vec<Alert>) -> bool {
        let passed = now.saturating_duration_since(self.last_check);
        self.last_check = now;
        let counted = passed.min(LONGEST_CHECK);
        let limit = self.rules.no_data_after;
        if self.source.add(counted, limit) {
            self.silences.source += 1;
            found.push((WatchEvent::NoData, self.source.lasts));
        }
        // If nothing arrives at all, no column is to blame.
        if self.source.lasts < limit.min(LONGEST_CHECK) {
            for Channel { id, allowance, silence } in &mut self.channels {
                let Some(allowance) = *allowance else { continue };
                if silence.add(counted, limit.saturating_add(allowance)) {
                    self.silences.channels += 1;
                    found.push((WatchEvent::ChannelNoData { channel: id.clone() }, silence.lasts));
                }
            }
        }
        self.since_beat += passed;
        let is_due = self.rules.heartbeat.is_some_and(|every| self.since_beat >= every);
        if is_due {
            self.since_beat = Duration::ZERO;
        }
        is_due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NAN: f64 = f64::NAN;

    /// Checks every 0.2 s; each check has a period with values, or none. Returns the alerts, and the number of
    /// heartbeats.
    fn alerts(
        checks: impl IntoIterator<Item = Option<[f64; 2]>>,
        heartbeat_s: u64,
    ) -> (Vec<Alert>, usize) {
        let heartbeat = Some(Duration::from_secs(heartbeat_s)).filter(|beat| !beat.is_zero());
        let rules = WatchdogRules { heartbeat, ..WatchdogRules::default() };
        let begin = Instant::now();
        let channels = [("a", 0), ("b", 1)]
            .map(|(id, allowance_s)| Channel::new(id, Some(Duration::from_secs(allowance_s))));
        let mut watchdog = Watchdog::new(rules, channels.to_vec(), begin);
        let (mut found, mut beats) = (vec![], 0);
        for (k, values) in checks.into_iter().enumerate() {
            if let Some(values) = values {
                watchdog.note_data(&values, &mut found);
            }
            let now = begin + Duration::from_millis(200) * (k as u32 + 1);
            beats += usize::from(watchdog.check(now, &mut found));
        }
        (found, beats)
    }

    fn times(count: usize, values: Option<[f64; 2]>) -> impl Iterator<Item = Option<[f64; 2]>> {
        std::iter::repeat_n(values, count)
    }

    #[test]
    fn a_source_without_data_is_reported_once_and_its_return_too() {
        let whole = Some([1.0, 2.0]);
        let checks = times(5, whole).chain(times(30, None)).chain(times(5, whole));
        let second = Duration::from_secs(1);
        let silent = (WatchEvent::NoData, 2 * second);
        let again = (WatchEvent::DataAgain, Duration::from_millis(6200));
        assert_eq!(alerts(checks, 0).0, [silent.clone(), again]);
        // A source that never sends, and one that sends periods without a value.
        assert_eq!(alerts(times(30, None), 0).0, std::slice::from_ref(&silent));
        assert_eq!(alerts(times(30, Some([NAN; 2])), 0).0, [silent]);
    }

    #[test]
    fn a_channel_without_data_is_reported_while_others_go_on() {
        let [whole, first, second] = [[1.0, 2.0], [1.0, NAN], [NAN, 2.0]].map(Some);
        let checks = times(5, whole).chain(times(20, first)).chain(times(3, whole));
        // A value held for a second is reported missing a second later.
        let found = alerts(checks, 0).0;
        let [(silent, after), (again, _)] = &found[..] else { panic!("{found:?}") };
        assert_eq!(*silent, WatchEvent::ChannelNoData { channel: "b".into() });
        assert_eq!(*again, WatchEvent::ChannelDataAgain { channel: "b".into() });
        assert_eq!(*after, Duration::from_secs(3));
        let found = alerts(times(5, whole).chain(times(11, second)), 0).0;
        let silent = WatchEvent::ChannelNoData { channel: "a".into() };
        assert_eq!(found, [(silent, Duration::from_secs(2))]);
    }

    #[test]
    fn heartbeats_come_with_data_and_without() {
        assert_eq!(alerts(times(100, Some([1.0; 2])), 5).1, 4);
        assert_eq!(alerts(times(100, None), 5).1, 4);
        assert_eq!(alerts(times(100, None), 0).1, 0);
    }

    #[test]
    fn a_program_that_stood_still_does_not_blame_the_stream() {
        let begin = Instant::now();
        let mut watchdog = Watchdog::new(WatchdogRules::default(), vec![], begin);
        let mut found = vec![];
        assert!(watchdog.check(begin + Duration::from_secs(3600), &mut found));
        assert!(found.is_empty() && !watchdog.is_silent());
    }
}
