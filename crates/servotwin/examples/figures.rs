//! A gallery: one figure of each kind from made-up data, as SVG and PNG.
//!
//! `cargo run -p servotwin --example figures -- FOLDER`

use std::f64::consts::TAU;
use std::path::{Path, PathBuf};

use servotwin::figure::bars::{Bar, Bars};
use servotwin::figure::diagram::{Block, Diagram, Wire};
use servotwin::figure::heatmap::ConfusionMatrix;
use servotwin::figure::histogram::{HistogramGrid, HistogramPanel};
use servotwin::figure::lines::{Curve, Lines};
use servotwin::figure::time_series::{Band, Panel, Series, TimeSeries};
use servotwin::figure::tree::{Node, TreeFigure};
use servotwin::figure::{Figure, FigureError};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let folder = std::env::args().nth(1).map_or_else(std::env::temp_dir, PathBuf::from);
    servotwin::files::create_folder(&folder)?;
    save(&folder, "time_series", time_series())?;
    save(&folder, "histogram", histogram())?;
    save(&folder, "bars", bars())?;
    save(&folder, "heatmap", heatmap(5))?;
    save(&folder, "heatmap_18", heatmap(18))?;
    save(&folder, "lines", lines())?;
    save(&folder, "tree", tree())?;
    save(&folder, "diagram", diagram())?;
    Ok(())
}

fn save(folder: &Path, name: &str, figure: Figure) -> Result<(), FigureError> {
    figure.save(folder.join(format!("{name}.svg")))?;
    figure.save(folder.join(format!("{name}.png")))
}

/// Noise between −1 and 1, the same every time (xorshift).
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Roughly normal, standard deviation 1.
    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.next() / 2.0).sum()
    }
}

fn time_series() -> Figure {
    let mut noise = Noise(1);
    let time: Vec<f64> = (0..9000).map(|step| f64::from(step) * 0.01).collect();
    let slow =
        |at: f64, phase: f64| (TAU * 0.04 * at + phase).sin() + 0.3 * (TAU * 0.31 * at).sin();
    let command: Vec<f64> = time.iter().map(|at| 0.2 * slow(*at, 0.0)).collect();
    let angle: Vec<f64> = time.iter().map(|at| 0.2 * slow(*at - 0.12, 0.0)).collect();
    let twin: Vec<f64> = time.iter().map(|at| 0.2 * slow(*at - 0.1, 0.0)).collect();
    let mut pressure: Vec<f64> =
        time.iter().map(|at| 1.2e7 + 4e6 * slow(*at, 1.0) + 1e5 * noise.normal()).collect();
    pressure[4321] = 2.6e7;
    let pressure_twin: Vec<f64> = time.iter().map(|at| 1.2e7 + 3.9e6 * slow(*at, 1.0)).collect();
    let mut residual: Vec<f64> = time.iter().map(|_| 0.01 * noise.normal()).collect();
    residual[6000..6200].fill(f64::NAN);
    TimeSeries::new("External leakage in actuator 1, intensity 0.4", "time (s)")
        .with(
            Panel::new("Aileron angle", "angle (rad)")
                .with(Series::new("command", &time, &command))
                .with(Series::new("actuator", &time, &angle))
                .with(Series::new("virtual twin", &time, &twin)),
        )
        .with(
            Panel::new("Chamber pressure A", "pressure (Pa)")
                .with(Series::new("actuator 1", &time, &pressure))
                .with(Series::new("virtual twin", &time, &pressure_twin)),
        )
        .with(
            Panel::new("Scaled residual of the chamber pressure A", "residual (-)")
                .with(Series::new("residual", &time, &residual))
                .with_band(Band::constant("±3 %", -0.03, 0.03)),
        )
        .draw()
}

fn histogram() -> Figure {
    let mut noise = Noise(2);
    let names = [
        "supply pressure",
        "return pressure",
        "pressure A",
        "pressure B",
        "spool position",
        "stroke",
        "surface angle",
        "oil temperature",
    ];
    let series = ["healthy", "actuator 1, intensity 0.2", "actuator 1, intensity 0.8"];
    let mut grid = HistogramGrid::new(
        "Scaled residuals: external leakage in the cylinder",
        "scaled residual (-)",
        &series,
    );
    grid.band = Some(0.03);
    for (place, name) in names.into_iter().enumerate() {
        let shift = if (2..5).contains(&place) { 0.05 } else { 0.003 };
        let mut values = |shift: f64, width: f64| -> Vec<f64> {
            (0..9000).map(|_| shift + width * noise.normal()).collect()
        };
        let all = vec![
            values(0.0, 0.006).into(),
            values(-shift * 0.4, 0.009).into(),
            values(-shift * 1.6, 0.02).into(),
        ];
        grid.panels.push(HistogramPanel::new(name, all));
    }
    grid.draw()
}

