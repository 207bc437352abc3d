//! Block diagrams: components in columns, their connections as right-angled wires.
//!
//! The layout is automatic and layered. A block's column is its distance, counted in wires, from
//! the nearest block that nothing leads to (or the column asked for); its group, such as an
//! actuator, is a horizontal band. Within a band the blocks are ordered and placed by the mean of
//! their neighbours, a few times forwards and backwards. Wires run only between the columns, each
//! on a track of its own, and pass a column through a gap kept for them: none crosses a block.

use std::collections::{BTreeMap, VecDeque};

use super::Figure;
use super::font;
use super::legend::{self, Entry, Swatch};
use super::style::{GREY, colour, dash, shade, tint};
use super::svg::{Anchor, Area, Canvas, Type};

/// A figure of blocks and wires.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Diagram {
    /// The figure's title, may be empty.
    pub title: String,
    /// The groups from the top; those not named here follow as they first appear.
    pub groups: Vec<String>,
    /// The blocks.
    pub blocks: Vec<Block>,
    /// The wires; one that leads to an unknown block or back to its own is not drawn.
    pub wires: Vec<Wire>,
}

/// A component.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Block {
    /// The name that wires use.
    pub id: String,
    /// The text, the first line in bold.
    pub lines: Vec<String>,
    /// What kind of component it is: decides the colour.
    pub kind: String,
    /// The band it stands in, may be empty.
    pub group: String,
    /// The column it stands in, from 0; without it, found from the wires.
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
    /// The id of the block it comes from.
    pub from: String,
    /// The id of the block it leads to.
    pub to: String,
    /// What it carries: decides colour and dash.
    pub kind: String,
    /// A text at its end, may be empty.
    pub label: String,
    /// Whether its end has an arrow head.
    pub arrow: bool,
}

impl Wire {
    /// A wire without label and arrow head.
    pub fn new(from: &str, to: &str, kind: &str) -> Self {
        Self { from: from.to_owned(), to: to.to_owned(), kind: kind.to_owned(), ..Self::default() }
    }
}

const MARGIN: f64 = 12.0;
const SIZE: f64 = 9.5;
const LINE: f64 = 12.0;
const LABEL_SIZE: f64 = 8.0;
const GAP: f64 = 12.0;
const BAND_GAP: f64 = 10.0;
const BAND_HEAD: f64 = 18.0;
const TRACK: f64 = 7.0;
const CHANNEL_SIDE: f64 = 12.0;
/// Passes of ordering and placing; the picture hardly changes after half of them.
const SWEEPS: usize = 12;

