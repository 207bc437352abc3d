//! What fault trees and the rate of the function are computed from, read once for both.

use crate::counts::JudgedFlights;
use crate::error::SafetyError;
use crate::rates::FailureRates;
use crate::results::StudyResultsFolder;
use crate::tree::numbers::ExposureHours;
use std::path::Path;

/// Judged flights with the user's failure rates, and the tests on the ground if there are any.
pub struct RatedFlights<'r> {
    pub(crate) results: &'r StudyResultsFolder,
    pub(crate) flights: JudgedFlights,
    pub(crate) rates: FailureRates,
    pub(crate) hours: ExposureHours,
}

impl<'r> RatedFlights<'r> {
    /// Reads the rates of a table, and the flights of a folder.
    ///
    /// # Errors
    /// The folder has no judged flights, or no tests although there are hours between them; a rate is wrong; an interval is
    /// out of range.
    pub fn read(
        results: &'r StudyResultsFolder,
        rates: &Path,
        hours: ExposureHours,
    ) -> Result<Self, SafetyError> {
        let hours = hours.checked()?;
        let rates = FailureRates::read(rates, &results.study)?;
        let flights = JudgedFlights::read(&results.folder, results.flown_or_missing()?)?;
        let flights = match hours.test_h {
            None => flights,
            Some(_) => flights.tested_in(&results.folder)?,
        };
        Ok(RatedFlights { results, flights, rates, hours })
    }
}
