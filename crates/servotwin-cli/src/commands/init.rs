//! `servotwin init`: writes a system and a study to start from.

use crate::Global;
use crate::failure::Failure;
use crate::render::json;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use serde_json::json;
use servotwin::files;
use servotwin::template::{Like, Template};
use std::path::PathBuf;

/// Write a system and a study of your own to start from.
#[derive(clap::Args)]
pub(crate) struct Options {
    /// The name of the system: lowercase letters, digits and '_'.
    name: String,
    /// The template [default: press_axis if the name contains the word 'press', else servo_actuator].
    #[arg(long, value_parser = likes())]
    like: Option<Like>,
    /// The folder for both files.
    #[arg(long, value_name = "FOLDER", default_value = ".")]
    out: PathBuf,
}

fn likes() -> impl TypedValueParser<Value = Like> {
    PossibleValuesParser::new(Like::ALL.map(Like::name)).map(|name| {
        let found = Like::ALL.into_iter().find(|like| like.name() == name);
        found.expect("clap admits known names only")
    })
}

/// Lists the options for the other templates.
fn others(like: Like) -> String {
    let others = Like::ALL.into_iter().filter(|other| *other != like);
    let told = |other: Like| format!("; --like {} writes {} instead", other.name(), other.words());
    others.map(told).collect()
}

/// Returns the text for standard output.
pub(crate) fn run(options: &Options, global: Global) -> Result<String, Failure> {
    let like = options.like.unwrap_or_else(|| Like::of_name(&options.name));
    let template = Template::new(&options.name, like)
        .ok_or(Failure::Options("a system's name has small letters, digits and '_'"))?;
    let system = options.out.join(template.system_name());
    let study = options.out.join(template.study_name());
    for path in [&system, &study] {
        if path.exists() {
            return Err(Failure::Exists(path.clone()));
        }
    }
    for (path, text) in [(&system, template.system()), (&study, template.study())] {
        files::write_atomically(path, |out| out.write_all(text.as_bytes()))?;
    }
    let (system, study) = (system.display().to_string(), study.display().to_string());
    Ok(match global {
        Global { json: true, .. } => {
            json(&json!({ "system": system, "study": study, "like": like.name() }))
        }
        Global { quiet: true, .. } => String::new(),
        _ => format!(
            "{system}: the system    servotwin simulate {system} --command {}\n\
             {study}: the study    servotwin study {study} --out out_{}\n\
             both are of {}{}\n",
            like.command(),
            options.name,
            like.words(),
            others(like)
        ),
    })
}
