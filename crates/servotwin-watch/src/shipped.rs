//! The diagnosis of the built-in aileron that comes with the program, so that a first look needs no training.
//! `shipped/make.sh` learns it anew.

use flate2::read::GzDecoder;
use servotwin::learn::model_file;
use servotwin::manifest::sha256_of_text;
use servotwin::study::Study;
use servotwin_diagnosis::diagnoser::Diagnoser;
use std::io::Read;

/// The diagnoser of the quick study, scenario *noise*, as compressed JSON.
const DIAGNOSER: &[u8] = include_bytes!("../shipped/aileron.json.gz");
/// The SHA-256 of the study and the system that it was learned from.
const LEARNED_FROM: &str = include_str!("../shipped/learned-from.txt");

/// The shipped diagnoser, if it was learned from this study and its system; `None` if the study is another one.
pub fn diagnoser(study: &Study) -> Option<Diagnoser> {
    let text = format!("{}{}", study.text, study.system.text);
    if sha256_of_text(&text) != LEARNED_FROM {
        return None;
    }
    let mut text = String::new();
    GzDecoder::new(DIAGNOSER).read_to_string(&mut text).ok()?;
    let diagnoser: Diagnoser = model_file::parse("the shipped diagnoser".as_ref(), &text).ok()?;
    diagnoser.check().ok().map(|()| diagnoser)
}

#[cfg(test)]
mod tests {
    use super::*;
    use servotwin::live::closed_loop::{ClosedLoop, ClosedLoopFlight};
    use servotwin_model::program::FaultAt;

    #[test]
    fn the_shipped_diagnosis_is_that_of_the_built_in_study() {
        let study = Study::default();
        let diagnoser =
            std::sync::Arc::new(diagnoser(&study).expect("shipped/make.sh learns it anew"));
        let scenario = ClosedLoop {
            study: &study,
            inputs: study.system.default_inputs(),
            faults: vec![],
            duration_s: 8.0,
            specimen: None,
            reacts: true,
        };
        let mut flight = ClosedLoopFlight::new(&scenario, &diagnoser).unwrap();
        let mut action = None;
        let (component, fault) = study.system.find_fault("actuator_1.leakage_a.leakage").unwrap();
        while flight.time_s() < scenario.duration_s && action.is_none() {
            if flight.time_s() >= 4.0 {
                flight.inject(vec![FaultAt { component, fault, intensity: 0.5 }]);
            }
            flight.sample().unwrap();
            action = flight.react().unwrap();
        }
        let action = action.expect("a leak of half the intensity is shut down within four seconds");
        let names = diagnoser.names();
        assert!(action.time_s > 4.0);
        assert_eq!(names.actuators[action.raised.actuator as usize], "actuator_1");
        assert_eq!(names.actions[action.raised.action as usize], "shut_down");
    }

    #[test]
    fn another_study_has_none() {
        let mut study = Study::default();
        study.text.push('\n');
        assert!(diagnoser(&study).is_none());
    }
}
