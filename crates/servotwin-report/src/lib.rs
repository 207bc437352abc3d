//! The report: one HTML file that a reliability engineer reads, and its figures as files.
//!
//! The file needs no network and no script, prints on paper, and is readable without colour. A
//! section is one file in `sections/` and one line in [`ALL`]; a section that has nothing to say of
//! a study (no third sensor, no realistic setting) is left out. What is acted on comes first, what it
//! rests on stands behind it as an appendix. The same material gives the same bytes.

pub mod examples;
pub mod excerpt;
pub mod explain;
pub mod lines;
mod looks;
pub mod measured;
mod overview;
pub mod page;
pub mod schematic;
mod sections;
mod stages;
pub mod table;
pub mod table_model;
pub mod vocabulary;
pub mod words;
mod write;

use examples::Example;
use excerpt::Excerpt;
use looks::Looks;
use page::{Entry, Page};
use servotwin::campaign::Comparison;
use servotwin::flight::band::BandMerit;
use servotwin::job::flights::FlightResults;
use servotwin::job::manifest::Manifest;
use servotwin::job::results::SubjectResult;
use servotwin::job::{Results, Subject};
use servotwin::study::{Setting, Study};
use servotwin_diagnosis::hierarchy::Hierarchy;
use servotwin_plot::Figure;
use vocabulary::Vocabulary;
pub use write::write;

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
    /// Some rows and columns of the data set whose trees are drawn, and its setting.
    pub excerpt: Option<(Setting, &'a Excerpt)>,
    /// Where everything comes from.
    pub manifest: &'a Manifest,
}

/// One section of the report.
pub trait Section: Sync {
    /// The anchor in the file.
    fn id(&self) -> &'static str;
    /// The heading.
    fn title(&self) -> &'static str;
    /// Whether it is evidence behind what the others say: it then stands in the appendix.
    fn is_appendix(&self) -> bool {
        false
    }
    /// Writes the section; nothing where there is nothing to say.
    fn write(&self, material: &Material, page: &mut Page);
}

/// Every section, in the order of the report; those of the appendix follow the others.
pub static ALL: &[&dyn Section] = &[
    &sections::summary::Summary,
    &sections::system::System,
    &sections::faults::Faults,
    &sections::commands::Commands,
    &sections::detectability::Detectability,
    &sections::safety::Safety,
    &sections::ambiguity::Ambiguity,
    &sections::flights::Flights,
    &sections::foreign::Foreign,
    &sections::settings::Settings,
    &sections::bands::Bands,
    &sections::twin::Twin,
    &sections::actuator_tree::ActuatorTree,
    &sections::macrostructure::Macrostructure,
    &sections::residuals::Residuals,
    &sections::commands_curve::CommandsCurve,
    &sections::protocols::Protocols,
    &sections::committee::Committee,
    &sections::robustness::Robustness,
    &sections::uncertainty::Uncertainty,
    &sections::confusion::Confusion,
    &sections::classifiers::Classifiers,
    &sections::ablation::Ablation,
    &sections::leaves::Leaves,
    &sections::data_set::DataSet,
    &sections::exclusions::Exclusions,
    &sections::effort::Effort,
    &sections::making::Making,
];

/// The subject whose trees are drawn: those that learned with noise, because trees that never saw any ask for
/// what no sensor shows. Without a setting of noise, the first.
pub(crate) fn main_of(results: &Results) -> Option<&SubjectResult> {
    results.of(Subject::Noise).or(results.subjects.first())
}

impl Material<'_> {
    /// What things are called.
    pub fn words(&self) -> Vocabulary {
        Vocabulary::of(self.study)
    }

    /// What looks how in figures.
    fn looks(&self) -> Looks {
        Looks::of(self.study)
    }

    /// The subject whose trees are drawn.
    pub fn main(&self) -> Option<&SubjectResult> {
        main_of(self.results)
    }

    /// The hierarchy of a subject.
    pub fn hierarchy(&self, subject: Subject) -> Option<&Hierarchy> {
        self.hierarchies.iter().find(|(own, _)| *own == subject).map(|(_, hierarchy)| hierarchy)
    }
}

/// Shows the hardest of some settings, the last, and the others where somebody asks.
fn hardest_first(
    results: &[&SubjectResult],
    page: &mut Page,
    show: &dyn Fn(&SubjectResult, &mut Page),
) {
    let Some((hardest, others)) = results.split_last() else { return };
    show(hardest, page);
    for result in others {
        page.folded(&format!("Setting: {}", result.title), |page| show(result, page));
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
    // Stable: within both parts the order stays.
    sections.sort_by_key(|(section, _)| section.is_appendix());
    let mut page = Page::default();
    let entry = |(section, _): &(&&dyn Section, Page)| Entry {
        id: section.id().to_owned(),
        title: section.title().to_owned(),
        is_appendix: section.is_appendix(),
    };
    let entries: Vec<Entry> = sections.iter().map(entry).collect();
    let mut in_appendix = false;
    overview::write(material, &mut page);
    page.contents(&entries);
    for (section, written) in sections {
        if section.is_appendix() && !in_appendix {
            page.appendix();
            in_appendix = true;
        }
        page.append(written);
    }
    page.finish(&material.study.title)
}
