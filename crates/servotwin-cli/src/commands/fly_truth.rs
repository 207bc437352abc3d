//! Compares the diagnosis of a flight with the truth: the time of detection, and whether actuator, action and component
//! were right.

use servotwin::flight::closed_loop::{Action, FlightRecord};
use servotwin::flight::tracking::first_report_s;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::FaultAt;
use servotwin_report::words::spoken;
use servotwin_view::document::{Fact, Table, Value, fact};
use servotwin_view::row;

/// A simulated fault, with the answer that the study expects.
pub(crate) struct Truth {
    /// The fault's full name.
    pub name: String,
    /// The onset, s.
    pub onset_s: f64,
    /// The name of the actuator; empty if the study has one without a name.
    pub actuator: String,
    /// The action and the component; `None` for a fault that the study does not list.
    pub expected: Option<(String, String)>,
}

impl Truth {
    /// The truth about a fault and its onset.
    pub(crate) fn of(study: &Study, fault: FaultAt, onset_s: f64) -> Self {
        let instance = &study.system.network().components[fault.component];
        let name =
            format!("{}.{}", instance.id, instance.component.spec().faults[fault.fault].name);
        let same = |at: FaultAt| (at.component, at.fault) == (fault.component, fault.fault);
        let known = study.faults.iter().find(|case| same(case.at));
        let begins = |unit: &&String| unit.is_empty() || name.starts_with(&format!("{unit}."));
        let actuator = match known {
            Some(case) => study.units.get(case.unit).cloned(),
            None => study.units.iter().find(begins).cloned(),
        };
        let expected = known.map(|case| {
            let class = &study.classes[case.class];
            (class.command.clone(), class.detail.clone())
        });
        Truth { name, onset_s, actuator: actuator.unwrap_or_default(), expected }
    }
}

/// The raised alarm, by names.
struct Said {
    time_s: f64,
    actuator: String,
    action: String,
    component: Option<String>,
}

impl Said {
    fn of(action: &Action, diagnoser: &Diagnoser) -> Self {
        let names = diagnoser.names();
        let raised = &action.raised;
        Said {
            time_s: action.time_s,
            actuator: names.actuators[raised.actuator as usize].clone(),
            action: names.actions[raised.action as usize].clone(),
            component: raised.detail.map(|detail| names.details[detail as usize].clone()),
        }
    }
}

/// A fault and the first action raised for it.
pub(crate) struct AnsweredFault<'t> {
    truth: &'t Truth,
    detected_s: Option<f64>,
    said: Option<Said>,
}

impl<'t> AnsweredFault<'t> {
    /// Pairs a fault with the first action after its onset for its actuator, or for any actuator if there is none.
    fn of(truth: &'t Truth, record: &FlightRecord, diagnoser: &Diagnoser) -> Self {
        let later = || {
            let later = record.actions.iter().filter(|action| action.time_s >= truth.onset_s);
            later.map(|action| Said::of(action, diagnoser))
        };
        let said = later().find(|said| said.actuator == truth.actuator).or_else(|| later().next());
        AnsweredFault { truth, detected_s: first_report_s(record, truth.onset_s), said }
    }

    /// Whether actuator, action and component were right; `None` if there was no answer or none is expected.
    fn right(&self) -> [Option<bool>; 3] {
        let Some(said) = &self.said else { return [None; 3] };
        let expected = self.truth.expected.as_ref();
        let component = said.component.as_ref().zip(expected);
        [
            Some(said.actuator == self.truth.actuator),
            expected.map(|(action, _)| *action == said.action),
            component.map(|(said, (_, component))| said == component),
        ]
    }

    /// The fault, and what is right.
    fn truth(&self) -> String {
        let Truth { name, onset_s, actuator, expected } = self.truth;
        let text = format!("truth: {} from {onset_s} s on", spoken(name));
        let Some((action, component)) = expected else { return text };
        let of = if actuator.is_empty() { "" } else { " of " };
        let actuator = spoken(actuator);
        format!("{text}; right is: {}{of}{actuator}, {}", spoken(action), spoken(component))
    }

