//! The transcendental functions, written once for all lane types.
//!
//! They are branch-free and use only correctly rounded primitives, so that all lane
//! types and the generated C agree to the last bit. They are about a hundred times more
//! accurate than the solver's tightest tolerance needs, and less accurate than `libm`.
//! Every further digit would cost each chamber and each friction a few more operations,
//! and these functions take two fifths of an evaluation. The polynomials interpolate at
//! Chebyshev points, which is nearly the best fit of their degree. The errors below
//! were measured against `libm` (see the tests).
//!
//! | function | method | error |
//! |---|---|---|
//! | `exp2` | k = round(x), polynomial of degree 8 on ±½ | 2.2e-12 relative |
//! | [`exp`] | 2^(x/ln 2) | 2.3e-12 relative for \|x\| ≤ 693 |
//! | `log2` | x = m·2^e, odd polynomial in (m − 1)/(m + 1) to the 9th power | 2.2e-12 absolute |
//! | [`ln`] | ln 2 · log₂ x | 1.6e-12 absolute |
//! | [`tanh`] | 1 − 2/(e^{2\|x\|} + 1), odd by construction | 1.2e-12 absolute |
//! | [`sin_cos`] | reduction by π/2, polynomials to the 11th/10th power | 2.3e-13 absolute for \|x\| ≤ π |

use crate::scalar::{Primitive, lit};

/// A polynomial, highest coefficient first. Two Horner schemes in x² run in parallel,
/// because a single scheme is one long chain of dependent operations.
#[inline(always)]
fn polynomial<P: Primitive, const N: usize>(x: P, coefficients: &[f64; N]) -> P {
    let square = x * x;
    every_second(square, coefficients, 1) * x + every_second(square, coefficients, 0)
}

/// Horner's scheme in x² over the coefficients of x^power, x^(power + 2) …
#[inline(always)]
fn every_second<P: Primitive, const N: usize>(
    square: P,
    coefficients: &[f64; N],
    power: usize,
) -> P {
    let mut i = (N - 1 - power) % 2;
    let mut sum = P::constant(coefficients[i]);
    while i + 2 < N {
        i += 2;
        sum = sum * square + P::constant(coefficients[i]);
    }
    sum
}

/// Powers of two up to this exponent, of either sign, are normal numbers.
const LARGEST_EXPONENT: f64 = 1000.0;

/// `2^x` for |x| ≤ 1000.
#[inline(always)]
pub(crate) fn exp2<P: Primitive>(x: P) -> P {
    const COEFFICIENTS: [f64; 9] = [
        1.325080551750225e-6,
        1.5303700711365693e-5,
        0.00015403475186530786,
        0.0013333478473685416,
        0.00961812913523614,
        0.055504109063258665,
        0.24022650695888503,
        0.6931471805568324,
        1.0,
    ];
    let k = x.round();
    polynomial(x - k, &COEFFICIENTS).scale_by_power_of_two(k)
}

/// Binary logarithm of a positive, normal number.
#[inline(always)]
pub(crate) fn log2<P: Primitive>(x: P) -> P {
    const COEFFICIENTS: [f64; 5] = [
        0.3407120415619086,
        0.41167376623771057,
        0.5770835660048659,
        0.9617966734515485,
        2.885390081789987,
    ];
    let (m, e) = x.split_exponent();
    let one = P::constant(1.0);
    let s = (m - one) / (m + one);
    s * polynomial(s * s, &COEFFICIENTS) + e
}

/// `e^x`, with x limited to ±693.
#[inline(always)]
pub fn exp<P: Primitive>(x: P) -> P {
    let most = P::constant(LARGEST_EXPONENT);
    exp2((x * lit::<P>(core::f64::consts::LOG2_E)).clamp(-most, most))
}

/// Natural logarithm of a positive, normal number.
#[inline(always)]
pub fn ln<P: Primitive>(x: P) -> P {
    log2(x) * lit::<P>(core::f64::consts::LN_2)
}

/// Hyperbolic tangent.
#[inline(always)]
pub fn tanh<P: Primitive>(x: P) -> P {
    let one = P::constant(1.0);
    let doubled = x.abs() * lit::<P>(2.0 * core::f64::consts::LOG2_E);
    let power = exp2(doubled.min(P::constant(LARGEST_EXPONENT)));
    let t = one - P::constant(2.0) / (power + one);
    P::select(x.less(P::constant(0.0)), -t, t)
}

