//! Markdown, as the pages of the book.

use crate::document::{Block, Content, Document, Table};

/// A document as a page of Markdown.
pub fn markdown(document: &Document) -> String {
    let mut page = String::new();
    if !document.title.is_empty() {
        page += &format!("# {}\n", document.title);
    }
    if let Some(verdict) = &document.verdict {
        page += &format!("\n**{}**\n", verdict.line.text);
    }
    add(&mut page, document, 2);
    page
}

fn add(page: &mut String, document: &Document, level: usize) {
    let mut is_in_paragraph = false;
    for Block { id, content, .. } in &document.blocks {
        let listed = |line: String| format!("- {line}\n");
        let own = match content {
            Content::Text(line) => format!("{}\n", line.text),
            Content::Note(line) => format!("> {}\n", line.text),
            Content::Heading(heading) => format!("**{heading}**\n"),
            Content::Facts(facts) => {
                let shown = facts.iter().filter(|(_, name, _)| !name.is_empty());
                shown
                    .map(|(_, name, value)| listed(format!("{name}: {}", value.in_line())))
                    .collect()
            }
            Content::List(lines) => lines.iter().map(|line| listed(line.text.clone())).collect(),
            Content::Table(own) => table(own),
            Content::Files(paths) => paths.iter().map(|path| listed(format!("`{path}`"))).collect(),
            Content::Figure { caption, .. } => format!("![{caption}](figures/{id}.svg)\n"),
            Content::Raw(text) => format!("```text\n{}\n```\n", text.trim_end()),
            Content::Section(section) => {
                let mut own = String::new();
                if !section.title.is_empty() {
                    own += &format!("{} {}\n", "#".repeat(level), section.title);
                }
                add(&mut own, section, level + 1);
                own
            }
            Content::Data(_) => String::new(),
        };
        let is_sentence = matches!(content, Content::Text(_));
        if !own.is_empty() {
            // A block that shows nothing leaves no blank line.
            if !(is_sentence && is_in_paragraph) {
                page.push('\n');
            }
            is_in_paragraph = is_sentence;
        }
        *page += &own;
    }
}

/// A table, with its caption before it.
fn table(table: &Table) -> String {
    let shown = table.shown();
    if shown.is_empty() {
        return String::new();
    }
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let cell = |text: String| text.replace('|', "\\|");
    let mut text = String::new();
    if !table.caption.is_empty() {
        text += &format!("**{}**\n\n", table.caption);
    }
    let heads = shown.iter().map(|&k| cell(table.columns[k].heading.trim().into()));
    text += &line(heads.collect());
    text += &format!("|{}\n", "---|".repeat(shown.len()));
    for (row, _) in &table.rows {
        text += &line(shown.iter().map(|&k| cell(row[k].in_line())).collect());
    }
    text
}
