//! The places of mistakes in an export as Rust.

use super::{
    Site, Spelling, changed_items, first_words, items, operators, other_decision, swapped_branches,
};
use crate::source_file::SourceFile;

const ARRAY: Spelling = Spelling { follows: ": [", opens: "= [", closes: ']' };

/// All places, by kind of mistake; a kind without places is left out.
pub(super) fn sites(files: &[SourceFile], only: Option<&str>) -> Vec<Vec<Site>> {
    let (mut kinds, mut code) = (Vec::new(), Vec::new());
    for (file, SourceFile { name, text }) in files.iter().enumerate() {
        if only.is_some_and(|only| only != *name) {
            continue;
        }
        match *name {
            // An export calls none of the functions with such statements.
            "src/random.rs" => {}
            "src/tables.rs" => kinds.extend(sites_of_tables(file, text)),
            name if name.ends_with(".rs") => code.push(operators(file, text, &is_statement)),
            _ => {}
        }
    }
    kinds.extend(code);
    kinds.retain(|kind| !kind.is_empty());
    kinds
}

/// Guards (`least`) are left out, as in C.
fn is_statement(line: &str) -> bool {
    line.trim_start().starts_with("let ") && !line.contains("least") && !line.contains("LEAST")
}

/// Numbers, branches, features and classes of the tables.
fn sites_of_tables(file: usize, text: &str) -> Vec<Vec<Site>> {
    let changed = |ending: &str, change: &dyn Fn(&str) -> Option<String>| {
        changed_items(file, items(text, ending, ARRAY), change)
    };
    let next = |item: &str| Some(format!("{}", item.parse::<u32>().ok()? + 1));
    let (left, right) = (items(text, "_LEFT", ARRAY), items(text, "_RIGHT", ARRAY));
    let sensors = ("SENSORS: [Sensor;", ";\n\n", "Sensor { scale: ");
    vec![
        changed("_THRESHOLDS", &last_digit),
        changed("_VALUES", &last_digit),
        changed("_PROBABILITIES", &last_digit),
        changed("_THRESHOLDS", &twice),
        changed("_VALUES", &twice),
        changed("_FEATURES", &next),
        swapped_branches(file, left, right),
        first_words(file, text, sensors, &twice),
        changed("_DECISIONS", &other_decision),
    ]
}

/// The next number of the same sign.
fn last_digit(literal: &str) -> Option<String> {
    let number: f64 = literal.parse().ok().filter(|number| *number != 0.0)?;
    Some(format!("{:?}", f64::from_bits(number.to_bits() ^ 1)))
}

/// A number times two.
fn twice(literal: &str) -> Option<String> {
    let number: f64 = literal.parse().ok().filter(|number| *number != 0.0)?;
    Some(format!("{:?}", 2.0 * number))
}
