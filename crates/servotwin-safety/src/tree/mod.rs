//! Fault trees with counted probabilities.
//!
//! - [`structure`]: gates, basic events, and brute force for small trees
//! - [`decision_diagram`]: exact probabilities, minimal cut sets and importance
//! - [`lanes`]: the trees of a study: loss of one lane, loss of all lanes, undetected degradation
//! - [`numbers`]: what every tree's probability is, with its band, and who contributes
//! - [`exchange`]: the Open-PSA Model Exchange Format
//! - [`drawing`]: the trees as figures

pub mod decision_diagram;
pub mod drawing;
pub mod exchange;
pub mod lanes;
pub mod numbers;
pub mod structure;
