//! An excerpt of a data set, a few columns and rows, for the seed paper's figure 8.

use servotwin_io::table::TableError;
use servotwin_io::table::parquet::{self, ParquetReader};
use std::path::Path;

/// A few columns and rows of a data set. Each row is a variant whose fault is detectable.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Excerpt {
    /// How many variants of the data set have a detectable fault and were simulated to the end.
    pub detectable: usize,
    /// How many intensity columns the data set has, one for each fault.
    pub faults: usize,
    /// How many feature columns the data set has.
    pub features: usize,
    /// The faults of the columns shown: the first two with detectable rows, and the fault of the last row.
    pub shown_faults: Vec<String>,
    /// The features of the columns shown: the first three and the last.
    pub shown_features: Vec<String>,
    /// The rows shown: up to two for each shown fault, ending with the last detectable row.
    pub rows: Vec<ExcerptRow>,
}

/// A row of the excerpt.
#[derive(Debug, Clone, PartialEq)]
pub struct ExcerptRow {
    /// The number of the variant.
    pub variant: u32,
    /// Intensities of the shown faults.
    pub intensities: Vec<f64>,
    /// Actuator, command and fault class.
    pub classes: [String; 3],
    /// Values of the shown features.
    pub features: Vec<f64>,
}

const CLASSES: [&str; 3] = ["actuator", "command", "detail"];
/// Prefixes of the intensity and feature columns.
const INTENSITY: &str = "i:";
const FEATURE: &str = "f:";

/// Reads an excerpt of a data set; `None` if no fault in it is detectable.
///
/// # Errors
/// The file is missing or is no data set.
pub fn read(path: &Path) -> Result<Option<Excerpt>, TableError> {
    let schema = ParquetReader::open(path)?;
    let names: Vec<&str> = schema.schema().names().collect();
    let (faults, features) = (with_prefix(&names, INTENSITY), with_prefix(&names, FEATURE));
    let labels = ["variant", "detectable", "failure", "fault"];
    let table = parquet::read_columns(path, &[&labels[..], &CLASSES].concat())?;
    let (detectable, failure) = (table.bool("detectable")?, table.text("failure")?);
    let (variants, fault) = (table.u32("variant")?, table.text("fault")?);
    let is_fault = |row: usize| faults.contains(&fault[row].as_str());
    let is_used = |&row: &usize| detectable[row] && failure[row].is_empty() && is_fault(row);
    let used: Vec<usize> = (0..table.row_count()).filter(is_used).collect();
    let Some(&last) = used.last() else { return Ok(None) };

    // Choose columns with values in them: the faults of the first rows, and the fault of the last row.
    let own = |name: &str| -> Vec<usize> {
        used.iter().copied().filter(|&row| fault[row] == name).take(2).collect()
    };
    let there = faults.iter().copied().filter(|name| !own(name).is_empty());
    let mut shown_faults: Vec<&str> = there.take(2).collect();
    let mut rows: Vec<usize> = shown_faults.iter().flat_map(|name| own(name)).collect();
    if !shown_faults.contains(&fault[last].as_str()) {
        shown_faults.push(&fault[last]);
    }
    rows.retain(|&row| row != last);
    rows.sort_unstable();
    rows.push(last);
    let mut shown_features: Vec<&str> = features.iter().copied().take(3).collect();
    shown_features.extend(features.iter().skip(3).last());

    let column = |prefix: &str, names: &[&str]| -> Vec<String> {
        names.iter().map(|name| format!("{prefix}{name}")).collect()
    };
    let wanted = [column(INTENSITY, &shown_faults), column(FEATURE, &shown_features)].concat();
    let wanted: Vec<&str> = wanted.iter().map(String::as_str).collect();
    let numbers = parquet::read_columns(path, &wanted)?;
    let numbers: Vec<_> = wanted.iter().map(|name| numbers.f64(name)).collect::<Result<_, _>>()?;
    let (intensities, values) = numbers.split_at(shown_faults.len());
    let [unit, command, detail] = [0, 1, 2].map(|place| table.text(CLASSES[place]));
    let classes = [unit?, command?, detail?];
    let row = |&row: &usize| ExcerptRow {
        variant: variants[row],
        intensities: intensities.iter().map(|values| values[row]).collect(),
        classes: classes.map(|texts| texts[row].clone()),
        features: values.iter().map(|values| values[row]).collect(),
    };
    let owned = |names: &[&str]| names.iter().map(|&name| name.to_owned()).collect();
    Ok(Some(Excerpt {
        detectable: used.len(),
        faults: faults.len(),
        features: features.len(),
        shown_faults: owned(&shown_faults),
        shown_features: owned(&shown_features),
        rows: rows.iter().map(row).collect(),
    }))
}

/// Returns the rest of each name that starts with the prefix.
fn with_prefix<'n>(names: &[&'n str], prefix: &str) -> Vec<&'n str> {
    names.iter().filter_map(|name| name.strip_prefix(prefix)).collect()
}
