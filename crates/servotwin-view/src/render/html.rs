//! HTML: one page that needs no network and no script, prints on paper, and is readable without color.
//!
//! Sections of a document are chapters with an entry in the contents. Those that are details stand in an appendix.

use crate::dark_rules;
use crate::document::{Block, Content, Document, Fact, Form, Line, Table};
use servotwin_io::text::escaped;
use std::fmt::Write;

/// A document as a page.
pub fn page(document: &Document) -> String {
    let mut html = String::new();
    if let Some(verdict) = &document.verdict {
        let (call, text) = (verdict.call.name(), escaped(&verdict.line.text));
        let _ = writeln!(html, "<p class=\"verdict {call}\" role=\"status\">{text}</p>");
    }
    let is_chapter = |block: &&Block| title(block).is_some_and(|title| !title.is_empty());
    let (chapters, before): (Vec<&Block>, Vec<&Block>) =
        document.blocks.iter().partition(is_chapter);
    before.into_iter().for_each(|block| add(&mut html, block));
    contents(&mut html, &chapters);
    let mut is_in_appendix = false;
    for chapter in chapters {
        if chapter.is_detail && !is_in_appendix {
            html += APPENDIX;
            is_in_appendix = true;
        }
        if let Content::Section(section) = &chapter.content {
            let (id, title) = (escaped(&section.id), escaped(&section.title));
            let _ = write!(html, "<section id=\"{id}\">\n<h2>{title}</h2>\n");
            inside(&mut html, section);
            html += "</section>\n";
        }
    }
    format!(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <meta name=\"color-scheme\" content=\"light dark\">\n\
         <title>{0}</title>\n<style>\n{2}</style>\n</head>\n<body>\n<main>\n\
         <h1>{0}</h1>\n{1}</main>\n</body>\n</html>\n",
        escaped(&document.title),
        numbered(&numbered(&html, &FIGURE), &TABLE),
        STYLE.replacen("  /* colours */\n", &dark_rules(), 1)
    )
}

const APPENDIX: &str = "<p class=\"appendix\">Appendix: what this rests on</p>\n\
    <p class=\"note paper\">What is folded on a screen is not on paper: figures and tables whose numbers \
    have a point, and the values in figures.</p>\n";

fn title(block: &Block) -> Option<&str> {
    match &block.content {
        Content::Section(section) => Some(&section.title),
        _ => None,
    }
}

/// Links to the chapters, if there are several.
fn contents(html: &mut String, chapters: &[&Block]) {
    if chapters.len() < 2 {
        return;
    }
    *html += "<nav aria-label=\"Contents\">";
    for (is_appendix, head) in [(false, "Findings"), (true, "Appendix, what this rests on")] {
        let mut own = chapters.iter().filter(|chapter| chapter.is_detail == is_appendix).peekable();
        if own.peek().is_none() {
            continue;
        }
        let _ = writeln!(html, "<div><p>{head}</p>\n<ul>");
        for chapter in own {
            let (id, title) = (escaped(&chapter.id), escaped(title(chapter).unwrap_or_default()));
            let _ = writeln!(html, "<li><a href=\"#{id}\">{title}</a></li>");
        }
        *html += "</ul></div>\n";
    }
    *html += "</nav>\n";
}

/// The blocks of a section in its form.
fn inside(html: &mut String, section: &Document) {
    match section.form {
        Form::Choices => choices(html, section),
        Form::Beside => {
            *html += "<div class=\"beside\">\n";
            section.blocks.iter().for_each(|block| add(html, block));
            *html += "</div>\n";
        }
        Form::Folded => {
            let mut inner = String::new();
            section.blocks.iter().for_each(|block| add(&mut inner, block));
            for kind in [&FIGURE, &TABLE] {
                inner = inner.replace(kind.mark, &kind.folded.to_string());
            }
            let title = escaped(&section.title);
            let _ = write!(html, "<details><summary>{title}</summary>\n{inner}</details>\n");
        }
        Form::Plain | Form::Listing | Form::Line => {
            section.blocks.iter().for_each(|block| add(html, block));
        }
    }
}

