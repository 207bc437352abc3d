//! HTML: one page that needs no network and no script, prints on paper, and is readable without color.
//!
//! Sections of a document are chapters with an entry in the contents. Those that are details stand in an appendix. The
//! templates escape every text.

use crate::dark_rules;
use crate::document::{Block, Content, Document, Form, Verdict};
use askama::Template;
use std::cell::Cell;

/// A document as a page.
///
/// # Panics
/// Never: the templates render texts alone.
pub fn page(document: &Document) -> String {
    let numbers = Numbers::default();
    let chapter =
        |block: &'_ Block| matches!(&block.content, Content::Section(own) if !own.title.is_empty());
    let (chapters, before): (Vec<&Block>, Vec<&Block>) =
        document.blocks.iter().partition(|block| chapter(block));
    let sections = |is_detail: bool| -> Vec<Section> {
        let own = chapters.iter().filter(|block| block.is_detail == is_detail);
        own.filter_map(|block| Section::of(block, &numbers)).collect()
    };
    let page = Page {
        title: &document.title,
        verdict: document.verdict.as_ref(),
        style: STYLE.replacen("  /* colours */\n", &dark_rules(), 1),
        before: Blocks { blocks: before, numbers: &numbers, is_folded: false },
        findings: sections(false),
        appendix: sections(true),
    };
    page.render().expect("texts are rendered")
}

#[derive(Template)]
#[template(path = "page.html")]
struct Page<'d> {
    title: &'d str,
    verdict: Option<&'d Verdict>,
    style: String,
    /// What stands before the chapters.
    before: Blocks<'d>,
    findings: Vec<Section<'d>>,
    appendix: Vec<Section<'d>>,
}

impl<'d> Page<'d> {
    /// The chapters, each part with its heading and whether it is the appendix.
    fn parts(&self) -> [(&'static str, bool, &[Section<'d>]); 2] {
        [
            ("Findings", false, &self.findings),
            ("Appendix, what this rests on", true, &self.appendix),
        ]
    }
}

/// The blocks of a section in its form.
#[derive(Template)]
#[template(path = "section.html")]
struct Section<'d> {
    section: &'d Document,
    numbers: &'d Numbers,
    is_folded: bool,
}

impl<'d> Section<'d> {
    /// A block that is a section.
    fn of(block: &'d Block, numbers: &'d Numbers) -> Option<Self> {
        let Content::Section(section) = &block.content else { return None };
        Some(Section { section, numbers, is_folded: false })
    }

    /// Sections of which a screen shows one at a time, starting with the first; paper shows all.
    fn sections(&self) -> Vec<Section<'d>> {
        self.section.blocks.iter().filter_map(|block| Section::of(block, self.numbers)).collect()
    }

    fn blocks(&self) -> Blocks<'d> {
        let is_folded = self.is_folded || self.section.form == Form::Folded;
        let blocks = self.section.blocks.iter().collect();
        Blocks { blocks, numbers: self.numbers, is_folded }
    }
}

/// Blocks below each other.
#[derive(Template)]
#[template(path = "blocks.html")]
struct Blocks<'d> {
    blocks: Vec<&'d Block>,
    numbers: &'d Numbers,
    /// Whether a reader must open them.
    is_folded: bool,
}

impl<'d> Blocks<'d> {
    fn inside(&self, section: &'d Document) -> Section<'d> {
        Section { section, numbers: self.numbers, is_folded: self.is_folded }
    }
}

/// Counts figures and tables through all sections.
#[derive(Default)]
struct Numbers {
    figures: Counter,
    tables: Counter,
}

/// The last number on paper, and the last one that is folded behind it.
type Counter = Cell<(usize, usize)>;

impl Numbers {
    fn figure(&self, is_folded: &bool) -> String {
        next(&self.figures, *is_folded)
    }

