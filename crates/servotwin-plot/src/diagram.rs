//! Block diagrams: components in columns, their connections as right-angled wires.
//!
//! The layout is automatic and layered. A block's column is its distance, in wires, from the nearest block without
//! incoming wires, or the requested column. Its group, such as an actuator, is a horizontal band. Within a band, the
//! blocks are ordered and placed by the mean of their neighbors, in several forward and backward sweeps. Wires run only
//! between the columns, each on its own track, and pass a column through a reserved gap: none crosses a block. Wires
//! from the same port form one branching line, with a dot at every branch. Lines that cross without a dot are not
//! connected.
//! A diagram can be drawn downwards. Rows then replace columns, bands stand side by side, and blocks show the names of
//! their ports. Only the picture is turned, not the layout. So *along* is the direction from layer to layer, and
//! *across* is the direction within one.

use std::collections::{BTreeMap, VecDeque};

use super::Figure;
use super::font;
use super::junction::{Line, junctions};
use super::legend::{self, LegendEntry, Swatch};
use super::style::{GREY, Look, look, tint};
use super::svg::{Anchor, Area, Canvas, Type};

/// A figure of blocks and wires.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Diagram {
    /// The figure's title, may be empty.
    pub title: String,
    /// The groups from top to bottom; others follow in the order of their appearance.
    pub groups: Vec<String>,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// The wires; those to an unknown block or back to their own are not drawn.
    pub wires: Vec<Wire>,
    /// Kinds with the first colors, so that these are the same in every diagram.
    pub kinds: Vec<String>,
    /// Styles of the kinds, in the order of `kinds` and then of appearance; the others get the default style of their
    /// index.
    pub looks: Vec<Look>,
    /// Whether the layers run from top to bottom.
    pub downwards: bool,
}

/// A component.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Block {
    /// The name that wires use.
    pub id: String,
    /// The text, the first line in bold.
    pub lines: Vec<String>,
    /// The kind of component, which sets the color.
    pub kind: String,
    /// The band it stands in, may be empty.
    pub group: String,
    /// The column, from 0; `None` to derive it from the wires.
    pub layer: Option<usize>,
}

impl Block {
    /// A block from its id, text (with line feeds), kind and group.
    pub fn new(id: &str, text: &str, kind: &str, group: &str) -> Self {
        Self {
            id: id.to_owned(),
            lines: text.lines().map(str::to_owned).collect(),
            kind: kind.to_owned(),
            group: group.to_owned(),
            layer: None,
        }
    }

    fn width(&self) -> f64 {
        let lines = self.lines.iter().enumerate();
        let widths = lines.map(|(place, line)| font::width(line, SIZE, place == 0));
        widths.fold(40.0, f64::max) + 12.0
    }

    fn height(&self) -> f64 {
        LINE * self.lines.len().max(1) as f64 + 10.0
    }
}

/// A connection.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Wire {
    /// The id of the block where it starts.
    pub from: String,
    /// The id of the block where it ends.
    pub to: String,
    /// The kind of medium or signal, which sets color and dash.
    pub kind: String,
    /// A text at its end, may be empty.
    pub label: String,
    /// Whether its end has an arrow head.
    pub arrow: bool,
    /// The names of its ports, shown if the diagram is drawn downwards; a space for a port without a name. Wires from
    /// the same port form one branching line. Wires with an empty start port are separate lines.
    pub ports: [String; 2],
}

impl Wire {
    /// A wire without label and arrow head.
    pub fn new(from: &str, to: &str, kind: &str) -> Self {
        Self { from: from.to_owned(), to: to.to_owned(), kind: kind.to_owned(), ..Self::default() }
    }

    /// The connected ports as text, e.g. `valve.a → cylinder.a`.
    fn in_words(&self) -> String {
        let end = |id: &str, port: &str| match port.trim() {
            "" => id.to_owned(),
            port => format!("{id}.{port}"),
        };
        let [from, to] = &self.ports;
        let sign = if self.arrow { "→" } else { "–" };
        format!("{} {sign} {}", end(&self.from, from), end(&self.to, to))
    }
}

const MARGIN: f64 = 12.0;
const SIZE: f64 = 9.5;
const PORT_SIZE: f64 = 7.5;
/// Space for port names at one edge of a block.
const PORT_LINE: f64 = 10.0;
/// Radius of the dot at a junction.
const JUNCTION: f64 = 2.4;
/// Maximum width of a block due to the names of its ports.
const WIDEST: f64 = 300.0;
const LINE: f64 = 12.0;
const LABEL_SIZE: f64 = 8.0;
const GAP: f64 = 12.0;
const BAND_GAP: f64 = 10.0;
const BAND_HEAD: f64 = 18.0;
const TRACK: f64 = 7.0;
const CHANNEL_SIDE: f64 = 12.0;
/// Number of sweeps of ordering and placing; the picture hardly changes after half of them.
const SWEEPS: usize = 12;

