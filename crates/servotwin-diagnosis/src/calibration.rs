//! temp
use alloc::vec::Vec;
/// T
pub fn temperature(scores: &[f64], classes: usize, labels: &[u32]) -> f64 {
    let loss = |t: f64| -> f64 {
        let rows = scores.chunks_exact(classes).zip(labels);
        rows.map(|(row, &label)| {
            let powers: Vec<f64> = row.iter().map(|s| libm::pow(s.max(1e-12), 1.0 / t)).collect();
            -libm::log(powers[label as usize] / powers.iter().sum::<f64>())
        })
        .sum()
    };
    let (mut best, mut at) = (f64::INFINITY, 1.0);
    for k in 0..40 {
        let t = 0.3 * libm::pow(1.08, k as f64);
        let l = loss(t);
        if l < best {
            best = l;
            at = t;
        }
    }
    at
}