/// Sections of which a screen shows one at a time, starting with the first; paper shows all.
fn choices(html: &mut String, section: &Document) {
    let sections = section.blocks.iter().filter_map(|block| match &block.content {
        Content::Section(own) => Some(own),
        _ => None,
    });
    let sections: Vec<&Document> = sections.collect();
    if sections.len() > 1 {
        *html += "<div class=\"tabs\">\n";
        for (n, own) in sections.iter().enumerate() {
            let (name, title) = (escaped(&section.id), escaped(&own.title));
            let checked = if n == 0 { " checked" } else { "" };
            let _ = writeln!(
                html,
                "<input type=\"radio\" name=\"{name}\" id=\"{name}-{n}\"{checked}><label for=\"{name}-{n}\">{title}</label>"
            );
        }
    }
    for own in &sections {
        let (id, title) = (escaped(&own.id), escaped(&own.title));
        match sections.len() {
            1 => _ = writeln!(html, "<div id=\"{id}\">"),
            _ => _ = writeln!(html, "<div id=\"{id}\" class=\"tab\">\n<h3>{title}</h3>"),
        }
        inside(html, own);
        *html += "</div>\n";
    }
    if sections.len() > 1 {
        *html += "</div>\n";
    }
}

fn add(html: &mut String, Block { id, content, .. }: &Block) {
    let _ = match content {
        Content::Text(line) => writeln!(html, "<p>{}</p>", text(line)),
        Content::Note(line) => writeln!(html, "<p class=\"note\">{}</p>", text(line)),
        Content::Heading(heading) => writeln!(html, "<h3>{}</h3>", escaped(heading)),
        Content::Raw(raw) => writeln!(html, "<pre>{}</pre>", escaped(raw)),
        Content::List(lines) => {
            let items = lines.iter().map(|line| format!("<li>{}</li>\n", text(line)));
            write!(html, "<ol>\n{}</ol>\n", items.collect::<String>())
        }
        Content::Files(paths) => {
            let items = paths.iter().map(|path| format!("<li>{}</li>\n", escaped(path)));
            write!(html, "<ul>\n{}</ul>\n", items.collect::<String>())
        }
        Content::Facts(facts) => write!(html, "{}", cards(facts)),
        Content::Table(own) => write!(html, "{}", table(own)),
        Content::Figure { drawing, caption, is_wide } => {
            let is_large = drawing.width > PAPER.0 || drawing.height > PAPER.1;
            let class = match (is_wide, is_large) {
                (false, _) => "drawing",
                (true, false) => "drawing full",
                (true, true) => "drawing full large",
            };
            let (name, alt) = (escaped(id), escaped(caption));
            let head = format!("<svg role=\"img\" aria-label=\"{alt}\" ");
            let svg = drawing.svg.replacen("<svg ", &head, 1);
            // The box takes keyboard focus, so a wide figure scrolls without a mouse.
            write!(
                html,
                "<figure id=\"figure-{name}\">\n<div class=\"{class}\" tabindex=\"0\">{}</div>\n\
                 <figcaption>{}{alt}</figcaption>\n{}</figure>\n",
                svg.trim_end(),
                FIGURE.mark,
                values(&drawing.values)
            )
        }
        Content::Section(section) => {
            if !section.title.is_empty() && section.form == Form::Plain {
                let _ = writeln!(html, "<h3>{}</h3>", escaped(&section.title));
            }
            inside(html, section);
            Ok(())
        }
        Content::Data(_) => Ok(()),
    };
}

fn text(line: &Line) -> String {
    escaped(&line.text)
}

/// Named values as cards. The first line of a value is large.
fn cards(facts: &[Fact]) -> String {
    let shown = facts.iter().filter(|(_, name, _)| !name.is_empty());
    let card = |(_, name, value): &Fact| {
        let (first, below) = value.text.split_once('\n').unwrap_or((&value.text, ""));
        let call = value.call.map_or("", |call| call.name());
        let (name, first, below) = (escaped(name), escaped(first), escaped(below));
        let below = below.replace('\n', "<br>");
        format!(
            "<div class=\"card {call}\"><p>{name}</p><p class=\"value\">{first}</p><p class=\"note\">{below}</p></div>\n"
        )
    };
    format!("<div class=\"cards\">\n{}</div>\n", shown.map(card).collect::<String>())
}