impl Diagram {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let layout = Layout::of(self);
        let kinds = self.kinds();
        let entries = self.legend(&kinds);
        let title_width = font::width(&self.title, 13.0, true) + 2.0 * MARGIN;
        let wide = if self.downwards { layout.height + 2.0 * MARGIN } else { layout.width };
        let width = wide.max(title_width).max(240.0);
        let mut top = MARGIN;
        if !self.title.is_empty() {
            canvas.text((MARGIN, top + 12.0), &self.title, Type::new(13.0).bold());
            top += 20.0;
        }
        let rows = legend::rows(&entries, width - 2.0 * MARGIN);
        legend::draw(&mut canvas, (MARGIN, top), &rows);
        top += legend::ROW * rows.len() as f64 + 8.0;
        let view = View { downwards: self.downwards, top };
        layout.draw_bands(&mut canvas, view, width);
        layout.draw_wires(&mut canvas, view, self, &kinds);
        layout.draw_blocks(&mut canvas, view, self, &kinds);
        layout.draw_labels(&mut canvas, view, self);
        layout.draw_port_names(&mut canvas, view, self);
        let high = if self.downwards { layout.width } else { layout.height };
        canvas.finish(width, top + high + MARGIN, &self.title)
    }

    /// Every kind once: those of `kinds` first, then those of wires and blocks.
    fn kinds(&self) -> Vec<&str> {
        let first = self.kinds.iter().map(String::as_str);
        let wires = self.wires.iter().map(|wire| wire.kind.as_str());
        unique(first.chain(wires).chain(self.blocks.iter().map(|block| block.kind.as_str())))
    }

    /// Every kind in use, once: blocks and wires of one kind have the same color.
    fn legend(&self, kinds: &[&str]) -> Vec<LegendEntry> {
        let mut entries = Vec::new();
        for (index, kind) in kinds.iter().enumerate().filter(|(_, kind)| !kind.is_empty()) {
            let mut add = |swatch| entries.push(LegendEntry { name: (*kind).to_owned(), swatch });
            if self.wires.iter().any(|wire| wire.kind == *kind) {
                add(Swatch::Line(look(&self.looks, index)));
            } else if self.blocks.iter().any(|block| block.kind == *kind) {
                add(Swatch::Box(look(&self.looks, index)));
            }
        }
        entries
    }

    /// A block's size along and across the layers.
    fn size(&self, block: &Block) -> (f64, f64) {
        if !self.downwards {
            return (block.width(), block.height());
        }
        let own = |wire: &Wire| {
            let ends = [&wire.from, &wire.to].into_iter().zip(&wire.ports);
            ends.filter(|(id, port)| **id == block.id && !port.trim().is_empty())
                .map(|(_, port)| port.clone())
                .collect::<Vec<_>>()
        };
        let mut names: Vec<String> = self.wires.iter().flat_map(own).collect();
        names.sort();
        names.dedup();
        let names_width: f64 = names.iter().map(|name| port_width(name)).sum();
        let edges = if names.is_empty() { 0.0 } else { 2.0 * PORT_LINE };
        (block.height() + edges, block.width().max(names_width.min(WIDEST)))
    }

    /// The key that joins wires into one line: the port where they start, or the single wire.
    fn net(&self, wire: usize) -> String {
        let own = &self.wires[wire];
        match own.ports[0].as_str() {
            "" => format!("{wire}"),
            port => format!("{}.{port}", own.from),
        }
    }

    fn group_names(&self) -> Vec<&str> {
        let named = self.groups.iter().map(String::as_str);
        let all = unique(named.chain(self.blocks.iter().map(|block| block.group.as_str())));
        let used = |name: &&str| self.blocks.iter().any(|block| block.group == **name);
        all.into_iter().filter(used).collect()
    }
}

fn port_width(name: &str) -> f64 {
    font::width(name, PORT_SIZE, false) + 8.0
}

/// Converts the layout to the picture.
#[derive(Debug, Clone, Copy)]
struct View {
    downwards: bool,
    top: f64,
}

impl View {
    fn point(self, (along, across): (f64, f64)) -> (f64, f64) {
        match self.downwards {
            true => (across + MARGIN, along + self.top),
            false => (along, across + self.top),
        }
    }

