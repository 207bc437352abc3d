//! Vector arithmetic shared by the classifiers.

/// Upper limit of features and weights, so that squares and their sums stay finite.
pub const MAX_VALUE: f64 = 1e100;

/// Dot product, summed in eight fixed lanes: the compiler may use SIMD, and the result is the
/// same on every machine.
pub fn dot(a: &[f64], b: &[f64]) -> f64 {
    let (a_blocks, a_rest) = a.as_chunks::<8>();
    let (b_blocks, b_rest) = b.as_chunks::<8>();
    let mut lanes = [0.0; 8];
    for (x, y) in a_blocks.iter().zip(b_blocks) {
        for lane in 0..8 {
            lanes[lane] += x[lane] * y[lane];
        }
    }
    let rest: f64 = a_rest.iter().zip(b_rest).map(|(x, y)| x * y).sum();
    ((lanes[0] + lanes[4]) + (lanes[1] + lanes[5]))
        + ((lanes[2] + lanes[6]) + (lanes[3] + lanes[7]))
        + rest
}

/// `target += factor * direction`.
pub fn add_scaled(target: &mut [f64], factor: f64, direction: &[f64]) {
    for (slot, step) in target.iter_mut().zip(direction) {
        *slot += factor * step;
    }
}

/// Index of the largest value; the first one of a tie.
pub fn arg_max(values: impl IntoIterator<Item = f64>) -> usize {
    let mut best = (0, f64::NEG_INFINITY);
    for (place, value) in values.into_iter().enumerate() {
        if value > best.1 {
            best = (place, value);
        }
    }
    best.0
}

/// Turns logarithms into shares that sum to one, and returns the logarithm of the sum before. If all are minus infinity
/// (a row very far from every class), the shares are equal.
pub fn softmax(values: &mut [f64]) -> f64 {
    let largest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    if largest == f64::NEG_INFINITY {
        let share = 1.0 / values.len() as f64;
        values.fill(share);
        return largest;
    }
    let mut sum = 0.0;
    for value in values.iter_mut() {
        *value = libm::exp(*value - largest);
        sum += *value;
    }
    for value in values.iter_mut() {
        *value /= sum;
    }
    largest + libm::log(sum)
}

#[cfg(test)]
mod tests {
    use super::*;
    use alloc::vec::Vec;

    #[test]
    fn dot_of_any_length() {
        for length in 0..20 {
            let a: Vec<f64> = (0..length).map(f64::from).collect();
            let expected: f64 = a.iter().map(|x| x * x).sum();
            assert_eq!(dot(&a, &a), expected);
        }
    }

    #[test]
    fn softmax_of_large_numbers_sums_to_one() {
        let mut values = [1000.0, 1001.0];
        let log_sum = softmax(&mut values);
        assert!((values[0] + values[1] - 1.0).abs() < 1e-15);
        assert!((log_sum - 1_001.313_261_687_518).abs() < 1e-9);
    }

    #[test]
    fn ties_go_to_the_first() {
        assert_eq!(arg_max([1.0, 2.0, 2.0]), 1);
        assert_eq!(arg_max([f64::NAN, 0.0]), 1);
    }
}
