//! Inputs as functions of time, in cubic pieces.
//!
//! With breaks `b_0 < b_1 < …` and coefficients `c` of each piece:
//!
//! (SG1)  s(t) = c_0 + c_1 τ + c_2 τ² + c_3 τ³,  τ = t − b_k,  b_k ≤ t < b_{k+1}
//!
//! The last piece holds forever. Before the first break the first value
//! holds: s(t) = s(b_0), with slope zero. At a break the piece that begins there
//! applies, so s is right-continuous.
//!
//! Hermite pieces between (b_k, v_k, m_k) and (b_{k+1}, v_{k+1}, m_{k+1}), with
//! h = b_{k+1} − b_k and d = (v_{k+1} − v_k)/h:
//!
//! (SG2)  c = [v_k, m_k, (3d − 2 m_k − m_{k+1})/h, (m_k + m_{k+1} − 2d)/h²]
//!
//! Error of a Hermite piece for a function with |f⁗| ≤ M: h⁴ M / 384. All other
//! constructors are exact.
//!
//! A solver need not stop at every break: [`Piecewise::smoothness`] reports whether
//! the value jumps at a break, or only the slope, or neither.

use crate::hash::{Canonical, Fingerprint};
use crate::scalar::Scalar;
use alloc::vec;
use alloc::vec::Vec;
use core::fmt;

/// The coefficients of one piece, constant term first.
pub(crate) type Cubic = [f64; 4];

/// A function of time in cubic pieces.
#[derive(Clone, Debug, PartialEq)]
pub struct Piecewise {
    breaks_s: Vec<f64>,
    pieces: Vec<Cubic>,
}

impl Canonical for Piecewise {
    fn add_to(&self, fingerprint: &mut Fingerprint) {
        fingerprint.add(&self.breaks_s).add(&self.pieces);
    }
}

/// Why pieces do not form a function of time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CurveError {
    /// There is no point or piece.
    Empty,
    /// Times and values differ in number.
    Lengths {
        /// Number of times.
        times: usize,
        /// Number of values, slopes or pieces.
        values: usize,
    },
    /// A time is not finite.
    Time {
        /// Index of the time, from 0.
        index: usize,
        /// The time.
        time_s: f64,
    },
    /// A time is not after the one before it.
    Order {
        /// Index of the time, from 0.
        index: usize,
        /// The time before it.
        before_s: f64,
        /// The time.
        time_s: f64,
    },
    /// A value, a slope or a coefficient is not finite.
    Value {
        /// Index of the point or piece, from 0.
        index: usize,
        /// The number.
        value: f64,
    },
}

impl fmt::Display for CurveError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CurveError::Empty => write!(out, "there is no point in it"),
            CurveError::Lengths { times, values } => {
                write!(out, "{times} times but {values} values")
            }
            CurveError::Time { index, time_s } => {
                write!(out, "time {time_s} of point {index} is not finite")
            }
            CurveError::Order { index, before_s, time_s } => {
                write!(out, "time {time_s} s of point {index} is not after {before_s} s before it")
            }
            CurveError::Value { index, value } => {
                write!(out, "value {value} of point {index} is not finite")
            }
        }
    }
}

impl core::error::Error for CurveError {}

/// Continuity at a break.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Smoothness {
    /// Value and slope are continuous.
    Smooth,
    /// The slope jumps, the value is continuous.
    Kink,
    /// The value jumps.
    Jump,
}

/// (SG1) for a scalar, or for lanes in different pieces.
#[inline(always)]
pub(crate) fn cubic<S: Scalar<Base = S>>(piece: &[S; 4], tau_s: S) -> S {
    piece[0] + tau_s * (piece[1] + tau_s * (piece[2] + tau_s * piece[3]))
}

/// The time derivative of (SG1).
#[inline(always)]
pub(crate) fn cubic_slope<S: Scalar<Base = S>>(piece: &[S; 4], tau_s: S) -> S {
    let (two, three) = (S::constant(2.0), S::constant(3.0));
    piece[1] + tau_s * (two * piece[2] + tau_s * (three * piece[3]))
}