    fn area(self, (along, across): (f64, f64), size: (f64, f64)) -> Area {
        let (x, y) = self.point((along, across));
        let (width, height) = if self.downwards { (size.1, size.0) } else { size };
        Area { x, y, width, height }
    }
}

fn unique<'a>(names: impl Iterator<Item = &'a str>) -> Vec<&'a str> {
    let mut seen = Vec::new();
    for name in names {
        if !seen.contains(&name) {
            seen.push(name);
        }
    }
    seen
}

/// A block, or the gap through which a long wire passes a column.
#[derive(Debug, Clone)]
struct Item {
    block: Option<usize>,
    layer: usize,
    group: usize,
    width: f64,
    height: f64,
    top: f64,
}

impl Item {
    fn middle(&self) -> f64 {
        self.top + self.height / 2.0
    }
}

/// A piece of a wire between adjacent columns, or within one.
#[derive(Debug, Clone)]
struct Piece {
    wire: usize,
    /// Index of its net: pieces of one net may touch each other.
    net: usize,
    /// The items at both ends; the first one's column is the lower or the same.
    ends: [usize; 2],
    /// Its positions at both items, across.
    ports: [f64; 2],
    /// Its track in the channel after the first end's column.
    track: Option<usize>,
}

/// The point where pieces of one port leave a side of an item.
struct Port {
    /// The name, empty for none.
    name: String,
    /// Index of the pieces' net.
    net: usize,
    /// Positions of the items at the other ends, across.
    aims: Vec<f64>,
    /// The pieces, each with its end (0 or 1) at this port.
    ends: Vec<(usize, usize)>,
}

impl Port {
    fn aim(&self) -> f64 {
        self.aims.iter().sum::<f64>() / self.aims.len() as f64
    }

    /// Its share of the side.
    fn width(&self) -> f64 {
        port_width(&self.name)
    }
}

#[derive(Debug)]
struct Band {
    name: String,
    top: f64,
    height: f64,
}

struct Layout {
    items: Vec<Item>,
    pieces: Vec<Piece>,
    bands: Vec<Band>,
    /// Left edge and width of each column.
    columns: Vec<(f64, f64)>,
    width: f64,
    height: f64,
}

impl Layout {
    fn of(diagram: &Diagram) -> Self {
        let places: BTreeMap<&str, usize> = diagram
            .blocks
            .iter()
            .enumerate()
            .map(|(place, block)| (block.id.as_str(), place))
            .collect();
        let ends = |wire: &Wire| {
            let from = places.get(wire.from.as_str())?;
            let to = places.get(wire.to.as_str())?;
            (from != to).then_some((*from, *to))
        };
        let wires: Vec<Option<(usize, usize)>> = diagram.wires.iter().map(ends).collect();
        let groups = diagram.group_names();
        let mut items = block_items(diagram, &wires, &groups);
        let pieces = split_wires(diagram, &wires, &mut items);
        let bands = stack_bands(&groups, &items);
        let height = bands.last().map_or(0.0, |band| band.top + band.height);
        let mut layout = Self { items, pieces, bands, columns: Vec::new(), width: 0.0, height };
        layout.place_items();
        layout.place_ports(diagram);
        layout.part_ports();
        layout.place_tracks();
        layout.place_columns(diagram);
        layout
    }

    fn layer_count(&self) -> usize {
        self.items.iter().map(|item| item.layer + 1).max().unwrap_or(0)
    }

    /// The items of a column and a band, from the top.
    fn stack(&self, layer: usize, group: usize) -> Vec<usize> {
        let inside =
            |index: &usize| self.items[*index].layer == layer && self.items[*index].group == group;
        let mut stack: Vec<usize> = (0..self.items.len()).filter(inside).collect();
        stack.sort_by(|one, other| self.items[*one].top.total_cmp(&self.items[*other].top));
        stack
    }

    fn neighbours(&self) -> Vec<Vec<usize>> {
        let mut neighbours = vec![Vec::new(); self.items.len()];
        for piece in &self.pieces {
            let [one, other] = piece.ends;
            neighbours[one].push(other);
            neighbours[other].push(one);
        }
        neighbours
    }

    fn place_items(&mut self) {
        let neighbours = self.neighbours();
        let layers = self.layer_count();
        for sweep in 0..SWEEPS {
            // Early sweeps find an order, later ones only straighten wires.
            let reorder = sweep < SWEEPS * 2 / 3;
            for step in 0..layers {
                let layer = if sweep % 2 == 0 { step } else { layers - 1 - step };
                for group in 0..self.bands.len() {
                    self.place_stack(layer, group, &neighbours, reorder);
                }
            }
        }
    }

