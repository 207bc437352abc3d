//! The report: one HTML file that a reliability engineer reads, and its figures as files.
//!
//! The file needs no network and no script, prints on paper, and is readable without colour. A
//! section is one file in `sections/` and one line in [`CHAPTERS`]; a section that has nothing to say of
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
    /// Writes the section; nothing where there is nothing to say.
    fn write(&self, material: &Material, page: &mut Page);
}

/// Sections that answer the same question. The reader chooses among several; on paper all stand below each other.
pub struct Chapter {
    /// The anchor in the file.
    pub id: &'static str,
    /// The heading.
    pub title: &'static str,
    /// Whether it is evidence behind what the others say: it then stands in the appendix.
    pub is_appendix: bool,
    /// Its sections; the first is in front.
    pub sections: &'static [&'static dyn Section],
}

/// The chapters of the report, in their order. A new section is one file and one line here.
pub static CHAPTERS: &[Chapter] = &[
    Chapter {
        id: "findings",
        title: "Findings",
        is_appendix: false,
        sections: &[&sections::summary::Summary],
    },
    Chapter {
        id: "setup",
        title: "System, faults and commands",
        is_appendix: false,
        sections: &[
            &sections::faults::Faults,
            &sections::system::System,
            &sections::commands::Commands,
        ],
    },
    Chapter {
        id: "visible",
        title: "Which faults are detected",
        is_appendix: false,
        sections: &[&sections::detectability::Detectability],
    },
    Chapter {
        id: "errors",
        title: "What errors do",
        is_appendix: false,
        sections: &[&sections::safety::Safety, &sections::ambiguity::Ambiguity],
    },
    Chapter {
        id: "work",
        title: "Faults that begin at work",
        is_appendix: false,
        sections: &[&sections::flights::Flights, &sections::foreign::Foreign],
    },
    Chapter {
        id: "limits",
        title: "Bands and the twin behind them",
        is_appendix: true,
        sections: &[&sections::bands::Bands, &sections::twin::Twin],
    },
    Chapter {
        id: "decisions",
        title: "How the trees decide",
        is_appendix: true,
        sections: &[
            &sections::macrostructure::Macrostructure,
            &sections::actuator_tree::ActuatorTree,
            &sections::leaves::Leaves,
        ],
    },
    Chapter {
        id: "examples",
        title: "Examples",
        is_appendix: true,
        sections: &[&sections::residuals::Residuals],
    },
    Chapter {
        id: "rates",
        title: "Rates by scenario and protocol",
        is_appendix: true,
        sections: &[
            &sections::protocols::Protocols,
            &sections::committee::Committee,
            &sections::settings::Settings,
            &sections::robustness::Robustness,
            &sections::uncertainty::Uncertainty,
            &sections::confusion::Confusion,
            &sections::classifiers::Classifiers,
            &sections::ablation::Ablation,
            &sections::commands_curve::CommandsCurve,
        ],
    },
    Chapter {
        id: "origin",
        title: "The data and how it was made",
        is_appendix: true,
        sections: &[
            &sections::data_set::DataSet,
            &sections::exclusions::Exclusions,
            &sections::effort::Effort,
            &sections::making::Making,
        ],
    },
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
    let mut chapters = vec![];
    for chapter in CHAPTERS {
        let mut page = Page::default();
        page.section(chapter.id, chapter.title, |page| chapter.write(material, page));
        if !page.is_empty() {
            chapters.push((chapter, page));
        }
    }
    let mut page = Page::default();
    let entry = |(chapter, _): &(&Chapter, Page)| Entry {
        id: chapter.id.to_owned(),
        title: chapter.title.to_owned(),
        is_appendix: chapter.is_appendix,
    };
    let entries: Vec<Entry> = chapters.iter().map(entry).collect();
    overview::write(material, &mut page);
    page.contents(&entries);
    let mut in_appendix = false;
    for (chapter, written) in chapters {
        if chapter.is_appendix && !in_appendix {
            page.appendix();
            in_appendix = true;
        }
        page.append(written);
    }
    page.finish(&material.study.title)
}

impl Chapter {
    /// Writes its sections that have anything to say; the reader chooses among several.
    fn write(&self, material: &Material, page: &mut Page) {
        let written = self.sections.iter().map(|section| {
            let mut inner = Page::default();
            section.write(material, &mut inner);
            (section.id(), section.title(), inner)
        });
        let written: Vec<_> = written.filter(|(.., inner)| !inner.is_empty()).collect();
        page.choices(self.id, written);
    }
}
