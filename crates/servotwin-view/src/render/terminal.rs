//! Text for a terminal: the verdict first, then what fits on a screen.

use crate::document::{Block, Content, Document, Form, Table, Value};

/// The rows of a table that a terminal shows without `--details`.
const SHOWN_ROWS: usize = 10;

/// A document as lines. With `is_detailed` nothing is left out.
pub fn terminal(document: &Document, is_detailed: bool) -> String {
    let is_whole = is_detailed || document.form == Form::Listing;
    let mut text = String::new();
    if let Some(verdict) = &document.verdict {
        text += &format!("{}\n", verdict.line.text);
    }
    add(&mut text, document, is_whole);
    text
}

fn add(text: &mut String, document: &Document, is_whole: bool) {
    let shown = document.blocks.iter().filter(|block| is_whole || !block.is_detail);
    let mut is_below_table = false;
    for Block { content, .. } in shown {
        let own = match content {
            Content::Text(line) => format!("{}\n", line.text),
            Content::Note(line) => format!("note: {}\n", line.text),
            Content::Heading(heading) => format!("\n{heading}\n"),
            Content::Facts(facts) => named(facts.iter().map(|(_, name, v)| (&**name, v))),
            Content::List(lines) => lines.iter().map(|line| format!("  {}\n", line.text)).collect(),
            Content::Table(table) => grid(table, is_whole),
            Content::Files(paths) => paths.iter().map(|path| format!("{path}\n")).collect(),
            Content::Raw(raw) => raw.clone(),
            Content::Section(section) => {
                let mut own = String::new();
                add(&mut own, section, is_whole);
                match section.title.as_str() {
                    title if title.is_empty() || own.is_empty() => own,
                    title => format!("\n{title}\n{}", own.trim_start_matches('\n')),
                }
            }
            Content::Figure { .. } | Content::Data(_) => String::new(),
        };
        if is_below_table && !own.is_empty() && !own.starts_with('\n') {
            text.push('\n');
        }
        if !own.is_empty() {
            is_below_table = matches!(content, Content::Table(_));
        }
        *text += &own;
    }
}

/// Values behind their names, one in each line.
fn named<'v>(facts: impl Iterator<Item = (&'v str, &'v Value)>) -> String {
    let shown: Vec<(&str, &Value)> = facts.filter(|(name, _)| !name.is_empty()).collect();
    let width = shown.iter().map(|(name, _)| name.chars().count()).max().unwrap_or(0);
    let line = |(name, value): &(&str, &Value)| format!("{name:<width$}  {}\n", value.in_line());
    shown.iter().map(line).collect()
}

/// A table in columns, with an empty line and its caption before it.
fn grid(table: &Table, is_whole: bool) -> String {
    let shown = table.shown();
    if shown.is_empty() {
        return String::new();
    }
    let is_cut = !is_whole && table.rows.len() > SHOWN_ROWS + 1;
    let count = if is_cut { SHOWN_ROWS } else { table.rows.len() };
    let cells = shown.into_iter().map(|place| {
        let own = table.rows.iter().take(count).map(|(row, _)| row[place].in_line());
        let cells: Vec<String> =
            [table.columns[place].heading.to_string()].into_iter().chain(own).collect();
        let width = cells.iter().map(|cell| cell.chars().count()).max().unwrap_or(0);
        cells.into_iter().map(move |cell| match table.is_number(place) {
            true => format!("{cell:>width$}"),
            false => format!("{cell:<width$}"),
        })
    });
    let mut cells: Vec<_> = cells.collect();
    let caption = if table.caption.is_empty() { "" } else { "\n" };
    let mut text = format!("\n{}{caption}", table.caption);
    for _ in 0..=count {
        let row: Vec<String> = cells.iter_mut().filter_map(Iterator::next).collect();
        text += row.join("  ").trim_end();
        text.push('\n');
    }
    if is_cut {
        text += &format!("… and {} more: --details shows all\n", table.rows.len() - count);
    }
    text
}
