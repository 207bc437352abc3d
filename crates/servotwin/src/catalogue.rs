//! The component catalogue as documents: searchable and written as Markdown. All of it comes from the declarations of
//! components and from the headers of their files.

use crate::format::Key;
use crate::system::{POINT, keys_of};
use crate::toml_text::{NumberWithUnit, Quantities};
use crate::units::word;
use servotwin_model::component::Component;
use servotwin_model::components::{ALL, description};
use servotwin_model::fluid::{Fluid, FluidKind};
use servotwin_model::spec::{Fault, Law, Parameter, Port, PortKind};

/// Every component, in the order of the documentation.
pub fn all() -> impl Iterator<Item = &'static Component> {
    ALL.iter().copied()
}

/// The component of this kind.
pub fn find(kind: &str) -> Option<&'static Component> {
    all().find(|spec| spec.kind == kind)
}

/// A component that matches a search, with the matching lines.
pub struct Hit {
    /// The component.
    pub spec: &'static Component,
    /// The matching parameters, faults, ports and sentences of the description.
    pub lines: Vec<String>,
}

/// Finds a word in the declarations and descriptions of all components, ignoring case.
pub fn search(word: &str) -> Vec<Hit> {
    let wanted = word.to_lowercase();
    let has = |text: &str| text.to_lowercase().contains(&wanted);
    let found = all().filter_map(|spec| {
        let mut lines = Vec::new();
        let mut keep = |what: &str, name: &str, summary: &str| {
            if has(name) || has(summary) {
                lines.push(format!("{what} {name}: {summary}"));
            }
        };
        for p in spec.parameters {
            keep("parameter", p.name, p.summary);
        }
        for f in spec.faults {
            keep("fault", f.name, &format!("{} ({})", f.summary, f.category.name()));
        }
        for p in spec.ports {
            keep("port", p.name, p.summary);
        }
        let text = prose(spec.kind);
        for paragraph in text.split("\n\n") {
            let paragraph = paragraph.split_whitespace().collect::<Vec<_>>().join(" ");
            let sentences = paragraph.split_inclusive(". ").filter(|sentence| has(sentence));
            lines.extend(sentences.map(|sentence| sentence.trim().to_owned()));
        }
        let itself = has(spec.kind) || has(spec.summary);
        (itself || !lines.is_empty()).then_some(Hit { spec, lines })
    });
    found.collect()
}

/// A component's description with its equations, as Markdown. Links to other items become plain names.
pub fn prose(kind: &str) -> String {
    let text = description(kind).unwrap_or_default();
    let mut plain = String::new();
    let mut rest = text.as_str();
    while let Some((before, after)) = rest.split_once("[`") {
        let Some((link, behind)) = after.split_once("`]") else { break };
        let name = link.rsplit("::").next().unwrap_or(link);
        plain += &format!("{before}`{name}`");
        rest = behind;
    }
    plain + rest
}

/// The unit's name in tables.
fn unit(parameter: &Parameter) -> &'static str {
    word(parameter.unit)
}

/// The allowed range of a parameter, as text.
pub fn range(parameter: &Parameter) -> String {
    Quantities(parameter.min, parameter.max, parameter.unit.symbol()).to_string()
}

/// A parameter's default, as text.
pub fn default(parameter: &Parameter) -> String {
    parameter.default.map_or("required".into(), |value| NumberWithUnit(value, "").to_string())
}

/// The effect of a fault on its parameter as a formula, with `i` the intensity.
pub fn law(fault: &Fault, spec: &Component) -> String {
    let (name, full) = (fault.parameter, NumberWithUnit(fault.full, ""));
    let unit = spec.parameter(name).map_or("", |p| spec.parameters[p].unit.symbol());
    let is_less = fault.full < if fault.law == Law::Scale { 1.0 } else { 0.0 };
    let sign = if is_less { '−' } else { '+' };
    match fault.law {
        Law::Add => format!("{name} {sign} {} i", NumberWithUnit(fault.full.abs(), unit)),
        Law::Scale => format!("{name} (1 {sign} {}i)", change_of(fault.full)),
        Law::Geometric => format!("{name} · {full}^i"),
    }
}

