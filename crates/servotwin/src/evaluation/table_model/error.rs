//! What can be wrong with somebody's table.

use std::fmt;

/// Why a table cannot be learnt from, judged with or predicted.
#[derive(Debug, Clone, PartialEq)]
#[non_exhaustive]
pub enum TableModelError {
    /// A row has no class or no group.
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
    NumericLabel {
        /// The column.
        column: String,
        /// How many different numbers.
        different: usize,
        /// Two limits that would make three classes of them.
        limits: (f64, f64),
    },
    /// Limits that make classes of numbers are not ascending, or leave one class only.
    Limits {
        /// The column.
        column: String,
    },
    /// Hardly any class occurs twice.
    NamesNotClasses {
        /// The column.
        column: String,
        /// How many different texts.
        different: usize,
        /// In how many rows.
        rows: usize,
    },
    /// A text column named as a feature has too many different texts.
    TooManyCategories {
        /// The column.
        column: String,
        /// How many.
        different: usize,
        /// How many there may be.
        largest: usize,
    },
    /// The column of the split has no value that means test, or none that means training.
    Split {
        /// The column.
        column: String,
        /// The values it has, the first few.
        values: Vec<String>,
        /// The value that means test, where one was given.
        test_value: Option<String>,
    },
    /// A group stands on both sides of a fixed split.
    GroupOnBothSides {
        /// The column of the groups.
        column: String,
        /// The first such group.
        group: String,
        /// How many such groups.
        groups: usize,
    },
    /// Nothing is left on one side of the split.
    NothingLeft {
        /// Which side, in words.
        side: &'static str,
    },
    /// A value is missing, and the classifier cannot do without.
    Missing {
        /// The column.
        column: String,
        /// The place in the file.
        place: String,
        /// Why it cannot.
        reason: &'static str,
    },
    /// A class was given a weight, but does not occur.
    UnknownWeight {
        /// The class.
        class: String,
        /// The classes there are.
        known: Vec<String>,
    },
    /// A weight is no positive number.
    Weight {
        /// The class.
        class: String,
        /// The weight.
        weight: f64,
    },
    /// One column was named for two things.
    UsedTwice {
        /// The column.
        column: String,
    },
    /// Abstention needs probabilities, and the classifier gives none.
    NoProbabilities {
        /// The classifier.
        classifier: &'static str,
    },
    /// There is no such row.
    NoRow {
        /// The row, from 1.
        row: usize,
        /// How many there are.
        rows: usize,
    },
}

impl fmt::Display for TableModelError {
    fn fmt(&self, out: &mut fmt::Formatter<'_>) -> fmt::Result {
        use TableModelError as Error;
        match self {
            Error::Empty { what, column, place, rows } => {
                write!(out, "{place}, column '{column}': the row has no {what}")?;
                if *rows > 1 {
                    write!(out, ", and so have {} more", rows - 1)?;
                }
                match *what {
                    "class" => write!(out, " (rows without one are for 'servotwin predict')"),
                    _ => Ok(()),
                }
            }
            Error::NumericLabel { column, different, limits } => write!(
                out,
                "column '{column}' holds {different} different numbers: that is measured, no class; \
                 make classes of it, for example with --label-limits {},{}",
                limits.0, limits.1
            ),
            Error::Limits { column } => write!(
                out,
                "--label-limits must ascend and leave at least two classes of column '{column}'"
            ),
            Error::NamesNotClasses { column, different, rows } => write!(
                out,
                "column '{column}' holds {different} different texts in {rows} rows: \
                 hardly any class occurs twice, so there is nothing to learn"
            ),
            Error::TooManyCategories { column, different, largest } => write!(
                out,
                "column '{column}' holds {different} different texts; \
                 at most {largest} can become features"
            ),
            Error::Split { column, values, test_value } => {
                match test_value {
                    Some(value) => write!(out, "column '{column}' must hold '{value}' and others")?,
                    None => write!(out, "column '{column}' must hold 'train' and 'test'")?,
                }
                write!(out, "; it holds {}", values.join(", "))?;
                match test_value {
                    Some(_) => Ok(()),
                    None => write!(out, " (--test-value says what is tested with)"),
                }
            }
            Error::GroupOnBothSides { column, group, groups } => write!(
                out,
                "'{group}' of column '{column}'{} is in training and in test: \
                 a group must stand on one side of the split",
                match groups {
                    1 => String::new(),
                    more => format!(" (and {} more)", more - 1),
                }
            ),
            Error::NothingLeft { side } => write!(out, "no row is left for {side}"),
            Error::Missing { column, place, reason } => {
                write!(out, "{place}, column '{column}': no value, and {reason}")
            }
            Error::UnknownWeight { class, known } => {
                write!(out, "a weight for class '{class}', but there are {}", known.join(", "))
            }
            Error::Weight { class, weight } => {
                write!(out, "the weight of class '{class}' is {weight}, it must be above 0")
            }
            Error::UsedTwice { column } => {
                write!(out, "column '{column}' is named for two things that exclude each other")
            }
            Error::NoProbabilities { classifier } => {
                write!(
                    out,
                    "{classifier} gives no probabilities here, so it cannot abstain below one \
                     (AdaBoost gives none once classes are weighted)"
                )
            }
            Error::NoRow { row, rows } => {
                write!(out, "there is no row {row}: the table has the rows 1 to {rows}")
            }
        }
    }
}

impl std::error::Error for TableModelError {}
