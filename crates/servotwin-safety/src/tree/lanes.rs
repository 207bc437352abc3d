//! The fault trees of a study. A *lane* is an actuator with its diagnosis.
//!
//! | basic event | probability |
//! |---|---|
//! | a fault begins in this flight | 1 − exp(−λ · flight) |
//! | a fault is known and waits for its repair | 1 − exp(−λ · repair interval) |
//! | a fault is hidden since the last check | 1 − exp(−λ · check interval) |
//! | a fault is missed: the right action is not the first one | counted share of flights |
//! | another action is raised, which may be a shutdown | counted share of flights |
//! | a fault shuts another lane down | counted share of flights |
//! | a false alarm shuts a healthy lane down | counted rate, as a failure rate |
//!
//! A lane is *physically lost* if a fault that needs a shutdown is in it, whether the shutdown comes or not. It is *lost
//! by command* if a shutdown is raised without need. The alarm never shuts down the last lane that is on
//! ([`Study::least_on`]). So all lanes are lost only if at least one is lost physically.
//!
//! Every lane that is lost stays lost until its repair. A lane that was lost before the flight matters only beside one
//! that is lost in it.
//!
//! Flights are counted by action, so all faults of a lane that need one action share the events of their answers.
//! Rates λ are the user's. Counts are of `flights.json`. Its flights have faults of all intensities in equal shares,
//! weak ones included, and a fault that never becomes visible counts as missed.

use super::structure::{EventLaw, Exposure, FaultTree, GateKind, TopEvent, TreeInput};
use crate::counts::{ActionCounts, FaultIntensities, check_rates, false_shutdowns_per_h};
use crate::error::SafetyError;
use crate::interval::{CountedValue, clopper_pearson};
use crate::rates::{FailureRates, RatedFault};
use servotwin::flight::judge::FlightMetrics;
use servotwin::study::Study;
use servotwin::text::spoken;

/// The joint confidence of all counted intervals together.
pub const CONFIDENCE: f64 = 0.95;

/// A number that basic events share.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeParameter {
    /// An identifier of letters, digits, `_` and `-`.
    pub id: String,
    /// Its value; a rate in 1/h, or a probability. A user's rate has no band.
    pub value: CountedValue,
    /// Where it comes from.
    pub evidence: String,
}

/// The trees of a study, with the numbers of their events.
#[derive(Debug, Clone, PartialEq)]
pub struct LaneTrees {
    /// Gates, events and top events.
    pub tree: FaultTree,
    /// Rates, 1/h.
    pub rates: Vec<TreeParameter>,
    /// Probabilities.
    pub constants: Vec<TreeParameter>,
    /// Why a usual top event is missing.
    pub notes: Vec<String>,
}

/// The failure events of a fault.
struct FaultEvents {
    detail: String,
    begins: TreeInput,
    waits: TreeInput,
    hidden: TreeInput,
}

/// The answers of the diagnosis to faults of one lane that need one action. Flights are counted by action, so all of its
/// faults in a lane share these events.
struct AnswerEvents {
    lane: usize,
    needs_shutdown: bool,
    missed: TreeInput,
    /// For an action that is no shutdown: another one is raised, perhaps a shutdown.
    other_action: Option<TreeInput>,
    /// For every other lane: the lane, and the event that it is shut down.
    wrong_shutdowns: Vec<(usize, TreeInput)>,
}

/// The constants of the answers to faults that need one action, as indices.
#[derive(Debug, Clone, Copy)]
struct AnswerConstants {
    needs_shutdown: bool,
    missed: usize,
    other_action: Option<usize>,
    wrong_shutdown: Option<usize>,
}

/// The gates of the faults of one lane that need one action.
struct FaultGates {
    begins: TreeInput,
    waits: TreeInput,
    hidden: TreeInput,
    answers: AnswerEvents,
}

/// The faults that the trees of a study need rates for.
pub fn rated_faults(study: &Study) -> Vec<RatedFault> {
    let mut list: Vec<RatedFault> = vec![];
    for fault in &study.faults {
        if list.last().is_none_or(|last| last.id != fault.id) {
            list.push(RatedFault { id: fault.id.clone(), kind: fault.kind.clone() });
        }
    }
    list
}