/// The distance of a factor from 1, as the coefficient of an intensity.
fn change_of(factor: f64) -> String {
    // Rounds away binary noise, so that decimal factors give decimal differences.
    let change = ((factor - 1.0).abs() * 1e12).round() / 1e12;
    if change == 1.0 { String::new() } else { format!("{} ", NumberWithUnit(change, "")) }
}

/// The flow through a port, as text.
pub fn flow(port: &Port, spec: &Component) -> String {
    match port.kind {
        PortKind::SignalIn { unit, default } => {
            let range = spec
                .input_range(port)
                .map_or(String::new(), |(min, max)| format!(", {}", Quantities(min, max, "")));
            let stand_in = default.map_or(String::new(), |name| format!("; open: {name}"));
            format!("signal in ({}{range}{stand_in})", word(unit))
        }
        PortKind::SignalOut { unit } => format!("signal out ({})", word(unit)),
        kind => {
            let what = match (kind, kind.sets()) {
                (_, false) => "",
                (PortKind::Hydraulic { .. }, true) => ", sets the pressure",
                (_, true) => ", sets the motion",
            };
            let open = if port.optional { ", may be left open" } else { "" };
            format!("{}{what}{open}", kind.family())
        }
    }
}

/// The column headers of [`fluids`].
pub const FLUID_HEADS: [&str; 6] =
    ["fluid", "description", "°C", "kg/m³ at 40 °C", "cSt at 40 and 100 °C", "E₀ at 40 °C, GPa"];

/// The fluids with their properties, in the order of [`FLUID_HEADS`].
pub fn fluids() -> Vec<[String; 6]> {
    let one = |&kind: &FluidKind| {
        let fluid = Fluid { kind, ..Fluid::default() };
        let at = |celsius: f64| fluid.at(celsius + 273.15);
        let (low, high) = fluid.range_k();
        let (warm, hot) = (at(40.0), at(100.0));
        let centistokes = [warm, hot].map(|state| 1e6 * state.kinematic_viscosity_m2_s);
        [
            kind.name().into(),
            kind.summary().into(),
            format!("{:.0} … {:.0}", low - 273.15, high - 273.15),
            format!("{:.0}", warm.density_kg_m3),
            format!("{:.1}, {:.1}", centistokes[0], centistokes[1]),
            format!("{:.2}", warm.bulk.liquid_pa / 1e9),
        ]
    };
    FluidKind::ALL.iter().map(one).collect()
}

/// The keys that describe a kind of fluid in a system file, grouped under headings; none for another word.
pub fn fluid_keys(kind: &str) -> Vec<(&'static str, &'static [Key])> {
    let Some(kind) = FluidKind::ALL.iter().copied().find(|known| known.name() == kind) else {
        return vec![];
    };
    let points = (kind == FluidKind::Table).then_some(("keys of each of its points", POINT));
    points.into_iter().chain([("keys of [fluids.NAME]", keys_of(kind))]).collect()
}

/// Every component in one row.
fn overview() -> String {
    let names = |names: Vec<&str>| match names.is_empty() {
        true => "–".into(),
        false => format!("`{}`", names.join("`, `")),
    };
    let row = |spec: &Component| {
        vec![
            format!("[{kind}](#{kind})", kind = spec.kind),
            spec.summary.replace('|', "\\|"),
            names(spec.ports.iter().map(|port| port.name).collect()),
            names(spec.states.iter().map(|state| state.name).collect()),
            names(spec.faults.iter().map(|fault| fault.name).collect()),
        ]
    };
    table(&["kind", "description", "ports", "states", "faults"], all().map(row).collect())
}

/// The pages of the book about the catalogue: a row and a page for each component, and the liquids.
pub fn book() -> String {
    let pages: Vec<String> = all().map(markdown).collect();
    let rows = fluids().into_iter().map(Vec::from).collect();
    let fluids = "The numbers of `own` are its defaults, and `table` takes its numbers from its points, here those of HLP 46. \
                  [The system format](system-format.md) lists their keys.";
    let (overview, pages) = (overview(), pages.join("\n"));
    let liquids = table(&FLUID_HEADS, rows);
    format!("## All kinds\n{overview}\n{pages}\n## Fluids\n\n{fluids}\n{liquids}")
}

