//! Schematics: parts in columns, joined by right-angled lines.
//!
//! A part has a column; parts of a group form a band of rows. Between the columns are channels, between the rows are
//! streets. Lines run only there: a net has one vertical track in each channel where its parts have ports, and one
//! horizontal track in a street if it needs several channels. So no line crosses a part, and no two nets share a track.
//! A dot marks where a net branches; lines that cross without a dot are not connected.

use super::Figure;
use super::font;
use super::legend::{self, LegendEntry, Swatch};
use super::style::{GREY, Look, tint};
use super::svg::{Anchor, Area, Canvas, Type};
use std::collections::BTreeMap;
use std::ops::Range;

/// A figure of parts and the nets that join them.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Schematic {
    /// The figure's title, may be empty.
    pub title: String,
    /// The bands from top to bottom; a name may be empty.
    pub groups: Vec<String>,
    /// The kinds of parts and nets with their styles.
    pub kinds: Vec<(String, Look)>,
    /// The parts.
    pub parts: Vec<Part>,
    /// The nets.
    pub nets: Vec<Net>,
}

/// A box with text.
#[derive(Debug, Clone, PartialEq)]
pub struct Part {
    /// The name, written as `data-component` of its SVG group.
    pub id: String,
    /// The text with line feeds, the first line in bold.
    pub text: String,
    /// Index of its kind.
    pub kind: usize,
    /// Index of its group.
    pub group: usize,
    /// The column, from 0 at the left.
    pub column: usize,
}

/// Ports that are joined.
#[derive(Debug, Clone, PartialEq)]
pub struct Net {
    /// Index of its kind.
    pub kind: usize,
    /// The joined ports; the first one is the source.
    pub ends: Vec<NetEnd>,
}

/// A port of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct NetEnd {
    /// Index of the part.
    pub part: usize,
    /// The port's name, shown if the part has several ports; may be empty.
    pub port: String,
    /// Whether an arrow points to the port.
    pub arrow: bool,
}

const MARGIN: f64 = 12.0;
const SIZE: f64 = 9.5;
const LINE: f64 = 11.5;
const PORT_SIZE: f64 = 7.5;
/// Distance of ports on one side.
const PORT: f64 = 10.0;
/// Space below the last port.
const PAD: f64 = 3.0;
const TRACK: f64 = 6.0;
/// Space beside the tracks of a channel or street.
const SIDE: f64 = 9.0;
const BAND_HEAD: f64 = 22.0;
const BAND_GAP: f64 = 8.0;
/// Stubs of different nets in a channel are at least so far apart.
const APART: f64 = 3.0;
/// Sweeps that move parts towards the rows of their neighbors.
const SWEEPS: usize = 12;

type Point = (f64, f64);

impl Schematic {
    /// Draws the figure.
    ///
    /// # Panics
    /// An index has no part, group or kind.
    pub fn draw(&self) -> Figure {
        let mut canvas = Canvas::default();
        let entries = self.legend();
        let layout = Layout::new(self);
        let title_width = font::width(&self.title, 13.0, true) + 2.0 * MARGIN;
        let width = layout.width.max(title_width).max(240.0);
        let rows = legend::rows(&entries, width - 2.0 * MARGIN);
        let title = if self.title.is_empty() { 0.0 } else { 20.0 };
        let top = MARGIN + title + legend::ROW * rows.len() as f64 + 8.0;
        canvas.text((MARGIN, MARGIN + 12.0), &self.title, Type::new(13.0).bold());
        legend::draw(&mut canvas, (MARGIN, MARGIN + title), &rows);
        canvas.shifted((0.0, top), |canvas| {
            layout.draw_bands(canvas, width);
            (0..self.nets.len()).for_each(|net| layout.draw_net(canvas, net));
            (0..self.parts.len()).for_each(|part| layout.draw_part(canvas, part));
        });
        canvas.finish(width, top + layout.height + MARGIN, &self.title)
    }

