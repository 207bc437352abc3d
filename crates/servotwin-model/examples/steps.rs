//! Scratch, never committed.
#[allow(dead_code)]
#[path = "../tests/all/rig.rs"]
mod rig;
use servotwin_model::lanes;
use servotwin_model::signal::Piecewise;
use servotwin_model::solver::{Failure, Job, JobSource, Settings, Statistics, run};
struct All<'a>(Vec<Job<'a>>, f64, u64);
impl<'a> JobSource<'a> for All<'a> {
    fn next(&mut self) -> Option<Job<'a>> {
        self.0.pop()
    }
    fn sample(&mut self, _: usize, _: usize, v: &[f64]) {
        self.1 += v[0];
    }
    fn finish(&mut self, _: usize, o: Result<Statistics, Failure>) {
        self.2 += o.unwrap().steps;
    }
}
fn main() {
    let level = std::env::args().nth(1).unwrap();
    let n: usize = std::env::args().nth(2).unwrap().parse().unwrap();
    let level = lanes::ALL.into_iter().find(|l| l.name() == level).expect("level");
    let program = rig::actuator();
    let parameters = program.parameters(&[]);
    let inputs = [
        Piecewise::new(vec![0.0, 0.2], vec![[0.0, 0.3, 0.0, 0.0], [0.06, -0.2, 0.1, 0.0]]).unwrap(),
        Piecewise::new(vec![0.0], vec![[1.0, 0.0, 0.0, 0.0]]).unwrap(),
        Piecewise::new(vec![0.0], vec![[3000.0, 0.0, 0.0, 0.0]]).unwrap(),
    ];
    let job = |number| Job {
        number,
        constants: program.block_constants(&parameters),
        stand_ins: program.stand_in_values(&parameters),
        inputs: inputs.iter().collect(),
        start: program.first_guess(&parameters),
        settle: true,
        duration_s: 1.0,
        sample_period_s: 0.01,
        changes: Vec::new(),
    };
    let mut all = All((0..n).map(job).collect(), 0.0, 0);
    let t = std::time::Instant::now();
    run(&program, None, Settings::campaign(), &[0], level, &mut all);
    println!("{} steps, sum {:x}, {:.4} s", all.2, all.1.to_bits(), t.elapsed().as_secs_f64());
}
