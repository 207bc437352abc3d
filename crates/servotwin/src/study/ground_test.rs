//! The test on the ground: one command from rest, one window, one decision.
//!
//! The twin of an actuator is fitted to its first test, so that the residuals of a later one show changes alone. `wear`
//! declares the changes between two tests of a healthy actuator.
//!
//! The tests of a study are a study of their own ([`Study::on_ground`]), with the same system, sensors, classes and
//! specimens. The test's command stands for those of `[flights]`, the first test for the calibration flight of
//! `[fitted]`, and `ground_test.suites` for `[suites]`. Faults are present from the start. `ground_test.sensors` adds what
//! logs of flights lack and a test bench has, such as the current that the computer itself puts out.

use super::keys::{FLIGHT_S, SAMPLE_HZ};
use super::other_plant::{self, DrawText};
use super::reader::Reader;
use super::{SensorText, Study, flights, suites};
use crate::format::{At, Names, Value, section};
use crate::system::System;
use crate::system::imperfection::scale_within_noise;
use crate::toml_text::TomlError;
use servotwin_diagnosis::features::Quantity;
use std::cell::RefCell;

section! {
    /// The section of a study file.
    pub(super) struct Text {
        must command: At<String>, "command of the test, from rest";
        must duration_s: f64 = FLIGHT_S, "length of the test, and of its only window";
        may sample_hz: Option<f64> = SAMPLE_HZ, "sampling rate of the test, if it is not that of flights";
        with drawn: flights::DrawnRanges, "ranges from which each environment is drawn";
        may sensors: Names<TestSensor>,
            "sensors that only the test reads, such as what the computer itself puts out";
        may wear: Vec<At<DrawText>>,
            "ranges from which every test draws what differs from the first test of its actuator";
        may suites: Names<suites::NamedText>, "how many tests there are, and what for";
    }
}

section! {
    /// A sensor that only the test reads.
    pub(super) struct TestSensor {
        must signal: At<String>, "output of a component (component.port)";
        must scale: At<f64> = Value::Number(1e-9, 1e12, ""),
            "size that residuals are divided by, in the signal's unit";
        must quantity: Quantity, "role of the sensor in the diagnosis";
        must actuator: At<usize> = Value::Whole(0.0, 1e6),
            "position of its actuator in `actuators`, from 1; 0 for none";
    }
}

impl TestSensor {
    fn seen(self) -> SensorText {
        SensorText {
            quantity: self.quantity,
            actuator: self.actuator,
            follows_controller: At::new(false, 0..0),
            follows: At::new(Names::new(), 0..0),
        }
    }
}

impl super::Text {
    /// The sensors that only tests on the ground read.
    fn test_sensors(&self) -> impl Iterator<Item = (&At<String>, &TestSensor)> {
        self.ground_test.iter().flat_map(|test| &test.sensors)
    }

    /// Gives a system the sensors that only its tests on the ground read, where the study is that of these tests.
    pub(super) fn add_test_sensors(&self, system: &mut System) {
        for (id, sensor) in self.test_sensors().filter(|_| self.on_ground) {
            system.add_sensor(id, &sensor.signal, sensor.scale.value);
        }
    }

    /// The text of the study of its tests on the ground; the same text without such tests.
    pub(super) fn on_ground(self) -> Self {
        let Some(At { value: test, at }) = self.ground_test.clone() else { return self };
        let onset_s = At::new([0.0, 0.0], at.clone());
        let sample_hz = test.sample_hz.unwrap_or(self.sample_hz);
        // A latency is at most one sample.
        let on_time = |mut plant: other_plant::Text| {
            let latency_s = &mut plant.latency_s.value;
            *latency_s = latency_s.map(|time_s| time_s.min(1.0 / sample_hz));
            plant
        };
        let of_tests = |flights: flights::Text| flights::Text {
            duration_s: test.duration_s,
            onset_s,
            windows_s: vec![At::new(test.duration_s, at.clone())],
            commands: vec![test.command],
            drawn: test.drawn,
            phases: vec![],
            // An action at the end of a test is in time.
            limits: flights::Limits {
                latency_s: test.duration_s,
                latency_unfitted_s: test.duration_s,
                ..flights.limits
            },
            other_plant: flights.other_plant.map(on_time),
            ..flights
        };
        let mut sensors = self.sensors;
        sensors.extend(test.sensors.into_iter().map(|(id, sensor)| (id, sensor.seen())));
        super::Text {
            sample_hz,
            sensors,
            suites: test.suites,
            flights: self.flights.map(|own| At::new(of_tests(own.value), at.clone())),
            on_ground: true,
            ..self
        }
    }
}

