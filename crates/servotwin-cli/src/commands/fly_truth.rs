//! Compares the diagnosis of a flight with the truth: the time of detection, and whether actuator, action and component
//! were right.

use servotwin::live::closed_loop::{Action, FlightRecord};
use servotwin::live::tracking::first_report_s;
use servotwin::study::Study;
use servotwin::text::spoken;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_model::program::FaultAt;
use servotwin_view::document::{Table, Value};
use servotwin_view::row;

/// A simulated fault with the answer that the study expects, and the first action raised for it.
pub(crate) struct AnsweredFault {
    /// The fault's full name.
    name: String,
    /// The onset, s.
    onset_s: f64,
    /// The name of the actuator; empty if the study has one without a name.
    actuator: String,
    /// The action and the component; `None` for a fault that the study does not list.
    expected: Option<[String; 2]>,
    detected_s: Option<f64>,
    /// The time, the action and the component of the answer.
    said: Option<(f64, String, Option<String>)>,
    /// Whether actuator, action and component were right; `None` if there was no answer or none is expected.
    is_right: [Option<bool>; 3],
}

impl AnsweredFault {
    /// Pairs a fault with the first action after its onset for its actuator, or for any actuator if there is none.
    pub(crate) fn new(
        study: &Study,
        (fault, onset_s): (FaultAt, f64),
        record: &FlightRecord,
        diagnoser: &Diagnoser,
    ) -> Self {
        let name = study.system.network().components[fault.component].fault_name(fault.fault);
        let same = |at: FaultAt| (at.component, at.fault) == (fault.component, fault.fault);
        let known = study.faults.iter().find(|case| same(case.at));
        let actuator = study.actuator_of(&name).map(|actuator| study.actuators[actuator].clone());
        let actuator = actuator.unwrap_or_default();
        let class = known.map(|case| &study.classes[case.class]);
        let expected = class.map(|class| [class.action.clone(), class.detail.clone()]);
        let names = diagnoser.names();
        let of = |action: &Action| names.actuators[action.raised.actuator as usize].as_str();
        let later = || record.actions.iter().filter(|action| action.time_s >= onset_s);
        let answer = later().find(|action| of(action) == actuator).or_else(|| later().next());
        let said = answer.map(|Action { time_s, raised, .. }| {
            let component = raised.detail.map(|detail| names.details[detail as usize].clone());
            (*time_s, names.actions[raised.action as usize].clone(), component)
        });
        let right = |place: usize, said: &String| {
            expected.as_ref().map(|expected| expected[place] == *said)
        };
        let is_right = [
            answer.map(|action| of(action) == actuator),
            said.as_ref().and_then(|(_, action, _)| right(0, action)),
            said.as_ref().and_then(|(.., component)| right(1, component.as_ref()?)),
        ];
        let detected_s = first_report_s(record, onset_s);
        AnsweredFault { name, onset_s, actuator, expected, detected_s, said, is_right }
    }

    /// The fault, and what is right.
    pub(crate) fn truth(&self) -> String {
        let AnsweredFault { name, onset_s, actuator, expected, .. } = self;
        let text = format!("truth: {} from {onset_s} s on", spoken(name));
        let Some([action, component]) = expected else { return text };
        let of = if actuator.is_empty() { "" } else { " of " };
        let actuator = spoken(actuator);
        format!("{text}; right is: {}{of}{actuator}, {}", spoken(action), spoken(component))
    }

    /// The answer beside the truth.
    pub(crate) fn sentence(&self) -> String {
        let mut text = match self.detected_s {
            Some(time_s) => format!("detected {:.2} s after the onset; ", time_s - self.onset_s),
            None => "never detected; ".into(),
        };
        let Some((time_s, action, component)) = &self.said else {
            return text + "missed: no action was raised";
        };
        let words = |is_right: Option<bool>| match is_right {
            Some(true) => "right",
            Some(false) => "wrong",
            None => "not known",
        };
        text += &format!("first action {:.2} s after the onset: ", time_s - self.onset_s);
        if !self.actuator.is_empty() {
            text += &format!("actuator {}, ", words(self.is_right[0]));
        }
        let named = match (component, self.is_right[2]) {
            (Some(said), Some(false)) => format!("component wrong ({})", spoken(said)),
            (Some(_), is_right) => format!("component {}", words(is_right)),
            (None, _) => "component not named".into(),
        };
        text + &format!("action {} ({}), {named}", words(self.is_right[1]), spoken(action))
    }
}

/// The faults and their answers for programs.
pub(crate) fn table(faults: &[AnsweredFault]) -> Table {
    let mut table = Table::of(
        "fault: | onset_s: | actuator: | action: | detail: | detected_s: | action_s: | is_actuator_right: | is_action_right: | \
         is_detail_right:",
    );
    for AnsweredFault { name, onset_s, actuator, expected, detected_s, said, is_right } in faults {
        let actuator = Some(actuator).filter(|actuator| !actuator.is_empty());
        let [action, detail] = [0, 1].map(|place| expected.as_ref().map(|own| &own[place]));
        let action_s = said.as_ref().map(|(time_s, ..)| *time_s);
        let times = [Some(*onset_s), *detected_s, action_s].map(|time_s| Value::of("", &time_s));
        let [onset_s, detected_s, action_s] = times;
        let mut row = row![name, onset_s, actuator, action, detail, detected_s, action_s];
        row.extend(is_right.map(Value::from));
        table.push(row);
    }
    table
}
