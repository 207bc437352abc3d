//! Decimation: fewer points that draw the same line.
//!
//! The range of `x` is divided into buckets about one pixel wide. Each bucket keeps its first and last sample and those
//! with the smallest and largest `y`, so no peak is lost.

/// The indices of the samples to draw, in order; all of them if there are few.
///
/// If `x` decreases anywhere, every sample is kept. The first non-finite sample of a gap is kept, so that the line
/// breaks there.
pub fn decimate(x: &[f64], y: &[f64], buckets: usize) -> Vec<usize> {
    let count = x.len().min(y.len());
    let (x, y) = (&x[..count], &y[..count]);
    let sorted = x.windows(2).all(|pair| pair[0] <= pair[1]);
    if count <= 4 * buckets.max(1) || !sorted {
        return (0..count).collect();
    }
    let (low, width) = (x[0], x[count - 1] - x[0]);
    let bucket_of = |index: usize| ((x[index] - low) / width * buckets as f64) as usize;
    let mut kept = Vec::with_capacity(4 * buckets);
    let mut start = 0;
    while start < count {
        let finite = y[start].is_finite();
        let bucket = bucket_of(start);
        let same = |index: &usize| bucket_of(*index) == bucket && y[*index].is_finite() == finite;
        let end = (start..count).take_while(same).last().unwrap_or(start) + 1;
        keep_extremes(y, start..end, finite, &mut kept);
        start = end;
    }
    kept
}

fn keep_extremes(y: &[f64], range: std::ops::Range<usize>, finite: bool, kept: &mut Vec<usize>) {
    let mut chosen = vec![range.start];
    if finite {
        let by_value = |one: &usize, other: &usize| y[*one].total_cmp(&y[*other]);
        chosen.extend(range.clone().min_by(by_value));
        chosen.extend(range.clone().max_by(by_value));
        chosen.push(range.end - 1);
    }
    chosen.sort_unstable();
    chosen.dedup();
    kept.extend(chosen);
}
