//! The HTML of a report: headings, paragraphs, tables and figures, all escaped.

use servotwin::evaluation::metrics::Rate;
use servotwin_io::text::escaped;
use servotwin_view::{Figure, dark_rules};
use std::fmt::Write;

/// A page being written, with the figures in it.
#[derive(Debug, Default)]
pub struct Page {
    html: String,
    figures: Vec<(String, Figure)>,
}

/// A section in the table of contents.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct ContentsEntry {
    /// The anchor of the section.
    pub id: String,
    /// The heading of the section.
    pub title: String,
    /// Whether the section is in the appendix.
    pub is_appendix: bool,
}

/// The alignment of a column.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Alignment {
    /// For words.
    Left,
    /// For numbers.
    Right,
}

/// A table of text cells.
#[derive(Debug, Clone)]
pub(crate) struct HtmlTable {
    heads: Vec<(String, Alignment)>,
    rows: Vec<(Vec<String>, bool)>,
}

impl HtmlTable {
    /// A table without rows.
    pub(crate) fn new<H: Into<String>>(heads: impl IntoIterator<Item = (H, Alignment)>) -> Self {
        let heads = heads.into_iter().map(|(head, side)| (head.into(), side));
        HtmlTable { heads: heads.collect(), rows: vec![] }
    }

    /// Adds a row, one text for each column.
    pub(crate) fn push(&mut self, row: Vec<String>) {
        self.rows.push((row, false));
    }

    /// Adds an emphasized row: a sum, or the most important result.
    pub(crate) fn push_strong(&mut self, row: Vec<String>) {
        self.rows.push((row, true));
    }

    /// Whether the table has no rows.
    pub(crate) fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }
}