    fn place_stack(&mut self, layer: usize, group: usize, near: &[Vec<usize>], reorder: bool) {
        let mut stack = self.stack(layer, group);
        let wish = |index: usize| {
            let middles = near[index].iter().map(|other| self.items[*other].middle());
            let count = near[index].len() as f64;
            let mean = middles.sum::<f64>() / count;
            if count > 0.0 { mean } else { self.items[index].middle() }
        };
        if reorder {
            stack.sort_by(|one, other| wish(*one).total_cmp(&wish(*other)));
        }
        let wishes = stack.iter().map(|index| wish(*index) - self.items[*index].height / 2.0);
        let wishes: Vec<f64> = wishes.collect();
        let heights: Vec<f64> = stack.iter().map(|index| self.items[*index].height + GAP).collect();
        let band = &self.bands[group];
        let (top, bottom) = (band.top + BAND_HEAD, band.top + band.height - GAP / 2.0);
        let tops = separated(&wishes, &heights, top, bottom + GAP / 2.0);
        for (index, top) in stack.into_iter().zip(tops) {
            self.items[index].top = top;
        }
    }

    /// Places the ends of each piece on its two items.
    fn place_ports(&mut self, diagram: &Diagram) {
        let mut sides: BTreeMap<(usize, bool), Vec<Port>> = BTreeMap::new();
        for (place, piece) in self.pieces.iter().enumerate() {
            for end in [0, 1] {
                let (own, other) = (piece.ends[end], piece.ends[1 - end]);
                let right = self.items[other].layer >= self.items[own].layer;
                let (aim, name) = (self.items[other].middle(), self.port_name(piece, end, diagram));
                let ports = sides.entry((own, right)).or_default();
                match ports.iter_mut().find(|port| port.net == piece.net && port.name == name) {
                    Some(port) => {
                        port.aims.push(aim);
                        port.ends.push((place, end));
                    }
                    None => ports.push(Port {
                        name,
                        net: piece.net,
                        aims: vec![aim],
                        ends: vec![(place, end)],
                    }),
                }
            }
        }
        let mut alone = vec![[false; 2]; self.pieces.len()];
        for ((own, _), mut ports) in sides {
            ports.sort_by(|one, other| {
                one.aim().total_cmp(&other.aim()).then(one.ends.cmp(&other.ends))
            });
            let item = &self.items[own];
            let all: f64 = ports.iter().map(Port::width).sum();
            let mut before = 0.0;
            for port in &ports {
                // Names need space; without names, all ports have equal shares.
                let share = (before + port.width() / 2.0) / all;
                before += port.width();
                for &(place, end) in &port.ends {
                    self.pieces[place].ports[end] = item.top + item.height * share;
                    alone[place][end] = ports.len() == 1 && port.ends.len() == 1;
                }
            }
        }
        for (place, alone) in alone.into_iter().enumerate() {
            self.straighten(place, alone);
        }
    }

    /// The port name at an end of a piece; empty without a name or at a gap.
    fn port_name(&self, piece: &Piece, end: usize, diagram: &Diagram) -> String {
        let wire = &diagram.wires[piece.wire];
        let Some(block) = self.items[piece.ends[end]].block else { return String::new() };
        let is_from = diagram.blocks[block].id == wire.from;
        wire.ports[usize::from(!is_from)].clone()
    }

    /// Straightens a wire that is alone on a side, if its block extends far enough.
    fn straighten(&mut self, place: usize, alone: [bool; 2]) {
        let piece = &self.pieces[place];
        let items = piece.ends.map(|end| &self.items[end]);
        if items[0].layer == items[1].layer {
            return;
        }
        let span =
            |item: &Item| (item.top + 4.0, (item.top + item.height - 4.0).max(item.top + 4.0));
        let (one, other) = (span(items[0]), span(items[1]));
        let free = |end: usize| alone[end] && items[end].block.is_some();
        let target = match (free(0), free(1)) {
            (true, true) => (one.0.max(other.0) + one.1.min(other.1)) / 2.0,
            (true, false) => piece.ports[1],
            (false, true) => piece.ports[0],
            (false, false) => return,
        };
        let reaches = |end: usize, (low, high): (f64, f64)| {
            if free(end) { target >= low && target <= high } else { true }
        };
        if reaches(0, one) && reaches(1, other) {
            self.pieces[place].ports = [target; 2];
        }
    }

