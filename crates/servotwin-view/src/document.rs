//! A result as a document: all that a reader may see of it, whether a person or a program.
//!
//! A command, a section of the report and a certificate return a [`Document`]. The renderers in
//! [`render`](crate::render) write it for a terminal, as JSON, Markdown and HTML. A [`Value`] holds its text and its
//! number together, so that no two renderings differ.

mod value;

pub use value::{NONE, Value};

use crate::Figure;
use serde::Serialize;
use serde_json::Value as Json;
use std::borrow::Cow;
use std::fmt::Display;
use std::path::Path;

/// A result. As a part of another document it is a section, which has a title instead of a verdict.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Document {
    /// The key in JSON and the anchor in HTML.
    pub(crate) id: Cow<'static, str>,
    /// The heading of a section.
    pub title: String,
    /// The first line.
    pub verdict: Option<Verdict>,
    /// Everything else, in the order for readers.
    pub(crate) blocks: Vec<Block>,
    /// The form for terminals and pages.
    pub form: Form,
    /// The exit code of the command. 1 for a verdict that calls for a person.
    pub exit_code: u8,
}

/// How the blocks of a document are laid out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Form {
    /// One below the other; a terminal shows the beginning of long tables.
    #[default]
    Plain,
    /// The blocks were asked for, such as a catalog: a terminal shows them whole, even if it should be quiet.
    Listing,
    /// The last line of a stream of JSON, so JSON is a single line.
    Line,
    /// A page folds them until the reader opens them.
    Folded,
    /// A page shows one section at a time, beginning with the first; paper shows all.
    Choices,
    /// A page puts figures side by side.
    Beside,
}

/// What a result means for its reader.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Call {
    /// All is well.
    Good,
    /// A fact to take note of.
    Neutral,
    /// A person must act.
    Act,
}

/// A result in one sentence.
#[derive(Debug, Clone, PartialEq)]
pub struct Verdict {
    /// What it means.
    pub call: Call,
    /// The sentence.
    pub line: Line,
}

/// A sentence, and the values in it by their keys in JSON.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Line {
    /// The sentence.
    pub text: String,
    /// The values.
    pub values: Vec<(&'static str, Value)>,
}

/// A named value: its key in JSON without the suffix of the unit, its name for people, and the value. Without a name for
/// people it stands in JSON only.
pub type Fact = (&'static str, Cow<'static, str>, Value);

/// A part of a document.
#[derive(Debug, Clone, PartialEq)]
pub struct Block {
    /// The key in JSON. Facts without one are facts of the document itself.
    pub(crate) id: Cow<'static, str>,
    /// Whether a terminal shows it with `--details` only.
    pub is_detail: bool,
    /// What it holds.
    pub(crate) content: Content,
}

/// What a block holds.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// A paragraph.
    Text(Line),
    /// A limit or a warning that changes how to read the result.
    Note(Line),
    /// A heading within a section.
    Heading(String),
    /// Named values.
    Facts(Vec<Fact>),
    /// Rows of values.
    Table(Table),
    /// Sentences.
    List(Vec<Line>),
    /// A drawing with a caption. A wide one keeps its size.
    Figure {
        /// The figure.
        drawing: Figure,
        /// One sentence, which is its text alternative too.
        caption: String,
        /// Whether it scrolls instead of shrinking.
        is_wide: bool,
    },
    /// Paths of written files.
    Files(Vec<String>),
    /// A whole result for programs.
    Data(Json),
    /// Text of a fixed form. Alone in a document it is printed as it is, whatever the renderer.
    Raw(String),
    /// A part with a title.
    Section(Document),
}

/// A table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Table {
    /// The columns.
    pub(crate) columns: Vec<Column>,
    /// The rows, one value for each column, and whether the row is emphasized.
    pub rows: Vec<(Vec<Value>, bool)>,
    /// One sentence or a title; may be empty.
    pub(crate) caption: String,
}

/// A column of a table.
#[derive(Debug, Clone, PartialEq)]
pub struct Column {
    /// The key in JSON, without the suffix of the unit. Empty for a column that programs do not need.
    pub(crate) id: Cow<'static, str>,
    /// The heading. Empty for a column that people do not need; a space for one that needs no heading.
    pub(crate) heading: Cow<'static, str>,
}

/// A row of a table: values of several types.
#[macro_export]
macro_rules! row {
    ($($value:expr),* $(,)?) => { vec![$($crate::document::Value::from($value)),*] };
}

/// A named value. Without a name for people it stands in JSON only.
pub fn fact(
    key: &'static str,
    name: impl Into<Cow<'static, str>>,
    value: impl Into<Value>,
) -> Fact {
    (key, name.into(), value.into())
}

