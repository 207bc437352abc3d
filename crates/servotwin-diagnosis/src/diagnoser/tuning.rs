//! Every constant of a diagnosis, with where its value comes from.
//!
//! A [`Tuning`] is part of a stored diagnoser. Training reads it to make windows, bands and ranges, and a session reads it
//! to decide. Each constant is declared once, below, with its unit, its range, its [`Origin`], a sentence and a source.
//! Report and book print this list.
//!
//! Not in it are what training learned, the settings of the classifiers, the definitions of the features, and the guards
//! of the arithmetic, such as the least number before a logarithm.

use alloc::string::String;
use alloc::vec::Vec;
use serde::{Deserialize, Serialize};

use Origin::{Physical, Statistical};

use crate::error::{Error, require};
use crate::hierarchy::Names;

/// Where the value of a constant comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// From what actuators, sensors and computers are.
    Physical,
    /// From an error rate, odds or a criterion of statistics.
    Statistical,
    /// The best of several in healthy flights and flights with a fault, drawn with this seed. Evaluations use other seeds.
    Tuned {
        /// The seed.
        seed: u32,
    },
}

impl Origin {
    /// The label: `physical`, `statistical` or `tuned on seed 9`.
    pub fn label(self) -> String {
        match self {
            Origin::Physical => "physical".into(),
            Origin::Statistical => "statistical".into(),
            Origin::Tuned { seed } => alloc::format!("tuned on seed {seed}"),
        }
    }
}

/// A constant of a diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Constant {
    /// The name of its field.
    pub name: &'static str,
    /// Its value.
    pub value: f64,
    /// Its usual value, which the origin explains.
    pub usual: f64,
    /// The unit; empty for a number or a share.
    pub unit: &'static str,
    /// Where the usual value comes from.
    pub origin: Origin,
    /// One sentence.
    pub meaning: &'static str,
    /// The page of the book that derives or measures it, relative to `docs/`.
    pub source: &'static str,
}

impl Constant {
    /// The label of the origin, or that the value is not the usual one.
    pub fn label(&self) -> String {
        if self.value == self.usual { self.origin.label() } else { "set by hand".into() }
    }
}

