//! Finds the decisions of a C text: the conditions of `if`, `while`, `for`, `switch` and `?:`, and every truth value that
//! is stored, passed or returned.
//!
//! This reads functions of the hand-written code, statement by statement. What it does not understand it refuses, with the
//! place: a decision that is overlooked would look like one that is covered.

use super::decision::{ConditionTree, Decision, DecisionKind, MOST_CONDITIONS};
use super::tokens::{Token, line_of, refused, tokens};
use crate::error::ExportError;
use std::collections::BTreeSet;

/// Types of C; those of the text are added.
const TYPES: [&str; 16] = [
    "void", "bool", "char", "int", "float", "double", "int8_t", "int16_t", "int32_t", "int64_t",
    "uint8_t", "uint16_t", "uint32_t", "uint64_t", "size_t", "FILE",
];

/// What may stand before the type of a declaration.
const QUALIFIERS: [&str; 7] =
    ["const", "static", "volatile", "struct", "enum", "unsigned", "extern"];

const ASSIGNMENTS: [&str; 11] = ["=", "+=", "-=", "*=", "/=", "%=", "&=", "|=", "^=", "<<=", ">>="];

/// Binary operators from the weakest to the strongest.
const BINARY: [&[&str]; 10] = [
    &["||"],
    &["&&"],
    &["|"],
    &["^"],
    &["&"],
    &["==", "!="],
    &["<", ">", "<=", ">="],
    &["<<", ">>"],
    &["+", "-"],
    &["*", "/", "%"],
];

const UNARY: [&str; 8] = ["!", "~", "-", "+", "&", "*", "++", "--"];

/// The names of types that a text defines.
pub(crate) fn types_of(file: &'static str, text: &str) -> Result<Vec<String>, ExportError> {
    let all = tokens(file, text)?;
    let (mut names, mut depth, mut is_type) = (Vec::new(), 0_usize, false);
    for (place, token) in all.iter().enumerate() {
        match token.text {
            "typedef" if depth == 0 => is_type = true,
            "{" | "(" => depth += 1,
            "}" | ")" => depth = depth.saturating_sub(1),
            ";" if depth == 0 && is_type => {
                let name = place.checked_sub(1).map(|before| all[before].text.to_owned());
                names.extend(name);
                is_type = false;
            }
            _ => {}
        }
    }
    Ok(names)
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Shape {
    And,
    Or,
    Not,
    Compare,
    Group,
    Choice,
    Other,
}

/// Part of an expression.
struct Node {
    shape: Shape,
    start: usize,
    end: usize,
    parts: Vec<Node>,
}

/// A text that is put into the C text before this byte.
pub(crate) struct Insert {
    pub at: usize,
    pub text: String,
}

/// The decisions of a file, and what records them.
pub(crate) struct Found {
    pub decisions: Vec<Decision>,
    pub inserts: Vec<Insert>,
}

/// Finds the decisions of a file, numbered from `first`. `types` are the names of all types that it uses.
///
/// # Errors
/// [`ExportError::NotUnderstood`].
pub(crate) fn decisions(
    file: &'static str,
    text: &str,
    types: &BTreeSet<String>,
    first: usize,
) -> Result<Found, ExportError> {
    let tokens = tokens(file, text)?;
    let found = Found { decisions: Vec::new(), inserts: Vec::new() };
    let function = String::new();
    let mut reader = Reader { file, text, tokens, at: 0, types, first, function, found };
    reader.read_file()?;
    Ok(reader.found)
}

struct Reader<'t> {
    file: &'static str,
    text: &'t str,
    tokens: Vec<Token<'t>>,
    at: usize,
    types: &'t BTreeSet<String>,
    first: usize,
    /// The function that is read, or the last name before brackets.
    function: String,
    found: Found,
}

// ---- Tokens. ----