    /// Every kind in use: parts and nets of one kind have the same color.
    fn legend(&self) -> Vec<LegendEntry> {
        let kinds = self.kinds.iter().enumerate();
        let entry = |(kind, (name, look)): (usize, &(String, Look))| {
            let swatch = if self.nets.iter().any(|net| net.kind == kind) {
                Swatch::Line(*look)
            } else {
                self.parts.iter().find(|part| part.kind == kind).map(|_| Swatch::Box(*look))?
            };
            Some(LegendEntry { name: name.clone(), swatch })
        };
        kinds.filter_map(entry).collect()
    }

    fn column_count(&self) -> usize {
        self.parts.iter().map(|part| part.column + 1).max().unwrap_or(0)
    }

    /// The parts of a column and a group.
    fn stack(&self, column: usize, group: usize) -> Vec<usize> {
        let is_inside = |part: &Part| part.column == column && part.group == group;
        (0..self.parts.len()).filter(|&part| is_inside(&self.parts[part])).collect()
    }

    /// The first row of each band, and last the number of rows.
    fn bands(&self) -> Vec<usize> {
        let mut bands = vec![0];
        for group in 0..self.groups.len() {
            let heights = (0..self.column_count()).map(|column| self.stack(column, group).len());
            bands.push(bands[group] + heights.max().unwrap_or(0));
        }
        bands
    }

    /// The parts that each part is joined with.
    fn neighbors(&self) -> Vec<Vec<usize>> {
        let neighbors = |part: usize| {
            let nets = self.nets.iter().filter(|net| net.ends.iter().any(|end| end.part == part));
            let ends = nets.flat_map(|net| &net.ends).map(|end| end.part);
            ends.filter(|other| *other != part).collect()
        };
        (0..self.parts.len()).map(neighbors).collect()
    }

    /// The row of each part: near the mean of its neighbors, and alone in its column.
    fn rows(&self, bands: &[usize]) -> Vec<usize> {
        let (columns, neighbors) = (self.column_count(), self.neighbors());
        let mut rows: Vec<usize> = vec![0; self.parts.len()];
        // The first sweep keeps the given order.
        let none = vec![vec![]; self.parts.len()];
        for sweep in 0..=SWEEPS {
            let neighbors = if sweep == 0 { &none } else { &neighbors };
            for step in 0..columns {
                let column = if sweep % 2 == 0 { step } else { columns - 1 - step };
                for (group, ends) in bands.windows(2).enumerate() {
                    let stack = self.stack(column, group);
                    place_stack(stack, ends[0]..ends[1], neighbors, &mut rows);
                }
            }
        }
        rows
    }

    /// The channel of each end of a net; channel `n` is left of column `n`. Most ends share one channel, the others
    /// have their ports on the side that faces it.
    fn channels(&self, net: &Net) -> Vec<usize> {
        let columns = || net.ends.iter().map(|end| self.parts[end.part].column);
        let reached =
            |channel: usize| columns().filter(|c| (*c..=c + 1).contains(&channel)).count();
        let (first, last) = (columns().min().unwrap_or(0) + 1, columns().max().unwrap_or(0));
        let best = (first..=last.max(first)).max_by_key(|channel| reached(*channel)).unwrap_or(0);
        columns().map(|column| if column < best { column + 1 } else { column }).collect()
    }
}

/// Places a stack in rows of a band, each part as near as possible to its neighbors.
fn place_stack(mut stack: Vec<usize>, band: Range<usize>, near: &[Vec<usize>], rows: &mut [usize]) {
    let wish = |part: usize| match near[part].len() {
        0 => rows[part] as f64,
        _ => mean(near[part].iter().map(|&other| rows[other] as f64)),
    };
    let wishes: Vec<f64> = (0..rows.len()).map(wish).collect();
    stack.sort_by(|one, other| wishes[*one].total_cmp(&wishes[*other]));
    let mut free = band.start;
    for (place, &part) in stack.iter().enumerate() {
        let last = band.end + place - stack.len();
        rows[part] = (wishes[part].round() as usize).clamp(free, last);
        free = rows[part] + 1;
    }
}