impl Reader<'_> {
    /// The ranges of wear, where the study is that of its tests on the ground.
    pub(super) fn wear(&self) -> &[At<DrawText>] {
        let test = self.text.ground_test.as_ref().filter(|_| self.text.on_ground);
        test.map_or(&[], |test| &test.wear)
    }

    /// Notes the mistakes of the sensors that only tests on the ground read. The system has its own sensors alone.
    pub(super) fn check_test_sensors(&self) {
        let outputs = || self.system.program.observables().iter().map(|own| own.name.as_str());
        for (id, TestSensor { signal, scale, actuator, .. }) in self.text.test_sensors() {
            if self.system.sensor(id).is_some() {
                self.repeated("sensor", &id.at, id);
            }
            let _ = self.actuator(actuator);
            let Some((component, of_signal)) = self.system.output(signal) else {
                self.unknown(&signal.at, ("signal", signal), outputs());
                continue;
            };
            let part = &self.system.network().components[component];
            let read = (part.id.as_str(), part.component, part.parameters.as_slice());
            let mistake = scale_within_noise((id, scale.value, of_signal), read);
            mistake.map(|mistake| self.note(&scale.at, mistake));
        }
    }

    /// Notes the mistakes of the tests on the ground, if the study declares some and is not theirs already.
    pub(super) fn check_ground_test(&self) {
        match (&self.text.ground_test, &self.text.flights) {
            (Some(test), None) => drop(self.empty(&test.at, "flights")),
            (None, _) if self.text.on_ground => drop(self.empty(&(0..0), "ground_test")),
            (Some(_), _) if !self.text.on_ground => {
                let text = self.text.clone().on_ground();
                let mistakes = RefCell::new(self.mistakes.take());
                let Reader { path, source, system, .. } = *self;
                let reader = Reader { path, source, text: &text, system, mistakes };
                let _ = reader.flown();
                self.mistakes.replace(reader.mistakes.into_inner());
            }
            _ => {}
        }
    }
}

impl Study {
    /// Whether it is the study of its tests on the ground.
    pub fn is_on_ground(&self) -> bool {
        self.parsed.on_ground
    }

