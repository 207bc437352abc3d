//! `servotwin test`: trains and evaluates the decision of the test on the ground.

use super::{StudyOptions, flights};
use crate::Global;
use crate::failure::Failure;
use servotwin::job::JobError;
use servotwin::job::flights::scenarios;

/// Train the decision of the test on the ground, and measure what it finds.
///
/// An actuator runs the command of the study's section `[ground_test]` from rest, beside a twin that was fitted to its first
/// test. The decision comes at the end. Writes the same files as `servotwin study --suite flights` into the folder
/// `ground_test` of the output folder. This folder is a study, too: `servotwin study FOLDER/ground_test --suite healthy`
/// flies one of its suites.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    study: StudyOptions,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = options.study.read(global)?.on_ground()?.ok_or(JobError::NoGroundTest)?;
    let folder = options.study.folder().ground_test();
    let options = StudyOptions { out: Some(folder.path().into()), ..options.study.clone() };
    flights::flown(&options, &study, (&[], &scenarios(&study)), global)
}
