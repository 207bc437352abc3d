//! CVODE on the generated C: compiled here, run as a process.

use crate::{Run, Task, Work};
use servotwin_model::c_source;
use servotwin_model::program::Program;
use std::io::Write as _;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// The compiled equations with CVODE behind them.
pub(crate) struct Equations {
    binary: PathBuf,
}

impl Equations {
    /// Writes and compiles the C of a system.
    pub(crate) fn compile(program: &Program) -> Self {
        let folder = std::env::temp_dir().join(format!("servotwin-bench-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a folder for the C source");
        let (source, binary) = (folder.join("peer.c"), folder.join("peer"));
        let equations = c_source::write_equations(program, "t", &[]).expect("a good prefix");
        std::fs::write(&source, equations + include_str!("cvode.c")).expect("the C source");
        let libraries = ["cvode", "nvecserial", "sunmatrixdense", "sunlinsoldense", "m"];
        let done = Command::new("cc")
            .args(["-std=c11", "-O3", "-march=native", "-o"])
            .args([&binary, &source])
            .args(libraries.map(|name| {
                let prefix = if name == "m" { "" } else { "sundials_" };
                format!("-l{prefix}{name}")
            }))
            .status()
            .expect("cc");
        assert!(done.success(), "the C source does not compile");
        Self { binary }
    }

    /// Runs all variants, one after the other.
    pub(crate) fn solve(&self, task: &Task, tolerance: f64) -> Work {
        let program = task.program;
        let command = task.inputs[task.moving];
        let mut numbers = vec![
            task.faults.len() as f64,
            task.samples() as f64,
            task.period_s,
            tolerance,
            task.moving as f64,
        ];
        numbers.extend(program.states().iter().map(|s| s.scale));
        numbers.push(command.pieces().len() as f64);
        numbers.extend(&command.breaks_s()[..command.pieces().len()]);
        numbers.extend(command.pieces().as_flattened());
        for (&fault, start) in task.faults.iter().zip(&task.starts) {
            let parameters = program.parameters(&[fault]);
            numbers.extend(program.block_constants(&parameters));
            numbers.extend(program.stand_in_values(&parameters));
            numbers.extend(task.inputs.iter().map(|input| input.pieces()[0][0]));
            numbers.extend(start);
        }
        let output = self.pipe(&numbers);
        let (samples, work) = output.split_at(output.len() - 2);
        let length = task.samples() * program.states().len();
        let runs: Vec<Run> = samples.chunks(length).map(<[f64]>::to_vec).collect();
        Work { runs, seconds: work[0], steps: work[1] }
    }

    fn pipe(&self, numbers: &[f64]) -> Vec<f64> {
        let mut child = Command::new(&self.binary)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the compiled peer");
        let bytes: Vec<u8> = numbers.iter().flat_map(|n| n.to_ne_bytes()).collect();
        let mut input = child.stdin.take().expect("a pipe");
        let writer = std::thread::spawn(move || input.write_all(&bytes));
        let output = child.wait_with_output().expect("the peer ends");
        writer.join().expect("no panic").expect("the peer reads all");
        let numbers = output.stdout.as_chunks().0.iter();
        numbers.map(|bytes| f64::from_ne_bytes(*bytes)).collect()
    }
}
