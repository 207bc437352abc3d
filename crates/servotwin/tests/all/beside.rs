//! Mistakes of columns that show beside the twin.

use servotwin::beside::Comparisons;
use servotwin::system::{Sensor, System};
use servotwin::units::ATMOSPHERE_PA;
use servotwin_model::spec::Unit;

/// The sensors of the aileron after a motion, as `log` changes the twin's values.
fn after(log: impl Fn(usize, &mut [f64])) -> (System, Comparisons) {
    let system = System::default();
    let width = system.sensors.len();
    let mut found = Comparisons::new(width);
    for k in 0..400_usize {
        let wave = (0.05 * k as f64).sin();
        let value = |(place, sensor): (usize, &Sensor)| {
            let level = if sensor.unit == Unit::Pascal { 0.1 + 0.03 * place as f64 } else { 0.0 };
            let sign = if place % 2 == 0 { 1.0 } else { -1.0 };
            sensor.scale * (level + sign * (0.1 + 0.01 * place as f64) * wave)
        };
        let twin: Vec<f64> = system.sensors.iter().enumerate().map(value).collect();
        let mut measured = twin.clone();
        log(k, &mut measured);
        found.take(&measured, &twin);
    }
    (system, found)
}

fn place(system: &System, id: &str) -> usize {
    system.sensors.iter().position(|sensor| sensor.id == id).unwrap()
}

#[test]
fn exchanged_columns_are_found_as_a_pair_and_a_healthy_log_has_none() {
    let system = System::default();
    let [a, b] = ["p_a_1", "p_b_1"].map(|id| place(&system, id));
    let (system, found) = after(|_, values| values.swap(a, b));
    let sensors: Vec<&Sensor> = system.sensors.iter().collect();
    assert_eq!(found.exchanged(&sensors), [(a, b)]);
    let (_, healthy) = after(|_, _| ());
    assert_eq!(healthy.exchanged(&sensors), []);
    assert_eq!(healthy.without_atmosphere(&sensors), None);
    // A force fight that shifts each chamber to the level of the other is no exchange.
    let (_, fight) = after(|_, values| {
        let apart = 0.03 * 2.5e7;
        values[a] += apart;
        values[b] -= apart;
    });
    assert_eq!(fight.exchanged(&sensors), []);
    // A leak that makes both chambers alike is no exchange.
    let (_, leak) = after(|_, values| {
        let mean = 0.5 * (values[a] + values[b]);
        (values[a], values[b]) = (mean, mean);
    });
    assert_eq!(leak.exchanged(&sensors), []);
}

#[test]
fn all_pressures_without_the_atmosphere_are_recognized_and_one_of_them_is_not_enough() {
    let system = System::default();
    let sensors: Vec<&Sensor> = system.sensors.iter().collect();
    let pressures: Vec<usize> =
        (0..sensors.len()).filter(|&s| sensors[s].unit == Unit::Pascal).collect();
    for sign in [-1.0, 1.0] {
        let (_, found) = after(|k, values| {
            // Noise of a fifth of a bar.
            let noise_pa = 2e4 * (k as f64 * 7.7).sin();
            pressures.iter().for_each(|&p| values[p] += sign * ATMOSPHERE_PA + noise_pa);
        });
        assert_eq!(found.without_atmosphere(&sensors), Some((sign, pressures.clone())));
    }
    let (_, found) = after(|_, values| values[pressures[0]] -= ATMOSPHERE_PA);
    assert_eq!(found.without_atmosphere(&sensors), None);
}
