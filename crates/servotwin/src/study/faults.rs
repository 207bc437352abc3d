//! The fault list: every fault of every class, in every actuator, at every
//! intensity. For the paper's study it is Table 1: 28 components, 820 faults.

use super::reader::{Noted, Reader};
use crate::format::At;
use crate::toml_text::TextSpan;
use servotwin_model::program::FaultAt;

/// A row of Table 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Class {
    /// The fault class, e.g. `external_leakage`.
    pub detail: String,
    /// The action of the flight control computer, e.g. `shut_down`.
    pub action: String,
    /// Fault names without the actuator, e.g. `leakage_a.leakage`.
    pub(crate) kinds: Vec<String>,
}

impl Class {
    /// The number of different components of one actuator in the class.
    pub fn components(&self) -> usize {
        let component = |kind: &String| kind.split('.').next().unwrap_or_default().to_string();
        let mut components: Vec<String> = self.kinds.iter().map(component).collect();
        components.sort();
        components.dedup();
        components.len()
    }
}

/// One fault at one intensity, i.e. one row of a data set for each operating case.
#[derive(Clone, Debug, PartialEq)]
pub struct FaultCase {
    /// The fault's full name, e.g. `actuator_1.leakage_a.leakage`.
    pub id: String,
    /// The name without the actuator.
    pub kind: String,
    /// The index of the actuator in the study's list.
    pub actuator: usize,
    /// The index of the class in the study's list.
    pub class: usize,
    /// The fault's place in the program, with its intensity.
    pub at: FaultAt,
}

impl Reader<'_> {
    pub(super) fn classes(&self) -> Vec<Class> {
        let class = |c: &super::ClassText| {
            for (key, text) in [("detail", &c.detail), ("action", &c.action)] {
                if text.trim().is_empty() {
                    self.empty(&text.at, key);
                }
            }
            Class {
                detail: c.detail.value.clone(),
                action: c.action.value.clone(),
                kinds: c.faults.iter().map(|name| name.value.clone()).collect(),
            }
        };
        self.text.classes.iter().map(class).collect()
    }

    /// The place in the file where a class lists a fault.
    pub(super) fn place_of_fault(&self, FaultCase { class, kind, .. }: &FaultCase) -> TextSpan {
        let mut of_class = self.text.classes[*class].faults.iter();
        of_class.find(|name| name.value == *kind).map_or(0..0, |name| name.at.clone())
    }

    pub(super) fn faults(&self) -> Vec<FaultCase> {
        let mut faults = Vec::new();
        for (actuator, actuator_name) in self.text.actuators.iter().enumerate() {
            for (class, text) in self.text.classes.iter().enumerate() {
                for kind in &text.faults {
                    let Ok((component, fault)) = self.find_fault(actuator_name, kind) else {
                        continue;
                    };
                    for intensity in self.text.intensities.iter().map(|own| own.value) {
                        let at = FaultAt { component, fault, intensity };
                        let (id, kind) = (full_name(actuator_name, kind), kind.value.clone());
                        faults.push(FaultCase { id, kind, actuator, class, at });
                    }
                }
            }
        }
        faults
    }

    fn find_fault(&self, actuator: &str, kind: &At<String>) -> Result<(usize, usize), Noted> {
        let id = &full_name(actuator, kind);
        let find = |id: &str| self.system.program.find_fault(id);
        find(id).ok_or_else(|| {
            if find(kind).is_some() {
                return self.shared("fault", actuator, kind);
            }
            let all = self.system.all_faults();
            let known = all.iter().map(String::as_str);
            self.unknown(&kind.at, ("fault in the system", id), known)
        })
    }
}

/// Prefixes a name with its actuator. An empty actuator name stands for the whole system.
pub(crate) fn full_name(actuator: &str, rest: &str) -> String {
    if actuator.is_empty() { rest.into() } else { format!("{actuator}.{rest}") }
}
