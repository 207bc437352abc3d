//! A field as a picture: by how much each bin of each covariate widens the band of each sensor.

use super::BandMerit;
use crate::figure::value_map::ValueMap;
use crate::report::words::number;

impl BandMerit {
    /// The factors of the field, a row for each bin, a column for each sensor.
    pub fn picture(&self) -> ValueMap {
        let (mut rows, mut values) = (Vec::new(), Vec::new());
        for (place, covariate) in self.field.covariates.iter().enumerate() {
            for bin in 0..=covariate.edges.len() {
                let low = bin.checked_sub(1).map_or(covariate.range.0, |k| covariate.edges[k]);
                let high = covariate.edges.get(bin).copied().unwrap_or(covariate.range.1);
                rows.push(format!("{}: {} … {}", covariate.name, number(low), number(high)));
                let factor = |factors: &Vec<Vec<f64>>| Some(factors[place][bin]);
                values.push(self.field.factors.iter().map(factor).collect::<Vec<_>>());
            }
        }
        let all = values.iter().flatten().flatten().copied();
        let range = (0.0, all.fold(1.0, f64::max));
        ValueMap {
            title: "By how much the band is wider than on the mean".into(),
            rows,
            columns: self.sensors.clone(),
            values,
            range,
            digits: 2,
            meaning: "darker: wider".into(),
            worst: None,
        }
    }

    /// The least and the largest half width of a sensor, in parts of scale.
    pub fn ends(&self, sensor: usize) -> [f64; 2] {
        let middle = self.field.scale * self.field.base[sensor];
        let end = |pick: fn(f64, f64) -> f64| {
            let of = |bins: &Vec<f64>| bins.iter().copied().reduce(pick).unwrap_or(1.0);
            self.field.factors[sensor].iter().fold(middle, |width, bins| width * of(bins))
        };
        [end(f64::min), end(f64::max)]
    }
}
