//! The fault list: every fault of every class, in every actuator, at every
//! intensity. For the paper's study it is Table 1: 28 components, 820 faults.

use super::mistake::StudyMistake;
use super::reader::{Noted, Reader};
use crate::document::{KeyPath, TextSpan};
use servotwin_model::program::FaultAt;

/// A row of Table 1.
#[derive(Clone, Debug, PartialEq)]
pub struct Class {
    /// The fault class, e.g. `external_leakage`.
    pub detail: String,
    /// The action of the flight control computer, e.g. `shut_down`.
    pub command: String,
    /// Fault names without the actuator, e.g. `leakage_a.leakage`.
    pub kinds: Vec<String>,
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
    pub unit: usize,
    /// The index of the class in the study's list.
    pub class: usize,
    /// The fault's place in the program, with its intensity.
    pub at: FaultAt,
}

impl Reader<'_> {
    pub(super) fn classes(&self) -> Vec<Class> {
        let class = |c: &super::ClassText| Class {
            detail: c.detail.clone(),
            command: c.command.clone(),
            kinds: c.faults.clone(),
        };
        for (place, c) in self.text.classes.iter().enumerate() {
            for (key, text) in [("detail", &c.detail), ("command", &c.command)] {
                if text.trim().is_empty() {
                    let at = KeyPath::of(&["classes"]).element(place).key(key);
                    self.note(&self.span(&at), StudyMistake::Empty { field: key });
                }
            }
        }
        self.text.classes.iter().map(class).collect()
    }

    /// The place in the file where a class lists a fault.
    pub(super) fn place_of_fault(&self, FaultCase { class, kind, .. }: &FaultCase) -> TextSpan {
        let of_class = &self.text.classes[*class].faults;
        let own = of_class.iter().position(|name| name == kind);
        self.span(&listed_fault(*class, own.unwrap_or(of_class.len())))
    }

    pub(super) fn faults(&self, classes: &[Class]) -> Result<Vec<FaultCase>, Noted> {
        let mut faults = Vec::new();
        for (unit, unit_name) in self.text.units.iter().enumerate() {
            for (index, class) in classes.iter().enumerate() {
                for (position, kind) in class.kinds.iter().enumerate() {
                    let id = full_name(unit_name, kind);
                    let at = listed_fault(index, position);
                    let found = self.find_fault(&at, unit_name, kind);
                    let Ok((component, fault)) = found else { continue };
                    for &intensity in &self.text.intensities {
                        let at = FaultAt { component, fault, intensity };
                        let (id, kind) = (id.clone(), kind.clone());
                        faults.push(FaultCase { id, kind, unit, class: index, at });
                    }
                }
            }
        }
        Ok(faults)
    }

    fn find_fault(&self, at: &KeyPath, unit: &str, kind: &str) -> Result<(usize, usize), Noted> {
        let id = &full_name(unit, kind);
        let find = |id: &str| self.system.program.find_fault(id);
        find(id).ok_or_else(|| {
            if find(kind).is_some() {
                return self.shared(at, "fault", unit, kind);
            }
            let components = &self.system.network().components;
            let all: Vec<String> = components
                .iter()
                .flat_map(|c| {
                    let faults = c.component.spec().faults.iter();
                    faults.map(|f| format!("{}.{}", c.id, f.name)).collect::<Vec<_>>()
                })
                .collect();
            self.unknown(at, "fault in the system", id, all.iter().map(String::as_str))
        })
    }
}

/// The place of a fault in the list of its class.
fn listed_fault(class: usize, position: usize) -> KeyPath<'static> {
    KeyPath::of(&["classes"]).element(class).key("faults").element(position)
}

/// Prefixes a name with its unit. An empty unit name stands for the whole system.
pub fn full_name(unit: &str, rest: &str) -> String {
    if unit.is_empty() { rest.into() } else { format!("{unit}.{rest}") }
}