/// Sine and cosine of an angle within ±π.
#[inline(always)]
pub fn sin_cos<P: Primitive>(x: P) -> (P, P) {
    const SINE: [f64; 5] = [
        -2.4805636241834762e-08,
        2.755599092956532e-06,
        -0.00019841266916985966,
        0.008333333331079223,
        -0.16666666666663885,
    ];
    const COSINE: [f64; 5] = [
        -2.7237140418016e-07,
        2.4799862190148396e-05,
        -0.00138888850913992,
        0.04166666663739607,
        -0.4999999999996389,
    ];
    let zero = P::constant(0.0);
    let one = P::constant(1.0);
    let quadrant = (x * lit::<P>(core::f64::consts::FRAC_2_PI)).round();
    let r = x - quadrant * lit::<P>(core::f64::consts::FRAC_PI_2);
    let z = r * r;
    let sine = r + r * z * polynomial(z, &SINE);
    let cosine = one + z * polynomial(z, &COSINE);
    // Quadrants run from −2 to 2: odd ones swap sine and cosine, ±2 flips both signs.
    let magnitude = quadrant.abs();
    let odd = (magnitude - one).abs().less(P::constant(0.5));
    let half_turn = P::constant(1.5).less(magnitude);
    let negative = quadrant.less(zero);
    let swapped_sine = P::select(negative, -cosine, cosine);
    let swapped_cosine = P::select(negative, sine, -sine);
    (
        P::select(odd, swapped_sine, P::select(half_turn, -sine, sine)),
        P::select(odd, swapped_cosine, P::select(half_turn, -cosine, cosine)),
    )
}

/// `x^exponent` for positive, normal x, where the result is normal too.
#[inline(always)]
pub(crate) fn power<S: crate::scalar::Scalar>(x: S, exponent: S::Base) -> S {
    (x.log2() * exponent).exp2()
}

/// A smooth step: 0 below 0, 1 above 1, `x² (3 − 2x)` between; its slope is
/// continuous.
#[inline(always)]
pub(crate) fn smooth_step<S: crate::scalar::Scalar>(x: S) -> S {
    let x = x.clamp(S::constant(0.0), S::constant(1.0));
    x * x * (S::constant(3.0) - x * lit::<S>(2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::components::contract::UniformNumbers;

    /// The largest `error(x)` at random points of a range.
    fn worst(low: f64, high: f64, error: impl Fn(f64) -> f64) -> f64 {
        let mut random = UniformNumbers(42);
        let samples = (0..200_000).map(|_| low + (high - low) * random.next());
        samples.map(error).fold(0.0, f64::max)
    }

    fn assert_near(measured: f64, stated: f64) {
        assert!(measured <= stated, "error {measured:e} over {stated:e}");
        assert!(measured > 0.2 * stated, "error {measured:e} of {stated:e}: state it sharper");
    }

    #[test]
    fn exp_agrees_with_libm() {
        let relative = |x: f64| (exp(x) / libm::exp(x) - 1.0).abs();
        assert_near(worst(-693.0, 693.0, relative), 2.3e-12);
        assert_near(worst(-1.0, 1.0, relative), 2.3e-12);
        let of_two = |x: f64| (exp2(x) / libm::exp2(x) - 1.0).abs();
        assert_near(worst(-1000.0, 1000.0, of_two), 2.2e-12);
        assert_eq!((exp(0.0), exp2(0.0)), (1.0, 1.0));
        assert!(exp(1e9).is_finite() && exp(-1e9) > 0.0);
    }

    #[test]
    fn ln_agrees_with_libm() {
        let error = |x: f64| (ln(x) - libm::log(x)).abs();
        let over_decades = worst(-300.0, 300.0, |decade| error(libm::exp10(decade)));
        assert_near(over_decades.max(worst(0.1, 10.0, error)), 1.6e-12);
        let of_two = |x: f64| (log2(x) - libm::log2(x)).abs();
        assert_near(worst(0.1, 10.0, of_two), 2.2e-12);
        assert_eq!((ln(1.0), log2(8.0)), (0.0, 3.0));
    }

    #[test]
    fn tanh_agrees_with_libm() {
        let error = |x: f64| (tanh(x) - libm::tanh(x)).abs();
        assert_near(worst(-3.0, 3.0, error).max(worst(-50.0, 50.0, error)), 1.2e-12);
        assert_eq!(tanh(0.0), 0.0);
        assert_eq!(tanh(1e3), 1.0);
        assert_eq!(tanh(-0.7), -tanh(0.7));
    }

    #[test]
    fn sine_and_cosine_agree_with_libm() {
        let error = |x: f64| {
            let (sine, cosine) = sin_cos(x);
            (sine - libm::sin(x)).abs().max((cosine - libm::cos(x)).abs())
        };
        let pi = core::f64::consts::PI;
        assert_near(worst(-pi, pi, error), 2.3e-13);
        assert_eq!(sin_cos(0.0), (0.0, 1.0));
        for x in [-pi, -0.5 * pi, 0.5 * pi, pi] {
            assert!(error(x) < 2.3e-13, "{x}");
        }
    }

    #[test]
    fn powers_agree_with_libm() {
        let error = |x: f64| (power(x, -1.0 / 1.4) / libm::pow(x, -1.0 / 1.4) - 1.0).abs();
        assert_near(worst(2e3, 4e7, error), 3.5e-12);
    }

    #[test]
    fn the_step_is_flat_at_both_ends() {
        let table = [(-1.0, 0.0), (0.0, 0.0), (0.25, 0.15625), (0.5, 0.5), (1.0, 1.0), (9.0, 1.0)];
        for (x, y) in table {
            assert_eq!(smooth_step(x), y);
        }
    }
}