fn bars() -> Figure {
    let names = [
        "decision tree",
        "random forest",
        "extra trees",
        "gradient boosting",
        "nearest neighbours",
        "naive Bayes",
        "linear discriminant analysis",
        "neural network",
    ];
    let mut figure =
        Bars::new("Accuracy on unseen variants", "accuracy (-)", &["one stage", "hierarchy"]);
    figure.range = Some((0.0, 1.0));
    for (place, name) in names.into_iter().enumerate() {
        let value = 0.95 - 0.06 * place as f64;
        let hierarchy =
            (place != 5).then(|| Bar::with_interval(value + 0.03, value + 0.01, value + 0.05));
        figure = figure.with(
            name,
            vec![Some(Bar::with_interval(value, value - 0.04, value + 0.03)), hierarchy],
        );
    }
    figure.draw()
}

fn heatmap(count: usize) -> Figure {
    let names = [
        "healthy",
        "external leakage",
        "internal leakage",
        "pressure sensor bias",
        "stroke sensor",
        "spool jam",
        "valve clogging",
        "coil open",
        "supply loss",
        "friction",
        "gas in oil",
        "return blocked",
        "filter",
        "accumulator",
        "hinge play",
        "bearing",
        "cable",
        "computer",
    ];
    let mut noise = Noise(3);
    let classes: Vec<String> = names.iter().take(count).map(|name| (*name).to_owned()).collect();
    let counts = (0..count)
        .map(|row| {
            let cell = |column: usize| match row.abs_diff(column) {
                0 => 180 + (60.0 * noise.next()) as u64,
                distance => (30.0 * noise.next().max(0.0) / distance as f64) as u64,
            };
            (0..count).map(cell).collect()
        })
        .collect();
    ConfusionMatrix::new("Fault classes of actuator 1", classes, counts).draw()
}

fn lines() -> Figure {
    let mut noise = Noise(4);
    let mut figure = Lines::new("Learning curves", "training variants", "error rate (-)");
    (figure.x_log, figure.y_log) = (true, true);
    for (place, name) in
        ["decision tree", "random forest", "nearest neighbours", "linear"].into_iter().enumerate()
    {
        let points: Vec<(f64, f64)> = (0..9)
            .map(|step| {
                let x = 40.0 * 2_f64.powi(step);
                (x, (0.9 + place as f64) * x.powf(-0.45) * (1.0 + 0.08 * noise.next()))
            })
            .collect();
        let intervals = points.iter().map(|(_, y)| (y * 0.85, y * 1.18)).collect();
        figure = figure.with(Curve::new(name, points).with_intervals(intervals));
    }
    figure.draw()
}

fn tree() -> Figure {
    fn grow(depth: usize, noise: &mut Noise) -> Node {
        let features = ["r_NoDev pressure A", "mean stroke", "variance spool", "r_NoDev return"];
        let feature = features[(noise.next().abs() * 4.0) as usize % 4];
        let shares: Vec<f64> = (0..3).map(|_| (noise.next() + 0.2).max(0.0).powi(3)).collect();
        let samples = format!("n = {}", (noise.next().abs() * 800.0) as u32 + 20);
        if depth == 7 || (depth > 2 && noise.next() > 0.55) {
            let class = ["healthy", "actuator 1", "actuator 2"];
            let best =
                (0..3).max_by(|one, other| shares[*one].total_cmp(&shares[*other])).unwrap_or(0);
            return Node::leaf(vec![class[best].to_owned(), samples], shares);
        }
        let question = format!("{feature} ≤ {:.3}", noise.next());
        let yes = grow(depth + 1, noise);
        Node::split(vec![question, samples], shares, yes, grow(depth + 1, noise))
    }
    let classes = ["healthy", "actuator 1", "actuator 2"].map(str::to_owned).to_vec();
    let root = grow(0, &mut Noise(11));
    TreeFigure {
        title: "Which actuator has failed?".to_owned(),
        classes,
        looks: vec![],
        root,
        sideways: false,
    }
    .draw()
}