    /// The study of its tests on the ground; `None` if it declares none.
    ///
    /// # Errors
    /// Mistakes in the section `[ground_test]`.
    pub fn on_ground(&self) -> Result<Option<Self>, TomlError> {
        if self.parsed.ground_test.is_none() {
            return Ok(None);
        }
        let system = System::parse(&self.system.text, &self.path)?;
        let text = super::quick::with_flag(&self.text, "on_ground");
        Self::parse_for(&text, &self.path, system).map(Some)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::suites::{HEALTHY, JUDGE, LEARN, UNSEEN};
    use crate::study::{Purpose, Scenario};

    fn mistakes(text: &str) -> String {
        let error = Study::parse(text, "studies/paper.toml").err().expect("a mistake");
        error.to_string()
    }

    #[test]
    fn tests_on_the_ground_are_a_study_with_other_flights() {
        let study = Study::default();
        assert!(!study.is_on_ground());
        let test = study.on_ground().unwrap().unwrap();
        assert!(test.is_on_ground() && test.text.ends_with(&study.text));
        let (flights, in_flight) =
            (test.flights.as_ref().unwrap(), study.flights.as_ref().unwrap());
        assert_eq!((flights.duration_s, &flights.windows_s[..]), (10.0, &[10.0][..]));
        assert_eq!((test.sample_period_s, study.sample_period_s), (0.002, 0.01));
        assert_eq!(flights.draws, in_flight.draws, "the specimens are the same");
        assert!(!flights.wear.is_empty() && in_flight.wear.is_empty());
        let seen =
            |of: &Study| of.sensors.0.iter().filter(|own| own.name.starts_with("u_")).count();
        assert_eq!((seen(&test), seen(&study)), (2, 0), "only the test reads the currents");
        // The stored text is that of the tests.
        let again = Study::parse(&test.text, "study.toml").unwrap();
        assert_eq!(again.flights.as_ref().unwrap().windows_s, flights.windows_s);
        assert_eq!(again.on_ground().unwrap().unwrap().text, test.text);
        assert!(study.full().unwrap().on_ground().unwrap().unwrap().is_full);
    }

    #[test]
    fn in_a_test_a_fault_is_present_from_the_start_and_no_air_flows() {
        let test = Study::default().on_ground().unwrap().unwrap();
        let judge = test.suite(JUDGE).unwrap();
        assert_eq!((judge.onset_s, &judge.scenarios[..]), (None, &[Scenario::Fitted][..]));
        let judged: Vec<&str> = test.suites().map(|suite| suite.name.as_str()).collect();
        assert!([LEARN, JUDGE, HEALTHY].iter().all(|name| judged.contains(name)), "{judged:?}");
        assert!(!judged.contains(&UNSEEN), "no fault begins in a test");
        let speed = test.system.network().inputs.iter().position(|input| input.id == "air_speed");
        let calibration = test.calibration.as_ref().unwrap();
        let drawn = test.environments(judge, 0..3).unwrap();
        for inputs in drawn.iter().map(|own| &own.inputs).chain([&calibration.inputs]) {
            assert_eq!(inputs[speed.unwrap()].value(3.0), 0.0);
            let command = &inputs[test.command_input];
            assert!(
                (command.value(6.0) - calibration.inputs[test.command_input].value(6.0)).abs()
                    < 1e-3
            );
        }
        assert_eq!(test.purposes(), [Purpose::Test, Purpose::Train]);
    }

    #[test]
    fn mistakes_in_the_section_are_found_at_their_places_by_whoever_reads_the_study() {
        let text = &Study::default().text;
        for (right, wrong, said) in [
            ("inputs.air_speed = [0, 0]", "inputs.air_sped = [0, 0]", "air_sped"),
            ("inputs.air_speed = [0, 0]", "inputs.air_speed = [0, 9000]", "air_speed"),
            ("sensors.u_1 =", "sensors.x_p_1 =", "x_p_1"),
            ("actuator_1.controller.current", "actuator_1.controller.curent", "curent"),
            (
                "actuator_1.controller.current",
                "actuator_1.sensor_supply.reading",
                "less than noise",
            ),
            (
                "quantity = \"current\", actuator = 1",
                "quantity = \"current\", actuator = 3",
                "actuator",
            ),
            ("amplitude=9deg,frequency=0.4Hz", "amplitude=900deg,frequency=0.4Hz", "command"),
            (
                "\"cylinder.viscous_friction_n_s_m\"], times",
                "\"cylinder.viscous\"], times",
                "viscous",
            ),
            (
                "judge = { environments = 24, repeats = 1, healthy = 3 }",
                "judge = { like = \"nothing\" }",
                "nothing",
            ),
        ] {
            let place = text.rfind(right).expect(right);
            let mut broken = text.clone();
            broken.replace_range(place..place + right.len(), wrong);
            let line = text[..place].lines().count().max(1);
            let near = [line, line + 1].map(|line| format!("studies/paper.toml:{line}"));
            let told = mistakes(&broken);
            assert!(told.contains(said), "{told}");
            assert!(near.iter().any(|near| told.contains(near)), "{near:?}: {told}");
        }
        // Also a stored study of the tests names its system anew.
        let twice =
            "on_ground = true\n".to_owned() + &text.replace("sensors.u_1 =", "sensors.x_p_3 =");
        assert!(mistakes(&twice).contains("the sensor 'x_p_3' stands twice"));
        let lacking =
            "on_ground = true\n".to_owned() + &text.replace("[ground_test", "[other_test");
        assert!(Study::parse(&lacking, "studies/paper.toml").is_err());
    }
}
