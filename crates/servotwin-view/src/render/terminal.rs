//! Text for a terminal: the verdict first, then what fits on a screen.

use crate::document::{Block, Content, Document, Form, Table, Value};
use comfy_table::{CellAlignment, ContentArrangement};

/// The rows of a table that a terminal shows without `--details`.
const SHOWN_ROWS: usize = 10;

/// What is shown, and the columns of the terminal, if it is one.
#[derive(Clone, Copy)]
struct Screen {
    is_whole: bool,
    width: Option<u16>,
}

/// A document as lines for a terminal with `width` columns; `None` for a file or a pipe, whose lines are never wrapped.
/// With `is_detailed` nothing is left out.
pub fn terminal(document: &Document, is_detailed: bool, width: Option<u16>) -> String {
    let screen = Screen { is_whole: is_detailed || document.form == Form::Listing, width };
    let mut text = String::new();
    if let Some(verdict) = &document.verdict {
        text += &format!("{}\n", verdict.line.text);
    }
    add(&mut text, document, screen);
    text
}

fn add(text: &mut String, document: &Document, screen: Screen) {
    let shown = document.blocks.iter().filter(|block| screen.is_whole || !block.is_detail);
    let mut is_below_table = false;
    for Block { content, .. } in shown {
        let own = match content {
            Content::Text(line) => format!("{}\n", line.text),
            Content::Note(line) => format!("note: {}\n", line.text),
            Content::Heading(heading) => format!("\n{heading}\n"),
            Content::Facts(facts) => named(facts.iter().map(|(_, name, v)| (&**name, v))),
            Content::List(lines) => lines.iter().map(|line| format!("  {}\n", line.text)).collect(),
            Content::Table(table) => grid(table, screen),
            Content::Files(paths) => paths.iter().map(|path| format!("{path}\n")).collect(),
            Content::Raw(raw) => raw.clone(),
            Content::Section(section) => {
                let mut own = String::new();
                add(&mut own, section, screen);
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

/// A table in columns, with an empty line and its caption before it. Cells of a table that is wider than the terminal are
/// wrapped.
fn grid(table: &Table, Screen { is_whole, width }: Screen) -> String {
    let shown = table.aligned();
    if shown.is_empty() {
        return String::new();
    }
    let is_cut = !is_whole && table.rows.len() > SHOWN_ROWS + 1;
    let count = if is_cut { SHOWN_ROWS } else { table.rows.len() };
    let mut grid = comfy_table::Table::new();
    grid.load_style(comfy_table::presets::NOTHING);
    grid.set_header(shown.iter().map(|(k, _)| table.columns[*k].heading.to_string()));
    for (row, _) in &table.rows[..count] {
        grid.add_row(shown.iter().map(|(k, _)| row[*k].in_line()));
    }
    for (column, (_, is_number)) in grid.column_iter_mut().zip(&shown) {
        let alignment = if *is_number { CellAlignment::Right } else { CellAlignment::Left };
        column.set_padding((0, 2)).set_cell_alignment(alignment);
    }
    if let Some(width) = width {
        grid.set_content_arrangement(ContentArrangement::Dynamic).set_width(width);
    }
    let caption = if table.caption.is_empty() { "" } else { "\n" };
    let mut text = format!("\n{}{caption}{}\n", table.caption, grid.trim_fmt());
    if is_cut {
        text += &format!("… and {} more: --details shows all\n", table.rows.len() - count);
    }
    text
}