fn diagram() -> Figure {
    let mut diagram = Diagram {
        title: "Aileron with two electro-hydraulic actuators".to_owned(),
        groups: ["Actuator 1", "Shared", "Actuator 2"].map(str::to_owned).to_vec(),
        ..Diagram::default()
    };
    diagram.blocks.extend([
        Block::new("computer", "flight computer\nposition control", "electronics", "Shared"),
        Block::new("surface", "aileron\nJ = 2.4 kg m²", "mechanics", "Shared"),
        Block::new("load", "air load", "source", "Shared"),
        Block::new("angle", "angle sensor", "sensor", "Shared"),
        Block::new("hinge", "hinge", "mechanics", "Shared"),
    ]);
    for number in 1..=2 {
        actuator(&mut diagram, number);
    }
    for (from, to, kind) in [
        ("load", "surface", "force"),
        ("surface", "hinge", "force"),
        ("surface", "angle", "signal"),
    ] {
        diagram.wires.push(Wire::new(from, to, kind));
    }
    diagram.draw()
}

fn actuator(diagram: &mut Diagram, number: usize) {
    let group = format!("Actuator {number}");
    let id = |name: &str| format!("{name}_{number}");
    let blocks = [
        ("supply", "supply\n21 MPa", "source"),
        ("tank", "return\n0.5 MPa", "source"),
        ("filter", "filter", "hydraulics"),
        ("supply_sensor", "p_S sensor", "sensor"),
        ("check", "check valve", "hydraulics"),
        ("accumulator", "accumulator", "hydraulics"),
        ("solenoid", "solenoid valve", "hydraulics"),
        ("torque_motor", "torque motor", "electronics"),
        ("amplifier", "amplifier", "electronics"),
        ("valve", "servo valve\n4/3, spool", "hydraulics"),
        ("spool_sensor", "x_v sensor", "sensor"),
        ("line_a", "line A", "hydraulics"),
        ("line_b", "line B", "hydraulics"),
        ("bypass", "bypass valve\ndamping", "hydraulics"),
        ("relief_a", "relief A", "hydraulics"),
        ("relief_b", "relief B", "hydraulics"),
        ("chamber_a", "chamber A", "hydraulics"),
        ("chamber_b", "chamber B", "hydraulics"),
        ("sensor_a", "p_A sensor", "sensor"),
        ("sensor_b", "p_B sensor", "sensor"),
        ("piston", "piston", "mechanics"),
        ("leak", "internal leakage", "hydraulics"),
        ("seal", "seal friction", "mechanics"),
        ("stroke", "x_p sensor", "sensor"),
        ("rod", "rod, stiffness", "mechanics"),
        ("return_sensor", "p_T sensor", "sensor"),
        ("temperature", "T sensor", "sensor"),
    ];
    for (name, text, kind) in blocks {
        diagram.blocks.push(Block::new(&id(name), text, kind, &group));
    }
    let wires = [
        ("supply", "filter", "oil"),
        ("filter", "check", "oil"),
        ("supply", "supply_sensor", "signal"),
        ("supply", "temperature", "signal"),
        ("check", "accumulator", "oil"),
        ("check", "solenoid", "oil"),
        ("solenoid", "valve", "oil"),
        ("tank", "valve", "oil"),
        ("tank", "return_sensor", "signal"),
        ("amplifier", "torque_motor", "signal"),
        ("torque_motor", "valve", "force"),
        ("valve", "spool_sensor", "signal"),
        ("valve", "line_a", "oil"),
        ("valve", "line_b", "oil"),
        ("line_a", "bypass", "oil"),
        ("line_b", "bypass", "oil"),
        ("line_a", "relief_a", "oil"),
        ("line_b", "relief_b", "oil"),
        ("line_a", "chamber_a", "oil"),
        ("line_b", "chamber_b", "oil"),
        ("chamber_a", "sensor_a", "signal"),
        ("chamber_b", "sensor_b", "signal"),
        ("chamber_a", "leak", "oil"),
        ("chamber_b", "leak", "oil"),
        ("chamber_a", "piston", "force"),
        ("chamber_b", "piston", "force"),
        ("piston", "seal", "force"),
        ("piston", "stroke", "signal"),
        ("piston", "rod", "force"),
    ];
    for (from, to, kind) in wires {
        diagram.wires.push(Wire::new(&id(from), &id(to), kind));
    }
    let command = Wire {
        label: "i".to_owned(),
        arrow: true,
        ..Wire::new("computer", &id("amplifier"), "signal")
    };
    let force = Wire { arrow: true, ..Wire::new(&id("rod"), "surface", "force") };
    diagram.wires.extend([command, force]);
}
