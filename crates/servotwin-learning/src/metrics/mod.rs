//! Quality of predictions: counts of right and wrong ones, and rates with intervals.

mod confusion;
mod rate;
mod score;
mod tail;

pub use confusion::Confusion;
pub use rate::{
    Rate, Trial, binomial_tail, clopper_pearson_upper, cluster_bootstrap, find_share,
    poisson_at_most, wilson_interval,
};
pub use score::{Prediction, Score};
pub use tail::{LEAST_EXCESSES, Tail};