macro_rules! tuning {
    ($(
        $(#[$attribute:meta])*
        $name:ident: $kind:ty = $usual:literal in $least:literal..=$largest:literal, $unit:literal,
            $origin:expr, $source:literal, $($meaning:literal)+;
    )*) => {
        /// Every constant of a diagnosis. The module describes it.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(default, deny_unknown_fields)]
        pub struct Tuning {
            /// Names of the actions that switch an actuator off.
            #[serde(rename = "off_commands")]
            pub off_actions: Vec<String>,
            /// Minimum number of actuators that stay on. Usually one of several, and none for a single actuator.
            pub least_on: u32,
            $(
                #[doc = concat!($($meaning,)+)]
                $(#[$attribute])*
                pub $name: $kind,
            )*
        }

        impl Default for Tuning {
            /// The usual constants, without an action that switches off.
            fn default() -> Self {
                Tuning { off_actions: Vec::new(), least_on: 0, $($name: $usual,)* }
            }
        }

        impl Tuning {
            /// All constants, in the order of their declaration.
            pub fn constants(&self) -> Vec<Constant> {
                let usual = Tuning::default();
                alloc::vec![$(
                    Constant {
                        name: stringify!($name),
                        value: f64::from(self.$name),
                        usual: f64::from(usual.$name),
                        unit: $unit,
                        origin: $origin,
                        meaning: concat!($($meaning,)+),
                        source: $source,
                    },
                )*]
            }

            fn check_ranges(&self) -> Result<(), Error> {
                $(
                    let holds = ($least..=$largest).contains(&self.$name);
                    let allowed = concat!(stringify!($least), " to ", stringify!($largest), " ", $unit);
                    require(holds, stringify!($name), f64::from(self.$name), allowed)?;
                )*
                Ok(())
            }
        }
    };
}

/// A constant that was tuned on a seed.
const fn tuned(seed: u32) -> Origin {
    Origin::Tuned { seed }
}

// Name, kind, usual value, range and unit; origin, source and meaning.
tuning! {
    false_alarms_per_h: f64 = 1e-3 in 1e-12..=3600.0, "1/h",
        Statistical, "decisions/071-matrix-cusum.md",
        "False alarms of an action in a fault-free hour, for an error of cost 1: a target, from which the limits against \
         health follow.";
    wrong_isolation: f64 = 1e-3 in 1e-12..=1.0, "",
        Statistical, "decisions/071-matrix-cusum.md",
        "Probability that a fault raises the wrong action, for an error of cost 1: a target, from which the limits between \
         actions follow.";
    cost_of_healthy_shutdown: f64 = 10.0 in 0.0..=1e12, "",
        Statistical, "decisions/138-one-allowance.md",
        "Cost of shutting an actuator down while nothing has a fault, in false alarms of another action.";
    cost_of_needless_shutdown: f64 = 3.0 in 0.0..=1e12, "",
        Statistical, "decisions/138-one-allowance.md",
        "Cost of shutting an actuator down while a milder action would do, in wrong actions of cost 1.";
    cost_of_wrong_shutdown: f64 = 1000.0 in 0.0..=1e12, "",
        Statistical, "decisions/138-one-allowance.md",
        "Cost of shutting a healthy actuator down while another one has a fault, in wrong actions of cost 1.";
    allowance_nats: f64 = 3.0 in 0.0..=1e6, "nats",
        tuned(41), "lab/2026-11-one-allowance.md",
        "Subtracted from the evidence of every window against health: as much as a healthy specimen may permanently look \
         like a fault.";
    overlap_exponent: f64 = 0.5 in 0.0..=1.0, "",
        Statistical, "decisions/071-matrix-cusum.md",
        "Exponent of a window's new share: its root lies between counting every sample once and every window in full.";
    clip_nats: f64 = 8.0 in 1e-3..=100.0, "nats",
        Statistical, "decisions/071-matrix-cusum.md",
        "The largest evidence of one window, odds of 3,000 to 1: no single window decides.";
    in_band_nats: f64 = 4.0 in 0.0..=1e6, "nats",
        Statistical, "decisions/071-matrix-cusum.md",
        "Evidence for health of a window with every residual in its band: about the odds at which the bands of healthy \
         records hold, 98.5 %.";
    least_limit_nats: f64 = 1.0 in 0.0..=1e6, "nats",
        Statistical, "decisions/071-matrix-cusum.md",
        "Lower end of every limit, whatever the costs: odds of 2.7 to 1.";
    evidence_cap: f64 = 1.5 in 1.0..=1e6, "",
        Statistical, "decisions/071-matrix-cusum.md",
        "Cap of gathered evidence in parts of its limit: it bounds the time that evidence needs to fall again.";
    #[serde(rename = "most_alike")]
    max_common_mode: f64 = 0.9 in 0.5..=1.0, "",
        Physical, "decisions/075-unknown.md",
        "The share of a deviation that two actuators have in common above which it is unknown: a fault of one actuator \
         gives one half, a wrong command 1.";
    pending_share: f64 = 0.5 in 1e-3..=0.999, "",
        Statistical, "decisions/071-matrix-cusum.md",
        "The part of a limit above which an alarm is pending, and below which a raised one recovers: the root of the odds.";
    recover_s: f64 = 5.0 in 0.0..=1e6, "s",
        Physical, "decisions/076-shutdown-rules.md",
        "Time without evidence before a raised alarm that is not latched ends: longer than the pauses of an intermittent \
         fault of 1 s.";
    least_detail_confidence: f64 = 0.5 in 0.0..=1.0, "",
        Statistical, "decisions/066-committee.md",
        "Least probability of a named detail: likelier than all others together.";
    settle_s: f64 = 1.0 in 0.0..=1e6, "s",
        Physical, "decisions/077-missing-sensors.md",
        "Time without judgement after the twin had wrong inputs or changed its mode: its transients last that long.";
    no_data_after_s: f64 = 0.1 in 0.0..=1e6, "s",
        Physical, "decisions/077-missing-sensors.md",
        "Time without usable values after which a sensor counts as lost: a few lost messages on a bus are shorter.";
    most_lost: f64 = 0.5 in 0.0..=1.0, "",
        Statistical, "decisions/077-missing-sensors.md",
        "The share of an actuator's sensors, or of all, beyond which lost sensors end the diagnosis: the majority.";
    fault_needed_nats: f64 = 3.0 in 0.0..=1e6, "nats",
        Statistical, "decisions/137-doubtful-boundary.md",
        "Evidence for a fault that a shutdown needs while a wrong boundary reading explains everything: odds of 20 to 1.";
    boundary_memory_s: f64 = 10.0 in 1e-3..=1e6, "s",
        Statistical, "decisions/137-doubtful-boundary.md",
        "How long this evidence is remembered: ten seconds of motion tell a wrong reading from a leak.";
    largest_boundary_error: f64 = 0.05 in 0.0..=1e6, "of scale",
        Physical, "decisions/137-doubtful-boundary.md",
        "The largest error of a boundary reading that a shutdown waits for: line transducers err by up to 4 % of their \
         full scale.";
    baseline_settle_s: f64 = 4.0 in 1e-3..=1e6, "s",
        Physical, "decisions/074-baseline-correction.md",
        "Time of the first mean of a specimen's residuals: it ends before the earliest fault of the training flights.";
    baseline_memory_s: f64 = 60.0 in 1e-3..=1e6, "s",
        Physical, "decisions/074-baseline-correction.md",
        "Memory of this mean afterwards: long beside the isolation of a fault, short beside changes of temperature.";
    panes: u32 = 5 in 1..=1000, "",
        Statistical, "decisions/070-windows-of-panes.md",
        "Panes of a window: so often a window is judged while it passes.";
    input_margin: f64 = 0.25 in 0.0..=1e6, "",
        Physical, "decisions/069-learning-from-flights.md",
        "How far an input may leave the range of the training flights, in parts of the range, before it counts as wrong.";
    known_share: f64 = 0.999 in 1e-3..=0.999_999, "",
        Statistical, "decisions/075-unknown.md",
        "The share of known windows that count as known; the others look like nothing in training.";
}

impl Tuning {
    /// The usual constants for these names; `off_actions` switch an actuator off.
    pub fn usual(names: &Names, off_actions: &[&str]) -> Self {
        Tuning {
            off_actions: off_actions.iter().map(|&action| action.into()).collect(),
            least_on: usual_least_on(names.actuators.len()),
            ..Tuning::default()
        }
    }

    /// Whether each action of these names switches an actuator off.
    pub fn switches_off(&self, names: &Names) -> Vec<bool> {
        names.actions.iter().map(|action| self.off_actions.contains(action)).collect()
    }

    /// Checks ranges and names.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`], [`Error::CorruptModel`].
    pub fn check(&self, names: &Names) -> Result<(), Error> {
        self.check_ranges()?;
        let actuators = names.actuators.len() as u32;
        let kept = f64::from(self.least_on);
        require(self.least_on <= actuators, "least_on", kept, "at most the number of actuators")?;
        let known = self.off_actions.iter().all(|action| names.actions.contains(action));
        let broken = "a command that switches off is none of the commands";
        if known { Ok(()) } else { Err(Error::CorruptModel { broken }) }
    }
}

/// The usual [`Tuning::least_on`]: one of several actuators, none of a single one.
pub fn usual_least_on(actuators: usize) -> u32 {
    u32::from(actuators > 1)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::string::ToString;
    use alloc::vec;

    fn names() -> Names {
        let list = |names: &[&str]| names.iter().map(ToString::to_string).collect();
        Names {
            features: vec![],
            actuators: list(&["a0", "a1"]),
            actions: list(&["c0", "c1"]),
            details: vec![],
        }
    }

    #[test]
    fn constants_out_of_range_are_refused() {
        let good = Tuning::usual(&names(), &["c0"]);
        good.check(&names()).unwrap();
        assert_eq!(good.switches_off(&names()), [true, false]);
        let bad = [
            Tuning { false_alarms_per_h: 0.0, ..good.clone() },
            Tuning { wrong_isolation: f64::NAN, ..good.clone() },
            Tuning { pending_share: 1.0, ..good.clone() },
            Tuning { recover_s: -1.0, ..good.clone() },
            Tuning { cost_of_wrong_shutdown: f64::INFINITY, ..good.clone() },
            Tuning { panes: 0, ..good.clone() },
            Tuning { least_on: 3, ..good.clone() },
            Tuning { off_actions: vec!["c9".into()], ..good.clone() },
        ];
        for tuning in bad {
            assert!(tuning.check(&names()).is_err(), "{tuning:?}");
        }
    }

    #[test]
    fn every_constant_has_a_range_a_sentence_and_a_source() {
        let constants = Tuning::default().constants();
        for constant in &constants {
            let Constant { name, meaning, source, .. } = constant;
            assert!(meaning.ends_with('.') && !meaning.contains("  "), "{name}: {meaning}");
            assert!(source.ends_with(".md"), "{name}: {source}");
            assert_eq!(constant.label(), constant.origin.label());
        }
        let by_hand = Tuning { clip_nats: 7.0, ..Tuning::default() }.constants();
        let changed: Vec<&str> =
            by_hand.iter().filter(|c| c.label() == "set by hand").map(|c| c.name).collect();
        assert_eq!(changed, ["clip_nats"]);
    }
}
