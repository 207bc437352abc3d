//! The fault trees of a study. A *lane* is an actuator with its diagnosis.
//!
//! | basic event | probability |
//! |---|---|
//! | a fault begins in this flight | 1 − exp(−λ · flight) |
//! | a fault is known and waits for its repair | 1 − exp(−λ · repair interval) |
//! | a fault is hidden since the last check | 1 − exp(−λ · check interval) |
//! | a fault is hidden since the last test on the ground | 1 − exp(−λ · test interval) |
//! | the test on the ground passes a hidden fault | counted share of tests |
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
use crate::counts::{Answer, FaultIntensities, JudgedFlights};
use crate::error::SafetyError;
use crate::interval::{CountedValue, confidence_of_each};
use crate::rates::FailureRates;
use servotwin::study::Study;
use servotwin::text::spoken;

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

/// A name in identifiers and in words.
#[derive(Clone)]
struct TreeName {
    id: String,
    words: String,
}

/// An action with the constants of the answers to faults that need it, as indices.
struct AnsweredAction {
    action: String,
    name: TreeName,
    needs_shutdown: bool,
    missed: usize,
    passed: Option<usize>,
    other_action: Option<usize>,
    wrong_shutdown: Option<usize>,
}

/// The faults of one lane that need one action, and what answers them. Flights are counted by action, so all of these
/// faults share the events of their answers.
struct FaultGroup {
    lane: usize,
    needs_shutdown: bool,
    begins: TreeInput,
    waits: TreeInput,
    hidden: TreeInput,
    missed: TreeInput,
    /// For an action that is no shutdown: another one is raised, perhaps a shutdown.
    other_action: Option<TreeInput>,
    /// For every other lane: the lane, and the event that it is shut down.
    wrong_shutdowns: Vec<(usize, TreeInput)>,
}

/// How long a fault may have been there: in identifiers, in words, and the hours. Those of the test come last.
const EXPOSURES: [(&str, &str, Exposure); 4] = [
    ("begins", "begins in this flight", Exposure::Flight),
    ("waits", "waits for its repair", Exposure::Repair),
    ("hidden", "is there since the last check", Exposure::Check),
    ("hidden_since_test", "is there since the last test on the ground", Exposure::Test),
];

/// Builds the trees of a study from judged flights and the user's rates.
///
/// # Errors
/// The study has no action that switches an actuator off; a fault has no rate.
pub fn lane_trees(
    study: &Study,
    flights: &JudgedFlights,
    rates: &FailureRates,
) -> Result<LaneTrees, SafetyError> {
    if study.shutdowns().is_empty() {
        let problem = "no action switches an actuator off, so no lane can be lost by an action; declare one with \
                       switches_off = true in [reactions]";
        return Err(SafetyError::Study { study: study.name.clone(), problem });
    }
    rates.check(study)?;
    let trees =
        LaneTrees { tree: FaultTree::default(), rates: vec![], constants: vec![], notes: vec![] };
    let name = |actuator: &String| match actuator.as_str() {
        "" => TreeName { id: "lane".into(), words: "the only lane".into() },
        name => TreeName::of(name),
    };
    let names = study.actuators.iter().map(name).collect();
    let mut growing = TreeGrower { study, flights, rates, names, trees, confidence: 0.0 };
    growing.grow();
    Ok(growing.trees)
}

