//! `servotwin test`: trains and evaluates the decision of the test on the ground.

use super::{StudyOptions, study};
use crate::failure::Failure;
use crate::{Global, Run};
use servotwin::job::JobError;
use servotwin::study::suites::FLIGHTS;
use servotwin_view::document::Document;

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

impl Run for Options {
    fn run(&self, global: Global) -> Result<Document, Failure> {
        let study = self.study.read(global)?.on_ground()?.ok_or(JobError::NoGroundTest)?;
        let folder = self.study.folder().ground_test();
        let options = StudyOptions { out: Some(folder.path().into()), ..self.study.clone() };
        study::suites(&study::Options::of(options), &study, &[FLIGHTS.into()], global)
    }
}
