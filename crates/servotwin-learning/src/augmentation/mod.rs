//! Augmentation of windows: other noise, or a weaker or stronger fault.

mod disturbed;
mod scaled;

pub use disturbed::disturbed;
pub use scaled::scaled;

use alloc::vec;
use alloc::vec::Vec;
use core::ops::Range;

use crate::numeric::cholesky;
use servotwin_diagnosis::residual::Window;

/// The lower factor of the covariances of some channels, row by row. A channel that depends on others has a zero on the
/// diagonal.
fn factor_of(window: &Window, channels: Range<usize>) -> Vec<f64> {
    const NEGLIGIBLE: f64 = 1e-12;
    let (first, size) = (channels.start, channels.len());
    let mut factor = vec![0.0; size * size];
    for i in 0..size {
        for j in 0..=i {
            factor[i * size + j] = window.covariance_of(first + i, first + j);
        }
    }
    let in_order = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(x, y)| x * y).sum();
    cholesky(&mut factor, size, |variance| NEGLIGIBLE * variance, in_order);
    factor
}