impl Diagram {
    /// Draws the figure.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let layout = Layout::of(self);
        let kinds = self.kinds();
        let entries = self.legend(&kinds);
        let title_width = font::width(&self.title, 13.0, true) + 2.0 * MARGIN;
        let width = layout.width.max(title_width).max(240.0);
        let mut top = MARGIN;
        if !self.title.is_empty() {
            canvas.text((MARGIN, top + 12.0), &self.title, Type::new(13.0).bold());
            top += 20.0;
        }
        let rows = legend::rows(&entries, width - 2.0 * MARGIN);
        legend::draw(&mut canvas, (MARGIN, top), &rows);
        top += legend::ROW * rows.len() as f64 + 8.0;
        layout.draw_bands(&mut canvas, top, width);
        layout.draw_wires(&mut canvas, top, self, &kinds);
        layout.draw_blocks(&mut canvas, top, self, &kinds);
        layout.draw_labels(&mut canvas, top, self);
        canvas.finish(width, top + layout.height + MARGIN, &self.title)
    }

    /// Every kind once, those of wires first.
    fn kinds(&self) -> Vec<&str> {
        let wires = self.wires.iter().map(|wire| wire.kind.as_str());
        unique(wires.chain(self.blocks.iter().map(|block| block.kind.as_str())))
    }

    fn legend(&self, kinds: &[&str]) -> Vec<Entry> {
        let mut entries = Vec::new();
        for (index, kind) in kinds.iter().enumerate().filter(|(_, kind)| !kind.is_empty()) {
            let mut add = |swatch| entries.push(Entry { name: (*kind).to_owned(), swatch });
            if self.wires.iter().any(|wire| wire.kind == *kind) {
                add(Swatch::Line(index));
            }
            if self.blocks.iter().any(|block| block.kind == *kind) {
                add(Swatch::Box(index));
            }
        }
        entries
    }

    fn group_names(&self) -> Vec<&str> {
        let named = self.groups.iter().map(String::as_str);
        let all = unique(named.chain(self.blocks.iter().map(|block| block.group.as_str())));
        let used = |name: &&str| self.blocks.iter().any(|block| block.group == **name);
        all.into_iter().filter(used).collect()
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

/// A piece of a wire between neighbouring columns, or within one.
#[derive(Debug, Clone)]
struct Piece {
    wire: usize,
    /// The items at the two ends; the first one's column is the lower or the same.
    ends: [usize; 2],
    /// The heights at which it leaves them.
    ports: [f64; 2],
    /// Its track in the channel right of the first end's column.
    track: Option<usize>,
}

/// One end of a piece at a side of its item.
struct Port {
    /// The height of the item at the piece's other end.
    aim: f64,
    place: usize,
    end: usize,
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
        let pieces = split_wires(&wires, &mut items);
        let bands = stack_bands(&groups, &items);
        let height = bands.last().map_or(0.0, |band| band.top + band.height);
        let mut layout = Self { items, pieces, bands, columns: Vec::new(), width: 0.0, height };
        layout.place_items();
        layout.place_ports();
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
            // Early passes find an order, later ones only straighten wires.
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

    /// Where each piece leaves its two items.
    fn place_ports(&mut self) {
        let mut sides: BTreeMap<(usize, bool), Vec<Port>> = BTreeMap::new();
        for (place, piece) in self.pieces.iter().enumerate() {
            for end in [0, 1] {
                let (own, other) = (piece.ends[end], piece.ends[1 - end]);
                let right = self.items[other].layer >= self.items[own].layer;
                let aim = self.items[other].middle();
                sides.entry((own, right)).or_default().push(Port { aim, place, end });
            }
        }
        let mut alone = vec![[false; 2]; self.pieces.len()];
        for ((own, _), mut ports) in sides {
            ports.sort_by(|one, other| {
                one.aim.total_cmp(&other.aim).then(one.place.cmp(&other.place))
            });
            let item = &self.items[own];
            let count = ports.len();
            for (rank, Port { place, end, .. }) in ports.into_iter().enumerate() {
                let share = (rank + 1) as f64 / (count + 1) as f64;
                self.pieces[place].ports[end] = item.top + item.height * share;
                alone[place][end] = count == 1;
            }
        }
        for (place, alone) in alone.into_iter().enumerate() {
            self.straighten(place, alone);
        }
    }

    /// A wire alone on a side is moved to where it runs straight, if its block reaches there.
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

    /// Moves ports apart where the end of one wire would run into the beginning of another.
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
            self.pieces[place].ports[1] = free.unwrap_or(to);
        }
    }

    /// Whether no other wire of a piece's channel ends at a height.
    fn is_free(&self, place: usize, y: f64) -> bool {
        let layer = self.items[self.pieces[place].ends[0]].layer;
        let others =
            self.pieces.iter().enumerate().filter(|(other, piece)| {
                *other != place && self.items[piece.ends[0]].layer == layer
            });
        others.flat_map(|(_, piece)| piece.ports).all(|port| (port - y).abs() >= 3.0)
    }

    /// Gives each piece that changes its height a track where it touches no other.
    fn place_tracks(&mut self) {
        for layer in 0..self.layer_count() {
            let bent = |place: &usize| {
                let piece = &self.pieces[*place];
                self.items[piece.ends[0]].layer == layer
                    && (self.same_layer(piece) || (piece.ports[0] - piece.ports[1]).abs() > 0.5)
            };
            let mut places: Vec<usize> = (0..self.pieces.len()).filter(bent).collect();
            let top = |place: &usize| {
                let ports = self.pieces[*place].ports;
                ports[0].min(ports[1])
            };
            places.sort_by(|one, other| top(one).total_cmp(&top(other)).then(one.cmp(other)));
            let mut ends: Vec<f64> = Vec::new();
            for place in places {
                let [one, other] = self.pieces[place].ports;
                let track = ends.iter().position(|end| *end + 3.0 < one.min(other));
                let track = track.unwrap_or(ends.len());
                ends.resize(ends.len().max(track + 1), f64::NEG_INFINITY);
                ends[track] = one.max(other);
                self.pieces[place].track = Some(track);
            }
        }
    }

    fn same_layer(&self, piece: &Piece) -> bool {
        self.items[piece.ends[0]].layer == self.items[piece.ends[1]].layer
    }

    fn place_columns(&mut self, diagram: &Diagram) {
        let mut x = MARGIN + 8.0;
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

    /// The left and right edge of an item's box; a gap's are those of its column.
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

    /// A piece's corners from its first end to its second, the figure's head left out.
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

    fn draw_bands(&self, canvas: &mut Canvas, top: f64, width: f64) {
        for band in &self.bands {
            let area = Area {
                x: MARGIN,
                y: top + band.top,
                width: width - 2.0 * MARGIN,
                height: band.height,
            };
            canvas.rect(area, " rx=\"6\" fill=\"#f5f5f5\" stroke=\"#d8d8d8\"");
            let kind = Type::new(10.0).bold().colour(GREY);
            canvas.text((area.x + 8.0, area.y + 13.0), &band.name, kind);
        }
    }

    fn draw_wires(&self, canvas: &mut Canvas, top: f64, diagram: &Diagram, kinds: &[&str]) {
        for piece in &self.pieces {
            let wire = &diagram.wires[piece.wire];
            let index = kinds.iter().position(|kind| *kind == wire.kind).unwrap_or(0);
            let corners: Vec<(f64, f64)> =
                self.corners(piece).into_iter().map(|(x, y)| (x, y + top)).collect();
            let style = format!(
                " stroke=\"{}\" stroke-width=\"1.3\" stroke-linejoin=\"round\"{}",
                colour(index),
                dash(index)
            );
            canvas.path(&corners, &style);
            for (item, (x, y)) in self.gap_ends(piece, &corners) {
                let (left, right) = self.sides(item);
                // The wire goes on through the gap, from its right end to its left one.
                canvas.line((left, y), (right.max(x), y), &style);
            }
            if wire.arrow {
                self.draw_arrow(canvas, piece, &corners, diagram, colour(index));
            }
        }
    }

    /// The gaps that a piece enters from the left.
    fn gap_ends<'a>(
        &'a self,
        piece: &Piece,
        corners: &[(f64, f64)],
    ) -> impl Iterator<Item = (&'a Item, (f64, f64))> {
        let item = &self.items[piece.ends[1]];
        let last = corners.last().copied();
        last.filter(|_| item.block.is_none()).map(|corner| (item, corner)).into_iter()
    }

    /// Which end of a piece is the wire's end, if any is.
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
        piece: &Piece,
        corners: &[(f64, f64)],
        diagram: &Diagram,
        fill: &str,
    ) {
        let Some(end) = self.target_end(piece, diagram) else {
            return;
        };
        let (x, y) = if end == 0 { corners[0] } else { corners[corners.len() - 1] };
        // An end on the right of its block is entered leftwards.
        let leftwards = end == 0 || self.same_layer(piece);
        let back = if leftwards { x + 7.0 } else { x - 7.0 };
        let head = [(x, y), (back, y - 3.2), (back, y + 3.2)];
        canvas.polygon(&head, &format!(" fill=\"{fill}\""));
    }

    fn draw_blocks(&self, canvas: &mut Canvas, top: f64, diagram: &Diagram, kinds: &[&str]) {
        for item in &self.items {
            let Some(block) = item.block.map(|block| &diagram.blocks[block]) else {
                continue;
            };
            let (left, right) = self.sides(item);
            let y = item.top + top;
            let area = Area { x: left, y, width: right - left, height: item.height };
            let index = kinds.iter().position(|kind| *kind == block.kind).unwrap_or(0);
            let (fill, stroke) = (tint(colour(index), 0.25), shade(colour(index)));
            canvas.rect(area, &format!(" rx=\"3\" fill=\"{fill}\" stroke=\"{stroke}\""));
            for (place, line) in block.lines.iter().enumerate() {
                let kind = Type::new(SIZE).anchor(Anchor::Middle);
                let kind = if place == 0 { kind.bold() } else { kind };
                let baseline = y + 5.0 + LINE * (place as f64 + 0.78);
                canvas.text(((left + right) / 2.0, baseline), line, kind);
            }
        }
    }

    /// Labels stand above their wire beside the block it leads to.
    fn draw_labels(&self, canvas: &mut Canvas, top: f64, diagram: &Diagram) {
        for piece in &self.pieces {
            let label = &diagram.wires[piece.wire].label;
            let Some(end) = self.target_end(piece, diagram).filter(|_| !label.is_empty()) else {
                continue;
            };
            let corners = self.corners(piece);
            let (x, y) = if end == 0 { corners[0] } else { corners[corners.len() - 1] };
            let rightwards = end == 0 || self.same_layer(piece);
            let (anchor, shift) =
                if rightwards { (Anchor::Start, 8.0) } else { (Anchor::End, -8.0) };
            let kind = Type::new(LABEL_SIZE).anchor(anchor).rim();
            canvas.text((x + shift, y + top - 2.5), label, kind);
        }
    }
}

