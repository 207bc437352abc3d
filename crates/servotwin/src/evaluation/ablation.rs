//! Ablation: which features and which methods the result depends on. It repeats the test on a new command (without
//! training commands, on faults unseen at their intensity) with parts removed.

use super::data_set::DataSet;
use super::error::EvaluationError;
use super::protocol::{Holding, Protocol, summary};
use super::run::{Scope, run};
use crate::parallel::{self, Workers};
use serde::{Deserialize, Serialize};
use servotwin_learning::classifiers;
use servotwin_learning::hierarchy::HierarchySettings;
use servotwin_learning::metrics::Rate;
use servotwin_learning::splits::Split;

/// The tree depths of the depth curve.
const DEPTHS: [usize; 4] = [3, 5, 7, 9];

/// The result with a part removed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Ablation {
    /// Description of the variation.
    pub title: String,
    /// Number of features.
    pub features: usize,
    /// Accuracy of the actuator (stage A).
    pub actuator: Option<Rate>,
    /// Accuracy of the command, given the actuator (stage B).
    pub command: Option<Rate>,
    /// Accuracy of all stages together.
    pub end_to_end: Option<Rate>,
    /// The component whose faults are most often attributed to the wrong actuator, with that rate.
    pub worst_component: Option<(String, Rate)>,
}

/// A variation: its title, feature families and settings.
struct Variation {
    title: String,
    families: Vec<String>,
    /// Whether B and the stages below it also read the other actuators' sensors.
    all_sensors_below: bool,
    settings: HierarchySettings,
}

/// Variations: single families, families added one by one, families removed one by one; without symmetric copies,
/// without pooling, without either; and every depth.
///
/// # Errors
/// Training fails.
pub(crate) fn evaluate(
    data: &DataSet,
    settings: &HierarchySettings,
    holding: Holding,
    workers: Workers,
) -> Result<Vec<Ablation>, EvaluationError> {
    let protocol = Protocol::headline(data);
    let splits = protocol.splits(data, holding)?;
    if splits.is_empty() {
        return Ok(vec![]);
    }
    let list = variations(&data.families(), data.examples.names().actuators.len(), settings);
    // One split means one training, so the variations share the threads.
    match splits.len() {
        1 => parallel::map(&list, workers, |variation| {
            one(data, variation, protocol, &splits, Workers::new(1))
        })?
        .into_iter()
        .collect(),
        _ => list.iter().map(|v| one(data, v, protocol, &splits, workers)).collect(),
    }
}

fn variations(families: &[String], units: usize, settings: &HierarchySettings) -> Vec<Variation> {
    let with = |title: String, families: Vec<String>| Variation {
        title,
        families,
        all_sensors_below: false,
        settings: settings.clone(),
    };
    let set = |title: &str, change: &dyn Fn(&mut HierarchySettings)| {
        let mut settings = settings.clone();
        change(&mut settings);
        Variation { settings, ..with(title.into(), families.to_vec()) }
    };
    let mut list = vec![with("all features".into(), families.to_vec())];
    if families.len() > 1 {
        for family in families {
            list.push(with(format!("{family} alone"), vec![family.clone()]));
        }
        for count in 2..families.len() {
            let names = families[..count].to_vec();
            list.push(with(names.join(" + "), names));
        }
        for family in families {
            let others = families.iter().filter(|other| *other != family).cloned();
            list.push(with(format!("without {family}"), others.collect()));
        }
    }
    // A single actuator has no others to compare with.
    if units > 1 {
        list.push(Variation {
            all_sensors_below: true,
            ..with("all sensors below A too".into(), families.to_vec())
        });
        list.push(set("without mirror images", &|s| s.mirror = false));
        list.push(set("a tree for each actuator", &|s| s.pool = false));
        list.push(set("without mirror images, a tree for each actuator", &|s| {
            s.mirror = false;
            s.pool = false;
        }));
    }
    if matches!(settings.actuator, classifiers::Settings::Cart(_)) {
        list.extend(DEPTHS.map(|depth| set(&format!("depth {depth}"), &|s| limit(s, depth))));
    }
    list
}

/// Limits the depth of every CART stage.
fn limit(settings: &mut HierarchySettings, depth: usize) {
    for stage in [&mut settings.actuator, &mut settings.action, &mut settings.detail] {
        if let classifiers::Settings::Cart(cart) = stage {
            cart.max_depth = Some(depth);
        }
    }
}

fn one(
    data: &DataSet,
    variation: &Variation,
    protocol: Protocol,
    splits: &[Split],
    workers: Workers,
) -> Result<Ablation, EvaluationError> {
    let mut data = data.with_features(|info| variation.families.contains(&info.family))?;
    if variation.all_sensors_below {
        data = data.all_sensors_below()?;
    }
    let outcomes = run(&data, &variation.settings, splits, Scope::All, workers)?;
    let result = summary(protocol, &data, &outcomes, &[]);
    let share = |rate: &Rate| rate.share.unwrap_or(0.0);
    let worst = result.components.iter().max_by(|a, b| {
        // Of equally bad components, the alphabetically first.
        share(&a.wrong_actuator)
            .total_cmp(&share(&b.wrong_actuator))
            .then_with(|| b.component.cmp(&a.component))
    });
    Ok(Ablation {
        title: variation.title.clone(),
        features: data.features.len(),
        actuator: result.stage("A").map(|score| score.accuracy),
        command: result.stage("B").map(|score| score.accuracy),
        end_to_end: result.end_to_end,
        worst_component: worst.map(|worst| (worst.component.clone(), worst.wrong_actuator)),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_unit_has_nothing_to_share_with_others() {
        let titles = |units| {
            let list = variations(&["moments".into()], units, &HierarchySettings::default());
            list.into_iter().map(|variation| variation.title).collect::<Vec<_>>()
        };
        let alone = ["all features", "depth 3", "depth 5", "depth 7", "depth 9"];
        assert_eq!(titles(1), alone);
        let more = titles(2);
        assert_eq!(more.len(), alone.len() + 4);
        assert!(more.contains(&"without mirror images".into()), "{more:?}");
    }
}