fn mean(values: impl Iterator<Item = f64>) -> f64 {
    let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count.max(1))
}

/// Gives every span the first track where it touches no other, and returns the number of tracks.
fn tracks(spans: &BTreeMap<usize, (f64, f64)>) -> (BTreeMap<usize, usize>, usize) {
    let mut order: Vec<(&usize, &(f64, f64))> = spans.iter().collect();
    order.sort_by(|one, other| one.1.0.total_cmp(&other.1.0));
    let mut ends: Vec<f64> = vec![];
    let mut tracks = BTreeMap::new();
    for (&net, &(low, high)) in order {
        let track = ends.iter().position(|end| end + APART < low).unwrap_or(ends.len());
        ends.resize(ends.len().max(track + 1), high);
        ends[track] = high;
        tracks.insert(net, track);
    }
    (tracks, ends.len())
}

fn widen(span: &mut (f64, f64), value: f64) {
    *span = (span.0.min(value), span.1.max(value));
}

/// The height at which a net leaves a part into a channel.
struct StubAt {
    net: usize,
    channel: usize,
    y: f64,
}

/// The places of everything, with the origin at the top left of the first band.
struct Layout<'s> {
    schematic: &'s Schematic,
    /// The top of each band, and last that of one more.
    bands: Vec<f64>,
    /// The boxes of the parts.
    areas: Vec<Area>,
    /// The channel of each end of each net.
    channels: Vec<Vec<usize>>,
    /// The height of each end of each net.
    heights: Vec<Vec<f64>>,
    /// The street track of each net that needs one.
    streets: BTreeMap<usize, f64>,
    /// The vertical track of each net, by channel and net.
    trunks: BTreeMap<(usize, usize), f64>,
    width: f64,
    height: f64,
}

impl<'s> Layout<'s> {
    fn new(schematic: &'s Schematic) -> Self {
        let channels = schematic.nets.iter().map(|net| schematic.channels(net)).collect();
        let mut layout = Layout {
            schematic,
            bands: vec![],
            areas: vec![],
            channels,
            heights: vec![],
            streets: BTreeMap::new(),
            trunks: BTreeMap::new(),
            width: 0.0,
            height: 0.0,
        };
        let bands = schematic.bands();
        let rows = schematic.rows(&bands);
        layout.areas = (0..rows.len()).map(|part| layout.size(part)).collect();
        layout.place_rows(&bands, &rows);
        layout.place_ports();
        layout.place_columns();
        layout
    }

    /// The ends of all nets at one side of a part, as pairs of net and end.
    fn side(&self, part: usize, is_right: bool) -> Vec<(usize, usize)> {
        let channel = self.schematic.parts[part].column + usize::from(is_right);
        let nets = self.schematic.nets.iter().enumerate();
        let all = nets.flat_map(|(net, own)| (0..own.ends.len()).map(move |end| (net, end)));
        let is_here = |(net, end): &(usize, usize)| {
            self.end(*net, *end).part == part && self.channels[*net][*end] == channel
        };
        all.filter(is_here).collect()
    }

