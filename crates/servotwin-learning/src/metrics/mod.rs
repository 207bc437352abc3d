//! Quality of predictions: counts of right and wrong ones, rates and medians with intervals.

mod median;
mod rate;
mod score;
mod tail;

pub use median::MedianTime;
pub use rate::{Rate, Trial, binomial_tail, clopper_pearson_upper, find_share, poisson_mean};
pub use score::{Prediction, Score};
pub use tail::Tail;
