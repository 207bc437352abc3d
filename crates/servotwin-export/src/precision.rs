//! The precisions of an export, and how a number of training becomes one of them.

use serde::{Deserialize, Serialize};

/// The precision of the numbers of an export.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Precision {
    /// Double precision (IEEE 754 binary64), in which the diagnosis was trained.
    #[default]
    F64,
    /// Single precision (binary32).
    F32,
}

impl Precision {
    /// The type of a number in C.
    pub(crate) fn c_type(self) -> &'static str {
        match self {
            Precision::F64 => "double",
            Precision::F32 => "float",
        }
    }

    /// The nearest number of this precision, or the largest one for a number beyond it. NaN stays.
    pub(crate) fn nearest(self, number: f64) -> f64 {
        match self {
            Precision::F64 => number,
            Precision::F32 => f64::from(nearest_single(number)),
        }
    }

    /// The largest number of this precision that is not above another one. A number x of this precision is at most t exactly
    /// when it is at most the result for t; so a test `x <= t` of a tree decides the same with it.
    pub(crate) fn not_above(self, threshold: f64) -> f64 {
        let nearest = self.nearest(threshold);
        if nearest > threshold { self.next_down(nearest) } else { nearest }
    }

    /// The next smaller number.
    pub(crate) fn next_down(self, number: f64) -> f64 {
        match self {
            Precision::F64 => number.next_down(),
            Precision::F32 => f64::from((number as f32).next_down()),
        }
    }

    /// The next larger number.
    pub(crate) fn next_up(self, number: f64) -> f64 {
        match self {
            Precision::F64 => number.next_up(),
            Precision::F32 => f64::from((number as f32).next_up()),
        }
    }
}

/// The nearest single, without infinities for finite numbers.
fn nearest_single(number: f64) -> f32 {
    let single = number as f32;
    if single.is_infinite() && number.is_finite() { f32::MAX.copysign(single) } else { single }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rounded_threshold_separates_singles_as_the_trained_one_does() {
        let between = 0.5 * (f64::from(1.5_f32) + f64::from(1.5_f32.next_up()));
        let kinds = [0.1, -0.1, 1.5, between, -between, 0.0, 1e-300, -1e-300, 1e-40, 1e39];
        for threshold in kinds {
            let rounded = Precision::F32.not_above(threshold);
            let mut x = (rounded as f32).next_down().next_down();
            for _ in 0..5 {
                let x64 = f64::from(x);
                assert_eq!(x64 <= threshold, x64 <= rounded, "{x:?} and {threshold:?}");
                x = x.next_up();
            }
        }
        assert_eq!(Precision::F64.not_above(between), between);
        assert!(Precision::F32.nearest(between.next_up()) > between);
    }

    #[test]
    fn a_number_beyond_all_singles_becomes_the_largest() {
        assert_eq!(Precision::F32.nearest(-1e300), -f64::from(f32::MAX));
    }
}