/// The values of a figure as a table, for readers who cannot hover over them.
fn values(values: &[Vec<String>]) -> String {
    let Some((heads, rows)) = values.split_first() else { return String::new() };
    let cells = |cells: &[String], open: &str, close: &str| {
        let cells = cells.iter().map(|cell| format!("<{open}>{}</{close}>", escaped(cell)));
        format!("<tr>{}</tr>\n", cells.collect::<String>())
    };
    format!(
        "<details class=\"values\"><summary>The values</summary><div class=\"sheet\"><table class=\"wide\"><thead>{}\
         </thead>\n<tbody>\n{}</tbody></table></div></details>\n",
        cells(heads, "th scope=\"col\"", "th"),
        rows.iter().map(|row| cells(row, "td", "td")).collect::<String>()
    )
}

/// A table with its caption. A line feed in a cell begins a new line in small type.
fn table(table: &Table) -> String {
    let shown = table.shown();
    if shown.is_empty() {
        return String::new();
    }
    let class = |k: usize| if table.is_number(k) { " class=\"number\"" } else { "" };
    let wide = if shown.len() >= WIDE { " class=\"wide\"" } else { "" };
    let short = if table.rows.len() <= SHORT { " short" } else { "" };
    let mut html = format!(
        "<div class=\"sheet{short}\" tabindex=\"0\"><table{wide}>\n<caption>{}{}</caption>\n<thead><tr>",
        TABLE.mark,
        escaped(&table.caption)
    );
    for &k in &shown {
        let head = escaped(table.columns[k].heading.trim());
        let _ = write!(html, "<th scope=\"col\"{}>{head}</th>", class(k));
    }
    html += "</tr></thead>\n<tbody>\n";
    for (row, is_strong) in &table.rows {
        html += if *is_strong { "<tr class=\"strong\">" } else { "<tr>" };
        for &k in &shown {
            let text = breakable(&escaped(&row[k].text));
            let (text, below) = text.split_once('\n').unwrap_or((&text, ""));
            let below = match below {
                "" => String::new(),
                below => format!("<br><small>{}</small>", below.replace('\n', "<br>")),
            };
            let _ = write!(html, "<td{}>{text}{below}</td>", class(k));
        }
        html += "</tr>\n";
    }
    html + "</tbody></table></div>\n"
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
    use crate::bars::{Bar, Bars};

    fn written(write: impl FnOnce(&mut Document)) -> String {
        let mut document = Document::section("", "<title>");
        write(&mut document);
        page(&document)
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
        assert!(html.contains("<h2>a &amp; B</h2>\n<p>p &lt; 3 &quot;bar&quot;</p>"));
        assert!(!html.contains("empty") && html.contains("<h1>&lt;title&gt;</h1>"));
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
                    page.table("", table.captioned("of\u{1} numbers"));
                    let bars = || Bars::new("", "x", &["one"]);
                    let bars = || bars().with("valve", vec![Some(Bar::new(0.25))]).draw();
                    page.figure(id, bars(), "bars");
                    page.folded("more", |page| _ = page.figure(id, bars(), "bars"));
                }));
            }
            page.blocks.last_mut().unwrap().is_detail = true;
        });
        // Folded content does not use the numbers of content on paper.
        let texts = ["<b>Table 1.</b> of numbers", "<b>Table 2.</b> of", "<b>Figure 1.</b> bars"];
        for text in texts.into_iter().chain(["<b>Figure 1.1.</b> bars", "<b>Figure 2.1.</b> bars"])
        {
            assert!(html.contains(text), "{text}");
        }
        assert_eq!(html.matches("<b>Figure").count(), 4);
        // Every value is in a table, and in the hover text of its mark.
        assert!(
            html.contains("<td>0.250</td>") && html.contains("<title>valve, one: 0.250 </title>")
        );
        assert!(html.contains("<td class=\"number\">1</td>"));
        assert_eq!(html.matches("<details").count(), html.matches("</details>").count());
        assert!(html.contains("Appendix, what this rests on</p>\n<ul>\n<li><a href=\"#b\">"));
    }
}