    fn table(&self, is_folded: &bool) -> String {
        next(&self.tables, *is_folded)
    }
}

/// The next number: 1, 2, and 2.1, 2.2 for the folded ones after 2, which are not on paper.
fn next(counter: &Counter, is_folded: bool) -> String {
    let (shown, folded) = counter.get();
    counter.set(if is_folded { (shown, folded + 1) } else { (shown + 1, 0) });
    if is_folded { format!("{shown}.{}", folded + 1) } else { (shown + 1).to_string() }
}

/// The parts of a text between which the browser may break long names in a table.
fn breakable(text: &str) -> Vec<&str> {
    /// Shorter names fit any column.
    const LONG: usize = 14;
    let parts = text.split_inclusive(' ').flat_map(|word| {
        let is_long = word.trim_end().len() > LONG;
        word.split_inclusive(move |c| is_long && matches!(c, '_' | '.'))
    });
    parts.collect()
}

/// Width and height in pixels that an upright page has for a figure at its own size, without the caption. In print, a
/// larger one is turned, set to the width of the page, and continued over as many pages as it needs.
const PAPER: (f64, f64) = (690.0, 900.0);

/// A table with at least this many columns is set in smaller type.
const WIDE: usize = 8;

/// A table with at most this many rows is not broken in print.
const SHORT: usize = 14;

const STYLE: &str = include_str!("style.css");

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Figure;
    use crate::document::Table;
    use crate::lines::{Curve, Lines};

    fn written(write: impl FnOnce(&mut Document)) -> String {
        let mut document = Document::section("", "<title>");
        write(&mut document);
        // Tags of the template leave blank lines.
        let lines: Vec<String> = page(&document).lines().map(|line| line.trim().into()).collect();
        lines.into_iter().filter(|line| !line.is_empty()).collect::<Vec<_>>().join("\n")
    }

    fn section(id: &'static str, write: impl FnOnce(&mut Document)) -> Document {
        let mut section = Document::section(id, format!("{id} & B"));
        write(&mut section);
        section
    }

    #[test]
    fn texts_are_escaped_and_empty_sections_left_out() {
        let html = written(|page| {
            page.add(section("a", |page| _ = page.text("p < 3 \"bar\"")));
            page.add(section("empty", |_| ()));
        });
        assert!(html.contains("<h2>a &#38; B</h2>\n<p>p &#60; 3 &#34;bar&#34;</p>"));
        assert!(!html.contains("empty") && html.contains("<h1>&#60;title&#62;</h1>"));
    }

    #[test]
    fn a_figure_too_large_for_a_page_is_turned_in_print() {
        let figure =
            |width, height| Figure { svg: "<svg ></svg>".into(), width, height, values: vec![] };
        let html = written(|page| {
            page.wide_figure("small", figure(600.0, 389.0), "fits");
            page.wide_figure("large", figure(1214.0, 2671.0), "does not");
        });
        assert_eq!(html.matches("class=\"drawing full\"").count(), 1);
        assert_eq!(html.matches("class=\"drawing full large\"").count(), 1);
    }

    #[test]
    fn figures_and_tables_are_counted_over_all_sections_and_details_stand_in_the_appendix() {
        let html = written(|page| {
            for id in ["a", "b"] {
                page.add(section(id, |page| {
                    let mut table = Table::headed(["value"]);
                    table.push(["1"]);
                    page.table("", table.captioned("of numbers"));
                    let curve = || Curve::new("valve", vec![(1.0, 0.25)]);
                    let lines = || Lines::new("", "x", "y").with(curve()).draw();
                    page.figure(id, lines(), "lines");
                    page.folded("more", |page| _ = page.figure(id, lines(), "lines"));
                }));
            }
            page.blocks.last_mut().unwrap().is_detail = true;
        });
        // Folded content does not use the numbers of content on paper.
        let texts = ["<b>Table 1.</b> of numbers", "<b>Table 2.</b> of", "<b>Figure 1.</b> lines"];
        for text in
            texts.into_iter().chain(["<b>Figure 1.1.</b> lines", "<b>Figure 2.1.</b> lines"])
        {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!(html.matches("<b>Figure").count(), 4);
        // Every value is in a table, and in the hover text of its mark.
        assert!(html.contains("<td>0.25</td>") && html.contains("<title>valve: 1, 0.25 </title>"));
        assert!(html.contains("<td class=\"number\">1</td>"));
        assert_eq!(html.matches("<details").count(), html.matches("</details>").count());
        assert!(html.contains("Appendix, what this rests on</p>\n<ul>\n<li><a href=\"#b\">"));
    }
}
