//! placeholder until the signals branch lands
use alloc::vec;
use alloc::vec::Vec;
/// x
#[derive(Clone, Debug)]
pub struct Piecewise {
    /// x
    pub breaks_s: Vec<f64>,
    /// x
    pub pieces: Vec<[f64; 4]>,
}
impl Piecewise {
    /// x
    pub fn constant(value: f64) -> Self {
        Self {
            breaks_s: vec![0.0],
            pieces: vec![[value, 0.0, 0.0, 0.0]],
        }
    }
}