    fn end(&self, net: usize, end: usize) -> &'s NetEnd {
        &self.schematic.nets[net].ends[end]
    }

    /// Whether a part shows the names of its ports: a single port needs none.
    fn has_names(&self, part: usize) -> bool {
        let ends = self.schematic.nets.iter().flat_map(|net| &net.ends);
        ends.filter(|end| end.part == part && !end.port.is_empty()).count() > 1
    }

    /// The number of ports on the fuller side of a part.
    fn port_count(&self, part: usize) -> f64 {
        self.side(part, false).len().max(self.side(part, true).len()) as f64
    }

    /// The box of a part at the origin.
    fn size(&self, part: usize) -> Area {
        let lines = self.schematic.parts[part].text.lines().enumerate();
        let widths = lines.map(|(place, line)| font::width(line, SIZE, place == 0));
        let text_width = widths.fold(30.0, f64::max) + 10.0;
        let text_height =
            LINE * self.schematic.parts[part].text.lines().count().max(1) as f64 + 7.0;
        let ports_height = PORT * self.port_count(part);
        let (mut width, mut height) = (text_width, text_height.max(ports_height));
        if self.has_names(part) {
            let names_width = |is_right| {
                let side = self.side(part, is_right).into_iter();
                let names = side.map(|(net, end)| &self.end(net, end).port);
                names.map(|name| font::width(name, PORT_SIZE, false)).fold(0.0, f64::max)
            };
            width = text_width.max(names_width(false) + names_width(true) + 14.0);
            height = text_height + ports_height + PAD;
        }
        Area { x: 0.0, y: 0.0, width, height }
    }

    /// The span of each net that needs a street, by street. Spans count channels, so that only a common one is touched.
    fn street_spans(&self, bands: &[usize], rows: &[usize]) -> Vec<BTreeMap<usize, (f64, f64)>> {
        let mut spans = vec![BTreeMap::new(); bands.last().map_or(1, |count| count + 1)];
        for (net, channels) in self.channels.iter().enumerate() {
            let ends = self.schematic.nets[net].ends.iter();
            let (low, high) = (channels.iter().min(), channels.iter().max());
            if let Some((low, high)) = low.zip(high).filter(|(low, high)| low != high) {
                let street = (mean(ends.map(|end| rows[end.part] as f64)) + 0.5).round() as usize;
                spans[street].insert(net, (4.0 * *low as f64, 4.0 * *high as f64));
            }
        }
        spans
    }

    /// Places bands, streets and parts from top to bottom.
    fn place_rows(&mut self, bands: &[usize], rows: &[usize]) {
        let spans = self.street_spans(bands, rows);
        let groups = &self.schematic.groups;
        let mut y = 0.0;
        for (row, street) in spans.iter().enumerate() {
            for (band, name) in groups.iter().enumerate().filter(|(band, _)| bands[*band] == row) {
                let top = if band == 0 { 0.0 } else { y + BAND_GAP };
                self.bands.push(top);
                y = top + if name.is_empty() { SIDE } else { BAND_HEAD };
            }
            let (tracks, count) = tracks(street);
            self.streets
                .extend(tracks.into_iter().map(|(net, track)| (net, y + TRACK * track as f64)));
            y += TRACK * count as f64 + 3.0;
            let parts = || (0..rows.len()).filter(|&part| rows[part] == row);
            let height = parts().map(|part| self.areas[part].height).fold(0.0, f64::max);
            for part in parts().collect::<Vec<_>>() {
                self.areas[part].y = y + (height - self.areas[part].height) / 2.0;
            }
            y += height + 5.0;
        }
        self.height = y;
        // The next band begins where this one ends.
        self.bands.push(y + BAND_GAP);
    }

    /// Places the ends of nets on the sides of parts, in the order of their aims. Parts without names of ports come
    /// last, so that their lines can be straight.
    fn place_ports(&mut self) {
        self.heights = self.schematic.nets.iter().map(|net| vec![0.0; net.ends.len()]).collect();
        let mut taken: Vec<StubAt> = vec![];
        let mut parts: Vec<usize> = (0..self.areas.len()).collect();
        parts.sort_by_key(|&part| !self.has_names(part));
        for (part, is_right) in parts.into_iter().flat_map(|part| [(part, false), (part, true)]) {
            let mut side = self.side(part, is_right);
            side.sort_by(|one, other| self.aim(*one).total_cmp(&self.aim(*other)));
            let ys = self.port_heights(part, &side, &taken);
            for ((net, end), y) in side.into_iter().zip(ys) {
                taken.push(StubAt { net, channel: self.channels[net][end], y });
                self.heights[net][end] = y;
            }
        }
    }

    /// The height that an end of a net leads to: its street, or the mean of the other parts.
    fn aim(&self, (net, own): (usize, usize)) -> f64 {
        let others = self.schematic.nets[net].ends.iter().enumerate();
        let others = others.filter(|(end, _)| *end != own).map(|(_, end)| self.areas[end.part]);
        let mean = || mean(others.map(|area| area.y + area.height / 2.0));
        self.streets.get(&net).copied().unwrap_or_else(mean)
    }

    /// The heights of a side's ports, shifted together so that no stub lies on one of another net.
    fn port_heights(&self, part: usize, side: &[(usize, usize)], taken: &[StubAt]) -> Vec<f64> {
        let (area, has_names) = (self.areas[part], self.has_names(part));
        let (space, pad) = match has_names {
            true => (PORT * self.port_count(part), PAD),
            false => (area.height, 0.0),
        };
        let (middle, count) = (area.bottom() - pad - space / 2.0, side.len() as f64);
        let channel = |(net, end): (usize, usize)| self.channels[net][end];
        let ys = |shift: f64| -> Vec<f64> {
            let places = (0..side.len()).map(|place| place as f64 + 0.5 - count / 2.0);
            places.map(|place| middle + space / count * place + shift).collect()
        };
        // A shift that makes a line straight is best.
        let limits = match has_names || side.len() > 1 {
            true => -4.5..=3.0,
            false => 4.0 - area.height / 2.0..=area.height / 2.0 - 4.0,
        };
        let straight = side.iter().zip(ys(0.0)).flat_map(|(&end, y)| {
            let same = move |stub: &&StubAt| stub.net == end.0 && stub.channel == channel(end);
            taken.iter().filter(same).map(move |stub| stub.y - y)
        });
        let straight = straight.filter(|shift| limits.contains(shift));
        let is_free = |shift: &f64| {
            ys(*shift).iter().zip(side).all(|(y, &end)| {
                let near =
                    |stub: &&StubAt| stub.channel == channel(end) && (stub.y - y).abs() < APART;
                taken.iter().filter(near).all(|stub| stub.net == end.0)
            })
        };
        let shifts = [0.0, -3.0, 3.0, -1.5, 1.5, -4.5];
        ys(straight.chain(shifts).find(is_free).unwrap_or(0.0))
    }

    /// Places channels and columns from left to right.
    fn place_columns(&mut self) {
        let mut spans = vec![BTreeMap::new(); self.schematic.column_count() + 1];
        for (net, channels) in self.channels.iter().enumerate() {
            for (&channel, &y) in channels.iter().zip(&self.heights[net]) {
                let street = self.streets.get(&net).copied().unwrap_or(y);
                let span = spans[channel].entry(net).or_insert((y, y));
                widen(span, y);
                widen(span, street);
            }
        }
        let mut x = MARGIN;
        for (channel, spans) in spans.iter().enumerate() {
            let (tracks, count) = tracks(spans);
            let track_x = |track: usize| x + SIDE + TRACK * track as f64;
            self.trunks
                .extend(tracks.into_iter().map(|(net, track)| ((channel, net), track_x(track))));
            x += 2.0 * SIDE + TRACK * count as f64;
            let parts = self.schematic.parts.iter().enumerate();
            let parts = parts.filter(|(_, part)| part.column == channel).map(|(part, _)| part);
            let parts: Vec<usize> = parts.collect();
            let width = parts.iter().map(|&part| self.areas[part].width).fold(0.0, f64::max);
            for part in parts {
                self.areas[part].x = x + (width - self.areas[part].width) / 2.0;
            }
            x += width;
        }
        self.width = x + MARGIN;
    }

    fn draw_bands(&self, canvas: &mut Canvas, width: f64) {
        for (name, ends) in self.schematic.groups.iter().zip(self.bands.windows(2)) {
            let (y, height) = (ends[0], ends[1] - BAND_GAP - ends[0]);
            let area = Area { x: MARGIN, y, width: width - 2.0 * MARGIN, height };
            canvas.rect(area, " rx=\"4\" fill=\"#f5f5f5\" stroke=\"#e2e2e2\"");
            let kind = Type::new(SIZE).bold().colour(GREY);
            canvas.text((MARGIN + 8.0, y + 13.0), name, kind);
        }
    }

    /// The point where a net leaves a part.
    fn port(&self, net: usize, end: usize) -> Point {
        let part = self.end(net, end).part;
        let is_right = self.channels[net][end] > self.schematic.parts[part].column;
        let area = self.areas[part];
        (if is_right { area.right() } else { area.x }, self.heights[net][end])
    }

    /// The straight lines of a net.
    fn lines(&self, net: usize) -> Vec<[Point; 2]> {
        let mut lines = vec![];
        let mut trunks: BTreeMap<usize, (f64, f64)> = BTreeMap::new();
        let street = self.streets.get(&net);
        for (end, &channel) in self.channels[net].iter().enumerate() {
            let (x, y) = self.port(net, end);
            lines.push([(x, y), (self.trunks[&(channel, net)], y)]);
            let span = trunks.entry(channel).or_insert((y, y));
            widen(span, y);
            street.into_iter().for_each(|street| widen(span, *street));
        }
        let xs = trunks.keys().map(|&channel| self.trunks[&(channel, net)]).collect::<Vec<_>>();
        lines.extend(xs.iter().zip(trunks.values()).map(|(&x, span)| [(x, span.0), (x, span.1)]));
        lines.extend(street.map(|&y| [(xs[0], y), (xs[xs.len() - 1], y)]));
        lines.retain(|[one, other]| one != other);
        lines
    }

    fn draw_net(&self, canvas: &mut Canvas, net: usize) {
        let lines = self.lines(net);
        let look = self.schematic.kinds[self.schematic.nets[net].kind].1;
        let (colour, dash) = (look.colour, look.dash());
        let style =
            format!(" stroke=\"{colour}\" stroke-width=\"1.3\" stroke-linecap=\"round\"{dash}");
        canvas.titled(&self.in_words(net), |canvas| {
            lines.iter().for_each(|[from, to]| canvas.line(*from, *to, &style));
            for point in junctions(&lines) {
                canvas.circle(point, 2.3, &format!(" fill=\"{colour}\""));
            }
            for end in (0..self.channels[net].len()).filter(|end| self.end(net, *end).arrow) {
                let (x, y) = self.port(net, end);
                let is_left = x < self.trunks[&(self.channels[net][end], net)];
                let back = if is_left { x + 6.0 } else { x - 6.0 };
                let head = [(x, y), (back, y - 3.0), (back, y + 3.0)];
                canvas.polygon(&head, &format!(" fill=\"{colour}\""));
            }
        });
    }

    /// The joined ports as text, e.g. `valve.a, cylinder.a`.
    fn in_words(&self, net: usize) -> String {
        let ends = self.schematic.nets[net].ends.iter().map(|end| {
            let id = &self.schematic.parts[end.part].id;
            if end.port.is_empty() { id.clone() } else { format!("{id}.{}", end.port) }
        });
        ends.collect::<Vec<_>>().join(", ")
    }

    fn draw_part(&self, canvas: &mut Canvas, index: usize) {
        let (part, area) = (&self.schematic.parts[index], self.areas[index]);
        let colour = self.schematic.kinds[part.kind].1.colour;
        let has_names = self.has_names(index);
        canvas.component(&part.id, |canvas| {
            let fill = tint(colour, 0.2);
            canvas.rect(area, &format!(" rx=\"3\"{fill} stroke=\"{colour}\""));
            let text = LINE * part.text.lines().count() as f64;
            let first = area.y + if has_names { 4.0 } else { (area.height - text) / 2.0 };
            for (place, line) in part.text.lines().enumerate() {
                let kind = Type::new(SIZE).anchor(Anchor::Middle);
                let kind = if place == 0 { kind.bold() } else { kind };
                let y = first + LINE * (place as f64 + 0.78);
                canvas.text((area.x + area.width / 2.0, y), line, kind);
            }
            for is_right in [false, true].into_iter().filter(|_| has_names) {
                for (net, end) in self.side(index, is_right) {
                    let (x, y) = self.port(net, end);
                    let (anchor, shift) =
                        if is_right { (Anchor::End, -3.0) } else { (Anchor::Start, 3.0) };
                    let kind = Type::new(PORT_SIZE).anchor(anchor);
                    canvas.text((x + shift, y + 2.6), &self.end(net, end).port, kind);
                }
            }
        });
    }
}

