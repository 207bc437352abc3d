//! The results of a study as evidence: what they were made of, and which scenario is quoted.

use crate::error::SafetyError;
use servotwin::files::{create_folder, write_text};
use servotwin::job::flights::{self, FlightResults};
use servotwin::job::manifest::Manifest;
use servotwin::job::results::SubjectResult;
use servotwin::job::{Folder, JobError, Results, Subject};
use servotwin::manifest::{sha256, sha256_of_text};
use servotwin::measure::flights::FlightMetrics;
use servotwin::study::{Purpose, Scenario, Study};
use servotwin::table::Table;
use std::path::PathBuf;

/// The folder for artefacts in an output folder.
pub const FOLDER: &str = "safety";

/// Digits of a hash in a basis; enough to tell versions of one study apart.
const DIGITS: usize = 12;

/// What results were made of, as hashes. Results of one basis are results of the same system, study and models.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct EvidenceBasis {
    /// The system's text.
    pub system: String,
    /// The study's text.
    pub study: String,
    /// The trained models; `none` without any.
    pub model: String,
}

impl EvidenceBasis {
    /// The basis of a study without results.
    pub(crate) fn of_study(study: &Study) -> Self {
        let short = |text: &str| sha256_of_text(text)[..DIGITS].to_owned();
        EvidenceBasis {
            system: short(&study.system.text),
            study: short(&study.text),
            model: "none".into(),
        }
    }

    /// One line, which [`EvidenceBasis::parse`] reads.
    pub(crate) fn in_words(&self) -> String {
        format!("system {} study {} model {}", self.system, self.study, self.model)
    }

    /// Reads a line; `None` if it is no basis.
    pub(crate) fn parse(text: &str) -> Option<Self> {
        let words: Vec<&str> = text.split_whitespace().collect();
        let ["system", system, "study", study, "model", model] = words[..] else { return None };
        let [system, study, model] = [system, study, model].map(str::to_owned);
        Some(EvidenceBasis { system, study, model })
    }

    /// What changed since another basis, in words; `None` if nothing did.
    pub(crate) fn changes_since(&self, earlier: &EvidenceBasis) -> Option<String> {
        let pairs = [
            ("system", &self.system, &earlier.system),
            ("study", &self.study, &earlier.study),
            ("model", &self.model, &earlier.model),
        ];
        let changed: Vec<&str> =
            pairs.into_iter().filter(|(_, now, then)| now != then).map(|(name, ..)| name).collect();
        match changed[..] {
            [] => None,
            [one] => Some(format!("the {one} changed")),
            [one, other] => Some(format!("the {one} and the {other} changed")),
            _ => Some("the system, the study and the model changed".into()),
        }
    }
}

/// An output folder with results.
pub struct StudyResultsFolder {
    /// The folder.
    pub(crate) folder: Folder,
    /// Its study.
    pub study: Study,
    /// What its results were made of.
    pub(crate) basis: EvidenceBasis,
    /// The evaluation; `None` if the study was not evaluated yet.
    pub(crate) evaluation: Option<Results>,
    /// The flights; `None` if none were judged.
    pub(crate) flights: Option<FlightResults>,
    /// The scenario that is quoted.
    pub(crate) scenario: Scenario,
}

impl StudyResultsFolder {
    /// Opens a folder. Without a wanted scenario the most realistic one is quoted.
    ///
    /// # Errors
    /// The folder has no manifest or no study; a file contradicts the manifest; there are no results of the scenario.
    pub fn open(folder: Folder, wanted: Option<Scenario>) -> Result<Self, SafetyError> {
        let study = folder.read_study()?;
        let manifest = Manifest::read(folder.path())?;
        let manifest = manifest.ok_or(SafetyError::NoManifest { folder: folder.path().into() })?;
        let basis = basis(&folder, &manifest)?;
        let evaluation = match folder.results().exists() {
            true => Some(Results::read(&folder)?),
            false => None,
        };
        let flights = flights::results(&folder)?;
        let scenario = scenario(&folder, wanted)?;
        Ok(StudyResultsFolder { folder, study, basis, evaluation, flights, scenario })
    }

    /// The path of an artefact.
    fn artefact(&self, name: &str) -> PathBuf {
        self.folder.path().join(FOLDER).join(name)
    }