impl Page {
    /// Adds a section. An empty one is dropped.
    pub(crate) fn section(&mut self, id: &str, title: &str, write: impl FnOnce(&mut Page)) {
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

    /// Whether the page has no content.
    pub(crate) fn is_empty(&self) -> bool {
        self.html.is_empty()
    }

    /// Appends another page.
    pub(crate) fn append(&mut self, other: Page) {
        self.html += &other.html;
        self.figures.extend(other.figures);
    }

    /// Adds a heading inside a section.
    pub(crate) fn heading(&mut self, text: &str) {
        let _ = writeln!(self.html, "<h3>{}</h3>", escaped(text));
    }

    /// Adds a paragraph.
    pub(crate) fn text(&mut self, text: &str) {
        let _ = writeln!(self.html, "<p>{}</p>", escaped(text));
    }

    /// Adds a remark in small print.
    pub(crate) fn note(&mut self, text: &str) {
        let _ = writeln!(self.html, "<p class=\"note\">{}</p>", escaped(text));
    }

    /// Adds tabs of a title and HTML each. The last one is shown first.
    pub(crate) fn tabs(&mut self, name: &str, tabs: &[(String, String)]) {
        if tabs.is_empty() {
            return;
        }
        self.html += "<div class=\"tabs\">\n";
        for (n, (title, _)) in tabs.iter().enumerate() {
            let checked = if n + 1 == tabs.len() { " checked" } else { "" };
            self.choice(&format!("{name}-{n}"), name, title, checked);
        }
        for (_, html) in tabs {
            let _ = write!(self.html, "<div class=\"tab\">\n{html}</div>\n");
        }
        self.html += "</div>\n";
    }

    /// Adds sections under one heading, each with its anchor and title. A screen shows one at a time, starting with the
    /// first; paper shows all.
    pub(crate) fn choices(&mut self, name: &str, sections: Vec<(&str, &str, Page)>) {
        if sections.is_empty() {
            return;
        }
        let is_alone = sections.len() == 1;
        if !is_alone {
            self.html += "<div class=\"tabs choices\">\n";
            for (n, (_, title, _)) in sections.iter().enumerate() {
                let checked = if n == 0 { " checked" } else { "" };
                self.choice(&format!("{name}-{n}"), name, title, checked);
            }
        }
        for (id, title, inner) in sections {
            let class = if is_alone { "" } else { " class=\"tab\"" };
            let (id, title) = (escaped(id), escaped(title));
            let _ = writeln!(self.html, "<div id=\"{id}\"{class}>");
            if !is_alone {
                let _ = writeln!(self.html, "<h3>{title}</h3>");
            }
            self.append(inner);
            self.html += "</div>\n";
        }
        if !is_alone {
            self.html += "</div>\n";
        }
    }

    fn choice(&mut self, id: &str, name: &str, title: &str, checked: &str) {
        let title = escaped(title);
        let _ = writeln!(
            self.html,
            "<input type=\"radio\" name=\"{name}\" id=\"{id}\"{checked}><label for=\"{id}\">{title}</label>"
        );
    }

    /// Adds a list of links to sections.
    pub(crate) fn contents(&mut self, entries: &[ContentsEntry]) {
        self.html += "<nav aria-label=\"Contents\">";
        for (is_appendix, head) in [(false, "Findings"), (true, "Appendix, what this rests on")] {
            let own = || entries.iter().filter(|entry| entry.is_appendix == is_appendix);
            if own().next().is_none() {
                continue;
            }
            let _ = writeln!(self.html, "<div><p>{head}</p>\n<ul>");
            for ContentsEntry { id, title, .. } in own() {
                let (id, title) = (escaped(id), escaped(title));
                let _ = writeln!(self.html, "<li><a href=\"#{id}\">{title}</a></li>");
            }
            self.html += "</ul></div>\n";
        }
        self.html += "</nav>\n";
    }

    /// Begins the appendix. In print it starts on a new page.
    pub(crate) fn appendix(&mut self) {
        self.html += "<p class=\"appendix\">Appendix: what this rests on</p>\n\
            <p class=\"note paper\">What is folded on a screen is not on paper: figures and tables whose numbers \
            have a point, and the values in figures.</p>\n";
    }

    /// Adds content that is collapsed until the reader opens it.
    pub(crate) fn folded(&mut self, summary: &str, write: impl FnOnce(&mut Page)) {
        let mut inner = Page::default();
        write(&mut inner);
        if inner.is_empty() {
            return;
        }
        let _ = writeln!(self.html, "<details><summary>{}</summary>", escaped(summary));
        for kind in &KINDS {
            inner.html = inner.html.replace(kind.mark, &kind.folded.to_string());
        }
        self.append(inner);
        self.html += "</details>\n";
    }

    /// Adds a figure with a one-sentence caption, which also serves as its text alternative.
    /// `name` is the name of the figure's own file.
    pub(crate) fn figure(&mut self, name: &str, figure: Figure, caption: &str) {
        self.draw(name, figure, caption, "drawing");
    }

    /// Adds a figure that keeps its size and scrolls. In print, a figure too large for an upright page is turned, set
    /// to the width of the page, and continued over as many pages as it needs.
    pub(crate) fn wide_figure(&mut self, name: &str, figure: Figure, caption: &str) {
        let (width, height) = PAPER;
        let is_large = figure.width > width || figure.height > height;
        self.draw(
            name,
            figure,
            caption,
            if is_large { "drawing full large" } else { "drawing full" },
        );
    }

    fn draw(&mut self, name: &str, figure: Figure, caption: &str, class: &str) {
        let alt = escaped(caption);
        let head = format!("<svg role=\"img\" aria-label=\"{alt}\" ");
        let svg = figure.svg.replacen("<svg ", &head, 1);
        let name_text = escaped(name);
        // The box takes keyboard focus, so a wide figure scrolls without a mouse.
        let _ = write!(
            self.html,
            "<figure id=\"figure-{name_text}\">\n<div class=\"{class}\" tabindex=\"0\">{}</div>\n\
             <figcaption>{}{alt}</figcaption>\n",
            svg.trim_end(),
            FIGURE.mark
        );
        self.values(&figure.values);
        self.html += "</figure>\n";
        self.figures.push((name.to_owned(), figure));
    }

    /// Adds the values of a figure as a table, for readers who cannot hover over them.
    fn values(&mut self, values: &[Vec<String>]) {
        let Some((heads, rows)) = values.split_first() else { return };
        self.html += "<details class=\"values\"><summary>The values</summary><div class=\"sheet\">\
            <table class=\"wide\"><thead><tr>";
        for head in heads {
            let _ = write!(self.html, "<th scope=\"col\">{}</th>", escaped(head));
        }
        self.html += "</tr></thead>\n<tbody>\n";
        for row in rows {
            self.html += "<tr>";
            for cell in row {
                let _ = write!(self.html, "<td>{}</td>", escaped(cell));
            }
            self.html += "</tr>\n";
        }
        self.html += "</tbody></table></div></details>\n";
    }

    /// Adds figures side by side, as many as fit.
    pub(crate) fn beside(&mut self, write: impl FnOnce(&mut Page)) {
        let mut inner = Page::default();
        write(&mut inner);
        self.html += "<div class=\"beside\">\n";
        self.append(inner);
        self.html += "</div>\n";
    }

    /// Adds a table with a one-sentence caption. A line feed in a cell begins a new line in small type.
    pub(crate) fn table(&mut self, grid: &HtmlTable, caption: &str) {
        let class =
            |side: Alignment| if side == Alignment::Right { " class=\"number\"" } else { "" };
        let wide = if grid.heads.len() >= WIDE { " class=\"wide\"" } else { "" };
        let short = if grid.rows.len() <= SHORT { " short" } else { "" };
        let _ = writeln!(self.html, "<div class=\"sheet{short}\" tabindex=\"0\"><table{wide}>");
        let _ = writeln!(self.html, "<caption>{}{}</caption>", TABLE.mark, escaped(caption));
        self.html += "<thead><tr>";
        for (head, side) in &grid.heads {
            let _ = write!(self.html, "<th scope=\"col\"{}>{}</th>", class(*side), escaped(head));
        }
        self.html += "</tr></thead>\n<tbody>\n";
        for (row, strong) in &grid.rows {
            self.html += if *strong { "<tr class=\"strong\">" } else { "<tr>" };
            for (cell, (_, side)) in row.iter().zip(&grid.heads) {
                let text = breakable(&escaped(cell));
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

    /// Returns the finished document, and its figures with their file names.
    pub fn finish(self, title: &str) -> (String, Vec<(String, Figure)>) {
        let html = format!(
            "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <meta name=\"color-scheme\" content=\"light dark\">\n\
             <title>{0}</title>\n<style>\n{2}</style>\n</head>\n<body>\n<main>\n\
             <h1>{0}</h1>\n{1}</main>\n</body>\n</html>\n",
            escaped(title),
            numbered(&numbered(&self.html, &FIGURE), &TABLE),
            STYLE.replacen("  /* colours */\n", &dark_rules(), 1)
        );
        (html, self.figures)
    }
}

/// A rate as HTML; its count is the hover text.
pub(crate) fn counted(text: &str, rate: Rate) -> String {
    format!("<abbr title=\"{} of {}\">{}</abbr>", rate.count, rate.of, escaped(text))
}

/// A numbered kind of content.
struct Kind {
    word: &'static str,
    /// Marks where the number goes: sections are written separately and numbered together. No text contains these
    /// characters, because escaping drops control characters.
    mark: char,
    /// The mark inside folded content. It is not on paper, so it uses none of the main numbers.
    folded: char,
}

const FIGURE: Kind = Kind { word: "Figure", mark: '\u{1}', folded: '\u{2}' };
const TABLE: Kind = Kind { word: "Table", mark: '\u{3}', folded: '\u{4}' };
const KINDS: [Kind; 2] = [FIGURE, TABLE];

/// Replaces the marks by numbers in their order: 1, 2, and 2.1, 2.2 for the folded ones after 2.
fn numbered(html: &str, kind: &Kind) -> String {
    let mut all = String::with_capacity(html.len());
    let (mut shown, mut folded, mut rest) = (0, 0, html);
    while let Some(place) = rest.find([kind.mark, kind.folded]) {
        all += &rest[..place];
        // A mark is one byte long.
        let is_folded = rest[place..].starts_with(kind.folded);
        rest = &rest[place + 1..];
        (shown, folded) = if is_folded { (shown, folded + 1) } else { (shown + 1, 0) };
        let below = if is_folded { format!(".{folded}") } else { String::new() };
        let _ = write!(all, "<b>{} {shown}{below}.</b> ", kind.word);
    }
    all + rest
}

/// Lets the browser break long names in a table between their parts.
fn breakable(html: &str) -> String {
    /// Shorter names fit any column.
    const LONG: usize = 14;
    let words = html.split(' ').map(|word| match word.len() > LONG {
        true => word.replace('_', "_<wbr>").replace('.', ".<wbr>"),
        false => word.to_owned(),
    });
    words.collect::<Vec<_>>().join(" ")
}

/// Width and height in pixels that an upright page has for a figure at its own size, without the caption.
const PAPER: (f64, f64) = (690.0, 900.0);

/// A table with at least this many columns is set in smaller type.
const WIDE: usize = 8;

/// A table with at most this many rows is not broken in print.
const SHORT: usize = 14;

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

    #[test]
    fn a_figure_too_large_for_a_page_is_turned_in_print() {
        let figure =
            |width, height| Figure { svg: "<svg ></svg>".into(), width, height, values: vec![] };
        let mut page = Page::default();
        page.wide_figure("small", figure(600.0, 389.0), "fits");
        page.wide_figure("large", figure(1214.0, 2671.0), "does not");
        let (html, _) = page.finish("");
        assert_eq!(html.matches("class=\"drawing full\"").count(), 1);
        assert_eq!(html.matches("class=\"drawing full large\"").count(), 1);
    }

    #[test]
    fn the_contents_stand_before_everything_else() {
        let entry =
            |id: &str, is_appendix| ContentsEntry { id: id.into(), title: id.into(), is_appendix };
        let mut page = Page::default();
        page.contents(&[entry("found", false), entry("rests", true)]);
        page.section("found", "found", |page| page.text("text"));
        let (html, _) = page.finish("title");
        let begin = html.find("<h1>title</h1>\n<nav").unwrap();
        assert!(begin < html.find("<section").unwrap(), "{html}");
        assert!(html.contains("Appendix, what this rests on</p>\n<ul>\n<li><a href=\"#rests\">"));
    }

    #[test]
    fn figures_and_tables_are_counted_over_all_sections() {
        let mut page = Page::default();
        for section in ["a", "b"] {
            page.section(section, section, |page| {
                let mut grid = HtmlTable::new([("value", Alignment::Right)]);
                grid.push(vec!["1".into()]);
                page.table(&grid, "of\u{1} numbers");
                let bars = || {
                    let bars = servotwin_view::bars::Bars::new("", "x", &["one"]);
                    bars.with("valve", vec![Some(servotwin_view::bars::Bar::new(0.25))]).draw()
                };
                page.figure(section, bars(), "bars");
                page.folded("more", |page| page.figure(section, bars(), "bars"));
            });
        }
        let (html, figures) = page.finish("");
        // Folded content does not use the numbers of content on paper.
        let texts = ["<b>Table 1.</b> of numbers", "<b>Table 2.</b> of", "<b>Figure 1.</b> bars"];
        for text in texts.into_iter().chain(["<b>Figure 1.1.</b> bars", "<b>Figure 2.1.</b> bars"])
        {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!((figures.len(), html.matches("<b>Figure").count()), (4, 4));
        // Every value is in a table, and in the hover text of its mark.
        assert!(
            html.contains("<td>0.250</td>") && html.contains("<title>valve, one: 0.250 </title>")
        );
        assert_eq!(html.matches("<details").count(), html.matches("</details>").count());
    }
}
