//! Example faults, simulated again for the report with their time series. The choice is small and always the same.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::records::{self, RunError};
use servotwin::study::{FaultCase, Study};

/// Words to find in a fault class.
const WANTED: [&str; 2] = ["leakage", "pressure_sensor"];

/// One fault with its time series.
pub struct Example {
    /// The fault's name.
    pub(crate) fault: String,
    /// The fault class, e.g. `external_leakage`.
    pub(crate) detail: String,
    /// The name of the operating case.
    pub(crate) case: String,
    /// Samples of the twin, one vector for each measured sensor.
    pub(crate) twin: Vec<Vec<f64>>,
    /// The intensity of the fault.
    pub(crate) intensity: f64,
    /// Samples of the faulty plant, like those of the twin.
    pub(crate) plant: Vec<Vec<f64>>,
}

/// Simulates the examples of a study, without noise.
///
/// # Errors
/// The healthy system cannot be simulated. A faulty system that cannot be simulated is left out.
pub(crate) fn simulate(study: &Study) -> Result<Vec<Example>, RunError> {
    let ensemble = records::ensemble(study);
    // The case in the middle is neither the easiest nor the hardest.
    let case = study.cases.len() / 2;
    let inputs = || study.cases[case].inputs.iter().collect();
    let healthy = Variant { inputs: inputs(), ..Variant::default() };
    let twin = signals(&ensemble, &healthy)
        .map_err(|reason| RunError::Twin { case: study.cases[case].name.clone(), reason })?;
    let example = |fault: &FaultCase| {
        let variant = Variant { faults: vec![fault.at], inputs: inputs(), ..Variant::default() };
        Some(Example {
            fault: fault.id.clone(),
            detail: study.classes[fault.class].detail.clone(),
            case: study.cases[case].name.clone(),
            twin: twin.clone(),
            intensity: fault.at.intensity,
            plant: signals(&ensemble, &variant).ok()?,
        })
    };
    Ok(wanted(study).filter_map(example).collect())
}

fn signals(ensemble: &Ensemble, variant: &Variant) -> Result<Vec<Vec<f64>>, String> {
    ensemble
        .run_one(variant)
        .map(|(signals, _)| signals)
        .map_err(|failure| failure.cause.to_string())
}

/// For each wanted word, the first fault of the first matching class, at its greatest intensity.
fn wanted(study: &Study) -> impl Iterator<Item = &FaultCase> {
    WANTED.iter().filter_map(|word| {
        let is_class = |fault: &&FaultCase| study.classes[fault.class].detail.contains(*word);
        let first = study.faults.iter().find(is_class)?;
        let same = study.faults.iter().filter(|fault| fault.id == first.id);
        same.max_by(|a, b| a.at.intensity.total_cmp(&b.at.intensity))
    })
}