/// Builds the trees of a study from counted flights and the user's rates.
///
/// # Errors
/// The study has no action that switches an actuator off; a fault has no rate.
pub fn lane_trees(
    study: &Study,
    metrics: &FlightMetrics,
    rates: &FailureRates,
) -> Result<LaneTrees, SafetyError> {
    if study.shutdowns().is_empty() {
        let problem = "no action switches an actuator off, so no lane can be lost by command; declare one with \
                       switches_off = true in [reactions]";
        return Err(SafetyError::Study { study: study.name.clone(), problem });
    }
    check_rates(&rated_faults(study), rates)?;
    let trees =
        LaneTrees { tree: FaultTree::default(), rates: vec![], constants: vec![], notes: vec![] };
    let mut growing = TreeGrower { study, metrics, rates, trees, confidence: 0.0 };
    growing.grow();
    Ok(growing.trees)
}

struct TreeGrower<'g> {
    study: &'g Study,
    metrics: &'g FlightMetrics,
    rates: &'g FailureRates,
    trees: LaneTrees,
    /// The confidence of each interval.
    confidence: f64,
}

/// The gates of a lane.
struct LaneGates {
    lost_now: Option<TreeInput>,
    lost_ever: Option<TreeInput>,
    physical: Option<TreeInput>,
}

/// Faults with an answer that shuts a lane down without need: a needless one of its own faults, or a wrong one of the
/// faults of others.
fn needless(
    lane: usize,
    gates: &[FaultGates],
    fault: fn(&FaultGates) -> TreeInput,
) -> Vec<(TreeInput, TreeInput)> {
    let own = gates.iter().filter(|of| of.answers.lane == lane);
    let own = own.filter_map(|of| Some((fault(of), of.answers.other_action?)));
    let others = gates.iter().flat_map(|of| {
        let wrong = of.answers.wrong_shutdowns.iter().filter(|(other, _)| *other == lane);
        wrong.map(|(_, event)| (fault(of), *event))
    });
    own.chain(others).collect()
}

/// An identifier made of a name.
pub(super) fn identifier(name: &str) -> String {
    let letter = |c: char| if c.is_ascii_alphanumeric() || c == '_' { c } else { '-' };
    let text: String = name.chars().map(letter).collect();
    let starts_well = text.starts_with(|c: char| c.is_ascii_alphabetic());
    if starts_well { text } else { format!("n{text}") }
}

