//! Fluids in a system file: the keys of each kind.

use crate::format::{At, Entry, Key, Read, Value, get, object, section, words};
use crate::toml_text::{Collector, Diagnostic, TextSpan};
use serde_json::json;
use servotwin_model::fluid::own::{LEAST_BULK_MODULUS_PA, OwnLiquid};
use servotwin_model::fluid::table::{LEAST_STEP_K, Point, Table};
use servotwin_model::fluid::{Fluid, FluidKind};

words!(FluidKind, FluidKind::ALL.iter().map(|kind| (kind.name(), *kind)));

const AIR: Value = Value::Number(0.0, 0.2, "");
const EXPONENT: Value = Value::Number(1.0, 1.67, "");
const WALL: Value = Value::Number(1e8, 1e13, "Pa");
const SLOPE: Value = Value::Number(0.0, 20.0, "");
const MODULUS: Value = Value::Number(LEAST_BULK_MODULUS_PA, 1e10, "Pa");
const CHANGE: Value = Value::Number(-2e7, 0.0, "");
const DENSITY: Value = Value::Number(500.0, 2000.0, "kg/m³");

/// A section with the keys that every kind of fluid has, and its own.
macro_rules! fluid {
    ($(#[$doc:meta])* struct $Name:ident { $($own:tt)* }) => {
        section! {
            $(#[$doc])*
            struct $Name {
                must kind: FluidKind, "kind of fluid";
                may air_fraction: f64 = AIR => 0.005, "free gas per volume of liquid; default 0.005";
                may polytropic_exponent: f64 = EXPONENT => 1.4, "polytropic exponent of the gas; default 1.4";
                may wall_modulus_pa: f64 = WALL => 10e9, "stiffness of the walls; default 10e9";
                $($own)*
            }
        }
    };
}

fluid! {
    /// A fluid of the catalog.
    struct CatalogFluid {}
}

fluid! {
    /// A fluid by the numbers of its data sheet.
    struct OwnFluid {
        may bulk_modulus_slope: f64 = SLOPE => 11.0,
            "rise of the bulk modulus, Pa per pascal; default 11";
        may bulk_modulus_pa: f64 = MODULUS => 1.6e9,
            "bulk modulus of the liquid at 40 °C; default 1.6e9";
        may bulk_modulus_change: f64 = CHANGE => -8e6,
            "change of the bulk modulus, Pa per kelvin; default -8e6";
        may density_kg_m3: f64 = DENSITY => 880.0, "density at 15 °C; default 880";
        may expansion: f64 = Value::Number(0.0, 5e-3, "") => 7e-4,
            "thermal expansion of its volume, per kelvin; default 7e-4";
        may viscosity_40_m2_s: f64 = Value::Number(2e-6, 1e-3, "m²/s") => 46e-6,
            "kinematic viscosity at 40 °C; default 46e-6";
        may viscosity_100_m2_s: f64 = Value::Number(1e-6, 5e-4, "m²/s") => 6.8e-6,
            "kinematic viscosity at 100 °C; default 6.8e-6";
    }
}

fluid! {
    /// A fluid by its numbers at several temperatures.
    struct TableFluid {
        may bulk_modulus_slope: f64 = SLOPE => 11.0,
            "rise of the bulk modulus, Pa per pascal; default 11";
        may bulk_modulus_pa: f64 = MODULUS => 1.6e9,
            "bulk modulus of the liquid at 40 °C, unless the points give it; default 1.6e9";
        may bulk_modulus_change: f64 = CHANGE => -8e6,
            "change of the bulk modulus, Pa per kelvin, unless the points give it; default -8e6";
        must points: Vec<At<PointText>> = Value::List(2, &Value::Table(PointText::KEYS)),
            "from cold to hot: { temperature_k = 313.15, density_kg_m3 = 865, viscosity_m2_s = 46e-6 }";
    }
}

section! {
    /// A point of a fluid of kind `table`.
    struct PointText {
        must temperature_k: At<f64> = Value::Number(200.0, 480.0, "K"),
            "temperature, at least one kelvin above the previous point";
        must density_kg_m3: At<f64> = DENSITY,
            "density, no more than at the previous, colder point";
        must viscosity_m2_s: At<f64> = Value::Number(1e-6, 2e-2, "m²/s"),
            "kinematic viscosity, no more than at the previous, colder point";
        may bulk_modulus_pa: Option<At<f64>> = MODULUS,
            "bulk modulus of the liquid, no more than at the previous, colder point";
    }
}

/// The keys of a kind of fluid in a system file.
pub(crate) fn keys_of(kind: FluidKind) -> &'static [Key] {
    match kind {
        FluidKind::Own => OwnFluid::KEYS,
        FluidKind::Table => TableFluid::KEYS,
        _ => CatalogFluid::KEYS,
    }
}

/// The keys of a point of a fluid of kind `table`.
pub(crate) const POINT: &[Key] = PointText::KEYS;

/// A fluid of any kind.
pub(super) struct FluidText(pub Fluid);

impl Read for FluidText {
    const VALUE: Value = Value::Other(
        || {
            let of_kind = |kind: &FluidKind| {
                let mut schema = object(keys_of(*kind));
                schema["properties"]["kind"] = json!({ "const": kind.name() });
                schema
            };
            json!({ "anyOf": FluidKind::ALL.iter().map(of_kind).collect::<Vec<_>>() })
        },
        "the numbers of a fluid",
    );

    fn read(entry: &Entry, _key: Key, mistakes: &mut Collector) -> Option<Self> {
        let all = mistakes.table(entry)?;
        let name = format!("fluid '{}'", entry.key);
        let place = (&entry.at, name.as_str());
        let word = get(&all, "kind").and_then(Entry::text);
        let fluid = if word == Some(FluidKind::Own.name()) {
            OwnFluid::of(&all, place, mistakes)?.fluid(place, mistakes)
        } else if word == Some(FluidKind::Table.name()) {
            let gives_modulus = ["bulk_modulus_pa", "bulk_modulus_change"];
            let given = gives_modulus.iter().find_map(|key| get(&all, key));
            TableFluid::of(&all, place, mistakes)?.fluid(given, mistakes)?
        } else {
            let CatalogFluid { kind, air_fraction, polytropic_exponent, wall_modulus_pa } =
                CatalogFluid::of(&all, place, mistakes)?;
            Fluid { kind, air_fraction, polytropic_exponent, wall_modulus_pa, ..Fluid::default() }
        };
        Some(FluidText(fluid))
    }
}

impl OwnFluid {
    fn fluid(self, (at, name): (&TextSpan, &str), mistakes: &mut Collector) -> Fluid {
        if self.viscosity_100_m2_s >= self.viscosity_40_m2_s {
            let message = format!("the {name} is no thinner at 100 °C than at 40 °C");
            let help = "give both viscosity_40_m2_s and viscosity_100_m2_s (1 cSt = 1e-6 m²/s)";
            mistakes.note(at, Diagnostic::new(message).with_help(help));
        }
        Fluid {
            kind: self.kind,
            air_fraction: self.air_fraction,
            polytropic_exponent: self.polytropic_exponent,
            wall_modulus_pa: self.wall_modulus_pa,
            own: OwnLiquid {
                density_kg_m3: self.density_kg_m3,
                expansion: self.expansion,
                viscosity_40_m2_s: self.viscosity_40_m2_s,
                viscosity_100_m2_s: self.viscosity_100_m2_s,
                bulk_modulus_pa: self.bulk_modulus_pa,
                bulk_modulus_change: self.bulk_modulus_change,
                bulk_modulus_slope: self.bulk_modulus_slope,
            },
            ..Fluid::default()
        }
    }
}

impl TableFluid {
    /// The fluid; `modulus` is a key that gives its bulk modulus instead of the points.
    fn fluid(self, modulus: Option<&Entry>, mistakes: &mut Collector) -> Option<Fluid> {
        let usual = Fluid::default();
        let own = OwnLiquid {
            bulk_modulus_pa: self.bulk_modulus_pa,
            bulk_modulus_change: self.bulk_modulus_change,
            bulk_modulus_slope: self.bulk_modulus_slope,
            ..usual.own
        };
        let is_in_points = self.points.iter().any(|point| point.bulk_modulus_pa.is_some());
        if let Some(entry) = modulus.filter(|_| is_in_points) {
            let message =
                format!("the points give the bulk modulus, so '{}' has no use", entry.key);
            mistakes.note(&entry.at, Diagnostic::new(message));
        }
        let law = (!is_in_points).then_some(&own);
        self.points.windows(2).for_each(|pair| pair[1].check_order(&pair[0], mistakes));
        let points: Vec<_> =
            self.points.iter().map(|point| point.point(&point.at, law, mistakes)).collect();
        Some(Fluid {
            kind: self.kind,
            air_fraction: self.air_fraction,
            polytropic_exponent: self.polytropic_exponent,
            wall_modulus_pa: self.wall_modulus_pa,
            table: Table::new(points.into_iter().collect::<Option<_>>()?)?,
            own,
        })
    }
}

impl PointText {
    /// The point; `law` gives its bulk modulus where points do not.
    fn point(
        &self,
        at: &TextSpan,
        law: Option<&OwnLiquid>,
        mistakes: &mut Collector,
    ) -> Option<Point> {
        let temperature_k = self.temperature_k.value;
        let bulk_modulus_pa = match (law, &self.bulk_modulus_pa) {
            (Some(own), _) => own.bulk_modulus_at(temperature_k),
            (None, Some(given)) => given.value,
            (None, None) => {
                let write = "bulk_modulus_pa = …";
                mistakes.note(at, Diagnostic::missing("a point", "bulk_modulus_pa", write));
                return None;
            }
        };
        let (min, max, unit) = MODULUS.range();
        if !(min..=max).contains(&bulk_modulus_pa) {
            let summary = "of the liquid here, by its value at 40 °C and bulk_modulus_change";
            let mistake = Diagnostic::out_of_range(
                "bulk_modulus_pa",
                bulk_modulus_pa,
                (min, max),
                unit,
                summary,
            );
            mistakes.note(at, mistake);
        }
        let (density_kg_m3, viscosity_m2_s) = (self.density_kg_m3.value, self.viscosity_m2_s.value);
        Some(Point { temperature_k, density_kg_m3, viscosity_m2_s, bulk_modulus_pa })
    }

    /// Notes the numbers that are not in order behind the point before. A misplaced point is reported by its
    /// temperature alone.
    fn check_order(&self, before: &Self, mistakes: &mut Collector) {
        let numbers = |of: &Self| {
            let [density, viscosity] =
                [&of.density_kg_m3, &of.viscosity_m2_s].map(|own| Some(own.clone()));
            [Some(of.temperature_k.clone()), density, viscosity, of.bulk_modulus_pa.clone()]
        };
        for (place, key) in Self::KEYS.iter().enumerate() {
            let (Some(own), Some(before)) = (&numbers(self)[place], &numbers(before)[place]) else {
                continue;
            };
            let (min, max, unit) = key.value.range();
            let range = match place {
                0 => ((before.value + LEAST_STEP_K).min(max), max),
                _ => (min, before.value),
            };
            if !(range.0..=range.1).contains(&own.value) {
                let mistake =
                    Diagnostic::out_of_range(key.name, own.value, range, unit, key.summary);
                mistakes.note(&own.at, mistake);
                if place == 0 {
                    return;
                }
            }
        }
    }
}
