//! The commands and versions that reproduce the report.

use crate::Material;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    let (study, manifest) = (material.study, material.manifest);
    let mut grid = Table::headed(["", ""]);
    let mut push = |name: &str, value: String| grid.push(vec![name.into(), value]);
    push("program", format!("servotwin {}", manifest.version));
    push("study", format!("{} ({})", manifest.study, study.title));
    push("system", format!("{} ({})", study.system.name, study.system.title));
    let every = 1.0 / study.sample_period_s;
    push("runs", format!("{} s, sampled at {every} Hz", study.duration_s));
    push("solver", manifest.solver.clone());
    let seed = manifest.seed.to_string();
    push("seed of everything drawn", seed);
    for result in &material.results.subjects {
        let holding = result.settings.holding;
        push(
            &format!("splits, {}", result.title),
            format!("{} random thirds; {} folds of groups", holding.repeats, holding.folds),
        );
    }
    page.table(
        "",
        grid.captioned(
            "Versions, settings and seeds. The same study gives the same bytes again, \
             on any number of processors.",
        ),
    );
    let mut files = Table::headed(["file", "SHA-256"]);
    for file in manifest.inputs.iter().chain(&manifest.outputs) {
        files.push(vec![file.file.clone(), file.sha256.clone()]);
    }
    page.table("", files.captioned("What went in and what this report was made from."));
}