/// A sentence with values: `{key}` stands for the value of this key. Values that the sentence does not name stand in JSON
/// only.
pub fn line<const N: usize>(text: &str, values: [(&'static str, Value); N]) -> Line {
    let text = values.iter().fold(text.to_owned(), |text, (key, value)| {
        text.replace(&format!("{{{key}}}"), &value.text)
    });
    Line { text, values: values.into() }
}

impl<T: Into<String>> From<T> for Line {
    fn from(text: T) -> Self {
        Line { text: text.into(), values: vec![] }
    }
}

impl Verdict {
    /// All is well.
    pub fn good(line: impl Into<Line>) -> Self {
        Verdict { call: Call::Good, line: line.into() }
    }

    /// A fact to take note of.
    pub fn neutral(line: impl Into<Line>) -> Self {
        Verdict { call: Call::Neutral, line: line.into() }
    }

    /// A person must act.
    pub fn act(line: impl Into<Line>) -> Self {
        Verdict { call: Call::Act, line: line.into() }
    }
}

impl Call {
    /// The name in JSON and in style sheets.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Call::Good => "good",
            Call::Neutral => "neutral",
            Call::Act => "act",
        }
    }
}

impl Document {
    /// A result with its verdict.
    pub fn new(id: &'static str, verdict: Verdict) -> Self {
        let exit_code = u8::from(verdict.call == Call::Act);
        Document { id: id.into(), verdict: Some(verdict), exit_code, ..Document::default() }
    }

    /// A list that was asked for: a terminal shows all of it.
    pub fn listing(id: &'static str, verdict: impl Into<Line>) -> Self {
        Document { form: Form::Listing, ..Document::new(id, Verdict::neutral(verdict)) }
    }

    /// A part of a document.
    pub fn section(id: impl Into<Cow<'static, str>>, title: impl Into<String>) -> Self {
        Document { id: id.into(), title: title.into(), ..Document::default() }
    }

    /// Text that is printed as it is.
    pub fn raw(text: String) -> Self {
        let mut document = Document { form: Form::Listing, ..Document::default() };
        document.push("", Content::Raw(text));
        document
    }

    /// Sets the form.
    #[must_use]
    pub fn formed(self, form: Form) -> Self {
        Document { form, ..self }
    }

    /// Whether a reader would see nothing.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Adds a block.
    pub fn push(&mut self, id: impl Into<Cow<'static, str>>, content: Content) -> &mut Block {
        self.blocks.push(Block { id: id.into(), is_detail: false, content });
        self.blocks.last_mut().expect("a block was added")
    }

    /// Adds a paragraph.
    pub fn text(&mut self, text: impl Into<Line>) -> &mut Block {
        self.push("", Content::Text(text.into()))
    }

    /// Adds a limit or a warning that changes how to read the result.
    pub fn note(&mut self, text: impl Into<Line>) -> &mut Block {
        self.push("", Content::Note(text.into()))
    }

    /// Adds a heading.
    pub fn heading(&mut self, text: impl Into<String>) -> &mut Block {
        self.push("", Content::Heading(text.into()))
    }

    /// Adds a named value of the document itself, beside the last ones.
    pub fn fact(
        &mut self,
        key: &'static str,
        name: impl Into<Cow<'static, str>>,
        value: impl Into<Value>,
    ) {
        let fact = fact(key, name, value);
        match self.blocks.last_mut() {
            Some(Block { id, content: Content::Facts(facts), .. }) if id.is_empty() => {
                facts.push(fact)
            }
            _ => _ = self.facts("", [fact]),
        }
    }

    /// Adds named values.
    pub fn facts(&mut self, id: &'static str, facts: impl IntoIterator<Item = Fact>) -> &mut Block {
        self.push(id, Content::Facts(facts.into_iter().collect()))
    }

    /// Adds a table.
    pub fn table(&mut self, id: impl Into<Cow<'static, str>>, table: Table) -> &mut Block {
        self.push(id, Content::Table(table))
    }

    /// Adds sentences.
    pub fn list<L: Into<Line>>(
        &mut self,
        id: &'static str,
        lines: impl IntoIterator<Item = L>,
    ) -> &mut Block {
        self.push(id, Content::List(lines.into_iter().map(Into::into).collect()))
    }

    /// Adds a figure. Its id is the name of its own file.
    pub fn figure(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        drawing: Figure,
        caption: impl Into<String>,
    ) -> &mut Block {
        self.push(name, Content::Figure { drawing, caption: caption.into(), is_wide: false })
    }

    /// Adds a figure that keeps its size and scrolls.
    pub fn wide_figure(
        &mut self,
        name: impl Into<Cow<'static, str>>,
        drawing: Figure,
        caption: impl Into<String>,
    ) -> &mut Block {
        self.push(name, Content::Figure { drawing, caption: caption.into(), is_wide: true })
    }

    /// Adds the paths of written files.
    pub fn files<P: AsRef<Path>>(&mut self, paths: impl IntoIterator<Item = P>) -> &mut Block {
        let paths = paths.into_iter().map(|path| path.as_ref().display().to_string());
        self.push("files", Content::Files(paths.collect()))
    }

