//! Quality of predictions: counts of right and wrong ones, rates and medians with intervals.

mod confusion;
mod median;
mod rate;
mod score;
mod tail;

pub use confusion::Confusion;
pub use median::MedianTime;
pub use rate::{
    Rate, Trial, binomial_tail, clopper_pearson_upper, cluster_bootstrap, find_share, poisson_mean,
    wilson_interval,
};
pub use score::{Prediction, Score};
pub use tail::{LEAST_EXCESSES, Tail};