impl<'t> Reader<'t> {
    fn peek(&self) -> &'t str {
        self.peek_at(0)
    }

    fn peek_at(&self, ahead: usize) -> &'t str {
        self.tokens.get(self.at + ahead).map_or("", |token| token.text)
    }

    /// The byte at which the next token starts.
    fn start(&self) -> usize {
        self.tokens.get(self.at).map_or(self.text.len(), |token| token.start)
    }

    /// The byte after the last token.
    fn end(&self) -> usize {
        self.tokens[self.at - 1].end()
    }

    fn refuse<T>(&self) -> Result<T, ExportError> {
        Err(refused(self.file, self.text, self.start()))
    }

    fn expect(&mut self, symbol: &str) -> Result<(), ExportError> {
        if self.accept(symbol) { Ok(()) } else { self.refuse() }
    }

    fn accept(&mut self, symbol: &str) -> bool {
        let is_there = self.peek() == symbol;
        self.at += usize::from(is_there);
        is_there
    }

    /// Passes everything up to and with the bracket that closes the next one.
    fn skip_brackets(&mut self) -> Result<(), ExportError> {
        let mut depth = 0_usize;
        loop {
            match self.peek() {
                "(" | "[" | "{" => depth += 1,
                ")" | "]" | "}" => depth -= 1,
                "" => return self.refuse(),
                _ => {}
            }
            self.at += 1;
            if depth == 0 {
                return Ok(());
            }
        }
    }

    fn is_type(&self, ahead: usize) -> bool {
        let word = self.peek_at(ahead);
        TYPES.contains(&word) || QUALIFIERS.contains(&word) || self.types.contains(word)
    }
}

// ---- Declarations and statements. ----

impl Reader<'_> {
    fn read_file(&mut self) -> Result<(), ExportError> {
        while self.at < self.tokens.len() {
            let before = self.at.checked_sub(1).map_or("", |place| self.tokens[place].text);
            match self.peek() {
                "{" if before == ")" => self.read_block()?,
                "(" => {
                    self.function = before.into();
                    self.skip_brackets()?;
                }
                "{" | "[" => self.skip_brackets()?,
                _ => self.at += 1,
            }
        }
        Ok(())
    }

    fn read_block(&mut self) -> Result<(), ExportError> {
        self.expect("{")?;
        while !self.accept("}") {
            self.read_statement()?;
        }
        Ok(())
    }

    fn read_statement(&mut self) -> Result<(), ExportError> {
        match self.peek() {
            "{" => self.read_block(),
            "if" => self.read_if(),
            "while" => {
                self.read_condition(DecisionKind::While)?;
                self.read_statement()
            }
            "for" => self.read_for(),
            "switch" => self.read_switch(),
            "break" | "continue" => {
                self.at += 1;
                self.expect(";")
            }
            "return" => {
                self.at += 1;
                if self.peek() != ";" {
                    self.read_value()?;
                }
                self.expect(";")
            }
            ";" => self.expect(";"),
            "do" | "goto" | "case" | "default" | "else" | "" => self.refuse(),
            _ => self.read_plain(),
        }
    }

    /// A declaration or an expression, with its semicolon.
    fn read_plain(&mut self) -> Result<(), ExportError> {
        if !self.is_type(0) {
            self.read_value()?;
            return self.expect(";");
        }
        loop {
            match self.peek() {
                "=" => {
                    self.at += 1;
                    self.read_initializer()?;
                    return self.expect(";");
                }
                ";" => return self.expect(";"),
                // The length of an array is constant.
                "[" => self.skip_brackets()?,
                "*" => self.at += 1,
                word if self.tokens[self.at].is_word() && word != "typedef" => self.at += 1,
                _ => return self.refuse(),
            }
        }
    }

    fn read_initializer(&mut self) -> Result<(), ExportError> {
        if self.peek() != "{" {
            let node = self.assignment()?;
            return self.visit(&node);
        }
        self.expect("{")?;
        while !self.accept("}") {
            self.read_initializer()?;
            if self.peek() != "}" {
                self.expect(",")?;
            }
        }
        Ok(())
    }

    fn read_value(&mut self) -> Result<(), ExportError> {
        let node = self.expression()?;
        self.visit(&node)
    }

    /// A keyword with a condition in brackets.
    fn read_condition(&mut self, kind: DecisionKind) -> Result<(), ExportError> {
        self.at += 1;
        self.expect("(")?;
        let node = self.expression()?;
        self.decide(&node, kind)?;
        self.expect(")")
    }

    fn read_if(&mut self) -> Result<(), ExportError> {
        self.read_condition(DecisionKind::If)?;
        self.read_statement()?;
        if self.accept("else") {
            self.read_statement()?;
        }
        Ok(())
    }

    fn read_for(&mut self) -> Result<(), ExportError> {
        self.at += 1;
        self.expect("(")?;
        self.read_plain()?;
        let condition = self.expression()?;
        self.decide(&condition, DecisionKind::For)?;
        self.expect(";")?;
        self.read_value()?;
        self.expect(")")?;
        self.read_statement()
    }

    fn read_switch(&mut self) -> Result<(), ExportError> {
        self.at += 1;
        self.expect("(")?;
        let node = self.expression()?;
        self.expect(")")?;
        let number = self.open(&node, DecisionKind::Switch)?;
        self.visit(&node)?;
        self.expect("{")?;
        let mut labels = Vec::new();
        let mut has_default = false;
        while !self.accept("}") {
            match self.peek() {
                "case" => {
                    self.at += 1;
                    let start = self.start();
                    self.binary(0)?;
                    labels.push(one_line(&self.text[start..self.end()]));
                    self.expect(":")?;
                }
                "default" => {
                    has_default = true;
                    self.at += 1;
                    self.expect(":")?;
                }
                _ => self.read_statement()?,
            }
        }
        if !has_default || labels.len() >= MOST_CONDITIONS {
            return Err(refused(self.file, self.text, node.start));
        }
        let all = labels.join(", ");
        let id = self.first + number;
        let count = labels.len();
        self.insert(
            node.start,
            format!("mcdc_switch({id}, (const int64_t[]){{ {all} }}, {count}, ("),
        );
        self.insert(node.end, "))".into());
        labels.push("default".into());
        self.found.decisions[number].conditions = labels;
        Ok(())
    }
}

