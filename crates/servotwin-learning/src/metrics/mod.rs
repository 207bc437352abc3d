//! Quality of predictions: counts of right and wrong ones, and rates with intervals.

mod confusion;
mod rate;
mod score;

pub use confusion::Confusion;
pub use rate::{
    Rate, Trial, at_least, cluster_bootstrap, largest_share, share_at, wilson_interval,
};
pub use score::{Prediction, Score};
