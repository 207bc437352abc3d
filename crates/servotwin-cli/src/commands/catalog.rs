//! `servotwin catalog`: shows the catalog.

use crate::failure::Failure;
use crate::{Global, Run};
use servotwin::catalogue::{self, Hit, default, flow, law, prose, range};
use servotwin::nearest::nearest;
use servotwin::toml_text::counted;
use servotwin_model::component::Component;
use servotwin_model::spec::PortKind;
use servotwin_view::document::{Content, Document, Table, Value};
use servotwin_view::row;

/// List the components of the catalog, describe one, or search them.
///
/// Without a word, lists all kinds. For a kind, shows its equations, its ports, its parameters with their ranges, and
/// its faults with their laws. Any other word is searched for in all of these.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// A kind of component, or a word to search for.
    #[arg(value_name = "KIND|WORD")]
    word: Option<String>,
    /// Write Markdown pages, as in the book.
    #[arg(long, conflicts_with = "json")]
    markdown: bool,
}

impl Run for Options {
    fn run(&self, _: Global) -> Result<Document, Failure> {
        let Some(word) = self.word.as_deref() else {
            return Ok(if self.markdown { Document::raw(catalogue::book()) } else { list() });
        };
        if let Some(spec) = catalogue::find(word) {
            return Ok(if self.markdown {
                Document::raw(catalogue::markdown(spec))
            } else {
                component(spec)
            });
        }
        let (hits, fluids) = (catalogue::search(word), fluids(word));
        if hits.is_empty() && fluids.is_empty() {
            return Err(unknown(word));
        }
        if self.markdown {
            let pages = hits.iter().map(|hit| catalogue::markdown(hit.spec));
            return Ok(Document::raw(pages.collect::<Vec<_>>().join("\n")));
        }
        Ok(found(word, &hits, fluids))
    }
}

fn unknown(word: &str) -> Failure {
    let kinds = || catalogue::all().map(|spec| spec.kind);
    // Suggest a whole kind before a word within one.
    let words = || kinds().flat_map(|kind| kind.split('_'));
    let hint = match nearest(word, kinds()).or_else(|| nearest(word, words())) {
        Some(name) => format!("did you mean '{name}'?"),
        None => "'servotwin catalog' lists all".into(),
    };
    Failure::usage(format!("no component has '{word}'; {hint}"))
}

fn list() -> Document {
    let mut table = Table::of("kind | parameters | faults | summary:description");
    for spec in catalogue::all() {
        table.push(row![spec.kind, spec.parameters.len(), spec.faults.len(), spec.summary]);
    }
    let verdict = format!("{} kinds; 'servotwin catalog KIND' describes one", table.rows.len());
    let mut document = Document::listing("catalog", verdict);
    document.table("components", table);
    document.table("fluids", fluids(""));
    document
}

/// The fluids whose description contains a word.
fn fluids(word: &str) -> Table {
    let word = word.to_lowercase();
    let has = |row: &[String; 6]| row.iter().any(|cell| cell.to_lowercase().contains(&word));
    let mut table = Table::new(catalogue::FLUID_HEADS.map(|head| (head.replace(' ', "_"), head)));
    catalogue::fluids().into_iter().filter(has).for_each(|row| table.push(row));
    table
}

/// What has a word. A kind of fluid is described by its keys.
fn found(word: &str, hits: &[Hit], fluids: Table) -> Document {
    let mut document = Document::listing(
        "catalog",
        format!(
            "'{word}' stands in {} and {}.",
            counted(hits.len(), "component"),
            counted(fluids.rows.len(), "fluid")
        ),
    );
    document.table("fluids", fluids);
    let keys = catalogue::fluid_keys(word);
    if !keys.is_empty() {
        for (title, keys) in keys {
            let mut table = Table::of("name:key | range | summary:meaning");
            for key in keys {
                table.push(row![key.name, key.value.words(), key.summary]);
            }
            document.table(title, table.captioned(format!("{title}:")));
        }
        return document;
    }
    for hit in hits {
        let title = format!("{}: {}", hit.spec.kind, hit.spec.summary);
        let mut section = Document::section(hit.spec.kind, title);
        section.list("lines", hit.lines.iter().cloned());
        document.add(section);
    }
    document
}

fn component(spec: &Component) -> Document {
    let mut document = Document::listing("catalog", format!("{}: {}", spec.kind, spec.summary));
    document.fact("kind", "", spec.kind);
    document.fact("summary", "", spec.summary);
    document.fact("states", "", Value::list(spec.states.iter().map(|state| state.name)));
    document
        .push("description", Content::Text(format!("\n{}", prose(spec.kind).trim_end()).into()));
    document.table("ports", ports(spec));
    let mut parameters = Table::of(
        "name:parameter | unit: | default | :shown as | range: | :range | summary:meaning",
    );
    for p in spec.parameters {
        let shown = p.default.map_or_else(|| "".into(), |value| Value::mixed(value, p.unit));
        parameters.push(row![
            p.name,
            p.unit.symbol(),
            Value::of(default(p), &p.default),
            shown,
            Value::of("", &[p.min, p.max]),
            range(p),
            p.summary,
        ]);
    }
    document.table("parameters", parameters);
    let mut faults = Table::of(
        "name:fault | category | parameter: | law:parameter at intensity i | full: | range: | summary:meaning",
    );
    for f in spec.faults {
        faults.push(row![
            f.name,
            f.category.name(),
            f.parameter,
            law(f, spec),
            Value::of("", &f.full),
            Value::of("", &[f.full_min, f.full_max]),
            f.summary,
        ]);
    }
    document.table("faults", faults);
    document
}

fn ports(spec: &Component) -> Table {
    let mut table = Table::of(
        "name:port | :type | family: | sets: | unit: | range: | optional: | summary:meaning",
    );
    for port in spec.ports {
        let unit = match port.kind {
            PortKind::SignalIn { unit, .. } | PortKind::SignalOut { unit } => Some(unit.symbol()),
            _ => None,
        };
        table.push(row![
            port.name,
            flow(port, spec),
            port.kind.family(),
            port.kind.sets(),
            unit,
            Value::of("", &spec.input_range(port)),
            port.optional,
            port.summary,
        ]);
    }
    table
}