    /// Separates ports where the end of one wire would overlap the start of another.
    fn part_ports(&mut self) {
        for place in 0..self.pieces.len() {
            let [from, to] = self.pieces[place].ports;
            let item = &self.items[self.pieces[place].ends[1]];
            let movable = item.block.is_some() && (from - to).abs() > 0.5;
            if !movable || self.is_free(place, to) {
                continue;
            }
            let (low, high) = (item.top + 3.0, item.top + item.height - 3.0);
            let shifts = [4.0, -4.0, 6.0, -6.0, 8.0, -8.0, 10.0, -10.0];
            let mut others = shifts.into_iter().map(|shift| to + shift);
            let free = others.find(|y| *y >= low && *y <= high && self.is_free(place, *y));
            let (net, own) = (self.pieces[place].net, self.pieces[place].ends[1]);
            // All pieces of the same port move together.
            for piece in self.pieces.iter_mut().filter(|piece| piece.net == net) {
                for end in [0, 1] {
                    if piece.ends[end] == own && piece.ports[end] == to {
                        piece.ports[end] = free.unwrap_or(to);
                    }
                }
            }
        }
    }

    /// Whether no other net in a piece's channel ends near a position.
    fn is_free(&self, place: usize, y: f64) -> bool {
        let layer = self.items[self.pieces[place].ends[0]].layer;
        let others = self.pieces.iter().enumerate().filter(|(other, piece)| {
            *other != place
                && piece.net != self.pieces[place].net
                && self.items[piece.ends[0]].layer == layer
        });
        others.flat_map(|(_, piece)| piece.ports).all(|port| (port - y).abs() >= 3.0)
    }

    /// Gives each bent piece a track where it touches no other.
    fn place_tracks(&mut self) {
        for layer in 0..self.layer_count() {
            let bent = |place: &usize| {
                let piece = &self.pieces[*place];
                self.items[piece.ends[0]].layer == layer
                    && (self.same_layer(piece) || (piece.ports[0] - piece.ports[1]).abs() > 0.5)
            };
            let places: Vec<usize> = (0..self.pieces.len()).filter(bent).collect();
            // Pieces of one net share a track.
            let mut spans: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
            for &place in &places {
                let [one, other] = self.pieces[place].ports;
                let span = spans.entry(self.pieces[place].net).or_insert((one, one));
                *span = (span.0.min(one).min(other), span.1.max(one).max(other));
            }
            let mut order: Vec<(usize, (f64, f64))> = spans.into_iter().collect();
            order.sort_by(|one, other| one.1.0.total_cmp(&other.1.0).then(one.0.cmp(&other.0)));
            let mut ends: Vec<f64> = Vec::new();
            let mut tracks: BTreeMap<usize, usize> = BTreeMap::new();
            for (net, (low, high)) in order {
                let track = ends.iter().position(|end| *end + 3.0 < low).unwrap_or(ends.len());
                ends.resize(ends.len().max(track + 1), f64::NEG_INFINITY);
                ends[track] = high;
                tracks.insert(net, track);
            }
            for place in places {
                self.pieces[place].track = tracks.get(&self.pieces[place].net).copied();
            }
        }
    }

    fn same_layer(&self, piece: &Piece) -> bool {
        self.items[piece.ends[0]].layer == self.items[piece.ends[1]].layer
    }

    fn place_columns(&mut self, diagram: &Diagram) {
        let mut x = if diagram.downwards { BAND_HEAD + 6.0 } else { MARGIN + 8.0 };
        for layer in 0..self.layer_count() {
            let items = self.items.iter().filter(|item| item.layer == layer);
            let width = items.map(|item| item.width).fold(0.0, f64::max);
            self.columns.push((x, width));
            x += width + self.channel_width(layer, diagram);
        }
        self.width = x + MARGIN;
    }

    fn channel_width(&self, layer: usize, diagram: &Diagram) -> f64 {
        let inside = |piece: &&Piece| self.items[piece.ends[0]].layer == layer;
        let pieces = || self.pieces.iter().filter(inside);
        let labels = pieces().map(|piece| &diagram.wires[piece.wire].label);
        let label = labels.map(|label| font::width(label, LABEL_SIZE, false)).fold(0.0, f64::max);
        let tracks = pieces().filter_map(|piece| piece.track).max().map_or(0, |last| last + 1);
        match pieces().count() {
            0 if layer + 1 == self.layer_count() => 8.0,
            _ => 2.0 * CHANNEL_SIDE + TRACK * tracks as f64 + label,
        }
    }

    /// The left and right edge of a block's box, or of a gap's column.
    fn sides(&self, item: &Item) -> (f64, f64) {
        let (left, width) = self.columns[item.layer];
        match item.block {
            Some(_) => {
                let middle = left + width / 2.0;
                (middle - item.width / 2.0, middle + item.width / 2.0)
            }
            None => (left, left + width),
        }
    }

