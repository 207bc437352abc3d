//! One of several displacements, or their vote, for a controller.
//!
//! ```text
//! y = x_1 + s (v − x_1)                                                   (SE1)
//! v = x_2                                            of two                (SE2)
//! v = max(min(x_1, x_2), min(max(x_1, x_2), x_3))    of three              (SE3)
//! v = (l + h)/2                                      of four               (SE4)
//!     l = max(min(x_1, x_2), min(x_3, x_4))
//!     h = min(max(x_1, x_2), max(x_3, x_4))
//! ```
//!
//! s is 0 for the first and 1 for the vote `v`. With it, a position loop that no longer trusts its own sensor
//! reads another one. The vote of two displacements is the second one. The vote of three is the median, as in
//! the mid-value voter of a triplex channel. The vote of four is the mean of the two in the middle. Three or
//! four outvote a single wrong one, whatever its error, even if it is the first.
//!
//! Source: an ideal element, by definition.

use crate::component::{Component, SteadyGain};
use crate::equation::Equation;
use crate::scalar::{Scalar, lit};
use crate::spec::{Unit, declare::*};
use crate::wiring::{Output, Variable, Wiring};
use alloc::vec;
use alloc::vec::Vec;

parameters! {
    select: parameter(0.0, (0.0, 1.0), "selection s: 0 for the first, 1 for the vote"),
}

/// A selector; see the module documentation.
pub(crate) static SELECTOR: Component = Component {
    kind: "selector",
    summary: "one of two to four displacements, or their vote, for a controller",
    parameters: &PARAMETERS,
    ports: &[
        input("first", Unit::Metre, "x_1"),
        input("second", Unit::Metre, "x_2"),
        optional(input("third", Unit::Metre, "x_3; if open, the vote is of two")),
        optional(input("fourth", Unit::Metre, "x_4; if open, the vote is of three")),
        input_or("select", Unit::None, "select", "0 for the first, 1 for the vote"),
        output("output", Unit::Metre, "selected displacement y"),
    ],
    connect,
    steady_gains,
    ..Component::PLAIN
};

fn connect(wiring: &mut Wiring) {
    let [first, second, select] = ["first", "second", "select"].map(|p| wiring.signal(p));
    let vote = vote(wiring, first, second);
    let inputs = [first, vote, select];
    wiring.output("output", Selection, inputs);
}

/// Those of the first displacement; a vote is not linear.
fn steady_gains(_parameters: &[f64]) -> Vec<SteadyGain> {
    vec![SteadyGain { from: "first", to: "output", gain: 1.0 }]
}

/// Wires the vote v of the connected displacements. Either optional port may be left open.
fn vote(wiring: &mut Wiring, first: Variable, second: Variable) -> Variable {
    let others =
        ["third", "fourth"].map(|port| wiring.connected(port).then(|| wiring.signal(port)));
    let vote = match others {
        [None, None] => return second,
        _ => wiring.internal(),
    };
    let output = [Output::add(vote)];
    match others {
        [Some(third), Some(fourth)] => {
            wiring.equation(MiddleOfFour, [first, second, third, fourth], output);
        }
        [third, fourth] => {
            let third = third.or(fourth).expect("one is connected");
            wiring.equation(MiddleOfThree, [first, second, third], output);
        }
    }
    vote.variable()
}

/// Equation (SE1): (first, vote, select) → output.
pub(crate) struct Selection;

impl Equation<3, 1, 0> for Selection {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [first, vote, select]: [S; 3]) -> [S; 1] {
        [first + select * (vote - first)]
    }
}

/// Equation (SE3): three displacements → their median.
pub(crate) struct MiddleOfThree;

impl Equation<3, 1, 0> for MiddleOfThree {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [a, b, c]: [S; 3]) -> [S; 1] {
        [a.min(b).max(a.max(b).min(c))]
    }
}

/// Equation (SE4): four displacements → the mean of the two in the middle.
pub(crate) struct MiddleOfFour;

impl Equation<4, 1, 0> for MiddleOfFour {
    #[inline(always)]
    fn evaluate<S: Scalar>(_: &[S::Base; 0], [a, b, c, d]: [S; 4]) -> [S; 1] {
        let low = a.min(b).max(c.min(d));
        let high = a.max(b).min(c.max(d));
        [(low + high) * lit::<S>(0.5)]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_mid_value_outvotes_one_that_is_wrong_whichever_it_is() {
        for wrong in [-1e3, 1e3] {
            for place in 0..3 {
                let mut values = [1.0, 2.0, 2.0];
                values[place] = wrong;
                let [middle] = MiddleOfThree::evaluate(&[], values);
                assert!((1.0..=2.0).contains(&middle), "{values:?}: {middle}");
            }
            for place in 0..4 {
                let mut values = [1.0, 2.0, 2.0, 1.0];
                values[place] = wrong;
                let [middle] = MiddleOfFour::evaluate(&[], values);
                assert!((1.0..=2.0).contains(&middle), "{values:?}: {middle}");
            }
        }
    }

    #[test]
    fn the_order_does_not_matter() {
        let orders = [[3.0, 1.0, 2.0], [1.0, 2.0, 3.0], [2.0, 3.0, 1.0], [3.0, 2.0, 1.0]];
        for order in orders {
            assert_eq!(MiddleOfThree::evaluate(&[], order), [2.0]);
            let [a, b, c] = order;
            assert_eq!(MiddleOfFour::evaluate(&[], [a, 10.0, b, c]), [2.5]);
            assert_eq!(MiddleOfFour::evaluate(&[], [b, a, c, -10.0]), [1.5]);
        }
    }
}
