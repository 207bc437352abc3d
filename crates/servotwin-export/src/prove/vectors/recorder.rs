//! An export that records the evaluations of its decisions.

use crate::error::ExportError;
use crate::mcdc::{Decision, Instrumented, Vector, instrument};
use crate::prove::library::{Build, Compiled, Objects, entries};
use crate::source_file::SourceFile;
use libloading::Symbol;

/// The hand-written files of the diagnosis, whose decisions are measured. The features are straight code, the models are
/// tables, and the control of the twin's steps is not part of the diagnosis.
pub(crate) const MEASURED: [&str; 9] = [
    "servotwin_session.c",
    "servotwin_judge.c",
    "servotwin_decision.c",
    "servotwin_boundary.c",
    "servotwin_windows.c",
    "servotwin_models.c",
    "servotwin_random.c",
    "servotwin_math.c",
    "servotwin_hybrid.c",
];

/// Calls of the entry points, beside which nothing is recorded: the file with them, their beginning, the one that stands for
/// it, and the header that declares that.
const CALLS: [[&str; 4]; 2] = [
    ["prove.c", "servotwin_session_", "mcdc_session_", "mcdc_session.h"],
    ["prove_hybrid.c", "servotwin_hybrid_", "mcdc_hybrid_", "mcdc_hybrid.h"],
];

/// The calls that record.
const SESSION: [(&str, &str); 2] = [
    ("mcdc_session.h", include_str!("../../../runtime/mcdc_session.h")),
    ("mcdc_session.c", include_str!("../../../runtime/mcdc_session.c")),
];

/// Those of a hybrid twin.
const HYBRID: [(&str, &str); 2] = [
    ("mcdc_hybrid.h", include_str!("../../../runtime/mcdc_hybrid.h")),
    ("mcdc_hybrid.c", include_str!("../../../runtime/mcdc_hybrid.c")),
];

/// An evaluation that was not seen before, by the number of its decision.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Evaluation {
    pub decision: usize,
    pub vector: Vector,
}

/// The decisions of an export, and its compiled copy that records them.
pub(super) struct Recording {
    pub decisions: Vec<Decision>,
    pub compiled: Compiled,
}

impl Recording {
    /// Instruments and compiles the files of an export.
    pub fn new(files: &[SourceFile], build: &Build) -> Result<Self, ExportError> {
        let Instrumented { files, decisions } = instrument(files, &MEASURED)?;
        let mut entries = entries(&files);
        for [name, old, new, header] in CALLS {
            for entry in entries.iter_mut().filter(|entry| entry.name == name) {
                entry.text = format!("#include \"{header}\"\n{}", entry.text.replace(old, new));
            }
        }
        let calls = match entries.iter().any(|entry| entry.name == "prove_hybrid.c") {
            true => [SESSION, HYBRID].concat(),
            false => SESSION.to_vec(),
        };
        entries
            .extend(calls.into_iter().map(|(name, text)| SourceFile { name, text: text.into() }));
        let compiled = Objects::with_entries(&files, entries, build)?.load("recording.so")?;
        Ok(Recording { decisions, compiled })
    }

    /// The recorder.
    pub fn recorder(&self) -> Result<Recorder<'_>, ExportError> {
        Ok(Recorder {
            forget: self.compiled.symbol(b"mcdc_forget")?,
            take_new: self.compiled.symbol(b"mcdc_take_new")?,
            count: self.compiled.symbol(b"mcdc_count")?,
            // As many as the recorder can ever have, four numbers each.
            memory: vec![0; 4 * 64 * self.decisions.len()],
            decisions: &self.decisions,
        })
    }
}

/// What records the evaluations of decisions.
pub(super) struct Recorder<'c> {
    forget: Symbol<'c, unsafe extern "C" fn()>,
    take_new: Symbol<'c, unsafe extern "C" fn(*mut u32) -> i32>,
    count: Symbol<'c, unsafe extern "C" fn(i32, i32) -> u64>,
    memory: Vec<u32>,
    decisions: &'c [Decision],
}

impl Recorder<'_> {
    /// Forgets all evaluations.
    pub fn forget(&mut self) {
        // SAFETY: here and below, the types are those of the C text.
        unsafe { (self.forget)() }
    }

    /// The evaluations that are new since the last call.
    ///
    /// # Errors
    /// [`ExportError::Recording`] for a decision with too many different evaluations, and for one whose result is not
    /// that of its conditions.
    pub fn take_new(&mut self) -> Result<Vec<Evaluation>, ExportError> {
        // SAFETY: the memory has room for all evaluations.
        let count = unsafe { (self.take_new)(self.memory.as_mut_ptr()) };
        let count = usize::try_from(count).map_err(|_| {
            ExportError::Recording("a decision has too many different evaluations".into())
        })?;
        let rows = self.memory.chunks_exact(4).take(count);
        rows.map(|row| {
            let (decision, vector) =
                (row[0] as usize, Vector { evaluated: row[1], values: row[2] });
            let known = &self.decisions[decision];
            let value = known.tree.value(&vector);
            match value.is_none_or(|value| value == (row[3] == 1)) {
                true => Ok(Evaluation { decision, vector }),
                false => {
                    let (file, line) = (known.file, known.line);
                    let what = format!("{file}:{line}: the result is not that of the conditions");
                    Err(ExportError::Recording(what))
                }
            }
        })
        .collect()
    }

    /// How often the evaluation at a place of a decision occurred, in the order in which they were new.
    pub fn count(&self, decision: usize, place: usize) -> u64 {
        // SAFETY: the place exists.
        unsafe { (self.count)(decision as i32, place as i32) }
    }
}
