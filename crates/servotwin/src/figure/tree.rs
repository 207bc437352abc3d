//! Decision trees, drawn from the root at the top to the leaves.
//!
//! The layout is tidy: a node stands above the middle of its children, subtrees are moved together
//! until their outlines touch, and equal subtrees look equal wherever they stand.

use super::Figure;
use super::font;
use super::legend::{self, Entry, Swatch};
use super::style::{FRAME, GREY, colour, tint};
use super::svg::{Anchor, Area, Canvas, Type};

/// A figure of a tree.
#[derive(Debug, Clone, PartialEq)]
pub struct Tree {
    /// The figure's title, may be empty.
    pub title: String,
    /// The class names, in the order of the nodes' shares.
    pub classes: Vec<String>,
    /// The root.
    pub root: Node,
}

/// A node: lines of text, the shares of the classes in it, and what is below.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Node {
    /// The text, the first line in bold.
    pub lines: Vec<String>,
    /// How much of each class is in the node, in any common measure; empty for no bar.
    pub shares: Vec<f64>,
    /// The children from left to right.
    pub children: Vec<Branch>,
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
        Self { lines, shares, children: Vec::new() }
    }

    /// A node that asks a question: the left child for `yes`, the right one for `no`.
    pub fn split(lines: Vec<String>, shares: Vec<f64>, yes: Node, no: Node) -> Self {
        let branch = |label: &str, node| Branch { label: label.to_owned(), node };
        Self { lines, shares, children: vec![branch("yes", yes), branch("no", no)] }
    }

    fn width(&self) -> f64 {
        let lines = self.lines.iter().enumerate();
        let widths = lines.map(|(place, line)| font::width(line, SIZE, place == 0));
        widths.fold(MIN_WIDTH, f64::max) + 2.0 * PADDING
    }

    fn height(&self) -> f64 {
        let bar = if self.shares.is_empty() { 0.0 } else { BAR };
        LINE * self.lines.len() as f64 + bar + 2.0 * PADDING
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
const SIZE: f64 = 9.0;
const LINE: f64 = 11.5;
const PADDING: f64 = 4.0;
const BAR: f64 = 8.0;
const MIN_WIDTH: f64 = 44.0;
const SIBLING_GAP: f64 = 8.0;
const LEVEL_GAP: f64 = 30.0;

impl Tree {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let placed = Placed::of(&self.root);
        let mut heights = Vec::new();
        level_heights(&self.root, 0, &mut heights);
        let (left, right) = placed.extent();
        let title_width = font::width(&self.title, 13.0, true);
        let width = (right - left).max(title_width).max(320.0) + 2.0 * MARGIN;
        let top = self.draw_header(&mut canvas, width);
        let mut levels = vec![top];
        for height in &heights {
            levels.push(levels[levels.len() - 1] + height + LEVEL_GAP);
        }
        let root_x = MARGIN - left + (width - 2.0 * MARGIN - (right - left)) / 2.0;
        draw_edges(&mut canvas, &placed, root_x, 0, &levels);
        draw_nodes(&mut canvas, &placed, root_x, 0, &levels);
        let bottom = levels[levels.len() - 1] - LEVEL_GAP + MARGIN;
        canvas.finish(width, bottom, &self.title)
    }

    fn draw_header(&self, canvas: &mut Canvas, width: f64) -> f64 {
        let mut y = MARGIN;
        if !self.title.is_empty() {
            canvas.text((MARGIN, y + 12.0), &self.title, Type::new(13.0).bold());
            y += 20.0;
        }
        let named = self.classes.iter().enumerate();
        let entries: Vec<Entry> = named
            .map(|(index, name)| Entry { name: name.clone(), swatch: Swatch::Box(index) })
            .collect();
        let rows = legend::rows(&entries, width - 2.0 * MARGIN);
        legend::draw(canvas, (MARGIN, y), &rows);
        y + legend::ROW * rows.len() as f64 + 10.0
    }
}

/// A subtree laid out with its root's middle at zero.
struct Placed<'a> {
    node: &'a Node,
    /// Each child with the place of its middle.
    children: Vec<(f64, Placed<'a>)>,
    /// The left and right edges of the subtree, level by level.
    outline: Vec<(f64, f64)>,
}

