//! The report: one HTML file that a reliability engineer reads, and its figures as files.
//!
//! The file needs no network and no script, prints on paper, and is readable without colour. A
//! section is one file in `sections/` and one line in [`ALL`]; a section that has nothing to say of
//! a study (no third sensor, no realistic setting) is left out. The same material gives the same
//! bytes.

pub mod examples;
pub mod lines;
pub mod page;
pub mod schematic;
mod sections;
mod stages;
pub mod table;
pub mod table_model;
pub mod words;

use crate::figure::Figure;
use crate::flight::band::BandMerit;
use crate::job::flights::FlightResults;
use crate::job::manifest::Manifest;
use crate::job::results::SubjectResult;
use crate::job::{Results, Subject};
use crate::study::Study;
use crate::study::campaign::Comparison;
use examples::Example;
use page::Page;
use servotwin_diagnosis::hierarchy::Hierarchy;

/// What a report is made of.
pub struct Material<'a> {
    /// The study.
    pub study: &'a Study,
    /// What was measured.
    pub results: &'a Results,
    /// The hierarchy of each subject.
    pub hierarchies: &'a [(Subject, Hierarchy)],
    /// What was measured in flights, where the study has any.
    pub flights: Option<&'a FlightResults>,
    /// The confidence bands that were learned.
    pub bands: &'a [BandMerit],
    /// True and fitted parameters of the pool of the fitted setting.
    pub calibrations: &'a [Comparison],
    /// Faults simulated as examples.
    pub examples: &'a [Example],
    /// Where everything comes from.
    pub manifest: &'a Manifest,
}

/// One section of the report.
pub trait Section: Sync {
    /// The anchor in the file.
    fn id(&self) -> &'static str;
    /// The heading.
    fn title(&self) -> &'static str;
    /// Writes the section; nothing where there is nothing to say.
    fn write(&self, material: &Material, page: &mut Page);
}

/// Every section, in the order of the report.
pub static ALL: &[&dyn Section] = &[
    &sections::summary::Summary,
    &sections::system::System,
    &sections::faults::Faults,
    &sections::commands::Commands,
    &sections::commands_curve::CommandsCurve,
    &sections::residuals::Residuals,
    &sections::detectability::Detectability,
    &sections::bands::Bands,
    &sections::twin::Twin,
    &sections::actuator_tree::ActuatorTree,
    &sections::macrostructure::Macrostructure,
    &sections::protocols::Protocols,
    &sections::safety::Safety,
    &sections::committee::Committee,
    &sections::flights::Flights,
    &sections::foreign::Foreign,
    &sections::robustness::Robustness,
    &sections::uncertainty::Uncertainty,
    &sections::confusion::Confusion,
    &sections::classifiers::Classifiers,
    &sections::ablation::Ablation,
    &sections::ambiguity::Ambiguity,
    &sections::leaves::Leaves,
    &sections::settings::Settings,
    &sections::exclusions::Exclusions,
    &sections::making::Making,
];

impl Material<'_> {
    /// The subject whose trees are drawn: those that learned with noise, because trees that never
    /// saw any ask for what no sensor shows. Without a setting of noise, the first.
    pub fn main(&self) -> Option<&SubjectResult> {
        self.results.of(Subject::Noise).or(self.results.subjects.first())
    }

    /// The hierarchy of a subject.
    pub fn hierarchy(&self, subject: Subject) -> Option<&Hierarchy> {
        self.hierarchies.iter().find(|(own, _)| *own == subject).map(|(_, hierarchy)| hierarchy)
    }
}

/// The report as HTML, and its figures with the names of their files.
pub fn render(material: &Material) -> (String, Vec<(String, Figure)>) {
    let mut sections = vec![];
    for section in ALL {
        let mut page = Page::default();
        page.section(section.id(), section.title(), |page| section.write(material, page));
        if !page.is_empty() {
            sections.push((section, page));
        }
    }
    let mut page = Page::default();
    let entries = sections.iter().map(|(s, _)| (s.id().to_owned(), s.title().to_owned()));
    let entries: Vec<(String, String)> = entries.collect();
    // What was found stands before where to look.
    for (place, (_, section)) in sections.into_iter().enumerate() {
        page.append(section);
        if place == 0 {
            page.contents(&entries);
        }
    }
    page.finish(&material.study.title)
}
