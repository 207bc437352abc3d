//! The courses of inputs between samples.

/// An input at a sample.
#[derive(Debug, Clone, Copy)]
pub struct Knot {
    /// SI.
    pub value: f64,
    /// Only inputs that are cubic use it.
    pub slope_per_s: f64,
}

impl Knot {
    pub const ZERO: Knot = Knot { value: 0.0, slope_per_s: 0.0 };
}

/// The course of an input between samples.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Between {
    /// The value of the preceding sample.
    Hold,
    Line,
    /// With the slopes at the samples.
    Cubic,
}

/// The coefficients of a cubic in time, from the constant one on.
#[derive(Clone, Copy)]
pub struct Course(pub [f64; 4]);

impl Course {
    /// A constant value.
    pub const fn held(value: f64) -> Course {
        Course([value, 0.0, 0.0, 0.0])
    }

    /// The course at a sample whose successor is not known.
    pub fn beginning_at(knot: &Knot, between: Between) -> Course {
        let slope_per_s = if between == Between::Cubic { knot.slope_per_s } else { 0.0 };
        Course([knot.value, slope_per_s, 0.0, 0.0])
    }

    /// The course from one sample to the next.
    pub fn between(between: Between, from: &Knot, to: &Knot, length_s: f64) -> Course {
        let mean = (to.value - from.value) / length_s;
        match between {
            Between::Hold => Course::held(from.value),
            Between::Line => Course([from.value, mean, 0.0, 0.0]),
            Between::Cubic => {
                let bend = 3.0 * mean - 2.0 * from.slope_per_s - to.slope_per_s;
                let last = from.slope_per_s + to.slope_per_s - 2.0 * mean;
                let square = length_s * length_s;
                Course([from.value, from.slope_per_s, bend / length_s, last / square])
            }
        }
    }

    /// The value after a time, s.
    pub fn value(&self, t: f64) -> f64 {
        let [value, slope, bend, last] = self.0;
        value + t * (slope + t * (bend + t * last))
    }

    /// The same course, from a later time on, s.
    pub fn moved(&self, t: f64) -> Course {
        let [_, slope, bend, last] = self.0;
        let last_tripled = t * 3.0 * last;
        let slope = slope + t * (2.0 * bend + last_tripled);
        Course([self.value(t), slope, bend + last_tripled, last])
    }
}
