//! Semantic colors: one color has the same meaning in all figures of a report.
//!
//! | series | colors |
//! |---|---|
//! | actuators | blue, orange, indigo, rust |
//! | actions and their fault classes | shades of red, violet and ochre for the first, second and third action |
//! | scenarios | greens: ideal, noise, fitted, realistic, and with one more sensor |
//! | measured values; twin values beside them | black; sky blue |
//! | connections in a system | petrol (oil), brown and sand (motion), dark gray (signals) |
//! | series without a meaning in other figures: bands, limits, healthy ones, protocols | black and gray |
//!
//! Dashes and markers also distinguish series. Heat maps have their own scale, which a bar beside them explains.

use super::style::Look;

/// A color on white, and its replacement on a dark background.
pub(super) type Shade = [&'static str; 2];

/// Replacements on a dark background for palette colors without a meaning.
const ON_DARK: [Shade; 2] = [["#009e73", "#2fc79b"], ["#7a5c00", "#cfa63a"]];

const ACTUATORS: [Shade; 4] = [
    ["#0072b2", "#4fa8e0"],
    ["#d55e00", "#f08a3c"],
    ["#2b1fbf", "#8d86ff"],
    ["#8f3a00", "#c46a2a"],
];
const FIRST: [Shade; 4] = [
    ["#9b1c31", "#e8677b"],
    ["#d9455f", "#ffb3be"],
    ["#5c0a18", "#c23a50"],
    ["#c2578f", "#e58cba"],
];
const SECOND: [Shade; 3] = [["#6f4fa8", "#ad93e0"], ["#9a78e0", "#d6c6ff"], ["#3d1f78", "#8563c9"]];
const THIRD: [Shade; 3] = [["#8a6a00", "#d9b13a"], ["#b08a1e", "#ffe08a"], ["#524000", "#a8852a"]];
const ACTIONS: [&[Shade]; 3] = [&FIRST, &SECOND, &THIRD];
const TWIN: Shade = ["#2f9bd6", "#7cc8f5"];
const MEDIA: [Shade; 4] = [
    ["#1d4e6b", "#b3cfdf"],
    ["#7a4a2b", "#c08a66"],
    ["#4a4a4a", "#c4c4c4"],
    ["#a0785a", "#ecc9ad"],
];
const PLAIN: [Shade; 2] = [["#000000", "#ffffff"], ["#7f7f7f", "#9a9a9a"]];

/// The meaning of a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SemanticColor {
    /// An actuator, by index.
    Actuator(usize),
    /// An action, by index.
    Action(usize),
    /// A fault class: the index of its action, and its own index below that.
    Detail(usize, usize),
    /// Measured values.
    Measured,
    /// Values of the twin.
    Twin,
    /// A connection in a system, by index in the legend.
    Medium(usize),
    /// No meaning in other figures, by index; the colors repeat after two.
    Plain(usize),
}

impl SemanticColor {
    /// The style of a series with this meaning.
    pub fn look(self) -> Look {
        let of = |shades: &[Shade], place: usize| Look::new(shades[place % shades.len()][0], place);
        let below = |action: usize, place: usize| {
            // Actions beyond the third start with another shade.
            let (shades, round) = (ACTIONS[action % ACTIONS.len()], action / ACTIONS.len());
            Look::new(shades[(place + round) % shades.len()][0], place)
        };
        match self {
            SemanticColor::Actuator(place) => of(&ACTUATORS, place),
            SemanticColor::Action(place) => Look { index: place, ..below(place, 0) },
            SemanticColor::Detail(action, place) => below(action, place),
            SemanticColor::Measured => of(&PLAIN, 0),
            SemanticColor::Twin => Look::new(TWIN[0], 1),
            SemanticColor::Medium(place) => of(&MEDIA, place),
            SemanticColor::Plain(place) => of(&PLAIN, place),
        }
    }
}

/// Every color with a meaning, and its replacement on a dark background.
pub(super) fn shades() -> Vec<Shade> {
    let actions = ACTIONS.concat();
    [&ACTUATORS[..], &actions, &[TWIN], &MEDIA, &PLAIN].concat()
}

/// Style sheet rules that make a drawing's colors readable on a dark background; texts keep their colors.
pub(crate) fn dark_rules() -> String {
    let rule = |[light, dark]: Shade| {
        format!(
            "  .drawing [stroke=\"{light}\"] {{ stroke: {dark}; }}\n  \
             .drawing :not(text)[fill=\"{light}\"] {{ fill: {dark}; }}\n"
        )
    };
    shades().into_iter().chain(ON_DARK).map(rule).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::style::{contrast, difference};

    #[test]
    fn no_two_meanings_look_alike_on_either_ground() {
        let shades = shades();
        for (place, [light, dark]) in shades.iter().enumerate() {
            assert!(contrast(light, "#ffffff") >= 3.0, "{light} fades on white");
            assert!(contrast(dark, "#16181b") >= 3.0, "{dark} fades on a dark ground");
            for other in &shades[place + 1..] {
                assert!(difference(light, other[0]) > 45.0, "{light} and {} look alike", other[0]);
                assert!(difference(dark, other[1]) > 30.0, "{dark} and {} look alike", other[1]);
            }
        }
    }

    #[test]
    fn what_is_broken_has_the_colours_of_its_command() {
        assert_eq!(
            SemanticColor::Detail(1, 0).look().colour,
            SemanticColor::Action(1).look().colour
        );
        let off: Vec<&str> =
            (0..4).map(|place| SemanticColor::Detail(0, place).look().colour).collect();
        assert!(off.iter().all(|colour| FIRST.iter().any(|shade| shade[0] == *colour)));
        assert_ne!(SemanticColor::Action(3).look(), SemanticColor::Action(0).look());
    }
}
