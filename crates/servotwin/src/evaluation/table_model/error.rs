//! What can be wrong with somebody's table.

/// Why a table cannot be learnt from, judged with or predicted.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableModelError {
    /// A row has no class or no group.
    #[error("{place}, column '{column}': the row has no {what}{}", and_more(*.rows))]
    Empty {
        /// What it lacks, in words.
        what: &'static str,
        /// The column.
        column: String,
        /// The place in the file, such as `line 17`.
        place: String,
        /// How many rows lack it.
        rows: usize,
    },
    /// The column of the classes holds measured numbers.
    #[error(
        "column '{column}' holds {different} different numbers: that is measured, no class; make classes of it by \
         limits, for example {},{}",
        .limits.0, .limits.1
    )]
    NumericLabel {
        /// The column.
        column: String,
        /// How many different numbers.
        different: usize,
        /// Two limits that would make three classes of them.
        limits: (f64, f64),
    },
    /// Limits that make classes of numbers are not ascending, or leave one class only.
    #[error("the limits must ascend and leave at least two classes of column '{column}'")]
    Limits {
        /// The column.
        column: String,
    },
    /// Hardly any class occurs twice.
    #[error(
        "column '{column}' holds {different} different texts in {rows} rows: hardly any class occurs twice, so there \
         is nothing to learn"
    )]
    NamesNotClasses {
        /// The column.
        column: String,
        /// How many different texts.
        different: usize,
        /// In how many rows.
        rows: usize,
    },
    /// A text column named as a feature has too many different texts.
    #[error(
        "column '{column}' holds {different} different texts; at most {largest} can become features"
    )]
    TooManyCategories {
        /// The column.
        column: String,
        /// How many.
        different: usize,
        /// How many there may be.
        largest: usize,
    },
    /// The column of the split has no value that means test, or none that means training.
    #[error(
        "column '{column}' must hold {}; it holds {}",
        needed_values(.test_value.as_deref()), .values.join(", ")
    )]
    Split {
        /// The column.
        column: String,
        /// The values it has, the first few.
        values: Vec<String>,
        /// The value that means test, where one was given.
        test_value: Option<String>,
    },
    /// A group stands on both sides of a fixed split.
    #[error(
        "'{group}' of column '{column}'{} is in training and in test: a group must stand on one side of the split",
        others(*.groups)
    )]
    GroupOnBothSides {
        /// The column of the groups.
        column: String,
        /// The first such group.
        group: String,
        /// How many such groups.
        groups: usize,
    },
    /// Nothing is left on one side of the split.
    #[error("no row is left for {side}")]
    NothingLeft {
        /// Which side, in words.
        side: &'static str,
    },
    /// A value is missing, and the classifier cannot do without.
    #[error("{place}, column '{column}': no value, and {reason}")]
    Missing {
        /// The column.
        column: String,
        /// The place in the file.
        place: String,
        /// Why it cannot.
        reason: &'static str,
    },
    /// A class was given a weight, but does not occur.
    #[error("a weight for class '{class}', but there are {}", .known.join(", "))]
    UnknownWeight {
        /// The class.
        class: String,
        /// The classes there are.
        known: Vec<String>,
    },
    /// A weight is no positive number.
    #[error("the weight of class '{class}' is {weight}, it must be above 0")]
    Weight {
        /// The class.
        class: String,
        /// The weight.
        weight: f64,
    },
    /// One column was named for two things.
    #[error("column '{column}' is named for two things that exclude each other")]
    UsedTwice {
        /// The column.
        column: String,
    },
    /// Abstention needs probabilities, and the classifier gives none.
    #[error(
        "{classifier} gives no probabilities here, so it cannot abstain below one (AdaBoost gives none once classes \
         are weighted)"
    )]
    NoProbabilities {
        /// The classifier.
        classifier: &'static str,
    },
    /// There is no such row.
    #[error("there is no row {row}: the table has the rows 1 to {rows}")]
    NoRow {
        /// The row, from 1.
        row: usize,
        /// How many there are.
        rows: usize,
    },
}

fn and_more(rows: usize) -> String {
    if rows > 1 { format!(", and so have {} more", rows - 1) } else { String::new() }
}

fn needed_values(test_value: Option<&str>) -> String {
    match test_value {
        Some(value) => format!("'{value}' and others"),
        None => "'train' and 'test'".to_owned(),
    }
}

fn others(groups: usize) -> String {
    if groups == 1 { String::new() } else { format!(" (and {} more)", groups - 1) }
}