    /// A piece's corners from its first end to its second, without the offset of the figure's header.
    fn corners(&self, piece: &Piece) -> Vec<(f64, f64)> {
        let [first, second] = piece.ends.map(|end| &self.items[end]);
        let start = self.sides(first).1;
        let end = if self.same_layer(piece) { self.sides(second).1 } else { self.sides(second).0 };
        let [from, to] = piece.ports;
        let Some(track) = piece.track else {
            return vec![(start, from), (end, to)];
        };
        let (left, width) = self.columns[first.layer];
        let x = left + width + CHANNEL_SIDE + TRACK * track as f64;
        vec![(start, from), (x, from), (x, to), (end, to)]
    }

    fn draw_bands(&self, canvas: &mut Canvas, view: View, width: f64) {
        for band in &self.bands {
            let area = match view.downwards {
                true => view.area((0.0, band.top), (self.width, band.height)),
                false => view.area((MARGIN, band.top), (width - 2.0 * MARGIN, band.height)),
            };
            canvas.rect(area, " rx=\"6\" fill=\"#f5f5f5\" stroke=\"#d8d8d8\"");
            let kind = Type::new(10.0).bold().colour(GREY);
            canvas.text((area.x + 8.0, area.y + 13.0), &band.name, kind);
        }
    }

    fn draw_wires(&self, canvas: &mut Canvas, view: View, diagram: &Diagram, kinds: &[&str]) {
        let mut nets: BTreeMap<usize, (Look, Vec<Line>)> = BTreeMap::new();
        for piece in &self.pieces {
            let wire = &diagram.wires[piece.wire];
            let index = kinds.iter().position(|kind| *kind == wire.kind).unwrap_or(0);
            let look = look(&diagram.looks, index);
            let corners = self.corners(piece);
            let drawn: Vec<(f64, f64)> = corners.iter().map(|corner| view.point(*corner)).collect();
            let net = nets.entry(piece.net).or_insert_with(|| (look, vec![]));
            net.1.extend(drawn.windows(2).map(|ends| [ends[0], ends[1]]));
            let style = format!(
                " stroke=\"{}\" stroke-width=\"1.3\" stroke-linejoin=\"round\"{}",
                look.colour,
                look.dash()
            );
            canvas.titled(&wire.in_words(), |canvas| {
                canvas.path(&drawn, &style);
                for (item, (along, across)) in self.gap_ends(piece, &corners) {
                    let (left, right) = self.sides(item);
                    // Extends the wire through the gap, from one side to the other.
                    let ends = [(left, across), (right.max(along), across)];
                    let ends = ends.map(|end| view.point(end));
                    canvas.line(ends[0], ends[1], &style);
                    net.1.push(ends);
                }
            });
            if wire.arrow {
                self.draw_arrow(canvas, view, piece, (diagram, look.colour));
            }
        }
        // Draw dots above all lines, so that crossing lines do not cover them.
        for (look, lines) in nets.values() {
            for point in junctions(lines) {
                canvas.circle(point, JUNCTION, &format!(" fill=\"{}\"", look.colour));
            }
        }
    }