// ---- Expressions. ----

impl Reader<'_> {
    fn node(&self, shape: Shape, start: usize, parts: Vec<Node>) -> Node {
        Node { shape, start, end: self.end(), parts }
    }

    fn expression(&mut self) -> Result<Node, ExportError> {
        let start = self.start();
        let mut parts = vec![self.assignment()?];
        while self.accept(",") {
            parts.push(self.assignment()?);
        }
        Ok(match parts.len() {
            1 => parts.remove(0),
            _ => self.node(Shape::Other, start, parts),
        })
    }

    fn assignment(&mut self) -> Result<Node, ExportError> {
        let start = self.start();
        let left = self.choice()?;
        if !ASSIGNMENTS.contains(&self.peek()) {
            return Ok(left);
        }
        self.at += 1;
        let right = self.assignment()?;
        Ok(self.node(Shape::Other, start, vec![left, right]))
    }

    fn choice(&mut self) -> Result<Node, ExportError> {
        let start = self.start();
        let condition = self.binary(0)?;
        if !self.accept("?") {
            return Ok(condition);
        }
        let one = self.expression()?;
        self.expect(":")?;
        let other = self.choice()?;
        Ok(self.node(Shape::Choice, start, vec![condition, one, other]))
    }

    fn binary(&mut self, level: usize) -> Result<Node, ExportError> {
        let Some(operators) = BINARY.get(level) else { return self.unary() };
        let start = self.start();
        let mut left = self.binary(level + 1)?;
        while operators.contains(&self.peek()) {
            let shape = match self.peek() {
                "||" => Shape::Or,
                "&&" => Shape::And,
                "==" | "!=" | "<" | ">" | "<=" | ">=" => Shape::Compare,
                _ => Shape::Other,
            };
            self.at += 1;
            let right = self.binary(level + 1)?;
            left = self.node(shape, start, vec![left, right]);
        }
        Ok(left)
    }

    fn unary(&mut self) -> Result<Node, ExportError> {
        let start = self.start();
        let operator = self.peek();
        if operator == "sizeof" {
            self.at += 1;
            match self.peek() == "(" {
                true => self.skip_brackets()?,
                false => drop(self.unary()?),
            }
            return Ok(self.node(Shape::Other, start, vec![]));
        }
        if UNARY.contains(&operator) {
            self.at += 1;
            let shape = if operator == "!" { Shape::Not } else { Shape::Other };
            let inner = self.unary()?;
            return Ok(self.node(shape, start, vec![inner]));
        }
        if operator == "(" && self.is_type(1) {
            self.skip_brackets()?;
            let inner = self.unary()?;
            return Ok(self.node(Shape::Other, start, vec![inner]));
        }
        self.postfix()
    }

    fn postfix(&mut self) -> Result<Node, ExportError> {
        let start = self.start();
        let mut node = self.primary()?;
        loop {
            match self.peek() {
                "[" | "(" => {
                    let closing = if self.peek() == "[" { "]" } else { ")" };
                    self.at += 1;
                    let mut parts = vec![node];
                    if self.peek() != closing {
                        parts.push(self.expression()?);
                    }
                    self.expect(closing)?;
                    node = self.node(Shape::Other, start, parts);
                }
                "." | "->" => {
                    self.at += 2;
                    node = self.node(Shape::Other, start, vec![node]);
                }
                "++" | "--" => {
                    self.at += 1;
                    node = self.node(Shape::Other, start, vec![node]);
                }
                _ => return Ok(node),
            }
        }
    }

    fn primary(&mut self) -> Result<Node, ExportError> {
        let start = self.start();
        if self.accept("(") {
            let inner = self.expression()?;
            self.expect(")")?;
            return Ok(self.node(Shape::Group, start, vec![inner]));
        }
        let is_known = self.tokens.get(self.at).is_some_and(|t| t.is_word() || t.is_constant());
        if !is_known || self.is_type(0) {
            return self.refuse();
        }
        self.at += 1;
        Ok(self.node(Shape::Other, start, vec![]))
    }
}

