//! The words for how often the function fails, with the hybrid twin and without.

use super::fault_tree::band;
use servotwin_report::words::number;
use servotwin_safety::function_rate::flight::FunctionFailure;
use servotwin_safety::function_rate::{ConditionRates, FunctionRate};

/// The rates of a function for people.
pub(super) fn text(found: &FunctionRate) -> String {
    let mut text = "the function: failures that begin per flight hour, and flights in which it is failed, also by a fault \
                    that was hidden before\n"
        .to_owned();
    for own in &found.conditions {
        text += &condition(own);
    }
    text += "relative change of the flights with a failed function per relative change of an input, with the twin\n";
    for own in found.sensitivities.iter().take(6) {
        text += &format!("  {:+.3}  {} ({})\n", own.elasticity, own.input, own.evidence);
    }
    text
}

fn condition(own: &ConditionRates) -> String {
    let row = |name: &str, rates: FunctionFailure| {
        format!(
            "    {name}: begins {}/h ({}); failed in {} of flights ({})\n",
            number(rates.begins_per_h),
            beside_twin(rates.begins_per_h, own.twin_begins_per_h.point),
            number(rates.failed),
            beside_twin(rates.failed, own.twin_failed.point)
        )
    };
    // With one actuator, a shutdown ends the function too; then the twin changes this part alone.
    let uncontained = || {
        format!(
            "    without a shutdown: in {} of flights with the twin, in {} without\n",
            band(own.twin_uncontained),
            number(own.nobody.uncontained)
        )
    };
    let comparison = own.comparison.map(|rates| row("comparison of two actuators", rates));
    format!(
        "  {}\n    hybrid twin: begins {}/h; failed in {} of flights\n{}{}{}",
        own.condition,
        band(own.twin_begins_per_h),
        band(own.twin_failed),
        row("no monitoring", own.nobody),
        comparison.unwrap_or_else(uncontained),
        own.comparison.and_then(|rates| order(own, rates)).unwrap_or_default()
    )
}

/// A number beside that of the twin.
fn beside_twin(value: f64, twin: f64) -> String {
    match (twin > 0.0, value > 0.0) {
        (true, _) => format!("{} times the twin's", number(value / twin)),
        (false, true) => "the twin's is 0".into(),
        (false, false) => "as with the twin".into(),
    }
}

/// What readers must know where the two numbers prefer different monitoring.
fn order(own: &ConditionRates, comparison: FunctionFailure) -> Option<String> {
    let fewer_begin = own.twin_begins_per_h.point < comparison.begins_per_h;
    let fewer_failed = own.twin_failed.point < comparison.failed;
    (fewer_begin != fewer_failed).then(|| {
        let [begin, failed] = [fewer_begin, fewer_failed].map(|of_twin| match of_twin {
            true => "the twin",
            false => "the comparison",
        });
        format!(
            "    the numbers disagree: fewer failures begin with {begin}, and fewer flights have a failed function with \
             {failed}, because faults stay hidden until the check\n"
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_twin_that_never_fails_gives_no_quotient() {
        assert_eq!(beside_twin(0.0, 0.0), "as with the twin");
        assert_eq!(beside_twin(1e-6, 0.0), "the twin's is 0");
        assert_eq!(beside_twin(3e-6, 1.5e-6), "2.00 times the twin's");
    }
}
