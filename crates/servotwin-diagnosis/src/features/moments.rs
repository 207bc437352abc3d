//! The paper's features: mean (5), variance (6) and indicator (7) of each scaled residual.

use super::{Sensors, Sink, Teaches};
use crate::residual::Statistics;

pub(super) fn list<W: Statistics, S: Sink<W::Number>>(sensors: &Sensors, window: &W, out: &mut S) {
    for (i, s) in sensors.0.iter().enumerate() {
        out.put(window.mean(i), || s.feature("mean", "of scale", "mean of the residual of {}"));
        out.put(window.covariance(i, i), || {
            let feature = s.feature("var", "of scale²", "variance of the residual of {}");
            feature.teaching(Teaches::Nobody)
        });
        out.put(window.indicator(i), || {
            let meaning = "1 if {} stays within ±3 % with a deviation below 1 %";
            s.feature("no_dev", "0 or 1", meaning).teaching(Teaches::Nobody)
        });
    }
}
