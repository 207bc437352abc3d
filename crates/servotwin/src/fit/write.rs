//! Writes a fitted twin as a system file: fitted values with standard errors and knowledge, and a head comment with
//! their origin.

use super::unknown::Moved;
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
            let Moved::Parameters { members, .. } = &unknown.moved else { continue };
            for &(component, parameter, nominal) in members {
                let per_sigma = unknown.per_sigma(nominal);
                let error = (self.known.error(k) * per_sigma).abs();
                let value = nominal + self.z[k] * per_sigma;
                let how = self.known.sentence(&problem.unknowns, k);
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
            lines.extend(self.findings.iter().map(|f| format!("  {}", f.sentence(problem))));
        }
        lines.push("A value behind ± is one standard error.".into());
        lines
    }
}