/// (SG2): the cubic over `length_s` seconds with the given values and slopes at its ends.
pub(crate) fn hermite_piece(
    length_s: f64,
    [from, to]: [f64; 2],
    [slope, end_slope]: [f64; 2],
) -> Cubic {
    let mean = (to - from) / length_s;
    let square = (3.0 * mean - 2.0 * slope - end_slope) / length_s;
    [from, slope, square, (slope + end_slope - 2.0 * mean) / (length_s * length_s)]
}

/// Times at which the slope of a cubic is zero; not finite where there are none.
fn turning_points([_, a, b, c]: &Cubic) -> [f64; 2] {
    // Solves c_1 + 2 c_2 τ + 3 c_3 τ² = 0 in a form without cancellation.
    let root = (b * b - 3.0 * a * c).sqrt();
    let sum = -(b + if *b < 0.0 { -root } else { root });
    [sum / (3.0 * c), a / sum]
}

impl Piecewise {
    /// Builds the function from breaks and the coefficients of the pieces that begin there.
    ///
    /// # Errors
    /// The breaks are not strictly increasing, the lengths differ, or a number is not finite.
    pub fn new(breaks_s: Vec<f64>, pieces: Vec<Cubic>) -> Result<Self, CurveError> {
        check_times(&breaks_s, pieces.len())?;
        for (index, piece) in pieces.iter().enumerate() {
            check_values(piece).map_err(|(_, value)| CurveError::Value { index, value })?;
        }
        Ok(Self { breaks_s, pieces })
    }

    /// The same value forever.
    ///
    /// # Errors
    /// The value is not finite.
    pub fn constant(value: f64) -> Result<Self, CurveError> {
        Self::new(vec![0.0], vec![[value, 0.0, 0.0, 0.0]])
    }

    /// Holds each value from its time to the next (zero-order hold).
    ///
    /// # Errors
    /// See [`Piecewise::new`].
    pub fn steps(times_s: &[f64], values: &[f64]) -> Result<Self, CurveError> {
        check_points(times_s, values)?;
        let pieces = values.iter().map(|&value| [value, 0.0, 0.0, 0.0]).collect();
        Self::new(times_s.to_vec(), pieces)
    }

    /// Straight lines between points; the last value holds forever.
    ///
    /// # Errors
    /// See [`Piecewise::new`].
    pub fn linear(times_s: &[f64], values: &[f64]) -> Result<Self, CurveError> {
        check_points(times_s, values)?;
        let pieces = with_last(values, |k| {
            let slope = (values[k + 1] - values[k]) / (times_s[k + 1] - times_s[k]);
            [values[k], slope, 0.0, 0.0]
        });
        Self::new(times_s.to_vec(), pieces)
    }

    /// Cubics through points with given slopes (SG2); the last value holds forever.
    ///
    /// # Errors
    /// See [`Piecewise::new`].
    pub fn hermite(times_s: &[f64], values: &[f64], slopes: &[f64]) -> Result<Self, CurveError> {
        check_points(times_s, values)?;
        check_points(times_s, slopes)?;
        let pieces = with_last(values, |k| {
            let length_s = times_s[k + 1] - times_s[k];
            hermite_piece(length_s, [values[k], values[k + 1]], [slopes[k], slopes[k + 1]])
        });
        Self::new(times_s.to_vec(), pieces)
    }

    /// The times at which the pieces begin.
    pub fn breaks_s(&self) -> &[f64] {
        &self.breaks_s
    }

    /// The coefficients of the pieces.
    pub fn pieces(&self) -> &[Cubic] {
        &self.pieces
    }

    /// Index of the piece that holds at a time; 0 before the first break.
    pub(crate) fn piece(&self, time_s: f64) -> usize {
        self.breaks_s.partition_point(|&b| b <= time_s).saturating_sub(1)
    }

    /// The value at a time.
    pub fn value(&self, time_s: f64) -> f64 {
        let k = self.piece(time_s);
        cubic(&self.pieces[k], (time_s - self.breaks_s[k]).max(0.0))
    }

    /// The time derivative at a time; at a break, that of the piece that begins there.
    #[cfg(test)]
    pub(crate) fn slope(&self, time_s: f64) -> f64 {
        if time_s < self.breaks_s[0] {
            return 0.0;
        }
        let k = self.piece(time_s);
        cubic_slope(&self.pieces[k], time_s - self.breaks_s[k])
    }