    /// Writes an artefact of text, and returns its path.
    pub(crate) fn write(&self, name: &str, text: &str) -> Result<PathBuf, SafetyError> {
        create_folder(self.folder.path().join(FOLDER))?;
        let path = self.artefact(name);
        write_text(&path, text)?;
        Ok(path)
    }

    /// Writes an artefact that is a table, and returns its path.
    pub(crate) fn write_table(&self, name: &str, table: &Table) -> Result<PathBuf, SafetyError> {
        create_folder(self.folder.path().join(FOLDER))?;
        let path = self.artefact(name);
        table.write(&path)?;
        Ok(path)
    }

    /// The evaluation of the quoted scenario.
    pub(crate) fn evaluated(&self) -> Option<&SubjectResult> {
        self.evaluation.as_ref()?.of(Subject::of(self.scenario))
    }

    /// The judged flights of the quoted scenario.
    pub(crate) fn flown(&self) -> Option<&FlightMetrics> {
        let mut judged = self.flights.as_ref()?.judged();
        judged.find(|metrics| metrics.group.scenario == self.scenario.name())
    }

    /// The judged flights, which the trees need.
    ///
    /// # Errors
    /// No flights were judged, or none in the quoted scenario.
    pub(crate) fn flown_or_missing(&self) -> Result<&FlightMetrics, SafetyError> {
        let path = self.folder.flights();
        let Some(flights) = &self.flights else {
            return Err(JobError::Missing { path, command: "study --suite flights" }.into());
        };
        self.flown().ok_or_else(|| SafetyError::NoScenario {
            path,
            given: self.scenario.name().into(),
            known: flights.judged().map(FlightMetrics::title).collect(),
        })
    }

    /// The scenario of the diagnoser that flies, which is the quoted one.
    ///
    /// # Errors
    /// Nothing flies in the quoted scenario.
    pub fn flown_setting(&self) -> Result<Scenario, SafetyError> {
        match flights::SCENARIOS.contains(&self.scenario) {
            true => Ok(self.scenario),
            false => Err(SafetyError::NoFlights {
                given: self.scenario.name(),
                known: flights::SCENARIOS.map(Scenario::name),
            }),
        }
    }

    /// Whether a figure of the report is there; its name relative to the folder.
    pub(crate) fn figure(&self, name: &str) -> Option<String> {
        self.folder.figures().join(name).exists().then(|| format!("figures/{name}"))
    }
}

/// The quoted scenario: the wanted one, or the most realistic one with results.
fn scenario(folder: &Folder, wanted: Option<Scenario>) -> Result<Scenario, SafetyError> {
    let has_runs = |scenario: &Scenario| folder.data_set(*scenario, Purpose::Test).exists();
    let has_any = |scenario: &Scenario| has_runs(scenario) || folder.diagnoser(*scenario).exists();
    let known: Vec<Scenario> = Scenario::ALL.into_iter().filter(has_any).collect();
    match wanted {
        Some(scenario) if !known.contains(&scenario) => Err(SafetyError::NoScenario {
            path: folder.path().into(),
            given: scenario.name().into(),
            known: known.iter().map(|known| known.name().to_owned()).collect(),
        }),
        Some(scenario) => Ok(scenario),
        None => {
            let subjects: Vec<Subject> = known.into_iter().map(Subject::of).collect();
            Ok(Subject::default_among(&subjects).map_or(Scenario::Noise, Subject::scenario))
        }
    }
}

/// The hashes of a folder's study, system and models.
fn basis(folder: &Folder, manifest: &Manifest) -> Result<EvidenceBasis, SafetyError> {
    let input = |name: &str| {
        let known = manifest.inputs.iter().find(|known| known.file == name);
        known.map_or_else(|| "none".into(), |known| known.sha256[..DIGITS].to_owned())
    };
    let mut models = String::new();
    for known in &manifest.outputs {
        if known.file.starts_with("records-") {
            models += &known.sha256;
        }
    }
    // A diagnoser may have been learned by a command that writes no manifest.
    for scenario in Scenario::ALL {
        let path = folder.diagnoser(scenario);
        if path.exists() {
            models += &sha256(&path)?;
        }
    }
    let model = match models.is_empty() {
        true => "none".into(),
        false => sha256_of_text(&models)[..DIGITS].to_owned(),
    };
    Ok(EvidenceBasis { system: input("system.toml"), study: input("study.toml"), model })
}
