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

use super::decision::{Allowances, Costs};
use crate::error::{Error, require, require_sound};
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
    pub(crate) fn label(self) -> String {
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
    pub(crate) usual: f64,
    /// Whether the value is usual; some constants have two usual values.
    pub(crate) is_usual: bool,
    /// The unit; empty for a number or a share.
    pub unit: &'static str,
    /// Where the usual value comes from.
    pub(crate) origin: Origin,
    /// One sentence.
    pub meaning: &'static str,
    /// The page of the book that derives or measures it, relative to `docs/`.
    pub source: &'static str,
}

impl Constant {
    /// The label of the origin, or that the value is not the usual one.
    pub fn label(&self) -> String {
        if self.is_usual { self.origin.label() } else { "not the usual value".into() }
    }
}

macro_rules! tuning {
    ($(
        $name:ident: $kind:ty = $usual:literal $(or $other:literal)? in $least:literal..=$largest:literal,
            $unit:literal,
            $origin:expr, $source:literal, $($meaning:literal)+;
    )*) => {
        /// Every constant of a diagnosis. The module describes it.
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(deny_unknown_fields)]
        pub struct Tuning {
            /// Names of the actions that switch an actuator off.
            pub off_actions: Vec<String>,
            /// Minimum number of actuators that stay on. Usually one of several, and none for a single actuator.
            pub least_on: u32,
            /// What errors cost.
            pub costs: Costs,
            $(
                #[doc = concat!($($meaning,)+)]
                pub $name: $kind,
            )*
        }

        impl Default for Tuning {
            /// The usual constants, without an action that switches off.
            fn default() -> Self {
                Tuning {
                    off_actions: Vec::new(),
                    least_on: 0,
                    costs: Costs::default(),
                    $($name: $usual,)*
                }
            }
        }

        impl Tuning {
            /// The declared constants, in order.
            fn declared(&self) -> Vec<Constant> {
                let usual = Tuning::default();
                alloc::vec![$(
                    Constant {
                        name: stringify!($name),
                        value: f64::from(self.$name),
                        usual: f64::from(usual.$name),
                        is_usual: self.$name == usual.$name $(|| self.$name == $other)?,
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
    false_alarm_target_per_h: f64 = 1e-3 in 1e-12..=3600.0, "1/h",
        Statistical, "decisions/018-evidence.md",
        "False alarms of an action in a fault-free hour, for an error of cost 1: a target, from which the limits against \
         health follow.";
    wrong_isolation: f64 = 1e-3 in 1e-12..=1.0, "",
        Statistical, "decisions/018-evidence.md",
        "Probability that a fault raises the wrong action, for an error of cost 1: a target, from which the limits between \
         actions follow.";
    allowance_nats: f64 = 0.2 in 0.0..=1e6, "nats",
        tuned(9), "decisions/018-evidence.md",
        "Subtracted from the evidence of every window for any hypothesis against any other.";
    health_allowance_nats: f64 = 3.0 or 0.5 in 0.0..=1e6, "nats",
        tuned(7), "decisions/018-evidence.md",
        "Subtracted besides against health, as much as a healthy specimen may permanently look like a fault; 0.5 beside \
         perfect specimens.";
    off_allowance_nats: f64 = 2.0 or 0.0 in 0.0..=1e6, "nats",
        tuned(9), "decisions/018-evidence.md",
        "Subtracted besides against health for an action that switches off; 0 beside perfect specimens.";
    other_allowance_nats: f64 = 1.5 in 0.0..=1e6, "nats",
        tuned(9), "decisions/018-evidence.md",
        "Subtracted besides against another actuator for an action that switches off: nearly uncertain windows are no \
         knowledge, however many.";
    clip_nats: f64 = 8.0 in 1e-3..=100.0, "nats",
        Statistical, "decisions/018-evidence.md",
        "The largest evidence of one window, odds of 3,000 to 1: no single window decides.";
    in_band_nats: f64 = 4.0 in 0.0..=1e6, "nats",
        Statistical, "decisions/018-evidence.md",
        "Evidence for health of a window with every residual in its band: about the odds at which the bands of healthy \
         records hold, 98.5 %.";
    least_limit_nats: f64 = 1.0 in 0.0..=1e6, "nats",
        Statistical, "decisions/018-evidence.md",
        "Lower end of every limit, whatever the costs: odds of 2.7 to 1.";
    evidence_cap: f64 = 1.5 in 1.0..=1e6, "",
        Statistical, "decisions/018-evidence.md",
        "Cap of gathered evidence in parts of its limit: it bounds the time that evidence needs to fall again.";
    max_common_mode: f64 = 0.9 in 0.5..=1.0, "",
        Physical, "decisions/016-unknown-is-not-isolated.md",
        "The share of a deviation that two actuators have in common above which it is unknown: a fault of one actuator \
         gives one half, a wrong command 1.";
    pending_share: f64 = 0.5 in 1e-3..=0.999, "",
        Statistical, "decisions/018-evidence.md",
        "The part of a limit above which an alarm is pending, and below which a raised one recovers: the root of the odds.";
    recover_s: f64 = 5.0 in 0.0..=1e6, "s",
        Physical, "decisions/019-the-last-one-stays-on.md",
        "Time without evidence before a raised alarm that is not latched ends: longer than the pauses of an intermittent \
         fault of 1 s.";
    least_detail_confidence: f64 = 0.5 in 0.0..=1.0, "",
        Statistical, "decisions/015-trees-and-committee-agree.md",
        "Least probability of a named detail: likelier than all others together.";
    settle_s: f64 = 1.0 in 0.0..=1e6, "s",
        Physical, "decisions/017-missing-sensors.md",
        "Time without judgement after the twin had wrong inputs or changed its mode: its transients last that long.";
    no_data_after_s: f64 = 0.1 in 0.0..=1e6, "s",
        Physical, "decisions/017-missing-sensors.md",
        "Time without usable values after which a sensor counts as lost: a few lost messages on a bus are shorter.";
    input_held_s: f64 = 0.03 in 0.0..=1e6, "s",
        Physical, "decisions/017-missing-sensors.md",
        "Time for which the twin goes on without an input: the command hardly leaves its slope meanwhile.";
    input_recover_s: f64 = 0.2 in 0.0..=1e6, "s",
        Physical, "decisions/017-missing-sensors.md",
        "Time without judgement afterwards: the twin follows a corrected command within a tenth of a second.";
    most_lost: f64 = 0.5 in 0.0..=1.0, "",
        Statistical, "decisions/017-missing-sensors.md",
        "The share of an actuator's sensors, or of all, beyond which lost sensors end the diagnosis: the majority.";
    fault_needed_nats: f64 = 3.0 in 0.0..=1e6, "nats",
        Statistical, "decisions/020-doubtful-boundary.md",
        "Evidence for a fault that a shutdown needs while a wrong boundary reading explains everything: odds of 20 to 1.";
    boundary_memory_s: f64 = 10.0 in 1e-3..=1e6, "s",
        Statistical, "decisions/020-doubtful-boundary.md",
        "How long this evidence is remembered: ten seconds of motion tell a wrong reading from a leak.";
    healthy_slope_memory_s: f64 = 60.0 in 1e-3..=1e6, "s",
        Statistical, "decisions/020-doubtful-boundary.md",
        "How long the slope of a healthy line is remembered: a minute of motion shows it, and a filter clogs more slowly.";
    line_slope_deviation: f64 = 0.15 in 1e-6..=1e6, "",
        Physical, "decisions/020-doubtful-boundary.md",
        "The standard deviation of a healthy line's slope that is not known yet: the resistance of lines and filters \
         differs from the twin's by up to a quarter.";
    line_error: f64 = 0.0005 in 0.0..=1e6, "of scale",
        Physical, "decisions/020-doubtful-boundary.md",
        "The error of the twin's pressure drop in a line that moves with the flow: the quiescent flow of a valve differs.";
    least_boundary_move: f64 = 0.5 in 0.0..=1e6, "of the band",
        Statistical, "decisions/020-doubtful-boundary.md",
        "How far a wrong boundary reading moves its sensor before it explains anything: trees accuse within a band, and \
         noise lifts a mean at its edge in and out.";
    largest_boundary_error: f64 = 0.05 in 0.0..=1e6, "of scale",
        Physical, "decisions/020-doubtful-boundary.md",
        "The largest error of a boundary reading that a shutdown waits for: line transducers err by up to 4 % of their \
         full scale.";
    baseline_settle_s: f64 = 4.0 in 1e-3..=1e6, "s",
        Physical, "decisions/012-windows-of-panes.md",
        "Time of the first mean of a specimen's residuals: it ends before the earliest fault of the training flights.";
    baseline_memory_s: f64 = 60.0 in 1e-3..=1e6, "s",
        Physical, "decisions/012-windows-of-panes.md",
        "Memory of this mean afterwards: long beside the isolation of a fault, short beside changes of temperature.";
    panes: u32 = 5 in 1..=1000, "",
        Statistical, "decisions/012-windows-of-panes.md",
        "Panes of a window: so often a window is judged while it passes.";
    input_margin: f64 = 0.25 in 0.0..=1e6, "",
        Physical, "decisions/024-hard-negatives.md",
        "How far an input may leave the range of the training flights, in parts of the range, before it counts as wrong.";
    known_share: f64 = 0.999 in 1e-3..=0.999_999, "",
        Statistical, "decisions/016-unknown-is-not-isolated.md",
        "The share of known windows that count as known; the others look like nothing in training.";
}

/// The cost of shutting the healthy actuator down while another one has a fault.
pub const WRONG_ACTUATOR_COST: f64 = 1e9;

/// The cost of any false alarm that does not shut down, where specimens differ by their tolerances.
pub const WITH_TOLERANCES_COST: f64 = 3e8;

/// Allowances of baseline-corrected windows, nats.
pub const BASELINE_CORRECTED: Allowances =
    Allowances { of_pairs_nats: 0.0, health_nats: 0.0, off_nats: 2.0, other_nats: 1.5 };

impl Tuning {
    /// The usual constants for these names; `off_actions` switch an actuator off.
    pub fn usual(names: &Names, off_actions: &[&str]) -> Self {
        let is_off: Vec<bool> =
            names.actions.iter().map(|action| off_actions.contains(&action.as_str())).collect();
        Tuning {
            off_actions: off_actions.iter().map(|&action| action.into()).collect(),
            least_on: usual_least_on(names.actuators.len()),
            costs: Costs::usual(&is_off),
            ..Tuning::default()
        }
    }

    /// These constants with other allowances.
    pub(crate) fn allowing(&self, allowances: &Allowances) -> Self {
        Tuning {
            allowance_nats: allowances.of_pairs_nats,
            health_allowance_nats: allowances.health_nats,
            off_allowance_nats: allowances.off_nats,
            other_allowance_nats: allowances.other_nats,
            ..self.clone()
        }
    }

    /// The probability of health of a window with every residual in its band.
    pub fn in_band_share(&self) -> f64 {
        1.0 / (1.0 + libm::exp(-self.in_band_nats))
    }

    /// The allowance for any change against health, beside that for any hypothesis, nats.
    pub fn change_allowance_nats(&self) -> f64 {
        self.health_allowance_nats + self.off_allowance_nats
    }

    /// Whether each action of these names switches an actuator off.
    pub fn switches_off(&self, names: &Names) -> Vec<bool> {
        names.actions.iter().map(|action| self.off_actions.contains(action)).collect()
    }

    /// All constants: the declared ones, the costs, and the allowances of baseline-corrected windows, if there are such.
    /// Costs are those of a diagnoser with an action that switches off and another one.
    pub fn constants(&self, baseline_corrected: Option<&Allowances>) -> Vec<Constant> {
        let mut all = self.declared();
        all.extend(self.costs.constants());
        all.extend(baseline_corrected.into_iter().flat_map(Allowances::constants));
        all
    }

    /// Checks ranges and names.
    ///
    /// # Errors
    /// [`Error::SettingOutOfRange`], [`Error::CorruptModel`].
    pub(crate) fn check(&self, names: &Names) -> Result<(), Error> {
        self.check_ranges()?;
        self.costs.check(names.actions.len())?;
        let actuators = names.actuators.len() as u32;
        let kept = f64::from(self.least_on);
        require(self.least_on <= actuators, "least_on", kept, "at most the number of actuators")?;
        let known = self.off_actions.iter().all(|action| names.actions.contains(action));
        require_sound(known, "an action that switches off is none of the actions")
    }
}

impl Costs {
    /// The different costs as constants. The largest of each kind stands for it.
    fn constants(&self) -> Vec<Constant> {
        const SOURCE: &str = "decisions/018-evidence.md";
        let most = |costs: &[f64]| costs.iter().copied().fold(0.0, f64::max);
        let [healthy, faulty @ ..] = &self.same_actuator[..] else { return Vec::new() };
        let of = |name, value: f64, usual: [f64; 2], origin, meaning| Constant {
            name,
            value,
            usual: usual[0],
            is_usual: usual.contains(&value),
            unit: "",
            origin,
            meaning,
            source: SOURCE,
        };
        let least = healthy.iter().skip(1).copied().fold(f64::INFINITY, f64::min);
        let needless = faulty.iter().map(|row| most(row)).fold(0.0, f64::max);
        alloc::vec![
            of(
                "cost_of_healthy_shutdown",
                if least < 10.0 { most(healthy) } else { least },
                [10.0, 1.0],
                Statistical,
                "Cost of shutting an actuator down while nothing has a fault, in ordinary errors.",
            ),
            of(
                "cost_of_false_alarm",
                if least < 10.0 { least } else { most(healthy) },
                [WITH_TOLERANCES_COST, 1.0],
                Origin::Tuned { seed: 7 },
                "Cost of another false alarm: with tolerances no cost proper, but the limit for windows that count in \
                 full; 1 beside perfect specimens.",
            ),
            of(
                "cost_of_needless_shutdown",
                needless,
                [3.0, 1.0],
                Statistical,
                "Cost of shutting an actuator down while a milder action would do, in ordinary errors.",
            ),
            of(
                "cost_of_wrong_shutdown",
                most(&self.other_actuator),
                [WRONG_ACTUATOR_COST, 1.0],
                Origin::Tuned { seed: 7 },
                "Cost of shutting a healthy actuator down while another one has a fault: 1,000, and a million more \
                 because every window counts in full.",
            ),
        ]
    }
}

impl Allowances {
    /// The allowances as constants of baseline-corrected windows.
    fn constants(&self) -> Vec<Constant> {
        let of = |name, value, usual, meaning| Constant {
            name,
            value,
            usual,
            is_usual: value == usual,
            unit: "nats",
            origin: Origin::Tuned { seed: 9 },
            meaning,
            source: "decisions/018-evidence.md",
        };
        let usual = BASELINE_CORRECTED;
        alloc::vec![
            of(
                "corrected_allowance_nats",
                self.of_pairs_nats,
                usual.of_pairs_nats,
                "In baseline-corrected windows, in place of the allowance of every pair.",
            ),
            of(
                "corrected_health_allowance_nats",
                self.health_nats,
                usual.health_nats,
                "In baseline-corrected windows, in place of the allowance against health.",
            ),
            of(
                "corrected_off_allowance_nats",
                self.off_nats,
                usual.off_nats,
                "In baseline-corrected windows, in place of that for an action that switches off.",
            ),
            of(
                "corrected_other_allowance_nats",
                self.other_nats,
                usual.other_nats,
                "In baseline-corrected windows, in place of that against another actuator.",
            ),
        ]
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
            Tuning { false_alarm_target_per_h: 0.0, ..good.clone() },
            Tuning { wrong_isolation: f64::NAN, ..good.clone() },
            Tuning { pending_share: 1.0, ..good.clone() },
            Tuning { recover_s: -1.0, ..good.clone() },
            Tuning { costs: Costs::usual(&[true]), ..good.clone() },
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
        let usual = Tuning::usual(&names(), &["c0"]);
        let constants = usual.constants(Some(&BASELINE_CORRECTED));
        assert_eq!(constants.len(), usual.declared().len() + 8);
        for constant in &constants {
            let Constant { name, meaning, source, .. } = constant;
            assert!(meaning.ends_with('.') && !meaning.contains("  "), "{name}: {meaning}");
            assert!(source.ends_with(".md"), "{name}: {source}");
            let is_cost = name.starts_with("cost_");
            assert!(is_cost || constant.label() == constant.origin.label(), "{name}");
        }
        let by_hand = Tuning { clip_nats: 7.0, ..Tuning::default() };
        let changed: Vec<&str> =
            by_hand.declared().iter().filter(|c| !c.is_usual).map(|c| c.name).collect();
        assert_eq!(changed, ["clip_nats"]);
        let perfect = Tuning { health_allowance_nats: 0.5, ..Tuning::default() };
        assert!(perfect.declared().iter().all(|c| c.is_usual));
    }
}