    /// Value and slope immediately before a break.
    ///
    /// # Panics
    /// If there is no such break.
    pub(crate) fn before(&self, index: usize) -> (f64, f64) {
        match index.checked_sub(1) {
            None => (self.pieces[0][0], 0.0),
            Some(k) => {
                let tau_s = self.breaks_s[index] - self.breaks_s[k];
                (cubic(&self.pieces[k], tau_s), cubic_slope(&self.pieces[k], tau_s))
            }
        }
    }

    /// The continuity at a break. A difference below 1e-9 of the preceding piece's
    /// magnitude counts as rounding.
    ///
    /// # Panics
    /// If there is no such break.
    pub fn smoothness(&self, index: usize) -> Smoothness {
        const ROUNDING: f64 = 1e-9;
        let (value, slope) = self.before(index);
        let piece = &self.pieces[index];
        let k = index.saturating_sub(1);
        let length_s = if index == 0 { 1.0 } else { self.breaks_s[index] - self.breaks_s[k] };
        let size = self.pieces[k][0].abs().max(value.abs()).max(piece[0].abs());
        if (piece[0] - value).abs() > ROUNDING * size {
            Smoothness::Jump
        } else if (piece[1] - slope).abs() * length_s > ROUNDING * (size + slope.abs() * length_s) {
            Smoothness::Kink
        } else {
            Smoothness::Smooth
        }
    }

    /// The smallest and the largest value between two times.
    pub fn bounds(&self, from_s: f64, to_s: f64) -> (f64, f64) {
        let (mut least, mut largest) = (f64::INFINITY, f64::NEG_INFINITY);
        for k in self.piece(from_s)..=self.piece(to_s) {
            let piece = &self.pieces[k];
            let begin = (from_s - self.breaks_s[k]).max(0.0);
            let end = self.breaks_s.get(k + 1).map_or(to_s, |&b| b.min(to_s)) - self.breaks_s[k];
            let turns = turning_points(piece).into_iter().filter(|t| (begin..=end).contains(t));
            for tau_s in turns.chain([begin, end.max(begin)]) {
                let value = cubic(piece, tau_s);
                least = least.min(value);
                largest = largest.max(value);
            }
        }
        (least, largest)
    }

    /// The sum of two functions, with the breaks of both.
    ///
    /// # Errors
    /// A sum is not finite.
    pub fn plus(&self, other: &Self) -> Result<Self, CurveError> {
        let mut breaks_s = [self.breaks_s.as_slice(), &other.breaks_s].concat();
        breaks_s.sort_by(f64::total_cmp);
        breaks_s.dedup();
        let pieces = breaks_s.iter().map(|&b| {
            let (a, b) = (self.moved_to(b), other.moved_to(b));
            core::array::from_fn(|i| a[i] + b[i])
        });
        Self::new(breaks_s.clone(), pieces.collect())
    }

    /// The piece that holds from `time_s` on, as a cubic in the time since then.
    fn moved_to(&self, time_s: f64) -> Cubic {
        let k = self.piece(time_s);
        let tau_s = time_s - self.breaks_s[k];
        let [_, _, square, cube] = self.pieces[k];
        if tau_s < 0.0 {
            return [self.pieces[k][0], 0.0, 0.0, 0.0];
        }
        let slope = cubic_slope(&self.pieces[k], tau_s);
        [cubic(&self.pieces[k], tau_s), slope, square + 3.0 * cube * tau_s, cube]
    }

    /// The mean of the squared value from `from_s` to `to_s`, exact up to rounding.
    pub fn mean_square(&self, from_s: f64, to_s: f64) -> f64 {
        let mut sum = 0.0;
        let mut begin_s = from_s;
        while begin_s < to_s {
            let next = self.breaks_s.partition_point(|&b| b <= begin_s);
            let end_s = self.breaks_s.get(next).map_or(to_s, |&b| b.min(to_s));
            sum += square_integral(&self.moved_to(begin_s), end_s - begin_s);
            begin_s = end_s;
        }
        sum / (to_s - from_s)
    }
}

/// ∫ s² dτ from 0 to `length_s`.
fn square_integral(piece: &Cubic, length_s: f64) -> f64 {
    // With τ = length · x, x in 0 … 1: ∫ xⁱ xʲ dx = 1/(i + j + 1).
    let [c0, c1, c2, c3] = *piece;
    let scaled = [c0, c1 * length_s, c2 * length_s * length_s, c3 * length_s * length_s * length_s];
    let mut sum = 0.0;
    for (i, a) in scaled.iter().enumerate() {
        for (j, b) in scaled.iter().enumerate() {
            sum += a * b / (i + j + 1) as f64;
        }
    }
    sum * length_s
}

