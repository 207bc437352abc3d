//! What one sample costs a session: `cargo run --release -p servotwin-diagnosis --example push_time`.

use servotwin_diagnosis::diagnoser::Session;
use std::time::Instant;

#[allow(dead_code)]
#[path = "../tests/toy/mod.rs"]
mod toy;

fn main() -> Result<(), servotwin_diagnosis::Error> {
    const SAMPLES: usize = 100_000;
    for fault in [None, Some(toy::Kind::Wear)] {
        let mut session = Session::new(toy::diagnoser())?;
        let mut flight = toy::Flight::new(1);
        let fault = fault.map(|kind| toy::Fault { actuator: 1, kind, size: 0.8 });
        let mut times_us = Vec::with_capacity(SAMPLES);
        for _ in 0..SAMPLES {
            let (inputs, measured, twin) = flight.next(fault);
            let start = Instant::now();
            session.push(&inputs, &measured, &twin);
            times_us.push(start.elapsed().as_secs_f64() * 1e6);
        }
        times_us.sort_by(f64::total_cmp);
        let part = |share: f64| times_us[(share * (SAMPLES - 1) as f64) as usize];
        let mean = times_us.iter().sum::<f64>() / SAMPLES as f64;
        println!(
            "{fault:?}: mean {mean:.2} us, median {:.2}, p99 {:.2}, p99.9 {:.2}, largest {:.2}",
            part(0.5),
            part(0.99),
            part(0.999),
            part(1.0)
        );
    }
    println!("kind, size: samples until raised, of 20 flights");
    for kind in toy::KINDS {
        for size in [0.3, 0.5, 0.9] {
            let mut latencies: Vec<usize> =
                (0..20).filter_map(|seed| latency(kind, size, seed)).collect();
            latencies.sort_unstable();
            println!("{kind:?}, {size}: {latencies:?}");
        }
    }
    Ok(())
}

/// Samples from the onset until the right command is raised.
fn latency(kind: toy::Kind, size: f64, seed: u64) -> Option<usize> {
    let mut session = Session::new(toy::diagnoser()).ok()?;
    let mut flight = toy::Flight::new(9000 + seed);
    for _ in 0..500 {
        let (inputs, measured, twin) = flight.next(None);
        session.push(&inputs, &measured, &twin);
    }
    let fault = toy::Fault { actuator: 1, kind, size };
    (1..=1000).find(|_| {
        let (inputs, measured, twin) = flight.next(Some(fault));
        let raised = session.push(&inputs, &measured, &twin).raised;
        raised.is_some_and(|raised| (raised.actuator, raised.action) == (1, kind.action()))
    })
}
