//! A system with its faults, or a hybrid twin, as a Functional Mock-up Unit for other simulation tools.
//!
//! The FMU holds C sources and a binary for 64-bit Linux, which needs nothing but the C library. Faults and parameters of a
//! system are tunable parameters, so any tool can inject a fault while it simulates. A hybrid twin takes inputs and measured
//! values, and its outputs are those of the diagnosis.

mod description;
mod tables;
mod units;
mod variables;

pub use description::Version;

use crate::c;
use crate::compile::{Workplace, compiled, compilers};
use crate::error::ExportError;
use crate::source_file::SourceFile;
use crate::twin::ExportedTwin;
use description::Description;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_io::files::write_atomically;
use servotwin_io::manifest::sha256_of_text;
use servotwin_model::c_source::write_tangent;
use std::io::{Cursor, Write};
use std::path::Path;
use variables::Variables;
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

/// Name and text of hand-written files.
type Written = [(&'static str, &'static str); 2];

const COMMON: [(&str, &str); 3] = [
    ("servotwin_fmi.h", include_str!("../../runtime/fmu/servotwin_fmi.h")),
    ("servotwin_fmu.h", include_str!("../../runtime/fmu/servotwin_fmu.h")),
    ("servotwin_fmu.c", include_str!("../../runtime/fmu/servotwin_fmu.c")),
];

const OF_SYSTEM: Written = [
    ("servotwin_fmu_core.h", include_str!("../../runtime/fmu/system/servotwin_fmu_core.h")),
    ("servotwin_fmu_core.c", include_str!("../../runtime/fmu/system/servotwin_fmu_core.c")),
];

const OF_HYBRID: Written = [
    ("servotwin_fmu_core.h", include_str!("../../runtime/fmu/hybrid/servotwin_fmu_core.h")),
    ("servotwin_fmu_core.c", include_str!("../../runtime/fmu/hybrid/servotwin_fmu_core.c")),
];

/// Writes an FMU of a system, or with a diagnoser of its hybrid twin; returns the number of its variables. `name` becomes a
/// C identifier.
///
/// # Errors
/// [`ExportError::NoCompiler`] and [`ExportError::Refused`] if the sources cannot be compiled, and a file that cannot be
/// written; with a diagnoser also those of [`c::files`].
pub fn write(
    twin: &ExportedTwin,
    diagnoser: Option<&Diagnoser>,
    version: Version,
    (name, title): (&str, &str),
    path: &Path,
) -> Result<usize, ExportError> {
    let name = identifier(name);
    let mut sources = sources(twin, diagnoser, version)?;
    let all: String = sources.iter().map(|file| file.text.as_str()).collect();
    let token = sha256_of_text(&format!("{name} {all}"));
    sources.push(SourceFile {
        name: "servotwin_token.h",
        text: format!("/* Written by servotwin. */\n#define SERVOTWIN_TOKEN \"{token}\"\n"),
    });
    let variables = match diagnoser {
        Some(diagnoser) => Variables::of_hybrid(diagnoser, twin),
        None => Variables::of_system(twin),
    };
    let dependencies = diagnoser.is_none().then(|| twin.program.dependencies());
    let compiled: Vec<&str> = compiled(&sources).collect();
    let description = Description {
        version,
        name: &name,
        title,
        token: &token,
        sources: &compiled,
        variables: &variables,
        dependencies: dependencies.as_deref(),
        period_s: twin.period_s,
    };
    let binary = binary(&sources)?;
    let parts = parts(version, &name, description.text(), &sources, binary);
    let archive = archive(&parts).map_err(|cause| ExportError::from_io(path, cause))?;
    write_atomically(path, |out| out.write_all(&archive))?;
    Ok(variables.all.len())
}

