//! Errors in a user's table.

/// Why a table cannot be used for training, testing or prediction.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum TableModelError {
    /// A row has no class or no group.
    #[error("{place}, column '{column}': the row has no {what}{}", and_more(*.rows))]
    Empty {
        /// "class" or "group".
        what: &'static str,
        /// Name of the column.
        column: String,
        /// The place in the file, such as `line 17`.
        place: String,
        /// Number of rows without it.
        rows: usize,
    },
    /// The class column contains measured numbers.
    #[error(
        "column '{column}' holds {different} different numbers: that is measured, no class; make classes of it by \
         limits, for example {},{}",
        .limits.0, .limits.1
    )]
    NumericLabel {
        /// Name of the column.
        column: String,
        /// The number of distinct values.
        different: usize,
        /// Two limits that would divide the values into three classes.
        limits: (f64, f64),
    },
    /// Limits that divide numbers into classes are not ascending, or leave only one class.
    #[error("the limits must ascend and leave at least two classes of column '{column}'")]
    Limits {
        /// Name of the column.
        column: String,
    },
    /// Almost no class occurs twice.
    #[error(
        "column '{column}' holds {different} different texts in {rows} rows: hardly any class occurs twice, so there \
         is nothing to learn"
    )]
    NamesNotClasses {
        /// Name of the column.
        column: String,
        /// The number of distinct texts.
        different: usize,
        /// The number of rows.
        rows: usize,
    },
    /// A text column named as a feature has too many distinct texts.
    #[error(
        "column '{column}' holds {different} different texts; at most {largest} can become features"
    )]
    TooManyCategories {
        /// Name of the column.
        column: String,
        /// The number of distinct texts.
        different: usize,
        /// The largest allowed number.
        largest: usize,
    },
    /// The split column has no value for test, or none for training.
    #[error(
        "column '{column}' must hold {}; it holds {}",
        needed_values(.test_value.as_deref()), .values.join(", ")
    )]
    Split {
        /// Name of the column.
        column: String,
        /// Its first values.
        values: Vec<String>,
        /// The value that marks test rows, if given.
        test_value: Option<String>,
    },
    /// A group is on both sides of a fixed split.
    #[error(
        "'{group}' of column '{column}'{} is in training and in test: a group must stand on one side of the split",
        others(*.groups)
    )]
    GroupOnBothSides {
        /// The column of the groups.
        column: String,
        /// The first such group.
        group: String,
        /// The number of such groups.
        groups: usize,
    },
    /// One side of the split is empty.
    #[error("no row is left for {side}")]
    NothingLeft {
        /// The empty side, in words.
        side: &'static str,
    },
    /// A value is missing, and the classifier does not support that.
    #[error("{place}, column '{column}': no value, and {reason}")]
    Missing {
        /// Name of the column.
        column: String,
        /// The place in the file.
        place: String,
        /// Why it is not supported.
        reason: &'static str,
    },
    /// A weight was given for a class that does not occur.
    #[error("a weight for class '{class}', but there are {}", .known.join(", "))]
    UnknownWeight {
        /// Name of the class.
        class: String,
        /// The classes that occur.
        known: Vec<String>,
    },
    /// A weight is not a positive number.
    #[error("the weight of class '{class}' is {weight}, it must be above 0")]
    Weight {
        /// Name of the class.
        class: String,
        /// The rejected weight.
        weight: f64,
    },
    /// One column was named for two exclusive purposes.
    #[error("column '{column}' is named for two things that exclude each other")]
    UsedTwice {
        /// Name of the column.
        column: String,
    },
    /// Abstention needs probabilities, but the classifier has none.
    #[error(
        "{classifier} gives no probabilities here, so it cannot abstain below one (AdaBoost gives none once classes \
         are weighted)"
    )]
    NoProbabilities {
        /// Title of the classifier.
        classifier: &'static str,
    },
    /// The table has no such row.
    #[error("there is no row {row}: the table has the rows 1 to {rows}")]
    NoRow {
        /// The requested row, from 1.
        row: usize,
        /// The number of rows.
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
