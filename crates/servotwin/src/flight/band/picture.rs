//! Shows a conditional band as a map: the factor of each covariate's bins for each sensor.

use super::BandMerit;
use crate::figure::value_map::ValueMap;
use crate::shown::Shown;
use servotwin_diagnosis::conditional_band::CovariateSource;
use servotwin_io::text::{number, spoken};
use servotwin_model::network::Network;

impl BandMerit {
    /// The factors of the band, one row per bin, one column per sensor; bins are in display units.
    pub fn picture(&self, network: &Network) -> ValueMap {
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for (place, covariate) in self.field.covariates.iter().enumerate() {
            for bin in 0..=covariate.edges.len() {
                let low = bin.checked_sub(1).map_or(covariate.range.0, |k| covariate.edges[k]);
                let high = covariate.edges.get(bin).copied().unwrap_or(covariate.range.1);
                let bin_in_words = in_words(covariate.source, low, high, network);
                rows.push(format!("{}: {bin_in_words}", spoken(&covariate.name)));
                let factor = |factors: &Vec<Vec<f64>>| Some(factors[place][bin]);
                values.push(self.field.factors.iter().map(factor).collect::<Vec<_>>());
            }
        }
        let all = || values.iter().flatten().flatten().copied();
        let range = (all().fold(1.0, f64::min), all().fold(1.0, f64::max));
        ValueMap {
            title: "By how much the band is wider than on the mean".into(),
            rows,
            columns: self.sensors.clone(),
            values,
            range,
            digits: 2,
            meaning: "darker: wider; 1.00 is the mean".into(),
            worst: None,
        }
    }

    /// The smallest and the largest half width of a sensor, as a fraction of its scale.
    pub fn ends(&self, sensor: usize) -> [f64; 2] {
        let middle = self.field.scale * self.field.base[sensor];
        let end = |pick: fn(f64, f64) -> f64| {
            let of = |bins: &Vec<f64>| bins.iter().copied().reduce(pick).unwrap_or(1.0);
            self.field.factors[sensor].iter().fold(middle, |width, bins| width * of(bins))
        };
        [end(f64::min), end(f64::max)]
    }
}

/// A bin as text.
fn in_words(source: CovariateSource, low: f64, high: f64, network: &Network) -> String {
    let of = |input: u32, per: &str| {
        let shown = Shown::of_input(network, input as usize);
        let [low, high] = [low, high].map(|value| number(shown.value(value)));
        let unit = if shown.symbol() == "1" { "" } else { shown.symbol() };
        format!("{low} … {high} {unit}{per}").trim_end().to_owned()
    };
    match source {
        CovariateSource::Size { input } | CovariateSource::Input { input } => of(input, ""),
        CovariateSource::Rate { input } => of(input, "/s"),
        // The direction is −1, 0 or 1, and each bin has one of these values.
        CovariateSource::Way { .. } if high < 0.0 => "back".into(),
        CovariateSource::Way { .. } if low > 0.0 => "forth".into(),
        CovariateSource::Way { .. } if low < 0.0 && high > 0.0 => "at rest".into(),
        CovariateSource::Way { .. } => format!("{} … {}", number(low), number(high)),
    }
}
