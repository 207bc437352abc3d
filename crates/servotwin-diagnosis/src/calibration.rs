//! Temperature scaling of probabilities.
//!
//! `p → p^(1/T) / Σ p^(1/T)`, with the power as e^(ln p / T). The order of the classes stays, so no answer changes. A
//! temperature above 1 lowers the confidence, one below 1 raises it. `servotwin-learning` fits the temperature.
//!
//! Source: Guo, Pleiss, Sun, Weinberger, "On Calibration of Modern Neural Networks", ICML 2017.

/// Lower limit of a probability before its logarithm is taken: no class is impossible.
pub const MIN_PROBABILITY: f64 = 1e-15;

/// Scales the probabilities of one row by a temperature above 0. Does not allocate.
pub fn scale(shares: &mut [f64], temperature: f64) {
    let inverse = 1.0 / temperature;
    // Relative to the largest, so that they do not all underflow.
    let largest = shares.iter().copied().fold(MIN_PROBABILITY, f64::max);
    let mut sum = 0.0;
    for share in shares.iter_mut() {
        *share = libm::exp(libm::log(share.max(MIN_PROBABILITY) / largest) * inverse);
        sum += *share;
    }
    shares.iter_mut().for_each(|share| *share /= sum);
}