struct TreeGrower<'g> {
    study: &'g Study,
    flights: &'g JudgedFlights,
    rates: &'g FailureRates,
    /// The names of the lanes.
    names: Vec<TreeName>,
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
    groups: &[FaultGroup],
    fault: fn(&FaultGroup) -> TreeInput,
) -> Vec<(TreeInput, TreeInput)> {
    let own = groups.iter().filter(|of| of.lane == lane);
    let own = own.filter_map(|of| Some((fault(of), of.other_action?)));
    let others = groups.iter().flat_map(|of| {
        let wrong = of.wrong_shutdowns.iter().filter(|(other, _)| *other == lane);
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

impl TreeName {
    fn of(name: &str) -> Self {
        TreeName { id: identifier(name), words: spoken(name) }
    }
}

/// Adds a parameter with its value and evidence, and returns its index.
pub(crate) fn add(
    list: &mut Vec<TreeParameter>,
    id: String,
    (value, evidence): (CountedValue, String),
) -> usize {
    list.push(TreeParameter { id, value, evidence });
    list.len() - 1
}

impl TreeGrower<'_> {
    fn grow(&mut self) {
        let actions = self.study.actions();
        let of_action =
            2 + usize::from(self.names.len() > 1) + usize::from(self.flights.passed.is_some());
        let counted = 1 + actions.len() * of_action;
        self.confidence = confidence_of_each(counted);
        let actions: Vec<AnsweredAction> =
            actions.into_iter().map(|action| self.answered(action)).collect();
        let mut groups = vec![];
        for lane in 0..self.names.len() {
            for action in &actions {
                groups.extend(self.group(lane, action));
            }
        }
        let alarms = self.false_alarms();
        let lanes = 0..self.names.len();
        let lanes: Vec<LaneGates> = lanes.map(|lane| self.lane(lane, &groups, &alarms)).collect();
        self.tops(&lanes, &groups);
    }

    /// An action with the constants of its answers.
    fn answered(&mut self, action: String) -> AnsweredAction {
        let name = TreeName::of(&action);
        let TreeName { id, words } = &name;
        let needs_shutdown = self.study.reactions.switches_off(&action);
        let has_several = self.names.len() > 1;
        let mut constant = |id_of: &str, how: &str, answer: Answer| {
            let (value, evidence) =
                self.flights.share((&action, FaultIntensities::All), answer, self.confidence);
            let evidence = format!("{how} for faults that need '{words}': {evidence}");
            add(&mut self.trees.constants, format!("{id_of}-{id}"), (value, evidence))
        };
        let missed = constant("missed", "right action not raised first", Answer::Missed);
        let other_action = (!needs_shutdown).then(|| {
            constant("other_action", "another action for the right lane", Answer::OtherAction)
        });
        let wrong_shutdown = has_several
            .then(|| constant("wrong_shutdown", "shutdown of another lane", Answer::WrongShutdown));
        let passed = self.flights.passed.is_some().then(|| {
            constant(
                "passed",
                "hidden in flight and passed by the test on the ground",
                Answer::Passed,
            )
        });
        AnsweredAction {
            action,
            name,
            needs_shutdown,
            missed,
            passed,
            other_action,
            wrong_shutdown,
        }
    }

    /// The faults of a lane that need an action, with their answers; `None` without such faults.
    fn group(&mut self, lane: usize, action: &AnsweredAction) -> Option<FaultGroup> {
        let exposures = &EXPOSURES[..if self.flights.passed.is_some() { 4 } else { 3 }];
        let TreeName { id: lane_id, words: lane_words } = self.names[lane].clone();
        let id = format!("{lane_id}-{}", action.name.id);
        let fault = format!("a fault of {lane_words} that needs '{}'", action.name.words);
        let events = self.faults(lane, &action.action, exposures);
        // The answers follow their faults: then the decision diagram remembers one bit for all of them.
        let tree = &mut self.trees.tree;
        let mut answer = |what: &str, words: String, constant: usize| {
            tree.event(format!("{id}-{what}"), words, EventLaw::Constant(constant))
        };
        let missed = answer("missed", format!("{fault} is missed"), action.missed);
        let passed = action.passed.map(|constant| {
            answer("passed", format!("the test on the ground passes {fault}"), constant)
        });
        let other_action = action.other_action.map(|constant| {
            let words = format!("{fault} raises another action, perhaps a shutdown");
            answer("other_action", words, constant)
        });
        let mut wrong_shutdowns = vec![];
        if let Some(constant) = action.wrong_shutdown {
            for (other, TreeName { id, words }) in self.names.iter().enumerate() {
                if other != lane {
                    let words = format!("{fault} shuts {words} down");
                    let event = answer(&format!("shuts_down-{id}"), words, constant);
                    wrong_shutdowns.push((other, event));
                }
            }
        }
        let mut gates = vec![];
        for (place, (what, how, _)) in exposures.iter().enumerate() {
            let own = events.iter().map(|(detail, events)| (detail.as_str(), events[place]));
            let own: Vec<(&str, TreeInput)> = own.collect();
            gates.push(self.by_class(
                &format!("{id}-{what}"),
                &format!("{fault} {how}"),
                how,
                &own,
            )?);
        }
        let mut hidden = gates[2];
        if let (Some(passed), Some(&since_test)) = (passed, gates.get(3)) {
            let id = format!("{id}-hidden");
            let title = "a fault was there at the last test on the ground, which passed it";
            let was_passed = self.both(&format!("{id}-passed"), title, hidden, passed);
            let (id, title) = (format!("{id}-now"), format!("{fault} is hidden"));
            let inputs = vec![since_test, was_passed];
            hidden = self.trees.tree.named_gate(GateKind::Or, &id, &title, inputs);
        }
        Some(FaultGroup {
            lane,
            needs_shutdown: action.needs_shutdown,
            begins: gates[0],
            waits: gates[1],
            hidden,
            missed,
            other_action,
            wrong_shutdowns,
        })
    }

    /// For every fault of a lane that needs an action its class, and an event for each exposure.
    fn faults(
        &mut self,
        lane: usize,
        action: &str,
        exposures: &[(&str, &str, Exposure)],
    ) -> Vec<(String, Vec<TreeInput>)> {
        let study = self.study;
        let mut found = vec![];
        for (fault, rate) in self.rates.of_study(study).filter(|(fault, _)| fault.actuator == lane)
        {
            let class = &study.classes[fault.class];
            if class.action != action {
                continue;
            }
            let value = CountedValue::given(rate.per_h);
            let TreeName { id, words } = TreeName::of(&fault.id);
            let evidence = format!("{}: {}", self.rates.place(rate), rate.source);
            let rate = add(&mut self.trees.rates, format!("rate-{id}"), (value, evidence));
            let event = |&(what, how, exposure): &(&str, &str, Exposure)| {
                let law = EventLaw::Exponential(rate, exposure);
                self.trees.tree.event(format!("{id}-{what}"), format!("{words} {how}"), law)
            };
            found.push((class.detail.clone(), exposures.iter().map(event).collect()));
        }
        found
    }

    /// For every lane: a false alarm shuts it down in this flight, or has done so and waits for its repair.
    fn false_alarms(&mut self) -> Vec<[TreeInput; 2]> {
        let shutdowns = self.flights.false_shutdowns_per_h(self.names.len(), self.confidence);
        let rate = add(&mut self.trees.rates, "rate-false_shutdown".into(), shutdowns);
        let tree = &mut self.trees.tree;
        let mut event = |id: &str, what: &str, words: String, exposure: Exposure| {
            tree.event(format!("{id}-{what}"), words, EventLaw::Exponential(rate, exposure))
        };
        let mut of_lane = |TreeName { id, words }: &TreeName| {
            let now = format!("a false alarm shuts {words} down in this flight");
            let before = format!("{words} waits for its release after a false alarm");
            [
                event(id, "false_shutdown-begins", now, Exposure::Flight),
                event(id, "false_shutdown-waits", before, Exposure::Repair),
            ]
        };
        self.names.iter().map(&mut of_lane).collect()
    }

    fn or(&mut self, id: &str, title: &str, inputs: Vec<TreeInput>) -> Option<TreeInput> {
        self.trees.tree.gate(GateKind::Or, id, title, inputs)
    }

    fn both(&mut self, id: &str, title: &str, one: TreeInput, other: TreeInput) -> TreeInput {
        self.trees.tree.named_gate(GateKind::And, id, title, vec![one, other])
    }

    /// An OR that figures show as one box; `None` without inputs.
    fn folded(&mut self, id: &str, title: &str, inputs: Vec<TreeInput>) -> Option<TreeInput> {
        if inputs.is_empty() {
            return None;
        }
        let gate = self.trees.tree.named_gate(GateKind::Or, id, title, inputs);
        if let TreeInput::Gate(place) = gate {
            self.trees.tree.gates[place].is_folded = true;
        }
        Some(gate)
    }

    /// An OR of the events of every fault class; figures show a class as one box. `how` is what
    /// its faults do.
    fn by_class(
        &mut self,
        id: &str,
        title: &str,
        how: &str,
        events: &[(&str, TreeInput)],
    ) -> Option<TreeInput> {
        let mut details: Vec<&str> = vec![];
        for &(detail, _) in events {
            if !details.contains(&detail) {
                details.push(detail);
            }
        }
        let mut gates = vec![];
        for detail in details {
            let own = events.iter().filter(|(of, _)| *of == detail).map(|(_, event)| *event);
            let own: Vec<TreeInput> = own.collect();
            let own_id = format!("{id}-{}", identifier(detail));
            gates.extend(self.folded(&own_id, &format!("{}: {how}", spoken(detail)), own));
        }
        self.or(id, title, gates)
    }

    fn lane(&mut self, lane: usize, groups: &[FaultGroup], alarms: &[[TreeInput; 2]]) -> LaneGates {
        let TreeName { id, words } = self.names[lane].clone();
        let own = groups.iter().filter(|of| of.lane == lane && of.needs_shutdown);
        let (mut now, mut before) = (vec![], vec![]);
        for (place, of) in own.enumerate() {
            now.push(of.begins);
            let title = format!("a hidden fault of {words} was missed");
            let both_id = format!("{id}-missed-{}", place + 1);
            let hidden = self.both(&both_id, &title, of.hidden, of.missed);
            before.extend([of.waits, hidden]);
        }
        let title = format!("a fault that needs a shutdown begins in {words}");
        let physical_now = self.or(&format!("{id}-fails"), &title, now);
        let title = format!("a fault that needs a shutdown was in {words} before the flight");
        let physical_before = self.or(&format!("{id}-failed"), &title, before);
        let [false_now, false_before] = alarms[lane];
        let title = format!("{words} is shut down without need in this flight");
        let pairs = needless(lane, groups, |of| of.begins);
        let commanded_now = self.commanded(&format!("{id}-is_shut_down"), &title, pairs, false_now);
        let title = format!("{words} was shut down without need before the flight");
        let pairs = needless(lane, groups, |of| of.waits);
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
        let wrong_id = format!("{id}-by_wrong_answer");
        let wrong = self.folded(&wrong_id, &format!("{title}: a wrong answer to a fault"), inputs);
        let mut inputs: Vec<TreeInput> = wrong.into_iter().collect();
        inputs.push(false_alarm);
        self.trees.tree.named_gate(GateKind::Or, id, title, inputs)
    }

    fn tops(&mut self, lanes: &[LaneGates], groups: &[FaultGroup]) {
        let lost: Vec<TreeInput> = lanes.iter().filter_map(|lane| lane.lost_now).collect();
        let title = match lanes.len() {
            1 => "Loss of the only lane in a flight",
            _ => "Loss of at least one lane in a flight",
        };
        self.top("loss_of_one_lane", title, lost, true);
        match lanes.len() {
            1 => self.trees.notes.push(
                "one actuator: the loss of its lane is the loss of the function, so there is no tree for both lanes"
                    .into(),
            ),
            count => self.loss_of_all(lanes, count),
        }
        let mut undetected = vec![];
        for (place, of) in groups.iter().enumerate() {
            let present = self.trees.tree.named_gate(
                GateKind::Or,
                &format!("present-{}", place + 1),
                "a fault begins or is there since the last check",
                vec![of.begins, of.hidden],
            );
            let both_id = format!("undetected-{}", place + 1);
            let title = "a fault is there and missed";
            undetected.push(self.both(&both_id, title, present, of.missed));
        }
        let title = "A fault without its action in a flight: undetected degradation";
        self.top("undetected_degradation", title, undetected, false);
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
            let TreeName { id, words } = self.names[last].clone();
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
        self.top(id, title, ways, true);
    }

    fn top(&mut self, id: &str, title: &str, inputs: Vec<TreeInput>, begins: bool) {
        if let TreeInput::Gate(gate) = self.trees.tree.named_gate(GateKind::Or, id, title, inputs) {
            self.trees.tree.tops.push(TopEvent { gate, begins });
        }
    }
}
