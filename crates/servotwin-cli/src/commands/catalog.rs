//! `servotwin catalog`: shows the catalog.

use crate::Global;
use crate::failure::Failure;
use crate::render::{Side, TextTable, json, shown};
use serde_json::{Value, json};
use servotwin::catalogue::{self, Hit, default, flow, law, prose, range};
use servotwin::document::counted;
use servotwin::nearest::nearest;
use servotwin_model::component::Component;
use servotwin_model::spec::PortKind;

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

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let word = options.word.as_deref();
    let chosen = word.and_then(catalogue::find);
    if let (Some(word), None) = (word, chosen) {
        let hits = catalogue::search(word);
        let fluids = fluids(word);
        if hits.is_empty() && fluids.is_empty() {
            return Err(unknown(word));
        }
        return Ok(match options.markdown || global.json {
            true => whole(hits.iter().map(|hit| hit.spec), global),
            false if catalogue::is_fluid(word) => fluid(word, &fluids, hits.len()),
            false => hits.iter().map(found).collect::<String>() + &fluids,
        });
    }
    Ok(match chosen {
        Some(spec) if options.markdown => catalogue::markdown(spec),
        Some(spec) if global.json => json(&as_json(spec)),
        Some(spec) => people(spec),
        None if options.markdown => catalogue::book(),
        None if global.json => whole(catalogue::all(), global),
        None => list(),
    })
}

fn unknown(word: &str) -> Failure {
    let kinds = || catalogue::all().map(|spec| spec.kind);
    // Suggest a whole kind before a word within one.
    let words = || kinds().flat_map(|kind| kind.split('_'));
    let hint = nearest(word, kinds()).or_else(|| nearest(word, words())).map(str::to_owned);
    Failure::NoComponent { word: word.into(), nearest: hint }
}

/// Writes several components as JSON or Markdown.
fn whole(specs: impl Iterator<Item = &'static Component>, global: Global) -> String {
    match global.json {
        true => json(&specs.map(as_json).collect()),
        false => specs.map(catalogue::markdown).collect::<Vec<_>>().join("\n"),
    }
}

fn list() -> String {
    let mut grid = TextTable::new(&[
        ("kind", Side::Left),
        ("parameters", Side::Right),
        ("faults", Side::Right),
        ("description", Side::Left),
    ]);
    let mut kinds = 0;
    for spec in catalogue::all() {
        let numbers = [spec.parameters.len(), spec.faults.len()].map(|n| n.to_string());
        let [parameters, faults] = numbers;
        grid.push(vec![spec.kind.into(), parameters, faults, spec.summary.into()]);
        kinds += 1;
    }
    let kinds = format!("{kinds} kinds; 'servotwin catalog KIND' describes one");
    format!("{}\n{kinds}\n\n{}", grid.text(), fluids(""))
}

/// A table of the fluids whose description contains a word; empty if there are none.
fn fluids(word: &str) -> String {
    let word = word.to_lowercase();
    let has = |row: &[String; 6]| row.iter().any(|cell| cell.to_lowercase().contains(&word));
    let mut grid = TextTable::new(&catalogue::FLUID_HEADS.map(|head| (head, Side::Left)));
    let rows: Vec<_> = catalogue::fluids().into_iter().filter(has).collect();
    if rows.is_empty() {
        return String::new();
    }
    rows.into_iter().for_each(|row| grid.push(row.into()));
    grid.text()
}

/// Describes a kind of fluid with its keys, and counts the components that also contain the word.
fn fluid(kind: &str, row: &str, hits: usize) -> String {
    let mut text = row.to_owned();
    for (title, keys) in catalogue::fluid_keys(kind) {
        let heads = ["key", "default", "range", "meaning"].map(|head| (head, Side::Left));
        let mut grid = TextTable::new(&heads);
        for key in keys {
            grid.push(vec![key.name.into(), default(key), range(key), key.summary.into()]);
        }
        text += &format!("\n{title}:\n{}", grid.text());
    }
    match hits {
        0 => text,
        _ => text + &format!("\nThe word also stands in {}.\n", counted(hits, "component")),
    }
}

fn found(hit: &Hit) -> String {
    let lines: String = hit.lines.iter().map(|line| format!("    {line}\n")).collect();
    format!("{}: {}\n{lines}", hit.spec.kind, hit.spec.summary)
}

fn people(spec: &Component) -> String {
    let mut text = format!("{}: {}\n\n{}\n", spec.kind, spec.summary, prose(spec.kind).trim_end());
    let mut ports =
        TextTable::new(&[("port", Side::Left), ("type", Side::Left), ("meaning", Side::Left)]);
    for port in spec.ports {
        ports.push(vec![port.name.into(), flow(port, spec), port.summary.into()]);
    }
    text += &format!("\n{}", ports.text());
    if !spec.parameters.is_empty() {
        let mut grid = TextTable::new(&[
            ("parameter", Side::Left),
            ("default", Side::Right),
            ("shown as", Side::Right),
            ("range", Side::Left),
            ("meaning", Side::Left),
        ]);
        for p in spec.parameters {
            let value = p.default.map_or(String::new(), |value| shown(value, p.unit));
            grid.push(vec![p.name.into(), default(p), value, range(p), p.summary.into()]);
        }
        text += &format!("\n{}", grid.text());
    }
    if !spec.faults.is_empty() {
        let mut grid = TextTable::new(&[
            ("fault", Side::Left),
            ("category", Side::Left),
            ("parameter at intensity i", Side::Left),
            ("meaning", Side::Left),
        ]);
        for f in spec.faults {
            let category = f.category.name().into();
            grid.push(vec![f.name.into(), category, law(f, spec), f.summary.into()]);
        }
        text += &format!("\n{}", grid.text());
    }
    text
}

fn as_json(spec: &Component) -> Value {
    let ports = spec.ports.iter().map(|port| {
        let unit = match port.kind {
            PortKind::SignalIn { unit, .. } | PortKind::SignalOut { unit } => Some(unit.symbol()),
            _ => None,
        };
        json!({
            "name": port.name, "family": port.kind.family(), "sets": port.kind.sets(),
            "unit": unit, "range": spec.input_range(port), "optional": port.optional,
            "summary": port.summary,
        })
    });
    let parameters = spec.parameters.iter().map(|p| {
        json!({
            "name": p.name, "unit": p.unit.symbol(), "default": p.default,
            "range": [p.min, p.max], "summary": p.summary,
        })
    });
    let faults = spec.faults.iter().map(|f| {
        json!({
            "name": f.name, "category": f.category.name(), "parameter": f.parameter,
            "law": law(f, spec), "full": f.full, "range": [f.full_min, f.full_max],
            "summary": f.summary,
        })
    });
    json!({
        "kind": spec.kind, "summary": spec.summary, "description": prose(spec.kind),
        "ports": ports.collect::<Vec<_>>(), "parameters": parameters.collect::<Vec<_>>(),
        "faults": faults.collect::<Vec<_>>(),
        "states": spec.states.iter().map(|s| s.name).collect::<Vec<_>>(),
    })
}
