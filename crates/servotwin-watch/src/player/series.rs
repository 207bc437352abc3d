//! A signal as minimum and maximum of equal parts of time, encoded as text for a script.

use serde_json::Value;
use servotwin_io::text::base64;

/// Minimum and maximum of each bucket; NaN if empty.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Series {
    buckets: Vec<(f32, f32)>,
}

impl Series {
    /// Adds a value to the last bucket, or begins a new one.
    pub(crate) fn push(&mut self, value: f64, begins: bool) {
        let value = if value.is_finite() { value as f32 } else { f32::NAN };
        match self.buckets.last_mut() {
            Some(last) if !begins => *last = merged(*last, (value, value)),
            _ => self.buckets.push((value, value)),
        }
    }

    /// Merges every two buckets into one.
    pub(crate) fn halve(&mut self) {
        let pairs = self.buckets.chunks(2);
        self.buckets = pairs.map(|pair| merged(pair[0], pair[pair.len() - 1])).collect();
    }

    /// Adds the values to a JSON object as 16-bit numbers scaled between `low` and `high`, in base 64. Each bucket has
    /// its minimum, then its maximum; -32768 means none. A constant signal has no data.
    pub(crate) fn add_to(&self, object: &mut Value) {
        let finite = self.buckets.iter().filter(|(low, _)| !low.is_nan());
        let none = (f32::INFINITY, f32::NEG_INFINITY);
        let (low, high) = finite.fold(none, |range, bucket| merged(range, *bucket));
        if low > high {
            object["low"] = Value::Null;
            return;
        }
        let (low, high) = (f64::from(low), f64::from(high));
        let gaps = self.buckets.iter().any(|(low, _)| low.is_nan());
        (object["low"], object["high"]) = (low.into(), high.into());
        if low == high && !gaps {
            return;
        }
        let span = if high > low { high - low } else { 1.0 };
        let short = |value: f32| match value.is_nan() {
            true => i16::MIN,
            false => ((f64::from(value) - low) / span * 65_534.0 - 32_767.0).round() as i16,
        };
        let pairs = self.buckets.iter().flat_map(|&(low, high)| [short(low), short(high)]);
        let bytes: Vec<u8> = pairs.flat_map(i16::to_le_bytes).collect();
        (object["high"], object["data"]) = ((low + span).into(), base64(&bytes).into());
    }
}

/// Minimum and maximum of two buckets; an empty one adds nothing.
fn merged(one: (f32, f32), other: (f32, f32)) -> (f32, f32) {
    // `min` and `max` of a number and NaN return the number.
    (one.0.min(other.0), one.1.max(other.1))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_peak_is_lost() {
        let mut series = Series::default();
        for k in 0..64 {
            series.push(if k == 37 { 100.0 } else { f64::from(k % 3) }, true);
        }
        series.push(f64::NAN, true);
        for _ in 0..3 {
            series.halve();
        }
        assert_eq!(series.buckets.len(), 9);
        assert_eq!(series.buckets[4], (0.0, 100.0));
        assert!(series.buckets[8].0.is_nan());
        series.push(-5.0, false);
        assert_eq!(series.buckets[8], (-5.0, -5.0));
    }

    #[test]
    fn a_constant_needs_no_data_and_a_gap_does() {
        let mut series = Series::default();
        series.push(2.0, true);
        series.push(2.0, true);
        let json = |series: &Series| {
            let mut object = serde_json::json!({});
            series.add_to(&mut object);
            object
        };
        assert_eq!((&json(&series)["data"], &json(&series)["low"]), (&Value::Null, &2.0.into()));
        series.push(f64::NAN, true);
        // -32767 twice, -32767 twice, -32768 twice.
        assert_eq!(json(&series)["data"], "AYABgAGAAYAAgACA");
        assert_eq!(json(&Series::default())["low"], Value::Null);
    }
}