// ---- Decisions. ----

impl Reader<'_> {
    fn insert(&mut self, at: usize, text: String) {
        self.found.inserts.push(Insert { at, text });
    }

    /// Finds the decisions in an expression whose value is no decision of a statement.
    fn visit(&mut self, node: &Node) -> Result<(), ExportError> {
        match node.shape {
            Shape::And | Shape::Or | Shape::Not | Shape::Compare => {
                self.decide(node, DecisionKind::Value)
            }
            Shape::Choice => {
                let [condition, branches @ ..] = node.parts.as_slice() else { return Ok(()) };
                self.decide(condition, DecisionKind::Choice)?;
                branches.iter().try_for_each(|branch| self.visit(branch))
            }
            Shape::Group | Shape::Other => node.parts.iter().try_for_each(|part| self.visit(part)),
        }
    }

    /// Notes a decision without its conditions; returns its place among those of the file.
    fn open(&mut self, node: &Node, kind: DecisionKind) -> Result<usize, ExportError> {
        self.found.decisions.push(Decision {
            file: self.file,
            function: self.function.clone(),
            line: line_of(self.text, node.start),
            column: 1 + node.start - self.text[..node.start].rfind('\n').map_or(0, |end| end + 1),
            kind,
            text: one_line(&self.text[node.start..node.end]),
            conditions: Vec::new(),
            tree: ConditionTree::Cases,
        });
        Ok(self.found.decisions.len() - 1)
    }

    fn decide(&mut self, node: &Node, kind: DecisionKind) -> Result<(), ExportError> {
        let number = self.open(node, kind)?;
        let id = self.first + number;
        self.insert(node.start, format!("(mcdc_begin({id}), mcdc_end({id}, ("));
        let tree = self.connect(node, number)?;
        self.insert(node.end, ")))".into());
        if self.found.decisions[number].conditions.len() > MOST_CONDITIONS {
            return Err(refused(self.file, self.text, node.start));
        }
        self.found.decisions[number].tree = tree;
        Ok(())
    }

    /// How the conditions below a node are connected. Each is recorded.
    fn connect(&mut self, node: &Node, number: usize) -> Result<ConditionTree, ExportError> {
        Ok(match (node.shape, node.parts.as_slice()) {
            (Shape::Group, [inner]) => self.connect(inner, number)?,
            (Shape::Not, [inner]) => ConditionTree::Not(Box::new(self.connect(inner, number)?)),
            (Shape::And, [left, right]) => ConditionTree::And(Box::new([
                self.connect(left, number)?,
                self.connect(right, number)?,
            ])),
            (Shape::Or, [left, right]) => ConditionTree::Or(Box::new([
                self.connect(left, number)?,
                self.connect(right, number)?,
            ])),
            _ => self.condition(node, number)?,
        })
    }

    fn condition(&mut self, node: &Node, number: usize) -> Result<ConditionTree, ExportError> {
        let conditions = &mut self.found.decisions[number].conditions;
        let place = conditions.len();
        conditions.push(one_line(&self.text[node.start..node.end]));
        let id = self.first + number;
        self.insert(node.start, format!("mcdc_condition({id}, {place}, ("));
        match node.shape {
            Shape::Compare => node.parts.iter().try_for_each(|part| self.visit(part))?,
            _ => self.visit(node)?,
        }
        self.insert(node.end, "))".into());
        Ok(ConditionTree::Condition(place))
    }
}

/// A text with single spaces.
fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