    /// The answer beside the truth.
    fn sentence(&self) -> String {
        let Truth { onset_s, actuator, .. } = self.truth;
        let mut text = match self.detected_s {
            Some(time_s) => format!("detected {:.2} s after the onset; ", time_s - onset_s),
            None => "never detected; ".into(),
        };
        let Some(said) = &self.said else { return text + "missed: no action was raised" };
        let words = |is_right: Option<bool>| match is_right {
            Some(true) => "right",
            Some(false) => "wrong",
            None => "not known",
        };
        let [unit, action, component] = self.right();
        text += &format!("first action {:.2} s after the onset: ", said.time_s - onset_s);
        if !actuator.is_empty() {
            text += &format!("actuator {}, ", words(unit));
        }
        let named = match (&said.component, component) {
            (Some(said), Some(false)) => format!("component wrong ({})", spoken(said)),
            (Some(_), is_right) => format!("component {}", words(is_right)),
            (None, _) => "component not named".into(),
        };
        text + &format!("action {} ({}), {named}", words(action), spoken(&said.action))
    }
}

/// All faults of a flight with the answers to them.
pub(crate) struct FlightVerdict<'t> {
    judged: Vec<AnsweredFault<'t>>,
    /// The number of actions before the first onset.
    false_alarms: usize,
    /// Actuators that were switched off; empty in a study of one actuator.
    dragged: Vec<String>,
}

impl<'t> FlightVerdict<'t> {
    /// Judges the answers in a flight with these faults.
    pub(crate) fn of(truths: &'t [Truth], record: &FlightRecord, diagnoser: &Diagnoser) -> Self {
        let first_s = truths.iter().map(|truth| truth.onset_s).fold(f64::INFINITY, f64::min);
        let before = record.actions.iter().filter(|action| action.time_s < first_s);
        let names = diagnoser.names();
        let off = record.actions.iter().filter(|action| action.reaction.switches_off);
        let dragged = off.map(|action| names.actuators[action.raised.actuator as usize].clone());
        FlightVerdict {
            judged: truths
                .iter()
                .map(|truth| AnsweredFault::of(truth, record, diagnoser))
                .collect(),
            false_alarms: before.count(),
            dragged: if names.actuators.len() > 1 { dragged.collect() } else { vec![] },
        }
    }

    /// The verdict in one sentence for each fault.
    pub(crate) fn sentence(&self) -> String {
        let mut text: Vec<String> = self.judged.iter().map(AnsweredFault::sentence).collect();
        match (self.judged.is_empty(), self.false_alarms) {
            (true, 0) => text.push("truth: no fault; right: no action was raised".into()),
            (_, 0) => {}
            (_, 1) => text.push("false alarm: an action was raised before any fault began".into()),
            (_, n) => {
                text.push(format!("{n} false alarms: actions were raised before any fault began"))
            }
        }
        text.join("\n")
    }

    /// What was true.
    pub(crate) fn truths(&self) -> Vec<String> {
        self.judged.iter().map(AnsweredFault::truth).collect()
    }

    /// Explains why a reaction raises the force fight, if it does.
    pub(crate) fn on_force_fight(&self, with: Option<f64>, without: Option<f64>) -> Option<String> {
        let is_raised = with.zip(without).is_some_and(|(with, without)| with > without);
        let first = self.dragged.first().filter(|_| is_raised)?;
        Some(format!(
            "The force fight rises because {} is passive after its shutdown: its bypass lets it move, and the other \
             actuator drags it along. The forces in the rods are then the drag, not two controllers that disagree.",
            spoken(first)
        ))
    }

    /// The faults and their answers for programs.
    pub(crate) fn table(&self) -> Table {
        let mut table = Table::of(
            "fault: | onset_s: | unit: | command: | detail: | detected_s: | action_s: | is_unit_right: | is_command_right: | is_detail_right:",
        );
        for one in &self.judged {
            let Truth { name, onset_s, actuator, expected } = one.truth;
            let unit = Some(actuator).filter(|actuator| !actuator.is_empty());
            let action_s = one.said.as_ref().map(|said| said.time_s);
            let mut row = row![
                name,
                Value::of("", onset_s),
                unit,
                expected.as_ref().map(|one| &one.0),
                expected.as_ref().map(|one| &one.1),
                Value::of("", &one.detected_s),
                Value::of("", &action_s),
            ];
            row.extend(one.right().map(Value::from));
            table.push(row);
        }
        table
    }

    /// The false alarms for programs.
    pub(crate) fn facts(&self) -> [Fact; 1] {
        [fact("false_alarms", "", self.false_alarms)]
    }
}