    /// The gap that a piece enters from the left, if any.
    fn gap_ends<'a>(
        &'a self,
        piece: &Piece,
        corners: &[(f64, f64)],
    ) -> impl Iterator<Item = (&'a Item, (f64, f64))> {
        let item = &self.items[piece.ends[1]];
        let last = corners.last().copied();
        last.filter(|_| item.block.is_none()).map(|corner| (item, corner)).into_iter()
    }

    /// The end of a piece that is the wire's end, if any.
    fn target_end(&self, piece: &Piece, diagram: &Diagram) -> Option<usize> {
        let target = &diagram.wires[piece.wire].to;
        let is_target = |end: &usize| {
            let block = self.items[piece.ends[*end]].block;
            block.is_some_and(|block| diagram.blocks[block].id == *target)
        };
        [0, 1].into_iter().find(is_target)
    }

    fn draw_arrow(
        &self,
        canvas: &mut Canvas,
        view: View,
        piece: &Piece,
        (diagram, fill): (&Diagram, &str),
    ) {
        let Some(end) = self.target_end(piece, diagram) else {
            return;
        };
        let corners = self.corners(piece);
        let (along, across) = if end == 0 { corners[0] } else { corners[corners.len() - 1] };
        // A wire enters an end on the right of its block leftwards.
        let leftwards = end == 0 || self.same_layer(piece);
        let back = if leftwards { along + 7.0 } else { along - 7.0 };
        let head = [(along, across), (back, across - 3.2), (back, across + 3.2)];
        canvas.polygon(&head.map(|corner| view.point(corner)), &format!(" fill=\"{fill}\""));
    }

    fn draw_blocks(&self, canvas: &mut Canvas, view: View, diagram: &Diagram, kinds: &[&str]) {
        for item in &self.items {
            let Some(block) = item.block.map(|block| &diagram.blocks[block]) else {
                continue;
            };
            let (left, right) = self.sides(item);
            let area = view.area((left, item.top), (right - left, item.height));
            let index = kinds.iter().position(|kind| *kind == block.kind).unwrap_or(0);
            let colour = look(&diagram.looks, index).colour;
            let fill = tint(colour, 0.2);
            canvas.rect(area, &format!(" rx=\"3\"{fill} stroke=\"{colour}\""));
            let text = LINE * block.lines.len() as f64;
            let first = area.y + (area.height - text) / 2.0;
            for (place, line) in block.lines.iter().enumerate() {
                let kind = Type::new(SIZE).anchor(Anchor::Middle);
                let kind = if place == 0 { kind.bold() } else { kind };
                let baseline = first + LINE * (place as f64 + 0.78);
                canvas.text((area.x + area.width / 2.0, baseline), line, kind);
            }
        }
    }

    /// Draws each port name in its block, once on a side, where the line leaves.
    fn draw_port_names(&self, canvas: &mut Canvas, view: View, diagram: &Diagram) {
        if !view.downwards {
            return;
        }
        let mut done: Vec<(usize, bool, String)> = vec![];
        for piece in &self.pieces {
            for end in [0, 1] {
                let item = &self.items[piece.ends[end]];
                let name = self.port_name(piece, end, diagram);
                // The lower edge faces the next layers and the block's own layer.
                let lower = end == 0 || self.same_layer(piece);
                let known = (piece.ends[end], lower, name.clone());
                if name.trim().is_empty() || done.contains(&known) {
                    continue;
                }
                done.push(known);
                let (upper_edge, lower_edge) = self.sides(item);
                let along = if lower { lower_edge - 3.0 } else { upper_edge + 8.0 };
                let kind = Type::new(PORT_SIZE).anchor(Anchor::Middle);
                // A line may leave at a corner; keep its name inside the edge.
                let half = font::width(&name, PORT_SIZE, false) / 2.0 + 2.0;
                let (first, last) = (item.top + half, item.top + item.height - half);
                let across = piece.ports[end].clamp(first.min(last), last.max(first));
                canvas.text(view.point((along, across)), &name, kind);
            }
        }
    }

    /// Draws labels above their wire, beside its target block.
    fn draw_labels(&self, canvas: &mut Canvas, view: View, diagram: &Diagram) {
        for piece in &self.pieces {
            let label = &diagram.wires[piece.wire].label;
            let Some(end) = self.target_end(piece, diagram).filter(|_| !label.is_empty()) else {
                continue;
            };
            let corners = self.corners(piece);
            let corner = if end == 0 { corners[0] } else { corners[corners.len() - 1] };
            let (x, y) = view.point(corner);
            let rightwards = end == 0 || self.same_layer(piece);
            let (anchor, shift) =
                if rightwards { (Anchor::Start, 8.0) } else { (Anchor::End, -8.0) };
            let kind = Type::new(LABEL_SIZE).anchor(anchor).rim();
            canvas.text((x + shift, y - 2.5), label, kind);
        }
    }
}

fn block_items(diagram: &Diagram, wires: &[Option<(usize, usize)>], groups: &[&str]) -> Vec<Item> {
    let layers = layers_of(diagram, wires);
    let blocks = diagram.blocks.iter().zip(layers).enumerate();
    let item = |(place, (block, layer)): (usize, (&Block, usize))| {
        let (width, height) = diagram.size(block);
        let group = groups.iter().position(|name| *name == block.group).unwrap_or(0);
        // The initial order is the given one.
        Item { block: Some(place), layer, group, width, height, top: place as f64 }
    };
    blocks.map(item).collect()
}

