//! `servotwin test`: learns and judges the tests of a study on the ground.

use super::StudyOptions;
use super::flights::{Choice, flown};
use crate::Global;
use crate::failure::Failure;
use servotwin::job::flights::scenarios;
use servotwin::job::{Folder, JobError};

/// Train the decision of the test on the ground, and measure what it finds.
///
/// An actuator runs the command of the study's section `[ground_test]` from rest, beside a twin that was fitted to its first
/// test. The decision comes at the end. Writes the same files as `servotwin flights` into the folder `ground_test` of the
/// output folder.
#[derive(clap::Args)]
pub(crate) struct Options {
    #[command(flatten)]
    study: StudyOptions,
    #[command(flatten)]
    choice: Choice,
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let study = options.study.read(global)?.on_ground()?.ok_or(JobError::NoGroundTest)?;
    let folder = Folder::new(&options.study.out).ground_test();
    let options =
        (&StudyOptions { out: folder.path().into(), ..options.study.clone() }, &options.choice);
    flown(options, &study, &scenarios(&study), global)
}
