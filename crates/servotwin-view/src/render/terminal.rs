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
    for Block { content, is_detail, .. } in &document.blocks {
        if *is_detail && !is_whole {
            continue;
        }
        match content {
            Content::Text(line) => *text += &format!("{}\n", line.text),
            Content::Note(line) => *text += &format!("note: {}\n", line.text),
            Content::Heading(heading) => *text += &format!("\n{heading}\n"),
            Content::Facts(facts) => *text += &named(facts.iter().map(|(_, name, v)| (&**name, v))),
            Content::List(lines) => {
                lines.iter().for_each(|line| *text += &format!("  {}\n", line.text));
            }
            Content::Table(table) => *text += &grid(table, is_whole),
            Content::Files(paths) => paths.iter().for_each(|path| *text += &format!("{path}\n")),
            Content::Raw(raw) => *text += raw,
            Content::Section(section) => {
                let mut own = String::new();
                add(&mut own, section, is_whole);
                if !own.is_empty() && !section.title.is_empty() {
                    *text += &format!("\n{}\n", section.title);
                }
                *text += own.trim_start_matches('\n');
            }
            Content::Figure { .. } | Content::Data(_) => {}
        }
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
    if table.is_empty() {
        return String::new();
    }
    let is_cut = !is_whole && table.rows.len() > SHOWN_ROWS + 1;
    let count = if is_cut { SHOWN_ROWS } else { table.rows.len() };
    let columns = table.columns.iter().enumerate().filter(|(_, own)| !own.heading.is_empty());
    let cells = columns.map(|(place, column)| {
        let own = table.rows.iter().take(count).map(|(row, _)| row[place].in_line());
        let cells: Vec<String> = [column.heading.to_string()].into_iter().chain(own).collect();
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
