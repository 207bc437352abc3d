//! The transcendental functions, once for every lane type.
//!
//! Branch-free and made of correctly rounded primitives only, so that all lane
//! types and the generated C agree to the last bit. They are as exact as the
//! tightest tolerance of the solver needs a thousand times over, not as `libm`:
//! every further digit would cost each chamber and each friction a few operations
//! more. The polynomials interpolate at Chebyshev's points, which is within a
//! little of the best of their degree. The errors below were measured against
//! `libm` (see the tests).
//!
//! | function | method | error |
//! |---|---|---|
//! | [`exp`] | k = round(x/ln 2), polynomial of degree 9 on ±ln 2 / 2 | 4e-14 relative for \|x\| ≤ 1, 1.2e-13 for \|x\| ≤ 700 |
//! | [`ln`] | x = m·2^e, odd polynomial in (m − 1)/(m + 1) to the 11th power | 4e-14 of max(1, result) |
//! | [`tanh`] | 1 − 2/(e^{2\|x\|} + 1), odd by construction | 2e-14 absolute |
//! | [`sin_cos`] | reduction by π/2, polynomials to the 11th/10th power | 2.3e-13 absolute for \|x\| ≤ π |

use crate::scalar::{Primitive, lit};

/// A polynomial, highest coefficient first: four interleaved Horner schemes in
/// x⁴, because one alone is a chain of which every link waits for the last.
#[inline(always)]
fn polynomial<P: Primitive, const N: usize>(x: P, coefficients: &[f64; N]) -> P {
    let square = x * x;
    let fourth = square * square;
    let high = every_fourth(fourth, coefficients, 3) * x + every_fourth(fourth, coefficients, 2);
    let low = every_fourth(fourth, coefficients, 1) * x + every_fourth(fourth, coefficients, 0);
    high * square + low
}

/// Horner's scheme in x⁴ over the coefficients of x^power, x^(power + 4) …
#[inline(always)]
fn every_fourth<P: Primitive, const N: usize>(
    fourth: P,
    coefficients: &[f64; N],
    power: usize,
) -> P {
    let mut i = (N - 1 - power) % 4;
    let mut sum = P::constant(coefficients[i]);
    while i + 4 < N {
        i += 4;
        sum = sum * fourth + P::constant(coefficients[i]);
    }
    sum
}

/// `e^x`, with x limited to ±700.
#[inline(always)]
pub fn exp<P: Primitive>(x: P) -> P {
    const COEFFICIENTS: [f64; 10] = [
        2.7625102005388108e-06,
        2.4876164022625967e-05,
        0.0001984120875699232,
        0.0013888821677630362,
        0.008333333353717156,
        0.041666666890957,
        0.16666666666648303,
        0.49999999999797934,
        1.0,
        1.0,
    ];
    let x = x.clamp(P::constant(-700.0), P::constant(700.0));
    let k = (x * lit::<P>(core::f64::consts::LOG2_E)).round();
    let r = x - k * lit::<P>(core::f64::consts::LN_2);
    polynomial(r, &COEFFICIENTS).scale_by_power_of_two(k)
}

/// Natural logarithm of a positive, normal number.
#[inline(always)]
pub fn ln<P: Primitive>(x: P) -> P {
    const COEFFICIENTS: [f64; 5] = [
        0.19362653714202008,
        0.22191400830308503,
        0.2857175453591449,
        0.3999999879733759,
        0.6666666666737509,
    ];
    let (m, e) = x.split_exponent();
    let one = P::constant(1.0);
    let s = (m - one) / (m + one);
    let z = s * s;
    let tail = s * z * polynomial(z, &COEFFICIENTS);
    ((s + s) + tail) + e * lit::<P>(core::f64::consts::LN_2)
}

/// Hyperbolic tangent.
#[inline(always)]
pub fn tanh<P: Primitive>(x: P) -> P {
    let one = P::constant(1.0);
    let two = P::constant(2.0);
    let magnitude = x.abs();
    let t = one - two / (exp(magnitude + magnitude) + one);
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
    // quadrant −2 … 2: odd ones swap the two, ±2 turns both signs.
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

/// `x^exponent` for positive, normal x.
#[inline(always)]
pub fn power<S: crate::scalar::Scalar>(x: S, exponent: S::Base) -> S {
    (x.ln() * exponent).exp()
}

/// A smooth step: 0 below 0, 1 above 1, `x² (3 − 2x)` between; its slope is
/// continuous.
#[inline(always)]
pub fn smooth_step<S: crate::scalar::Scalar>(x: S) -> S {
    let x = x.clamp(S::constant(0.0), S::constant(1.0));
    x * x * (S::constant(3.0) - x * lit::<S>(2.0))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::components::contract::Random;

    /// The largest of `error(x)` over a range.
    fn worst(low: f64, high: f64, error: impl Fn(f64) -> f64) -> f64 {
        let mut random = Random(42);
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
        assert_near(worst(-700.0, 700.0, relative), 1.2e-13);
        assert_near(worst(-1.0, 1.0, relative), 4e-14);
        assert_eq!(exp(0.0), 1.0);
        assert!(exp(1e9).is_finite() && exp(-1e9) > 0.0);
    }

    #[test]
    fn ln_agrees_with_libm() {
        let error = |x: f64| (ln(x) - libm::log(x)).abs() / libm::log(x).abs().max(1.0);
        let over_decades = worst(-300.0, 300.0, |decade| error(libm::exp10(decade)));
        assert_near(over_decades.max(worst(0.1, 10.0, error)), 4e-14);
        assert_eq!(ln(1.0), 0.0);
    }

    #[test]
    fn tanh_agrees_with_libm() {
        let error = |x: f64| (tanh(x) - libm::tanh(x)).abs();
        assert_near(worst(-3.0, 3.0, error).max(worst(-50.0, 50.0, error)), 2e-14);
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
        assert_near(worst(2e3, 4e7, error), 5e-14);
    }

    #[test]
    fn the_step_is_flat_at_both_ends() {
        let table = [(-1.0, 0.0), (0.0, 0.0), (0.25, 0.15625), (0.5, 0.5), (1.0, 1.0), (9.0, 1.0)];
        for (x, y) in table {
            assert_eq!(smooth_step(x), y);
        }
    }
}