/// The points where lines of one net meet from three or four directions; all lines are horizontal or vertical.
fn junctions(lines: &[[Point; 2]]) -> Vec<Point> {
    let between =
        |value: f64, one: f64, other: f64| one.min(other) <= value && value <= one.max(other);
    let directions = |point: Point| -> usize {
        let is_on = |[from, to]: &&[Point; 2]| {
            between(point.0, from.0, to.0) && between(point.1, from.1, to.1)
        };
        let ends = lines.iter().filter(is_on).flatten();
        ends.filter(|end| **end != point).count()
    };
    let mut found: Vec<Point> = vec![];
    for &point in lines.iter().flatten() {
        if !found.contains(&point) && directions(point) >= 3 {
            found.push(point);
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Parts in five columns and three bands, with nets of three and two ends between any of them.
    fn example() -> Schematic {
        let part = |number: usize| Part {
            id: format!("part {number}"),
            text: "title".to_owned(),
            kind: 0,
            group: number % 3,
            column: number % 5,
        };
        let net = |number: usize| {
            let parts = [number, (number * 7 + 1) % 30, (number * 11 + 3) % 30];
            let end = |part| NetEnd { part, port: format!("{number}"), arrow: false };
            Net { kind: 0, ends: parts[number % 2..].iter().map(|part| end(*part)).collect() }
        };
        Schematic {
            groups: ["a", "", "c"].map(str::to_owned).to_vec(),
            kinds: vec![("oil".to_owned(), Look::nth(0))],
            parts: (0..30).map(part).collect(),
            nets: (0..30).map(net).collect(),
            ..Schematic::default()
        }
    }

    /// Whether two boxes, also lines without width, have more than an edge in common.
    fn overlap([from, to]: [Point; 2], [first, last]: [Point; 2]) -> bool {
        let common =
            |a: f64, b: f64, c: f64, d: f64| a.max(b).min(c.max(d)) - a.min(b).max(c.min(d));
        let (x, y) = (common(from.0, to.0, first.0, last.0), common(from.1, to.1, first.1, last.1));
        x.min(y) > -1.0 && x.max(y) > 1.0
    }

    #[test]
    fn no_line_crosses_a_part_or_lies_on_another() {
        let example = example();
        let layout = Layout::new(&example);
        let lines: Vec<_> = (0..example.nets.len()).map(|net| layout.lines(net)).collect();
        for (net, line) in
            lines.iter().enumerate().flat_map(|(net, own)| own.iter().map(move |line| (net, *line)))
        {
            for (part, area) in layout.areas.iter().enumerate() {
                let inside =
                    [(area.x + 2.0, area.y + 2.0), (area.right() - 2.0, area.bottom() - 2.0)];
                assert!(!overlap(line, inside), "net {net} crosses part {part}");
            }
            for (other, others) in lines.iter().enumerate().filter(|(other, _)| *other != net) {
                assert!(
                    others.iter().all(|one| !overlap(line, *one)),
                    "net {net} lies on net {other}"
                );
            }
        }
    }

    #[test]
    fn three_lines_make_a_junction_and_a_corner_does_not() {
        let level = [(0.0, 0.0), (10.0, 0.0)];
        assert_eq!(junctions(&[level, [(4.0, 0.0), (4.0, 5.0)]]), [(4.0, 0.0)]);
        assert!(junctions(&[level, [(10.0, 0.0), (10.0, 5.0)]]).is_empty());
        assert!(junctions(&[level, [(10.0, 0.0), (20.0, 0.0)]]).is_empty());
        // Lines without a common end cross.
        assert!(junctions(&[level, [(4.0, -5.0), (4.0, 5.0)]]).is_empty());
    }
}
