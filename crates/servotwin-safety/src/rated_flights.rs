//! What fault trees and the rate of the function are computed from, read once for both.

use crate::error::SafetyError;
use crate::ground_test::GroundTest;
use crate::rates::FailureRates;
use crate::results::StudyResultsFolder;
use crate::tree::lanes::rated_faults;
use crate::tree::numbers::ExposureHours;
use servotwin::flight::judge::FlightMetrics;
use std::path::Path;

/// Judged flights with the user's failure rates, and the tests on the ground if there are any.
pub struct RatedFlights<'r> {
    pub(crate) results: &'r StudyResultsFolder,
    pub(crate) metrics: &'r FlightMetrics,
    pub(crate) rates: FailureRates,
    pub(crate) test: Option<GroundTest>,
    pub(crate) hours: ExposureHours,
}

impl<'r> RatedFlights<'r> {
    /// Reads the rates of a table, and what a folder counted.
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
        let rates = FailureRates::read(rates, &rated_faults(&results.study))?;
        let metrics = results.flown_or_missing()?;
        let test = hours.test_h.map(|_| GroundTest::read(results)).transpose()?;
        Ok(RatedFlights { results, metrics, rates, test, hours })
    }
}