impl<'a> Placed<'a> {
    fn of(node: &'a Node) -> Self {
        let half = node.width() / 2.0;
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
        let below = outline.iter().map(|(left, right)| (left - middle, right - middle));
        let outline = std::iter::once((-half, half)).chain(below).collect();
        Self { node, children, outline }
    }

    fn extent(&self) -> (f64, f64) {
        let levels = self.outline.iter();
        levels.fold((0.0, 0.0), |range, level| (level.0.min(range.0), level.1.max(range.1)))
    }
}

/// How far a subtree must be moved to the right of an outline.
fn distance(outline: &[(f64, f64)], next: &[(f64, f64)]) -> f64 {
    let levels = outline.iter().zip(next).map(|(one, other)| one.1 - other.0 + SIBLING_GAP);
    if outline.is_empty() { 0.0 } else { levels.fold(f64::NEG_INFINITY, f64::max) }
}

fn merge(outline: &mut Vec<(f64, f64)>, next: &[(f64, f64)], shift: f64) {
    for (level, (left, right)) in next.iter().enumerate() {
        match outline.get_mut(level) {
            Some(own) => own.1 = right + shift,
            None => outline.push((left + shift, right + shift)),
        }
    }
}

fn level_heights(node: &Node, level: usize, heights: &mut Vec<f64>) {
    if heights.len() == level {
        heights.push(0.0);
    }
    heights[level] = heights[level].max(node.height());
    for branch in &node.children {
        level_heights(&branch.node, level + 1, heights);
    }
}

fn draw_edges(canvas: &mut Canvas, placed: &Placed, x: f64, level: usize, levels: &[f64]) {
    let from = (x, levels[level] + placed.node.height());
    for ((shift, child), branch) in placed.children.iter().zip(&placed.node.children) {
        let to = (x + shift, levels[level + 1]);
        let bend = levels[level + 1] - LEVEL_GAP / 2.0;
        let points = [from, (from.0, bend), (to.0, bend), to];
        canvas.path(&points, &format!(" stroke=\"{FRAME}\""));
        let leftwards = *shift <= 0.0;
        let anchor = if leftwards { Anchor::End } else { Anchor::Start };
        let side = if leftwards { -3.0 } else { 3.0 };
        let kind = Type::new(8.5).colour(GREY).anchor(anchor).rim();
        canvas.text((to.0 + side, bend + 11.0), &branch.label, kind);
        draw_edges(canvas, child, to.0, level + 1, levels);
    }
}

fn draw_nodes(canvas: &mut Canvas, placed: &Placed, x: f64, level: usize, levels: &[f64]) {
    draw_node(canvas, placed.node, x, levels[level]);
    for (shift, child) in &placed.children {
        draw_nodes(canvas, child, x + shift, level + 1, levels);
    }
}

fn draw_node(canvas: &mut Canvas, node: &Node, x: f64, y: f64) {
    let width = node.width();
    let area = Area { x: x - width / 2.0, y, width, height: node.height() };
    let leaf = node.children.is_empty();
    let class = node.main_class().filter(|_| leaf);
    let fill = class.map_or("#ffffff".to_owned(), |class| tint(colour(class), 0.22));
    let stroke = class.map_or(FRAME, colour);
    let corner = if leaf { 5 } else { 0 };
    canvas.rect(area, &format!(" rx=\"{corner}\" fill=\"{fill}\" stroke=\"{stroke}\""));
    for (place, line) in node.lines.iter().enumerate() {
        let kind = Type::new(SIZE).anchor(Anchor::Middle);
        let kind = if place == 0 { kind.bold() } else { kind };
        canvas.text((x, y + PADDING + LINE * (place as f64 + 0.8)), line, kind);
    }
    draw_shares(canvas, node, area);
}

fn draw_shares(canvas: &mut Canvas, node: &Node, area: Area) {
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
            let fill = format!(" fill=\"{}\"", colour(class));
            canvas.rect(Area { x, width, ..bar }, &fill);
        }
        x += width;
    }
    canvas.rect(bar, &format!(" fill=\"none\" stroke=\"{FRAME}\" stroke-width=\".5\""));
}