/// The C files of an FMU, without the token.
fn sources(
    twin: &ExportedTwin,
    diagnoser: Option<&Diagnoser>,
    version: Version,
) -> Result<Vec<SourceFile>, ExportError> {
    let interface = match version {
        Version::Two => ("fmi2.c", include_str!("../../runtime/fmu/fmi2.c")),
        Version::Three => ("fmi3.c", include_str!("../../runtime/fmu/fmi3.c")),
    };
    let (mut files, core) = match diagnoser {
        Some(diagnoser) => (c::files_with_twin(diagnoser, twin)?, OF_HYBRID),
        None => {
            let mut files = c::files_of_twin(twin)?;
            let text = write_tangent(twin.program);
            files.push(SourceFile { name: "servotwin_tangent.c", text });
            files.extend(c::files_of_random());
            (files, OF_SYSTEM)
        }
    };
    let text = tables::text(twin, diagnoser.is_none());
    files.push(SourceFile { name: "servotwin_fmu_tables.c", text });
    // The program that reads standard input has no place in a library.
    files.retain(|file| file.name != "main.c");
    let written = COMMON.into_iter().chain(core).chain([interface]);
    files.extend(written.map(|(name, text)| SourceFile { name, text: text.into() }));
    Ok(files)
}

/// The binary for 64-bit Linux. It may use nothing but the C library, and shows only the functions of the interface.
fn binary(sources: &[SourceFile]) -> Result<Vec<u8>, ExportError> {
    let compiler = compilers().next().ok_or(ExportError::NoBuild)?;
    let workplace = Workplace::new(sources, None)?;
    let flags = [
        "-std=c99",
        "-O2",
        "-ffp-contract=off",
        "-fno-math-errno",
        "-fPIC",
        "-fvisibility=hidden",
        "-shared",
        "-Wl,--no-undefined",
        "-o",
        "system.so",
    ];
    workplace.run(compiler, compiler, flags.into_iter().chain(compiled(sources)))?;
    workplace.read("system.so")
}

/// The files of the archive.
fn parts(
    version: Version,
    name: &str,
    description: String,
    sources: &[SourceFile],
    binary: Vec<u8>,
) -> Vec<(String, Vec<u8>)> {
    let platform = if version == Version::Two { "linux64" } else { "x86_64-linux" };
    let mut parts = vec![
        ("modelDescription.xml".into(), description.into_bytes()),
        (format!("binaries/{platform}/{name}.so"), binary),
    ];
    if version == Version::Three {
        parts.push(("sources/buildDescription.xml".into(), build_description(name, sources)));
    }
    let texts = sources
        .iter()
        .map(|file| (format!("sources/{}", file.name), file.text.clone().into_bytes()));
    parts.extend(texts);
    parts
}

/// How an importing tool compiles the sources (version 3 only).
fn build_description(name: &str, sources: &[SourceFile]) -> Vec<u8> {
    let file = |name| format!("      <SourceFile name=\"{name}\"/>\n");
    let files: String = compiled(sources).map(file).collect();
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiBuildDescription fmiVersion=\"3.0\">\n  \
         <BuildConfiguration modelIdentifier=\"{name}\">\n    <SourceFileSet language=\"C99\">\n{files}    </SourceFileSet>\n  \
         </BuildConfiguration>\n</fmiBuildDescription>\n"
    )
    .into_bytes()
}

/// An archive in memory. It has no dates, so the same system gives the same bytes.
fn archive(parts: &[(String, Vec<u8>)]) -> std::io::Result<Vec<u8>> {
    let mut zip = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in parts {
        zip.start_file(name.as_str(), SimpleFileOptions::default())?;
        zip.write_all(bytes)?;
    }
    Ok(zip.finish()?.into_inner())
}

/// A C identifier made of a name.
fn identifier(name: &str) -> String {
    let legal = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    let text: String = name.chars().map(legal).collect();
    let starts_well = text.starts_with(|c: char| c.is_ascii_alphabetic());
    if starts_well { text } else { format!("system_{text}") }
}
