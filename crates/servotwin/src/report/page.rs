//! The HTML that a report is written in: headings, paragraphs, tables and figures, all escaped.

use crate::figure::Figure;
use std::fmt::Write;

/// A page being written, with the figures in it.
#[derive(Debug, Default)]
pub struct Page {
    html: String,
    figures: Vec<(String, Figure)>,
}

/// Where the texts of a column stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Side {
    /// Words.
    Left,
    /// Numbers.
    Right,
}

/// A table of texts.
#[derive(Debug, Clone)]
pub struct Grid {
    heads: Vec<(String, Side)>,
    rows: Vec<(Vec<String>, bool)>,
}

impl Grid {
    /// A table without rows.
    pub fn new<H: Into<String>>(heads: impl IntoIterator<Item = (H, Side)>) -> Self {
        let heads = heads.into_iter().map(|(head, side)| (head.into(), side));
        Grid { heads: heads.collect(), rows: vec![] }
    }

    /// Adds a row, one text for each column.
    pub fn push(&mut self, row: Vec<String>) {
        self.rows.push((row, false));
    }

    /// Adds a row that stands out: a sum, or what is most important.
    pub fn push_strong(&mut self, row: Vec<String>) {
        self.rows.push((row, true));
    }

    /// Whether there is no row.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl Page {
    /// Begins a section; nothing is written of one that turns out empty.
    pub fn section(&mut self, id: &str, title: &str, write: impl FnOnce(&mut Page)) {
        let mut inner = Page::default();
        write(&mut inner);
        if inner.is_empty() {
            return;
        }
        let (id, title) = (escaped(id), escaped(title));
        let _ = write!(self.html, "<section id=\"{id}\">\n<h2>{title}</h2>\n");
        self.append(inner);
        self.html += "</section>\n";
    }

    /// Whether nothing was written.
    pub fn is_empty(&self) -> bool {
        self.html.is_empty()
    }

    /// Another page below this one.
    pub fn append(&mut self, other: Page) {
        self.html += &other.html;
        self.figures.extend(other.figures);
    }

    /// A heading inside a section.
    pub fn heading(&mut self, text: &str) {
        let _ = writeln!(self.html, "<h3>{}</h3>", escaped(text));
    }

    /// A paragraph.
    pub fn text(&mut self, text: &str) {
        let _ = writeln!(self.html, "<p>{}</p>", escaped(text));
    }

    /// A remark in small print.
    pub fn note(&mut self, text: &str) {
        let _ = writeln!(self.html, "<p class=\"note\">{}</p>", escaped(text));
    }

    /// A list of findings: what each is about, and what was found.
    pub fn findings(&mut self, findings: &[(String, String)]) {
        self.html += "<ul class=\"findings\">\n";
        for (about, text) in findings {
            let (about, text) = (escaped(about), escaped(text));
            let _ = writeln!(self.html, "<li><b>{about}.</b> {text}</li>");
        }
        self.html += "</ul>\n";
    }

    /// A list of links to sections: (id, title).
    pub fn contents(&mut self, entries: &[(String, String)]) {
        self.html += "<nav><ul>\n";
        for (id, title) in entries {
            let (id, title) = (escaped(id), escaped(title));
            let _ = writeln!(self.html, "<li><a href=\"#{id}\">{title}</a></li>");
        }
        self.html += "</ul></nav>\n";
    }

    /// A figure with one sentence of what it shows, which readers that do not see it get, too.
    /// `name` is that of its own file.
    pub fn figure(&mut self, name: &str, figure: Figure, caption: &str) {
        let alt = escaped(caption);
        let head = format!("<svg role=\"img\" aria-label=\"{alt}\" ");
        let svg = figure.svg.replacen("<svg ", &head, 1);
        let name_text = escaped(name);
        let _ = write!(
            self.html,
            "<figure id=\"figure-{name_text}\">\n<div class=\"drawing\">{}</div>\n\
             <figcaption>{alt}</figcaption>\n</figure>\n",
            svg.trim_end()
        );
        self.figures.push((name.to_owned(), figure));
    }

    /// Figures side by side, as many as fit.
    pub fn beside(&mut self, write: impl FnOnce(&mut Page)) {
        let mut inner = Page::default();
        write(&mut inner);
        self.html += "<div class=\"beside\">\n";
        self.append(inner);
        self.html += "</div>\n";
    }

    /// A table with one sentence of what it shows; a line feed in a cell begins a new line, in small
    /// type.
    pub fn table(&mut self, grid: &Grid, caption: &str) {
        let class = |side: Side| if side == Side::Right { " class=\"number\"" } else { "" };
        let wide = if grid.heads.len() >= WIDE { " class=\"wide\"" } else { "" };
        let _ = writeln!(self.html, "<div class=\"sheet\"><table{wide}>");
        let _ = writeln!(self.html, "<caption>{}</caption>", escaped(caption));
        self.html += "<thead><tr>";
        for (head, side) in &grid.heads {
            let _ = write!(self.html, "<th scope=\"col\"{}>{}</th>", class(*side), escaped(head));
        }
        self.html += "</tr></thead>\n<tbody>\n";
        for (row, strong) in &grid.rows {
            self.html += if *strong { "<tr class=\"strong\">" } else { "<tr>" };
            for (cell, (_, side)) in row.iter().zip(&grid.heads) {
                let text = escaped(cell);
                let (text, below) = match text.split_once('\n') {
                    Some((text, below)) => {
                        (text, format!("<br><small>{}</small>", below.replace('\n', "<br>")))
                    }
                    None => (&*text, String::new()),
                };
                let _ = write!(self.html, "<td{}>{text}{below}</td>", class(*side));
            }
            self.html += "</tr>\n";
        }
        self.html += "</tbody></table></div>\n";
    }

    /// The finished document and the figures in it, with the names of their files.
    pub fn finish(self, title: &str) -> (String, Vec<(String, Figure)>) {
        let html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{0}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
             <h1>{0}</h1>\n{1}</main>\n</body>\n</html>\n",
            escaped(title),
            self.html
        );
        (html, self.figures)
    }
}

/// Text as HTML.
pub(crate) fn escaped(text: &str) -> String {
    let mut html = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => html += "&amp;",
            '<' => html += "&lt;",
            '>' => html += "&gt;",
            '"' => html += "&quot;",
            other => html.push(other),
        }
    }
    html
}

/// A table with so many columns is set in smaller type.
const WIDE: usize = 8;

const STYLE: &str = include_str!("style.css");

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_escaped_and_empty_sections_left_out() {
        let mut page = Page::default();
        page.section("a", "A & B", |page| page.text("p < 3 \"bar\""));
        page.section("b", "empty", |_| ());
        let (html, figures) = page.finish("<title>");
        assert!(html.contains("<h2>A &amp; B</h2>\n<p>p &lt; 3 &quot;bar&quot;</p>"));
        assert!(!html.contains("empty") && html.contains("<h1>&lt;title&gt;</h1>"));
        assert!(figures.is_empty());
    }
}