/// One piece per interval, then the last value forever.
fn with_last(values: &[f64], piece: impl Fn(usize) -> Cubic) -> Vec<Cubic> {
    let last = values.len() - 1;
    let hold = [values[last], 0.0, 0.0, 0.0];
    (0..last).map(piece).chain([hold]).collect()
}

fn check_points(times_s: &[f64], values: &[f64]) -> Result<(), CurveError> {
    check_times(times_s, values.len())?;
    check_values(values).map_err(|(index, value)| CurveError::Value { index, value })
}

fn check_times(times_s: &[f64], values: usize) -> Result<(), CurveError> {
    if times_s.is_empty() {
        return Err(CurveError::Empty);
    }
    if times_s.len() != values {
        return Err(CurveError::Lengths { times: times_s.len(), values });
    }
    for (index, &time_s) in times_s.iter().enumerate() {
        if !time_s.is_finite() {
            return Err(CurveError::Time { index, time_s });
        }
        if index > 0 && time_s <= times_s[index - 1] {
            return Err(CurveError::Order { index, before_s: times_s[index - 1], time_s });
        }
    }
    Ok(())
}

fn check_values(values: &[f64]) -> Result<(), (usize, f64)> {
    match values.iter().position(|v| !v.is_finite()) {
        Some(index) => Err((index, values[index])),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_hold_from_break_to_break() {
        let s = Piecewise::steps(&[1.0, 2.0], &[5.0, -3.0]).unwrap();
        assert_eq!([0.0, 1.0, 1.999, 2.0, 1e9].map(|t| s.value(t)), [5.0, 5.0, 5.0, -3.0, -3.0]);
        assert_eq!([0.0, 1.0, 1.999, 2.0, 1e9].map(|t| s.piece(t)), [0, 0, 0, 1, 1]);
        assert_eq!((s.smoothness(0), s.smoothness(1)), (Smoothness::Smooth, Smoothness::Jump));
    }

    #[test]
    fn linear_goes_through_its_points_and_then_holds() {
        let s = Piecewise::linear(&[0.0, 0.5, 2.0], &[1.0, 2.0, -1.0]).unwrap();
        assert_eq!(
            [-1.0, 0.0, 0.25, 0.5, 2.0, 3.0].map(|t| s.value(t)),
            [1., 1., 1.5, 2., -1., -1.]
        );
        assert_eq!([-1.0, 0.0, 0.5, 2.0].map(|t| s.slope(t)), [0.0, 2.0, -2.0, 0.0]);
        assert!((0..3).all(|k| s.smoothness(k) == Smoothness::Kink));
    }

    #[test]
    fn bounds_are_met_and_never_passed() {
        let times = [0.0, 0.4, 1.0, 1.3, 2.0];
        let s =
            Piecewise::hermite(&times, &[0.0, 1.0, -2.0, 0.5, 0.4], &[9.0, -3.0, 1.0, 0.0, 2.0])
                .unwrap();
        for (from, to) in [(0.0, 2.0), (0.1, 0.2), (0.7, 1.9), (-1.0, 0.3), (2.5, 9.0)] {
            let (least, largest) = s.bounds(from, to);
            let values = (0..=20_000).map(|i| s.value(from + (to - from) * f64::from(i) / 2e4));
            let found =
                values.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), v| (a.min(v), b.max(v)));
            assert!((least - found.0).abs() < 1e-6 && least <= found.0 + 1e-12, "{from} {to}");
            assert!((largest - found.1).abs() < 1e-6 && largest >= found.1 - 1e-12, "{from} {to}");
        }
        let steps = Piecewise::steps(&[1.0, 2.0, 3.0], &[5.0, -3.0, 90.0]).unwrap();
        assert_eq!(steps.bounds(0.0, 2.5), (-3.0, 5.0));
    }

    #[test]
    fn hermite_is_exact_for_cubics_and_smooth() {
        let f = |t: f64| 1.0 - 2.0 * t + 3.0 * t * t - 0.5 * t * t * t;
        let slope = |t: f64| -2.0 + 6.0 * t - 1.5 * t * t;
        let times = [0.5, 0.75, 2.0, 2.5];
        let s = Piecewise::hermite(&times, &times.map(f), &times.map(slope)).unwrap();
        for i in 0..=200 {
            let t = 0.5 + 0.01 * f64::from(i);
            assert!((s.value(t) - f(t)).abs() < 1e-13);
            assert!(t >= 2.5 || (s.slope(t) - slope(t)).abs() < 1e-12);
        }
        assert_eq!(s.smoothness(1), Smoothness::Smooth);
        assert_eq!(s.smoothness(2), Smoothness::Smooth);
        assert_eq!(s.smoothness(3), Smoothness::Kink);
    }

    #[test]
    fn a_sum_is_the_sum_of_the_values() {
        let a = Piecewise::hermite(&[0.3, 1.0, 2.0], &[1., 2., 0.], &[0., 3., -1.]).unwrap();
        let b = Piecewise::steps(&[0.0, 1.0, 1.5], &[0.5, 2.0, -2.0]).unwrap();
        let s = a.plus(&b).unwrap();
        assert_eq!(s.breaks_s(), [0.0, 0.3, 1.0, 1.5, 2.0]);
        for i in -50..300 {
            let t = 0.01 * f64::from(i);
            assert!((s.value(t) - a.value(t) - b.value(t)).abs() < 1e-14);
            assert!((s.slope(t) - a.slope(t) - b.slope(t)).abs() < 1e-13);
        }
    }

    #[test]
    fn the_mean_square_is_exact() {
        let ramp = Piecewise::linear(&[0.0, 2.0], &[0.0, 2.0]).unwrap();
        assert!((ramp.mean_square(0.0, 2.0) - 4.0 / 3.0).abs() < 1e-15);
        // ∫ t² from 1 to 2, then 4 for 2 s.
        assert!((ramp.mean_square(1.0, 4.0) - (7.0 / 3.0 + 8.0) / 3.0).abs() < 1e-14);
        assert_eq!(Piecewise::constant(-3.0).unwrap().mean_square(-1.0, 7.0), 9.0);
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        use CurveError as E;
        let nan = f64::NAN;
        assert_eq!(Piecewise::linear(&[], &[]), Err(E::Empty));
        assert_eq!(Piecewise::linear(&[0.0], &[1.0, 2.0]), Err(E::Lengths { times: 1, values: 2 }));
        assert_eq!(
            Piecewise::steps(&[0.0, 1.0, 1.0], &[0.0; 3]),
            Err(E::Order { index: 2, before_s: 1.0, time_s: 1.0 })
        );
        assert!(matches!(
            Piecewise::linear(&[0.0, 1.0], &[0.0, nan]),
            Err(E::Value { index: 1, .. })
        ));
        assert!(matches!(
            Piecewise::hermite(&[0.0, 1.0], &[0.0; 2], &[nan, 0.0]),
            Err(E::Value { index: 0, .. })
        ));
        assert!(matches!(
            Piecewise::steps(&[0.0, f64::INFINITY], &[0.0; 2]),
            Err(E::Time { index: 1, .. })
        ));
        assert!(matches!(
            Piecewise::new(vec![0.0], vec![[0.0, 0.0, nan, 0.0]]),
            Err(E::Value { index: 0, .. })
        ));
        assert!(Piecewise::constant(f64::NEG_INFINITY).is_err());
    }

    #[test]
    fn lanes_equal_scalars_bit_for_bit() {
        use crate::lanes::Portable;
        use crate::scalar::Lanes;
        let pieces = [[1.0, -2.0, 0.3, 0.07], [0.1, 1e-3, -5.0, 11.0]];
        let lanes: [Portable; 4] =
            core::array::from_fn(|i| Portable::from_fn(|lane| pieces[lane % 2][i]));
        let tau_s = Portable::from_fn(|lane| 0.1 * lane as f64);
        let (value, slope) = (cubic(&lanes, tau_s), cubic_slope(&lanes, tau_s));
        for lane in 0..Portable::WIDTH {
            let (piece, tau_s) = (&pieces[lane % 2], 0.1 * lane as f64);
            assert_eq!(value.lane(lane).to_bits(), cubic(piece, tau_s).to_bits());
            assert_eq!(slope.lane(lane).to_bits(), cubic_slope(piece, tau_s).to_bits());
        }
    }
}