fn block_items(diagram: &Diagram, wires: &[Option<(usize, usize)>], groups: &[&str]) -> Vec<Item> {
    let layers = layers_of(diagram, wires);
    let blocks = diagram.blocks.iter().zip(layers).enumerate();
    let item = |(place, (block, layer)): (usize, (&Block, usize))| Item {
        block: Some(place),
        layer,
        group: groups.iter().position(|name| *name == block.group).unwrap_or(0),
        width: block.width(),
        height: block.height(),
        // The first order is the one given.
        top: place as f64,
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
    // Parts that have no source, or are not reached, start at their first block.
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

/// Cuts wires into pieces; a wire over several columns gets a gap in each of those between.
fn split_wires(wires: &[Option<(usize, usize)>], items: &mut Vec<Item>) -> Vec<Piece> {
    let mut pieces = Vec::new();
    for (wire, ends) in wires.iter().enumerate() {
        let Some((from, to)) = *ends else { continue };
        let (first, last) =
            if items[from].layer <= items[to].layer { (from, to) } else { (to, from) };
        let mut left = first;
        for layer in items[first].layer + 1..items[last].layer {
            let group = items[first].group;
            let top = items[first].top;
            items.push(Item { block: None, layer, group, width: 0.0, height: 4.0, top });
            let gap = items.len() - 1;
            pieces.push(Piece { wire, ends: [left, gap], ports: [0.0; 2], track: None });
            left = gap;
        }
        pieces.push(Piece { wire, ends: [left, last], ports: [0.0; 2], track: None });
    }
    pieces
}

/// Bands high enough for their fullest column.
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

/// Tops as near as possible (in the sense of least squares) to the wishes, in order, without
/// overlap, between two limits: isotonic regression by pooling neighbours that get in conflict.
fn separated(wishes: &[f64], heights: &[f64], top: f64, bottom: f64) -> Vec<f64> {
    let mut offset = 0.0;
    let mut offsets = Vec::with_capacity(wishes.len());
    // Each pool is the mean of its members' wishes, less what stands above them, and their number.
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
