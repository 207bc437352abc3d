//! `servotwin init`: writes a system and a study to start from.

use crate::failure::Failure;
use crate::{Global, Run};
use servotwin::files;
use servotwin::template::{Like, Template};
use servotwin_view::document::{Document, Verdict, fact};
use std::path::PathBuf;

/// Write a system and a study of your own to start from.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The name of the system: lowercase letters, digits and '_'.
    name: String,
    /// The template [default: press_axis if the name contains the word 'press', else servo_actuator].
    #[arg(long, value_parser = super::one_of(Like::ALL, Like::name))]
    like: Option<Like>,
    /// The folder for both files.
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
}

/// Lists the options for the other templates.
fn others(like: Like) -> String {
    let others = Like::ALL.into_iter().filter(|other| *other != like);
    let told = |other: Like| format!("; --like {} writes {} instead", other.name(), other.words());
    others.map(told).collect()
}

impl Run for Options {
    fn run(&self, _: Global) -> Result<Document, Failure> {
        let like = self.like.unwrap_or_else(|| Like::of_name(&self.name));
        let template = Template::new(&self.name, like)
            .ok_or_else(|| Failure::usage("a system's name has small letters, digits and '_'"))?;
        let system = self.out.join(template.system_name());
        let study = self.out.join(template.study_name());
        [&system, &study].into_iter().try_for_each(|path| Failure::if_exists(path))?;
        for (path, text) in [(&system, template.system()), (&study, template.study())] {
            files::write_text(path, &text)?;
        }
        let verdict = format!("both are of {}{}", like.words(), others(like));
        let mut document = Document::new("init", Verdict::good(verdict));
        let facts = [
            fact("system", "the system", &system),
            fact("study", "the study", &study),
            fact("like", "", like.name()),
        ];
        document.facts("", facts);
        let (command, name) = (like.command(), &self.name);
        let (system, study) = (system.display(), study.display());
        document.list(
            "next",
            [
                format!("servotwin simulate {system} --command {command}"),
                format!("servotwin study {study} --out out_{name}"),
            ],
        );
        Ok(document)
    }
}