impl TreeGrower<'_> {
    fn grow(&mut self) {
        let actions = self.study.commands();
        let counted = 1 + actions.len() * if self.lanes() > 1 { 3 } else { 2 };
        // Bonferroni: all intervals together hold with the joint confidence.
        self.confidence = 1.0 - (1.0 - CONFIDENCE) / counted as f64;
        let constants: Vec<AnswerConstants> =
            actions.iter().map(|action| self.constants_of(action)).collect();
        let mut gates = vec![];
        for lane in 0..self.lanes() {
            for (name, &constants) in actions.iter().zip(&constants) {
                // The answers follow their faults: then the decision diagram remembers one bit for all of them.
                let faults = self.faults(lane, name);
                let answers = self.answers((lane, name), constants);
                gates.extend(self.fault_gates(name, answers, &faults));
            }
        }
        let alarms = self.false_alarms();
        let lanes: Vec<LaneGates> =
            (0..self.lanes()).map(|lane| self.lane(lane, &gates, &alarms)).collect();
        self.tops(&lanes, &gates);
    }

    fn lanes(&self) -> usize {
        self.study.units.len()
    }

    /// A lane's name in identifiers and in words.
    fn lane_name(&self, lane: usize) -> (String, String) {
        match self.study.units[lane].as_str() {
            "" => ("lane".into(), "the only lane".into()),
            name => (identifier(name), spoken(name)),
        }
    }

    fn constant(&mut self, id: String, count: u64, of: u64, what: &str) -> usize {
        let evidence = match of {
            0 => format!("{what}: not flown, so nothing is known"),
            _ => format!(
                "{what}: {count} of {of} flights, flights.json, scenario {}",
                self.metrics.setting
            ),
        };
        let value = clopper_pearson(count, of, self.confidence);
        self.trees.constants.push(TreeParameter { id, value, evidence });
        self.trees.constants.len() - 1
    }

    /// The constants of an action's answers.
    fn constants_of(&mut self, name: &str) -> AnswerConstants {
        let counts = ActionCounts::of(self.metrics, name, FaultIntensities::All);
        let (id, words) = (identifier(name), spoken(name));
        let needs_shutdown = self.study.reactions.switches_off(name);
        let what = format!("right action not raised first for faults that need '{words}'");
        let missed = self.constant(format!("missed-{id}"), counts.missed, counts.flown, &what);
        let what = format!("another action for the right lane for faults that need '{words}'");
        let other_action = (!needs_shutdown).then(|| {
            let (count, of) = (counts.other_action, counts.flown);
            self.constant(format!("other_action-{id}"), count, of, &what)
        });
        let what = format!("shutdown of another lane for faults that need '{words}'");
        let wrong_shutdown = (self.lanes() > 1).then(|| {
            let (count, of) = (counts.wrong_shutdown, counts.flown);
            self.constant(format!("wrong_shutdown-{id}"), count, of, &what)
        });
        AnswerConstants { needs_shutdown, missed, other_action, wrong_shutdown }
    }

    /// The answers to the faults of a lane that need an action.
    fn answers(&mut self, (lane, name): (usize, &str), constants: AnswerConstants) -> AnswerEvents {
        let (lane_id, lane_words) = self.lane_name(lane);
        let names: Vec<_> = (0..self.lanes()).map(|other| self.lane_name(other)).collect();
        let (id, words) = (format!("{lane_id}-{}", identifier(name)), spoken(name));
        let fault = format!("a fault of {lane_words} that needs '{words}'");
        let tree = &mut self.trees.tree;
        let mut event = |what: String, words: String, constant: usize| {
            tree.event(format!("{id}-{what}"), words, EventLaw::Constant(constant))
        };
        let missed = event("missed".into(), format!("{fault} is missed"), constants.missed);
        let other_action = constants.other_action.map(|constant| {
            let words = format!("{fault} raises another action, perhaps a shutdown");
            event("other_action".into(), words, constant)
        });
        let others = names.into_iter().enumerate().filter(|(other, _)| *other != lane);
        let wrong_shutdowns = constants.wrong_shutdown.map_or(vec![], |constant| {
            let one = |(other, (other_id, other_words)): (usize, (String, String))| {
                let words = format!("{fault} shuts {other_words} down");
                (other, event(format!("shuts_down-{other_id}"), words, constant))
            };
            others.map(one).collect()
        });
        let needs_shutdown = constants.needs_shutdown;
        AnswerEvents { lane, needs_shutdown, missed, other_action, wrong_shutdowns }
    }

    /// The events of every fault of a lane that needs an action.
    fn faults(&mut self, lane: usize, action: &str) -> Vec<FaultEvents> {
        let study = self.study;
        let mut found: Vec<FaultEvents> = vec![];
        let mut last = None;
        for fault in study.faults.iter().filter(|fault| fault.unit == lane) {
            let class = &study.classes[fault.class];
            // A fault stands in the list once for each intensity.
            if class.command != action || last.replace(&fault.id) == Some(&fault.id) {
                continue;
            }
            let rated = RatedFault { id: fault.id.clone(), kind: fault.kind.clone() };
            let Some(rate) = self.rates.of(&rated) else { continue };
            let value = CountedValue { point: rate.per_h, low: rate.per_h, high: rate.per_h };
            let (id, words) = (identifier(&fault.id), spoken(&fault.id));
            let evidence =
                format!("{} line {}: {}", self.rates.path.display(), rate.line, rate.source);
            self.trees.rates.push(TreeParameter { id: format!("rate-{id}"), value, evidence });
            let rate = self.trees.rates.len() - 1;
            let tree = &mut self.trees.tree;
            let mut failure = |what: &str, how: &str, exposure: Exposure| {
                let law = EventLaw::Exponential(rate, exposure);
                tree.event(format!("{id}-{what}"), format!("{words} {how}"), law)
            };
            found.push(FaultEvents {
                detail: class.detail.clone(),
                begins: failure("begins", "begins in this flight", Exposure::Flight),
                waits: failure("waits", "waits for its repair", Exposure::Repair),
                hidden: failure("hidden", "is there since the last check", Exposure::Check),
            });
        }
        found
    }

    /// The gates of the faults that some answers are for; `None` without such faults.
    fn fault_gates(
        &mut self,
        name: &str,
        answers: AnswerEvents,
        faults: &[FaultEvents],
    ) -> Option<FaultGates> {
        let (lane_id, lane_words) = self.lane_name(answers.lane);
        let (id, words) = (identifier(name), spoken(name));
        let own = |of: fn(&FaultEvents) -> TreeInput| {
            faults.iter().map(|fault| (fault.detail.clone(), of(fault))).collect::<Vec<_>>()
        };
        let mut gate = |what: &str, how: &str, of: fn(&FaultEvents) -> TreeInput| {
            let title = format!("a fault of {lane_words} that needs '{words}' {how}");
            self.by_class(&format!("{lane_id}-{id}-{what}"), &title, how, own(of))
        };
        Some(FaultGates {
            begins: gate("begins", "begins in this flight", |fault| fault.begins)?,
            waits: gate("waits", "waits for its repair", |fault| fault.waits)?,
            hidden: gate("hidden", "is there since the last check", |fault| fault.hidden)?,
            answers,
        })
    }

    /// For every lane: a false alarm shuts it down in this flight, or has done so and waits for its repair.
    fn false_alarms(&mut self) -> Vec<[TreeInput; 2]> {
        let (value, evidence) = false_shutdowns_per_h(self.metrics, self.lanes(), self.confidence);
        self.trees.rates.push(TreeParameter { id: "rate-false_shutdown".into(), value, evidence });
        let rate = self.trees.rates.len() - 1;
        let names: Vec<_> = (0..self.lanes()).map(|lane| self.lane_name(lane)).collect();
        let tree = &mut self.trees.tree;
        let mut event = |id: &str, what: &str, words: String, exposure: Exposure| {
            tree.event(format!("{id}-{what}"), words, EventLaw::Exponential(rate, exposure))
        };
        let mut of_lane = |(id, words): (String, String)| {
            let now = format!("a false alarm shuts {words} down in this flight");
            let before = format!("{words} waits for its release after a false alarm");
            [
                event(&id, "false_shutdown-begins", now, Exposure::Flight),
                event(&id, "false_shutdown-waits", before, Exposure::Repair),
            ]
        };
        names.into_iter().map(&mut of_lane).collect()
    }

    fn or(&mut self, id: &str, title: &str, inputs: Vec<TreeInput>) -> Option<TreeInput> {
        self.trees.tree.gate(GateKind::Or, id, title, inputs)
    }

    fn both(&mut self, id: &str, title: &str, one: TreeInput, other: TreeInput) -> TreeInput {
        self.trees.tree.named_gate(GateKind::And, id, title, vec![one, other])
    }

    /// An OR of the events of every fault class; figures show a class as one box. `how` is what
    /// its faults do.
    fn by_class(
        &mut self,
        id: &str,
        title: &str,
        how: &str,
        events: Vec<(String, TreeInput)>,
    ) -> Option<TreeInput> {
        let mut details: Vec<String> = vec![];
        for (detail, _) in &events {
            if !details.contains(detail) {
                details.push(detail.clone());
            }
        }
        let mut gates = vec![];
        for detail in details {
            let own = events.iter().filter(|(of, _)| *of == detail).map(|(_, event)| *event);
            let own: Vec<TreeInput> = own.collect();
            let gate = self.trees.tree.named_gate(
                GateKind::Or,
                &format!("{id}-{}", identifier(&detail)),
                &format!("{}: {how}", spoken(&detail)),
                own,
            );
            if let TreeInput::Gate(place) = gate {
                self.trees.tree.gates[place].is_folded = true;
            }
            gates.push(gate);
        }
        self.or(id, title, gates)
    }

    fn lane(&mut self, lane: usize, gates: &[FaultGates], alarms: &[[TreeInput; 2]]) -> LaneGates {
        let (id, words) = self.lane_name(lane);
        let own = gates.iter().filter(|of| of.answers.lane == lane && of.answers.needs_shutdown);
        let (mut now, mut before) = (vec![], vec![]);
        for (place, of) in own.enumerate() {
            now.push(of.begins);
            let title = format!("a hidden fault of {words} was missed");
            let both_id = format!("{id}-missed-{}", place + 1);
            let hidden = self.both(&both_id, &title, of.hidden, of.answers.missed);
            before.extend([of.waits, hidden]);
        }
        let title = format!("a fault that needs a shutdown begins in {words}");
        let physical_now = self.or(&format!("{id}-fails"), &title, now);
        let title = format!("a fault that needs a shutdown was in {words} before the flight");
        let physical_before = self.or(&format!("{id}-failed"), &title, before);
        let [false_now, false_before] = alarms[lane];
        let title = format!("{words} is shut down without need in this flight");
        let pairs = needless(lane, gates, |of| of.begins);
        let commanded_now = self.commanded(&format!("{id}-is_shut_down"), &title, pairs, false_now);
        let title = format!("{words} was shut down without need before the flight");
        let pairs = needless(lane, gates, |of| of.waits);
        let commanded_before =
            self.commanded(&format!("{id}-was_shut_down"), &title, pairs, false_before);
        let some = |list: [Option<TreeInput>; 2]| list.into_iter().flatten().collect::<Vec<_>>();
        let lost_now = self.or(
            &format!("{id}-lost"),
            &format!("{words} is lost in this flight"),
            some([physical_now, Some(commanded_now)]),
        );
        let lost_before = self.or(
            &format!("{id}-lost_before"),
            &format!("{words} was lost before the flight"),
            some([physical_before, Some(commanded_before)]),
        );
        let title = format!("{words} is lost");
        let lost_ever = self.or(&format!("{id}-off"), &title, some([lost_now, lost_before]));
        let title = format!("{words} has a fault that needs a shutdown");
        let physical =
            self.or(&format!("{id}-faulty"), &title, some([physical_now, physical_before]));
        LaneGates { lost_now, lost_ever, physical }
    }

    /// A shutdown without need: by a fault and a wrong answer to it, or by a false alarm.
    fn commanded(
        &mut self,
        id: &str,
        title: &str,
        pairs: Vec<(TreeInput, TreeInput)>,
        false_alarm: TreeInput,
    ) -> TreeInput {
        let mut inputs = vec![];
        for (place, (fault, answer)) in pairs.into_iter().enumerate() {
            let both_id = format!("{id}-{}", place + 1);
            inputs.push(self.both(&both_id, "a fault and a wrong answer to it", fault, answer));
        }
        inputs.push(false_alarm);
        self.trees.tree.named_gate(GateKind::Or, id, title, inputs)
    }

    fn tops(&mut self, lanes: &[LaneGates], gates: &[FaultGates]) {
        let lost: Vec<TreeInput> = lanes.iter().filter_map(|lane| lane.lost_now).collect();
        let title = match lanes.len() {
            1 => "Loss of the only lane in a flight",
            _ => "Loss of at least one lane in a flight",
        };
        self.top(GateKind::Or, "loss_of_one_lane", title, lost);
        match lanes.len() {
            1 => self.trees.notes.push(
                "one actuator: the loss of its lane is the loss of the function, so there is no tree for both lanes"
                    .into(),
            ),
            count => self.loss_of_all(lanes, count),
        }
        let mut undetected = vec![];
        for (place, of) in gates.iter().enumerate() {
            let present = self.trees.tree.named_gate(
                GateKind::Or,
                &format!("present-{}", place + 1),
                "a fault begins or is there since the last check",
                vec![of.begins, of.hidden],
            );
            let both_id = format!("undetected-{}", place + 1);
            let title = "a fault is there and missed";
            undetected.push(self.both(&both_id, title, present, of.answers.missed));
        }
        let title = "A fault without its action in a flight: undetected degradation";
        self.top(GateKind::Or, "undetected_degradation", title, undetected);
    }

    fn loss_of_all(&mut self, lanes: &[LaneGates], count: usize) {
        let physical: Vec<TreeInput> = lanes.iter().filter_map(|lane| lane.physical).collect();
        let guard = (self.study.least_on() > 0)
            .then(|| {
                self.or(
                    "any_lane-faulty",
                    "at least one lane has a fault that needs a shutdown",
                    physical,
                )
            })
            .flatten();
        let mut ways = vec![];
        for (last, lane) in lanes.iter().enumerate() {
            let (id, words) = self.lane_name(last);
            let others = lanes.iter().enumerate().filter(|(other, _)| *other != last);
            let others = others.filter_map(|(_, other)| other.lost_ever);
            let inputs: Vec<TreeInput> =
                lane.lost_now.into_iter().chain(others).chain(guard).collect();
            let title = format!("{words} is lost in this flight, and all others are lost");
            ways.push(self.trees.tree.named_gate(
                GateKind::And,
                &format!("all_lost-{id}"),
                &title,
                inputs,
            ));
        }
        let title = match count {
            2 => "Loss of both lanes in a flight",
            _ => "Loss of all lanes in a flight",
        };
        let id = if count == 2 { "loss_of_both_lanes" } else { "loss_of_all_lanes" };
        self.top(GateKind::Or, id, title, ways);
    }

    fn top(&mut self, kind: GateKind, id: &str, title: &str, inputs: Vec<TreeInput>) {
        if let TreeInput::Gate(gate) = self.trees.tree.named_gate(kind, id, title, inputs) {
            self.trees.tree.tops.push(TopEvent { gate });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::decision_diagram::DecisionDiagram;
    use super::super::exchange;
    use super::super::numbers::{BandEnd, ExposureHours, evaluate, event_probabilities};
    use super::super::structure::{TreeInput, brute_force};
    use super::*;
    use crate::rates::FailureRate;
    use serde_json::json;

    const HEAD: &str = include_str!("../../../servotwin/tests/tiny.toml");
    const HOURS: ExposureHours = ExposureHours { flight_h: 2.0, repair_h: 10.0, check_h: 100.0 };

    fn study(classes: &str) -> Study {
        let reactions = "[reactions]\nshut_down = { switches_off = true }\n";
        Study::parse(&format!("{HEAD}{classes}{reactions}"), "tiny.toml").unwrap()
    }

    fn class(detail: &str, action: &str, fault: &str) -> String {
        format!(
            "[[classes]]\ndetail = \"{detail}\"\ncommand = \"{action}\"\nfaults = [\"{fault}\"]\n"
        )
    }

    /// Flights with so many isolated of so many flown, with the other counts beside them.
    fn metrics(
        classes: &[(&str, u64, u64, u64, u64)],
        shutdowns: u64,
        hours: f64,
    ) -> FlightMetrics {
        let rate = |count: u64, of: u64| json!({"count": count, "of": of, "share": null, "low": 0.0, "high": 1.0, "by_kind": null});
        let class = |&(command, flown, isolated, other, wrong): &(&str, u64, u64, u64, u64)| {
            json!({
                "command": command, "intensities": [0.1, 1.0], "flown": flown, "visible": rate(flown, flown),
                "isolated": rate(isolated, flown), "other_command": rate(other, flown),
                "wrong_actuator": rate(wrong, flown), "wrong_shutdown": wrong, "silent": rate(0, flown),
                "detection": null, "isolation": null, "isolation_since_visible": null,
            })
        };
        let healthy = json!({
            "hours": hours, "alarms": shutdowns, "shutdowns": shutdowns, "alarms_per_h": 0.0, "alarms_per_h_upper": 1.0,
            "visible_by_chance": 0, "flights": [0, 0],
            "environments": {"flown": 0, "with_alarm": 0, "share_upper": 1.0},
        });
        let text = json!({
            "setting": "noise", "flights": 1, "failed": 0, "failed_to_learn": 0, "on_the_move_to_learn": [],
            "limit_s": 1.0, "in_time": rate(0, 0),
            "visible_in_time": rate(0, 0), "in_time_since_visible": rate(0, 0),
            "classes": classes.iter().map(class).collect::<Vec<_>>(), "kinds": [], "onsets": [],
            "healthy": healthy,
            "wrong_shutdowns": 0, "trade": [], "wrong_kinds": [],
        });
        serde_json::from_value(text).unwrap()
    }

    fn rates(list: &[(&str, f64)]) -> FailureRates {
        let rate = |&(fault, per_h): &(&str, f64)| FailureRate {
            fault: fault.into(),
            per_h,
            source: "a test".into(),
            line: 2,
        };
        FailureRates { path: "rates.csv".into(), list: list.iter().map(rate).collect() }
    }

    const VALVE: &str = "servo_valve.bias_positive";

    fn two_lanes() -> LaneTrees {
        let study = study(&class("valve", "shut_down", VALVE));
        // Coarse numbers, so that every kind of event matters.
        let metrics = metrics(&[("shut_down", 20, 15, 2, 3)], 1, 30.0);
        lane_trees(&study, &metrics, &rates(&[(VALVE, 0.01)])).unwrap()
    }

    #[test]
    fn the_trees_of_two_lanes_are_those_of_brute_force() {
        let trees = two_lanes();
        assert_eq!(trees.tree.events.len(), 14);
        for end in BandEnd::ALL {
            let of_events = event_probabilities(&trees, &HOURS, end);
            for top in &trees.tree.tops {
                let input = TreeInput::Gate(top.gate);
                let exact = brute_force::probability(&trees.tree, input, &of_events);
                let own = DecisionDiagram::new(&trees.tree, input).probability(&of_events);
                assert!(
                    (own - exact).abs() < 1e-12,
                    "{}: {own} {exact}",
                    trees.tree.gates[top.gate].id
                );
            }
        }
        let both = TreeInput::Gate(trees.tree.tops[1].gate);
        let sets = DecisionDiagram::new(&trees.tree, both).cut_sets();
        let of_events = event_probabilities(&trees, &HOURS, BandEnd::Point);
        let mut own: Vec<_> =
            sets.most_probable(&of_events, usize::MAX).into_iter().map(|s| s.1).collect();
        own.sort();
        assert_eq!(own, brute_force::cut_sets(&trees.tree, both));
    }

    #[test]
    fn both_lanes_are_lost_by_the_sets_that_an_engineer_names() {
        let trees = two_lanes();
        let tops = evaluate(&trees, &HOURS);
        let ids: Vec<&str> = tops.iter().map(|top| top.id.as_str()).collect();
        assert_eq!(ids, ["loss_of_one_lane", "loss_of_both_lanes", "undetected_degradation"]);
        let has = |events: &[&str]| {
            tops[1].cut_sets.iter().any(|set| {
                set.events.len() == events.len()
                    && events.iter().all(|e| set.events.iter().any(|own| own == e))
            })
        };
        let (one, two) =
            ("actuator_1-servo_valve-bias_positive", "actuator_2-servo_valve-bias_positive");
        assert!(has(&[&format!("{one}-begins"), &format!("{two}-begins")]));
        // One fault and a wrong answer to it.
        let wrong = "actuator_1-shut_down-shuts_down-actuator_2";
        assert!(has(&[&format!("{one}-begins"), wrong]));
        // A fault hidden in one lane, and one that begins in the other.
        assert!(has(&[
            &format!("{one}-begins"),
            &format!("{two}-hidden"),
            "actuator_2-shut_down-missed"
        ]));
        assert!(has(&[&format!("{one}-begins"), "actuator_2-false_shutdown-waits"]));
        // The alarm never shuts down the last lane: two false alarms are not enough.
        let alarms = ["actuator_1-false_shutdown-begins", "actuator_2-false_shutdown-begins"];
        assert!(
            !tops[1]
                .cut_sets
                .iter()
                .any(|set| set.events.iter().all(|e| alarms.contains(&e.as_str())))
        );
    }

    #[test]
    fn one_lane_by_hand() {
        let trees = two_lanes();
        let tops = evaluate(&trees, &HOURS);
        let q = 1.0 - (-0.01_f64 * 2.0).exp();
        // One shutdown in 30 h of two lanes.
        let a = 1.0 - (-2.0_f64 / 60.0).exp();
        let expected = 1.0 - (1.0 - q).powi(2) * (1.0 - a).powi(2);
        assert!((tops[0].probability.point - expected).abs() < 1e-14);
        assert!((tops[0].per_flight_hour.point - expected / 2.0).abs() < 1e-14);
        // Undetected: a fault begins now or is hidden, and is missed in 5 of 20 flights.
        let present = 1.0 - (1.0 - q) * (-0.01_f64 * 100.0).exp();
        let expected = 1.0 - (1.0 - 0.25 * present).powi(2);
        assert!((tops[2].probability.point - expected).abs() < 1e-14);
    }

    #[test]
    fn bands_hold_the_estimate_and_shrink_with_more_flights() {
        let study = study(&class("valve", "shut_down", VALVE));
        let width = |times: u64| {
            let classes = [("shut_down", 20 * times, 15 * times, 2 * times, times)];
            let metrics = metrics(&classes, times, 30.0 * times as f64);
            let trees = lane_trees(&study, &metrics, &rates(&[(VALVE, 0.01)])).unwrap();
            let top = &evaluate(&trees, &HOURS)[1];
            let band = top.per_flight_hour;
            assert!(band.low < band.point && band.point < band.high, "{band:?}");
            assert!(
                top.mean_per_flight_hour.point < band.point,
                "nothing is hidden in the first flight"
            );
            band.high / band.low
        };
        assert!(width(100) < 0.3 * width(1), "{} {}", width(100), width(1));
    }

    #[test]
    fn the_only_lane_of_a_machine_has_no_tree_for_both() {
        let study = Study::parse(servotwin::built_in::STUDIES[2].1, "press_axis").unwrap();
        let faults = rated_faults(&study);
        let list: Vec<(&str, f64)> = faults.iter().map(|fault| (fault.id.as_str(), 1e-6)).collect();
        let metrics = metrics(&[("stop", 64, 60, 1, 0), ("maintenance", 40, 38, 1, 0)], 0, 2.0);
        let trees = lane_trees(&study, &metrics, &rates(&list)).unwrap();
        let tops = evaluate(&trees, &HOURS);
        let ids: Vec<&str> = tops.iter().map(|top| top.id.as_str()).collect();
        assert_eq!(ids, ["loss_of_one_lane", "undetected_degradation"]);
        assert!(trees.notes[0].contains("one actuator"), "{:?}", trees.notes);
        // A false alarm alone stops a machine with one lane, even if none was counted.
        assert!(
            tops[0].probability.high > 0.5 && tops[0].probability.point < 1e-3,
            "{:?}",
            tops[0].probability
        );
    }

    #[test]
    fn a_fault_without_a_rate_and_a_study_without_a_shutdown_are_refused() {
        let classes = class("valve", "shut_down", VALVE)
            + &class("sensor", "change_mode", "sensor_ram.bias_positive");
        let metrics = metrics(&[], 0, 1.0);
        let error = lane_trees(&study(&classes), &metrics, &rates(&[(VALVE, 0.01)])).unwrap_err();
        let error = error.to_string();
        assert!(
            error.starts_with(
                "rates.csv: 2 faults of the tree have no rate: actuator_1.sensor_ram.bias_positive"
            ),
            "{error}"
        );
        let text = format!("{HEAD}{}", class("valve", "shut_down", VALVE));
        let without = Study::parse(&text, "tiny.toml").unwrap();
        let error =
            lane_trees(&without, &metrics, &rates(&[(VALVE, 0.01)])).unwrap_err().to_string();
        assert!(error.contains("no action switches an actuator off"), "{error}");
    }

    #[test]
    fn an_action_that_was_not_flown_is_missed_for_certain_or_not_at_all() {
        let study = study(&class("valve", "shut_down", VALVE));
        let trees = lane_trees(&study, &metrics(&[], 0, 1.0), &rates(&[(VALVE, 0.01)])).unwrap();
        let missed =
            trees.constants.iter().find(|constant| constant.id == "missed-shut_down").unwrap();
        assert_eq!(missed.value, CountedValue { point: 1.0, low: 0.0, high: 1.0 });
        assert!(missed.evidence.contains("not flown"), "{}", missed.evidence);
    }

    #[test]
    fn a_document_defines_what_it_uses_once() {
        let trees = two_lanes();
        let text = exchange::document("tiny study", &trees, &HOURS, BandEnd::High);
        assert!(text.contains("<define-fault-tree name=\"tiny-study\">"));
        for (used, defined) in [
            ("<gate name=\"", "<define-gate name=\""),
            ("<basic-event name=\"", "<define-basic-event name=\""),
            ("<parameter name=\"", "<define-parameter name=\""),
        ] {
            let names = |mark: &str| {
                let parts = text.split(mark).skip(1);
                parts.map(|rest| rest.split('"').next().unwrap().to_owned()).collect::<Vec<_>>()
            };
            let mut definitions = names(defined);
            let count = definitions.len();
            definitions.sort();
            definitions.dedup();
            assert_eq!(definitions.len(), count, "{defined} twice");
            let unknown: Vec<_> =
                names(used).into_iter().filter(|n| !definitions.contains(n)).collect();
            assert_eq!(unknown, Vec::<String>::new(), "{used}");
        }
        // Only the top events are used by nobody.
        let roots = text.matches("<define-gate").count();
        let used: std::collections::BTreeSet<&str> = text
            .split("<gate name=\"")
            .skip(1)
            .map(|rest| rest.split('"').next().unwrap())
            .collect();
        assert_eq!(roots - used.len(), 3);
    }
}
