//! Trees, drawn from the root at the left to the leaves, so that a large tree extends downwards like a page.
//!
//! The layout is tidy: a node is centered beside its children, subtrees move together until their outlines touch, and
//! equal subtrees look equal everywhere. Long texts wrap to limit the width of a tree; readers scroll it instead of
//! shrinking it.

use super::Figure;
use super::font;
use super::legend::{self, LegendEntry, Swatch};
use super::style::{FRAME, GREY, Look, look, tint};
use super::svg::{Anchor, Area, Canvas, Type};

/// A figure of a tree.
#[derive(Debug, Clone, PartialEq)]
pub struct TreeFigure {
    /// The figure's title, may be empty.
    pub title: String,
    /// The class names, in the order of the nodes' shares.
    pub classes: Vec<String>,
    /// Styles of the classes; the others get the default style of their index.
    pub looks: Vec<Look>,
    /// The root.
    pub root: Node,
}

/// A node: lines of text, class shares, and children.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Node {
    /// The text, the first line in bold.
    pub lines: Vec<String>,
    /// The amount of each class in the node, in any common measure; empty for no bar.
    pub shares: Vec<f64>,
    /// The children from left to right.
    pub children: Vec<Branch>,
    /// The symbol of a fault tree.
    pub symbol: Option<TreeSymbol>,
}

/// A symbol of fault trees, drawn between a node and what leads to it (IEC 61025).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TreeSymbol {
    /// All children.
    And,
    /// At least one child.
    Or,
    /// A basic event.
    BasicEvent,
    /// An event whose causes are not drawn.
    Undeveloped,
    /// A gate that is drawn elsewhere.
    Transfer,
}

impl TreeSymbol {
    /// The outline in SVG's path language, from the node at (0, 0) to its children at (14, 0).
    fn path(self) -> &'static str {
        match self {
            TreeSymbol::And => "M14,-7 H7 A7,7 0 0 0 7,7 H14 Z",
            TreeSymbol::Or => "M14,-7 Q4,-7 0,0 Q4,7 14,7 Q10,0 14,-7 Z",
            TreeSymbol::BasicEvent => "M0,0 A7,7 0 0 1 14,0 A7,7 0 0 1 0,0 Z",
            TreeSymbol::Undeveloped => "M0,0 L7,7 L14,0 L7,-7 Z",
            TreeSymbol::Transfer => "M0,0 L14,7 L14,-7 Z",
        }
    }
}

/// A child with the label of the edge to it.
#[derive(Debug, Clone, PartialEq)]
pub struct Branch {
    /// The edge's label, such as `yes`.
    pub label: String,
    /// The child.
    pub node: Node,
}

impl Node {
    /// A node without children.
    pub fn leaf(lines: Vec<String>, shares: Vec<f64>) -> Self {
        Self { lines, shares, ..Self::default() }
    }

    /// A node with a test: the left child for `yes`, the right one for `no`.
    pub fn split(lines: Vec<String>, shares: Vec<f64>, yes: Node, no: Node) -> Self {
        let branch = |label: &str, node| Branch { label: label.to_owned(), node };
        let children = vec![branch("yes", yes), branch("no", no)];
        Self { lines, shares, children, symbol: None }
    }

    /// The wrapped lines, and whether each is bold.
    fn set_lines(&self) -> Vec<(String, bool)> {
        let wrapped = self.lines.iter().enumerate().flat_map(|(place, line)| {
            let bold = place == 0;
            font::wrap(line, TEXT_WIDTH, SIZE, bold).into_iter().map(move |line| (line, bold))
        });
        wrapped.collect()
    }

    fn width(&self) -> f64 {
        let lines = self.set_lines();
        let widths = lines.iter().map(|(line, bold)| font::width(line, SIZE, *bold));
        widths.fold(MIN_WIDTH, f64::max) + 2.0 * PADDING
    }

    fn height(&self) -> f64 {
        let bar = if self.shares.is_empty() { 0.0 } else { BAR };
        LINE * self.set_lines().len() as f64 + bar + 2.0 * PADDING
    }

    fn has_symbols(&self) -> bool {
        self.symbol.is_some() || self.children.iter().any(|branch| branch.node.has_symbols())
    }

    /// The class with the largest share.
    fn main_class(&self) -> Option<usize> {
        let shares = self.shares.iter().enumerate();
        let largest =
            shares.filter(|(_, share)| **share > 0.0).fold(None, |best, next| match best {
                Some((_, share)) if share >= next.1 => best,
                _ => Some(next),
            });
        largest.map(|(class, _)| class)
    }
}