/// The column of each block.
fn layers_of(diagram: &Diagram, wires: &[Option<(usize, usize)>]) -> Vec<usize> {
    let count = diagram.blocks.len();
    let mut neighbours = vec![Vec::new(); count];
    let mut entered = vec![false; count];
    for (from, to) in wires.iter().flatten() {
        neighbours[*from].push(*to);
        neighbours[*to].push(*from);
        entered[*to] = true;
    }
    let mut layers: Vec<Option<usize>> = diagram.blocks.iter().map(|block| block.layer).collect();
    let fixed = layers.iter().any(Option::is_some);
    let mut queue = VecDeque::new();
    for place in 0..count {
        let source = !entered[place] && !fixed && !neighbours[place].is_empty();
        if source {
            layers[place] = Some(0);
        }
        if layers[place].is_some() {
            queue.push_back(place);
        }
    }
    // Parts without a source, or not reached, start at their first block.
    for start in 0..count {
        spread(&mut queue, &neighbours, &mut layers);
        if layers[start].is_none() {
            layers[start] = Some(0);
            queue.push_back(start);
        }
    }
    spread(&mut queue, &neighbours, &mut layers);
    layers.into_iter().map(Option::unwrap_or_default).collect()
}

fn spread(queue: &mut VecDeque<usize>, neighbours: &[Vec<usize>], layers: &mut [Option<usize>]) {
    while let Some(place) = queue.pop_front() {
        for next in &neighbours[place] {
            if layers[*next].is_none() {
                layers[*next] = layers[place].map(|layer| layer + 1);
                queue.push_back(*next);
            }
        }
    }
}

/// Cuts wires into pieces. A wire across several columns gets a gap in each column between, shared with the others of
/// its net.
fn split_wires(
    diagram: &Diagram,
    wires: &[Option<(usize, usize)>],
    items: &mut Vec<Item>,
) -> Vec<Piece> {
    let mut pieces: Vec<Piece> = Vec::new();
    let mut nets: BTreeMap<String, usize> = BTreeMap::new();
    let mut gaps: BTreeMap<(usize, usize, usize), usize> = BTreeMap::new();
    for (wire, ends) in wires.iter().enumerate() {
        let Some((from, to)) = *ends else { continue };
        let count = nets.len();
        let net = *nets.entry(diagram.net(wire)).or_insert(count);
        let mut push = |ends: [usize; 2]| {
            let is_there = pieces.iter().any(|piece| piece.net == net && piece.ends == ends);
            if !is_there {
                pieces.push(Piece { wire, net, ends, ports: [0.0; 2], track: None });
            }
        };
        let (first, last) =
            if items[from].layer <= items[to].layer { (from, to) } else { (to, from) };
        let mut left = first;
        for layer in items[first].layer + 1..items[last].layer {
            let (group, top) = (items[first].group, items[first].top);
            let gap = *gaps.entry((net, layer, group)).or_insert_with(|| {
                items.push(Item { block: None, layer, group, width: 0.0, height: 4.0, top });
                items.len() - 1
            });
            push([left, gap]);
            left = gap;
        }
        push([left, last]);
    }
    pieces
}

/// Stacks bands that are high enough for their fullest column.
fn stack_bands(groups: &[&str], items: &[Item]) -> Vec<Band> {
    let layers = items.iter().map(|item| item.layer + 1).max().unwrap_or(0);
    let mut top = 0.0;
    let mut bands = Vec::new();
    for (group, name) in groups.iter().enumerate() {
        let fill = |layer: usize| -> f64 {
            let inside = items.iter().filter(|item| item.layer == layer && item.group == group);
            inside.map(|item| item.height + GAP).sum()
        };
        let fullest = (0..layers).map(fill).fold(0.0, f64::max);
        let height = BAND_HEAD + fullest;
        bands.push(Band { name: (*name).to_owned(), top, height });
        top += height + BAND_GAP;
    }
    bands
}

/// Positions without overlap between two limits, in order, as near as possible to the wishes (least squares). It is an
/// isotonic regression by pooling adjacent violators.
fn separated(wishes: &[f64], heights: &[f64], top: f64, bottom: f64) -> Vec<f64> {
    let mut offset = 0.0;
    let mut offsets = Vec::with_capacity(wishes.len());
    // Each pool is the mean of its members' wishes minus the heights above them, and the number of members.
    let mut pools: Vec<(f64, usize)> = Vec::new();
    for (wish, height) in wishes.iter().zip(heights) {
        offsets.push(offset);
        pools.push((wish - offset, 1));
        offset += height;
        while let [.., (above, many), (below, few)] = pools.as_slice()
            && above > below
        {
            let count = many + few;
            let mean = (above * *many as f64 + below * *few as f64) / count as f64;
            pools.truncate(pools.len() - 2);
            pools.push((mean, count));
        }
    }
    let highest = (bottom - offset).max(top);
    let bases = pools.into_iter().flat_map(|(mean, count)| std::iter::repeat_n(mean, count));
    bases.zip(offsets).map(|(base, offset)| base.clamp(top, highest) + offset).collect()
}
