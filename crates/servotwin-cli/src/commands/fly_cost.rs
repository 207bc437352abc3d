//! Writes what a flight cost with the diagnosis beside what it cost without, and weighs them.

use serde_json::{Value, json};
use servotwin::flight::cost::{Cost, Fluid};
use servotwin_report::words::{number, spoken};
use std::fmt::Write;

/// The cost of one flight with and without the diagnosis.
pub(crate) struct FlightCosts {
    pub with: Cost,
    pub without: Cost,
}

impl FlightCosts {
    /// One line for each quantity and a sentence that weighs them; nothing for a system without reservoirs.
    pub(crate) fn text(&self) -> String {
        let mut out = String::new();
        if self.with.fluids.is_empty() {
            return out;
        }
        for (with, without) in self.leaking() {
            let name = spoken(&with.reservoir);
            let lost = |fluid: &Fluid| number(1e3 * fluid.lost_m3);
            let _ =
                line(&mut out, &format!("fluid lost from {name} / L"), lost(without), lost(with));
            let _ = line(&mut out, &format!("{name} is empty"), emptied(without), emptied(with));
        }
        let (with, without) = (&self.with, &self.without);
        let seconds = |cost: &Cost| number(cost.in_fault_s);
        let _ = line(&mut out, "time in fault / s", seconds(without), seconds(with));
        let percent = |cost: &Cost| number(100.0 * cost.authority);
        let _ = line(&mut out, "authority at the end / %", percent(without), percent(with));
        out + &self.weighed()
    }

    fn fluids(&self) -> impl Iterator<Item = (&Fluid, &Fluid)> {
        self.with.fluids.iter().zip(&self.without.fluids)
    }

    /// Reservoirs that lose fluid in either flight.
    fn leaking(&self) -> impl Iterator<Item = (&Fluid, &Fluid)> {
        self.fluids().filter(|(with, without)| with.empty_s.or(without.empty_s).is_some())
    }

    /// A sentence that weighs the authority given up against the fluid kept.
    fn weighed(&self) -> String {
        let price = match self.without.authority - self.with.authority {
            share if share > 0.0 => format!("costs {} % of the authority", number(100.0 * share)),
            _ => "costs no authority".into(),
        };
        let Some((with, without)) = self.leaking().next() else {
            return format!(
                "Weighed: no reservoir would be empty within a day. The diagnosis {price}.\n"
            );
        };
        let gain = match with.empty_s {
            None => "stops the loss".into(),
            Some(_) => format!("does not stop the loss: {}", emptied(with)),
        };
        let name = spoken(&without.reservoir);
        format!(
            "Weighed: without the diagnosis, {name} is empty {}, and everything that it feeds stops. The diagnosis \
             {price} and {gain}.\n",
            emptied(without)
        )
    }

    /// The numbers as JSON.
    pub(crate) fn json(&self) -> Value {
        let one = |cost: &Cost| {
            let fluids = cost.fluids.iter().map(|fluid| {
                json!({
                    "reservoir": fluid.reservoir,
                    "lost_m3": fluid.lost_m3,
                    "loss_m3_s": fluid.loss_m3_s,
                    "empty_s": fluid.empty_s,
                })
            });
            json!({
                "fluids": fluids.collect::<Vec<_>>(),
                "in_fault_s": cost.in_fault_s,
                "authority": cost.authority,
            })
        };
        json!({ "with_diagnosis": one(&self.with), "without": one(&self.without) })
    }
}

fn line(out: &mut String, name: &str, without: String, with: String) -> std::fmt::Result {
    writeln!(out, "{name}: {without} without the diagnosis, {with} with it")
}

/// When a reservoir is empty, counted from the onset.
fn emptied(fluid: &Fluid) -> String {
    match fluid.empty_s {
        None => "not within a day".into(),
        Some(time_s) if time_s < 120.0 => format!("{time_s:.0} s after the onset"),
        Some(time_s) if time_s < 7200.0 => format!("{:.0} min after the onset", time_s / 60.0),
        Some(time_s) => format!("{:.1} h after the onset", time_s / 3600.0),
    }
}