const MARGIN: f64 = 12.0;
const SIZE: f64 = 10.5;
const LINE: f64 = 13.0;
/// Lines are wrapped at this width.
const TEXT_WIDTH: f64 = 124.0;
const PADDING: f64 = 4.0;
const BAR: f64 = 8.0;
const MIN_WIDTH: f64 = 44.0;
const SIBLING_GAP: f64 = 7.0;
const LEVEL_GAP: f64 = 32.0;
/// Length of a symbol; the edges from level to level bend behind it.
const SYMBOL: f64 = 14.0;
const LEGEND_WIDTH: f64 = 900.0;

impl TreeFigure {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let placed = Placed::of(&self.root);
        let mut widths = Vec::new();
        level_widths(&self.root, 0, &mut widths);
        let (first, last) = placed.extent();
        // The last level may have symbols, too.
        let end = if self.root.has_symbols() { SYMBOL } else { 0.0 };
        let wide = widths.iter().map(|width| width + LEVEL_GAP).sum::<f64>() - LEVEL_GAP + end;
        let title_width = font::width(&self.title, 13.0, true);
        let width = wide.max(title_width).max(320.0) + 2.0 * MARGIN;
        let top = self.draw_header(&mut canvas, width);
        let mut begins = vec![MARGIN];
        for width in &widths {
            begins.push(begins[begins.len() - 1] + width + LEVEL_GAP);
        }
        let levels = Levels { begins: &begins, looks: &self.looks };
        levels.draw_edges(&mut canvas, &placed, top - first, 0);
        levels.draw_nodes(&mut canvas, &placed, top - first, 0);
        canvas.finish(width, top + (last - first) + MARGIN, &self.title)
    }

    fn draw_header(&self, canvas: &mut Canvas, width: f64) -> f64 {
        let mut y = MARGIN;
        if !self.title.is_empty() {
            canvas.text((MARGIN, y + 12.0), &self.title, Type::new(13.0).bold());
            y += 20.0;
        }
        let named = self.classes.iter().enumerate();
        let entries: Vec<LegendEntry> = named
            .map(|(index, name)| LegendEntry {
                name: name.clone(),
                swatch: Swatch::Box(look(&self.looks, index)),
            })
            .collect();
        // A wide tree is scrolled, but its legend must be visible at once.
        let rows = legend::rows(&entries, width.min(LEGEND_WIDTH) - 2.0 * MARGIN);
        legend::draw(canvas, (MARGIN, y), &rows);
        y + legend::ROW * rows.len() as f64 + 10.0
    }
}

/// A subtree laid out with its root's middle at zero.
struct Placed<'a> {
    node: &'a Node,
    /// Each child with the position of its middle.
    children: Vec<(f64, Placed<'a>)>,
    /// The upper and lower edges of the subtree, level by level.
    outline: Vec<(f64, f64)>,
}

impl<'a> Placed<'a> {
    fn of(node: &'a Node) -> Self {
        let half = node.height() / 2.0;
        let mut children: Vec<(f64, Placed)> = Vec::new();
        let mut outline: Vec<(f64, f64)> = Vec::new();
        for branch in &node.children {
            let child = Placed::of(&branch.node);
            let shift = distance(&outline, &child.outline);
            merge(&mut outline, &child.outline, shift);
            children.push((shift, child));
        }
        let first = children.first().map_or(0.0, |child| child.0);
        let last = children.last().map_or(0.0, |child| child.0);
        let middle = (first + last) / 2.0;
        children.iter_mut().for_each(|child| child.0 -= middle);
        let below = outline.iter().map(|(top, bottom)| (top - middle, bottom - middle));
        let outline = std::iter::once((-half, half)).chain(below).collect();
        Self { node, children, outline }
    }

    fn extent(&self) -> (f64, f64) {
        let levels = self.outline.iter();
        levels.fold((0.0, 0.0), |range, level| (level.0.min(range.0), level.1.max(range.1)))
    }
}

/// Distance by which a subtree must move below an outline.
fn distance(outline: &[(f64, f64)], next: &[(f64, f64)]) -> f64 {
    let levels = outline.iter().zip(next).map(|(one, other)| one.1 - other.0 + SIBLING_GAP);
    if outline.is_empty() { 0.0 } else { levels.fold(f64::NEG_INFINITY, f64::max) }
}

