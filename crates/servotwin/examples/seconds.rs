//! Processor time of the runs of records, for `peers/beside.sh`.
//!
//! `seconds [STRIDE] [DURATION_S]` (defaults 1, 90): every `STRIDE`-th of the study's
//! faults under its second command at full load, in one thread. What is sampled is
//! what records sample, and goes into a sum only. Prints the seconds, and those of compilers.

use servotwin::ensemble::{Sink, Variant};
use servotwin::records;
use servotwin::study::Study;
use servotwin_model::solver::Statistics;

struct Sum(f64);

impl Sink for Sum {
    fn sample(&mut self, _index: usize, values: &[f64]) {
        self.0 += values.iter().sum::<f64>();
    }
}

/// Of all threads, those that have ended included; and of compilers.
fn processor_seconds() -> [f64; 2] {
    let text = std::fs::read_to_string("/proc/self/stat").expect("Linux");
    let after_name = text.rsplit(')').next().unwrap_or_default();
    let fields: Vec<f64> =
        after_name.split_whitespace().map(|field| field.parse().unwrap_or(0.0)).collect();
    [(fields[11] + fields[12]) / 100.0, (fields[13] + fields[14]) / 100.0]
}

fn main() {
    let argument = |place: usize, default: f64| {
        std::env::args().nth(place).map_or(default, |text| text.parse().expect("a number"))
    };
    let study = Study::default();
    let case = study.cases.iter().find(|case| case.name == "S2/100").expect("a case of the study");
    let mut faults: Vec<_> = study.faults.iter().step_by(argument(1, 1.0) as usize).collect();
    // As records do: a few of them take a hundred times as long as the others.
    faults.sort_by(|a, b| b.at.intensity.total_cmp(&a.at.intensity));
    let mut ensemble = records::ensemble(&study);
    (ensemble.duration_s, ensemble.threads) = (argument(2, 90.0), 1);
    let variant = |job: usize| Variant {
        faults: vec![faults[job].at],
        inputs: case.inputs.iter().collect(),
        ..Variant::default()
    };
    let (mut total, mut sum) = (Statistics::default(), 0.0);
    let begin = processor_seconds();
    ensemble.run(
        faults.len(),
        variant,
        |_| Sum(0.0),
        |_, samples, outcome| {
            total += outcome.expect("the run ends");
            sum += samples.0;
        },
    );
    let [own, compilers] = processor_seconds();
    println!("{:.2} {compilers:.2} {total:?} {sum:e}", own - begin[0]);
}