/// A Markdown table.
fn table(heads: &[&str], rows: Vec<Vec<String>>) -> String {
    let cells = |row: &[String]| format!("| {} |\n", row.join(" | "));
    let heads: Vec<String> = heads.iter().map(|&head| head.to_owned()).collect();
    let rule = vec!["---".to_owned(); heads.len()];
    let rows: String = rows.iter().map(|row| cells(row)).collect();
    format!("\n{}{}{rows}", cells(&heads), cells(&rule))
}

/// The Markdown section about a component.
pub fn markdown(spec: &Component) -> String {
    let mut page = format!("## {}\n\n{}\n", spec.kind, prose(spec.kind).trim_end());
    let code = |text: &str| format!("`{text}`");
    let plain = |text: &str| text.replace('|', "\\|");
    let ports = spec.ports.iter();
    let ports = ports.map(|p| vec![code(p.name), flow(p, spec), plain(p.summary)]);
    page += &table(&["port", "type", "meaning"], ports.collect());
    if !spec.parameters.is_empty() {
        let rows = spec
            .parameters
            .iter()
            .map(|p| vec![code(p.name), unit(p).into(), default(p), range(p), plain(p.summary)]);
        page += &table(&["parameter", "unit", "default", "range", "meaning"], rows.collect());
    }
    if !spec.faults.is_empty() {
        let rows = spec.faults.iter().map(|f| {
            vec![code(f.name), f.category.name().into(), code(&law(f, spec)), plain(f.summary)]
        });
        let heads = ["fault", "category", "parameter at intensity i", "meaning"];
        page += &table(&heads, rows.collect());
    }
    page
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_declaration_stands_on_its_page() {
        for spec in all() {
            let page = markdown(spec);
            let names = spec.parameters.iter().map(|p| p.name);
            let names = names.chain(spec.faults.iter().map(|f| f.name));
            for name in names.chain(spec.ports.iter().map(|p| p.name)) {
                assert!(page.contains(&format!("`{name}`")), "{}.{name}", spec.kind);
            }
            assert!(!page.contains("super::") && !page.contains("crate::"), "{page}");
        }
    }

    #[test]
    fn words_are_found_in_faults_and_descriptions() {
        let kinds = |word| search(word).iter().map(|hit| hit.spec.kind).collect::<Vec<_>>();
        assert!(kinds("CLOGGING").contains(&"servo_valve"));
        assert!(kinds("stribeck").contains(&"cylinder"));
        assert_eq!(kinds("no such word"), Vec::<&str>::new());
        let hits = search("edge_rounding");
        assert_eq!(hits.len(), 1);
        assert!(hits[0].lines[0].starts_with("fault edge_rounding"), "{:?}", hits[0].lines);
    }

    #[test]
    fn fluids_have_their_numbers() {
        let all = fluids();
        let hlp = all.iter().find(|row| row[0] == "hlp_46").unwrap();
        assert_eq!(hlp[2..], ["-10 … 100", "865", "46.0, 6.8", "1.60"]);
        assert!(book().contains("| mil_prf_83282 |"));
    }

    #[test]
    fn laws_read_as_they_act() {
        let spec = find("relief_valve").unwrap();
        assert_eq!(law(&spec.faults[0], spec), "set_pa (1 − 0.5 i)");
        let controller = find("position_controller").unwrap();
        let gains = controller.faults.iter().filter(|fault| fault.parameter == "gain_per_m");
        let gains: Vec<String> = gains.map(|fault| law(fault, controller)).collect();
        assert_eq!(gains, ["gain_per_m (1 − 0.8 i)", "gain_per_m (1 + i)"]);
        assert_eq!(law(&spec.faults[1], spec), "leak_area_m2 + 2e-7 m² i");
    }
}