fn merge(outline: &mut Vec<(f64, f64)>, next: &[(f64, f64)], shift: f64) {
    for (level, (top, bottom)) in next.iter().enumerate() {
        match outline.get_mut(level) {
            Some(own) => own.1 = bottom + shift,
            None => outline.push((top + shift, bottom + shift)),
        }
    }
}

fn level_widths(node: &Node, level: usize, widths: &mut Vec<f64>) {
    if widths.len() == level {
        widths.push(0.0);
    }
    widths[level] = widths[level].max(node.width());
    for branch in &node.children {
        level_widths(&branch.node, level + 1, widths);
    }
}

/// A tree's levels on a canvas.
struct Levels<'a> {
    /// The left edge of each level.
    begins: &'a [f64],
    /// Styles of the classes.
    looks: &'a [Look],
}

impl Levels<'_> {
    fn draw_edges(&self, canvas: &mut Canvas, placed: &Placed, y: f64, level: usize) {
        let from = self.begins[level] + placed.node.width();
        for ((shift, child), branch) in placed.children.iter().zip(&placed.node.children) {
            let (to, there) = (self.begins[level + 1], y + shift);
            let bend = to - LEVEL_GAP / 2.0;
            let points = [(from, y), (bend, y), (bend, there), (to, there)];
            canvas.path(&points, &format!(" stroke=\"{FRAME}\""));
            let at = (bend + 2.0, there + if *shift <= 0.0 { -3.0 } else { 10.0 });
            canvas.text(at, &branch.label, Type::new(8.5).colour(GREY).rim());
            self.draw_edges(canvas, child, there, level + 1);
        }
    }

    fn draw_nodes(&self, canvas: &mut Canvas, placed: &Placed, middle: f64, level: usize) {
        let (width, height) = (placed.node.width(), placed.node.height());
        let area = Area { x: self.begins[level], y: middle - height / 2.0, width, height };
        canvas.titled(&placed.node.lines.join(", "), |canvas| {
            draw_node(canvas, placed.node, area, self.looks);
        });
        if let Some(symbol) = placed.node.symbol {
            let at = format!(" transform=\"translate({:.1} {middle:.1})\"", area.right());
            canvas.shape(symbol.path(), &format!("{at} fill=\"#ffffff\" stroke=\"{FRAME}\""));
        }
        for (shift, child) in &placed.children {
            self.draw_nodes(canvas, child, middle + shift, level + 1);
        }
    }
}

fn draw_node(canvas: &mut Canvas, node: &Node, area: Area, looks: &[Look]) {
    let leaf = node.children.is_empty();
    let class = node.main_class().filter(|_| leaf);
    let fill =
        class.map_or(" fill=\"#ffffff\"".to_owned(), |class| tint(look(looks, class).colour, 0.22));
    let stroke = class.map_or(FRAME, |class| look(looks, class).colour);
    let corner = if leaf { 5 } else { 0 };
    canvas.rect(area, &format!(" rx=\"{corner}\"{fill} stroke=\"{stroke}\""));
    for (place, (line, bold)) in node.set_lines().iter().enumerate() {
        let kind = Type::new(SIZE).anchor(Anchor::Middle);
        let kind = if *bold { kind.bold() } else { kind };
        let at = (area.x + area.width / 2.0, area.y + PADDING + LINE * (place as f64 + 0.8));
        canvas.text(at, line, kind);
    }
    draw_shares(canvas, node, area, looks);
}

fn draw_shares(canvas: &mut Canvas, node: &Node, area: Area, looks: &[Look]) {
    let positive = |share: &f64| {
        if share.is_finite() { share.max(0.0) } else { 0.0 }
    };
    let total: f64 = node.shares.iter().map(positive).sum();
    if total <= 0.0 {
        return;
    }
    let full = area.width - 2.0 * PADDING;
    let bar = Area {
        x: area.x + PADDING,
        y: area.bottom() - PADDING - BAR + 2.0,
        width: full,
        height: BAR - 2.0,
    };
    let mut x = bar.x;
    for (class, share) in node.shares.iter().enumerate() {
        let width = full * positive(share) / total;
        if width > 0.0 {
            let fill = format!(" fill=\"{}\"", look(looks, class).colour);
            canvas.rect(Area { x, width, ..bar }, &fill);
        }
        x += width;
    }
    canvas.rect(bar, &format!(" fill=\"none\" stroke=\"{FRAME}\" stroke-width=\".5\""));
}
