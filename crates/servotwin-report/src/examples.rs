//! Example faults, simulated again for the report with their time series. The choice is small and always the same.

use servotwin::ensemble::{Ensemble, Variant};
use servotwin::records::{self, RunError};
use servotwin::study::{FaultCase, Study};

/// Words to find in a fault class, and the intensities to show.
const WANTED: [&str; 2] = ["leakage", "pressure_sensor"];
const INTENSITIES: [f64; 2] = [0.3, 1.0];

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
    /// Intensity and samples of each faulty plant.
    pub(crate) runs: Vec<(f64, Vec<Vec<f64>>)>,
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
    let mut examples = vec![];
    for faults in wanted(study) {
        let run = |fault: &&FaultCase| {
            let variant =
                Variant { faults: vec![fault.at], inputs: inputs(), ..Variant::default() };
            Some((fault.at.intensity, signals(&ensemble, &variant).ok()?))
        };
        examples.push(Example {
            fault: faults[0].id.clone(),
            detail: study.classes[faults[0].class].detail.clone(),
            case: study.cases[case].name.clone(),
            twin: twin.clone(),
            runs: faults.iter().filter_map(run).collect(),
        });
    }
    Ok(examples)
}

fn signals(ensemble: &Ensemble, variant: &Variant) -> Result<Vec<Vec<f64>>, String> {
    ensemble
        .run_one(variant)
        .map(|(signals, _)| signals)
        .map_err(|failure| failure.cause.to_string())
}

/// For each wanted word, the first fault of the first matching class, at the intensities nearest to the wanted ones.
fn wanted(study: &Study) -> Vec<Vec<&FaultCase>> {
    let of_word = |word: &&str| {
        let is_class = |fault: &&FaultCase| study.classes[fault.class].detail.contains(*word);
        let first = study.faults.iter().find(is_class)?;
        let same: Vec<&FaultCase> = study.faults.iter().filter(|f| f.id == first.id).collect();
        let nearest = |intensity: &f64| {
            let distance = |fault: &&&FaultCase| (fault.at.intensity - intensity).abs();
            same.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).copied()
        };
        let mut chosen: Vec<&FaultCase> = INTENSITIES.iter().filter_map(nearest).collect();
        chosen.dedup_by(|a, b| a.at.intensity == b.at.intensity);
        Some(chosen)
    };
    WANTED.iter().filter_map(of_word).collect()
}