    /// Adds a whole result for programs.
    pub fn data(&mut self, id: &'static str, data: &impl Serialize) -> &mut Block {
        self.push(id, Content::Data(serde_json::json!(data)))
    }

    /// Adds a part with a title, unless it is empty.
    pub fn add(&mut self, section: Document) {
        if !section.is_empty() {
            self.push(section.id.clone(), Content::Section(section));
        }
    }

    /// Adds a part in which figures stand side by side.
    pub fn beside(&mut self, write: impl FnOnce(&mut Document)) {
        let mut section = Document::default().formed(Form::Beside);
        write(&mut section);
        self.add(section);
    }

    /// Adds a part that a page folds.
    pub fn folded(&mut self, title: &str, write: impl FnOnce(&mut Document)) {
        let mut section = Document::section("", title).formed(Form::Folded);
        write(&mut section);
        self.add(section);
    }

    /// All figures with their names, those of sections too.
    pub fn figures(&self) -> Vec<(&str, &Figure)> {
        let own = self.blocks.iter().flat_map(|block| match &block.content {
            Content::Figure { drawing, .. } => vec![(&*block.id, drawing)],
            Content::Section(section) => section.figures(),
            _ => vec![],
        });
        own.collect()
    }
}

impl Block {
    /// Shows the block with `--details` only.
    pub fn detail(&mut self) {
        self.is_detail = true;
    }
}

impl Table {
    /// A table without rows. A column has its key in JSON and its heading; see [`Column`].
    pub fn new<I, H>(columns: impl IntoIterator<Item = (I, H)>) -> Self
    where
        I: Into<Cow<'static, str>>,
        H: Into<Cow<'static, str>>,
    {
        let columns = columns.into_iter();
        let columns = columns.map(|(id, head)| Column { id: id.into(), heading: head.into() });
        Table { columns: columns.collect(), ..Table::default() }
    }

    /// A table without rows, by its columns: `key:heading` separated by ` | `. A column without a heading is for programs
    /// alone, one without a key for people; `_` is an empty heading, and a key alone is its own heading.
    pub fn of(columns: &'static str) -> Self {
        Table::new(columns.split(" | ").map(|column| match column.split_once(':') {
            None => (column, Cow::from(column.replace('_', " "))),
            Some((key, "_")) => (key, " ".into()),
            Some((key, heading)) => (key, heading.into()),
        }))
    }

    /// A table for people alone, by its headings.
    pub fn headed<H: Into<String>>(heads: impl IntoIterator<Item = H>) -> Self {
        let heads = heads.into_iter().map(Into::into);
        Table::new(heads.map(|head| ("", if head.is_empty() { " ".into() } else { head })))
    }

    /// Adds a column before there are rows.
    pub fn column(
        &mut self,
        id: impl Into<Cow<'static, str>>,
        heading: impl Into<Cow<'static, str>>,
    ) {
        self.columns.push(Column { id: id.into(), heading: heading.into() });
    }

    /// Sets the caption.
    #[must_use]
    pub fn captioned(self, caption: impl Display) -> Self {
        Table { caption: caption.to_string(), ..self }
    }

    /// Adds a row, one value for each column.
    pub fn push<V: Into<Value>>(&mut self, row: impl IntoIterator<Item = V>) {
        self.push_if(false, row);
    }

    /// Adds an emphasized row: a sum, or the most important result.
    pub fn push_strong<V: Into<Value>>(&mut self, row: impl IntoIterator<Item = V>) {
        self.push_if(true, row);
    }

    /// Adds a row, emphasized or not.
    pub fn push_if<V: Into<Value>>(&mut self, is_strong: bool, row: impl IntoIterator<Item = V>) {
        let row: Vec<Value> = row.into_iter().map(Into::into).collect();
        debug_assert_eq!(row.len(), self.columns.len(), "{:?}", self.columns);
        self.rows.push((row, is_strong));
    }

    /// Whether there are no rows.
    pub fn is_empty(&self) -> bool {
        self.rows.is_empty()
    }

    /// The columns for people; none if there are no rows.
    pub(crate) fn shown(&self) -> Vec<usize> {
        let shown = |k: &usize| !self.is_empty() && !self.columns[*k].heading.is_empty();
        (0..self.columns.len()).filter(shown).collect()
    }

    /// The columns for people, and whether each holds numbers.
    pub(crate) fn aligned(&self) -> Vec<(usize, bool)> {
        self.shown().into_iter().map(|k| (k, self.is_number(k))).collect()
    }

    /// Whether the column holds numbers, which are aligned at the right.
    pub(crate) fn is_number(&self, column: usize) -> bool {
        let mut texts = self.rows.iter().map(|(row, _)| row[column].text.trim()).peekable();
        let begins =
            |text: &str| text.starts_with(|c: char| c.is_ascii_digit() || "+-±–".contains(c));
        texts.peek().is_some()
            && self.rows.iter().any(|(row, _)| !row[column].text.is_empty())
            && texts.all(|text| text.is_empty() || begins(text))
    }
}
