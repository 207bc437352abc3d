//! Tests of the model from outside.

mod c_source;
mod rig;
