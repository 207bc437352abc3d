//! Growing of decision trees ([`servotwin_diagnosis::tree`]).
//!
//! One tree serves CART, random forest and AdaBoost. The split search tries rows without a value (NaN) on either side
//! of every threshold, and alone.
//!
//! Source: Breiman, Friedman, Olshen, Stone, "Classification and Regression Trees", 1984.

mod binned;
mod building;
mod criterion;
mod grow;
mod histogram;
mod presorted;
mod split;

pub use criterion::Criterion;

pub(crate) use binned::grow_binned;
pub(crate) use building::{Growth, SplitRules};
pub(crate) use grow::grow;
pub(crate) use histogram::Bins;
pub(crate) use presorted::Presorted;
pub(crate) use split::{divide_rows, separate};
