//! Writes a fitted twin as a system file: fitted values with standard errors and knowledge, and a head comment with
//! their origin.

use super::{Fit, FitResults};
use crate::system::{NewValue, RewriteError};

impl FitResults {
    /// The text of the system file with the fitted parameters.
    ///
    /// # Errors
    /// The file's layout does not allow a parameter to be written.
    pub fn system_text(&self, problem: &Fit) -> Result<String, RewriteError> {
        let mut values = Vec::new();
        for (k, unknown) in problem.unknowns.iter().enumerate() {
            for &(component, parameter, nominal) in &unknown.members {
                let per_sigma = unknown.per_sigma(nominal);
                let error = (self.known.error(k) * per_sigma).abs();
                let value = nominal + self.z[k] * per_sigma;
                let how = self.known.sentence("record", &problem.unknowns, k);
                let comment = format!("± {error:.2e}, was {nominal:?}; {how}");
                values.push(NewValue { component, parameter, value, comment });
            }
        }
        problem.system.rewritten(&self.origin(problem), &values)
    }

    fn origin(&self, problem: &Fit) -> Vec<String> {
        let mut lines = vec![format!("Fitted by servotwin {}:", env!("CARGO_PKG_VERSION"))];
        for record in &problem.records {
            lines.push(format!(
                "  {}: {:.1} s, {} sensors, {} samples",
                record.name,
                record.duration_s(),
                record.sensors.len(),
                record.samples()
            ));
        }
        if !self.is_update() {
            lines.push("NOT AN UPDATE: the record shows what no tolerance explains:".into());
            lines.extend(self.findings.iter().map(|finding| format!("  {finding}")));
        }
        lines.push("A value behind ± is one standard error.".into());
        lines
    }
}

#[cfg(test)]
mod tests {
    use super::super::Unknown;
    use super::*;
    use crate::built_in;
    use crate::study::Study;
    use crate::system::System;

    #[test]
    fn all_that_a_fit_may_move_can_be_written_for_every_shipped_study() {
        for (name, text) in built_in::STUDIES {
            let study = Study::parse(text, name).unwrap();
            let [tolerances, draws] = [Unknown::of_study(&study), Unknown::of_draws(&study)];
            assert!(!tolerances.is_empty(), "{name}");
            let moved = |unknown: &Unknown| {
                let z = 0.1 * if unknown.range.1 > 0.0 { unknown.range.1 } else { unknown.range.0 };
                assert_ne!(z, 0.0, "{}", unknown.name);
                let new = |&(component, parameter, nominal): &(usize, usize, f64)| NewValue {
                    component,
                    parameter,
                    value: nominal + z * unknown.per_sigma(nominal),
                    comment: String::new(),
                };
                unknown.members.iter().map(new).collect::<Vec<_>>()
            };
            let each: Vec<Vec<NewValue>> = tolerances.iter().chain(&draws).map(moved).collect();
            for values in each.iter().chain([&each.concat()]) {
                let text = study.system.rewritten(&[], values);
                let text = text.unwrap_or_else(|refusal| panic!("{name}: {refusal}"));
                let read = System::parse(&text, "rewritten").unwrap();
                for &NewValue { component, parameter, value, .. } in values {
                    assert_eq!(read.network().components[component].parameters[parameter], value);
                }
            }
        }
    }
}
