//! Mistakes of columns that show beside the twin.

use servotwin::beside::{Comparisons, SensorColumn};
use servotwin::system::{Sensor, System};
use servotwin::units::{self, ATMOSPHERE_PA, NamedUnit};
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

/// The sensors of the aileron in SI; those that `other` names are read in its unit.
fn columns<'s>(system: &'s System, other: &[(&str, &str)]) -> Vec<SensorColumn<'s>> {
    let column = |(place, sensor): (usize, &Sensor)| {
        let given = other.iter().find(|(id, _)| *id == sensor.id);
        let unit =
            given.map_or(NamedUnit::of_si(sensor.unit), |(_, unit)| units::exactly(unit).unwrap());
        SensorColumn::new(system, place, unit)
    };
    system.sensors.iter().enumerate().map(column).collect()
}

/// All mistakes after a motion, for a log whose sensors of these ids are read in these units.
fn told(other: &[(&str, &str)], log: impl Fn(usize, &mut [f64])) -> String {
    let (system, found) = after(log);
    found.mistakes(&columns(&system, other)).join("; ")
}

fn place(id: &str) -> usize {
    System::default().sensors.iter().position(|sensor| sensor.id == id).unwrap()
}

#[test]
fn exchanged_columns_are_found_in_pairs_and_cycles_and_a_healthy_log_has_none() {
    let [a, b, x, y] = ["p_a_1", "p_b_1", "x_p_1", "x_p_3"].map(place);
    let look = |log: &dyn Fn(&mut [f64])| told(&[], |_, values| log(values));
    assert_eq!(look(&|_| ()), "");
    let pair = "p_a_1 and p_b_1 look exchanged: each follows the twin of the other";
    assert_eq!(look(&|values| values.swap(a, b)), pair);
    assert!(look(&|values| values.swap(x, y)).contains("x_p_1 and x_p_3 look exchanged"));
    let s = place("p_s_1");
    let cycle =
        look(&|values| (values[a], values[b], values[s]) = (values[b], values[s], values[a]));
    assert_eq!(cycle, "p_a_1, p_b_1 and p_s_1 look exchanged: each follows the twin of the next");
    // A force fight that shifts each chamber to the level of the other is no exchange.
    let fight = look(&|values| {
        let apart = 0.03 * 2.5e7;
        values[a] += apart;
        values[b] -= apart;
    });
    assert_eq!(fight, "");
    // A leak that makes both chambers alike is no exchange.
    let leak = look(&|values| {
        let mean = 0.5 * (values[a] + values[b]);
        (values[a], values[b]) = (mean + 1e3, mean - 1e3);
    });
    assert_eq!(leak, "");
}

#[test]
fn one_pressure_without_the_atmosphere_is_in_doubt_while_nothing_moves() {
    let (system, pressure) = (System::default(), place("p_a_1"));
    let looks = |offset_pa: f64| {
        let twin: Vec<f64> = system.sensors.iter().map(|sensor| 0.2 * sensor.scale).collect();
        let mut measured = twin.clone();
        measured[pressure] += offset_pa;
        let mut found = Comparisons::new(twin.len());
        (0..400).for_each(|_| found.take(&measured, &twin));
        let columns = columns(&system, &[]);
        (found.mistakes(&columns).join("; "), found.atmosphere_at_rest(&columns))
    };
    let (certain, doubt) = looks(-ATMOSPHERE_PA);
    let doubt = doubt.unwrap();
    assert_eq!(certain, "");
    assert!(doubt.starts_with("p_a_1 is one atmosphere below the twin"), "{doubt}");
    assert!(doubt.ends_with("an offset of a faulty sensor looks the same"), "{doubt}");
    assert_eq!(looks(-0.5 * ATMOSPHERE_PA).1, None);
    assert_eq!(looks(0.0).1, None);
}

#[test]
fn pressures_without_the_atmosphere_are_recognized_all_of_them_or_some() {
    let pressures: Vec<usize> = {
        let system = System::default();
        (0..system.sensors.len()).filter(|&s| system.sensors[s].unit == Unit::Pascal).collect()
    };
    // Noise of a fifth of a bar.
    let noise_pa = |k: usize| 2e4 * (k as f64 * 7.7).sin();
    for (sign, where_is) in [(-1.0, "below"), (1.0, "above")] {
        let all = told(&[], |k, values| {
            pressures.iter().for_each(|&p| values[p] += sign * ATMOSPHERE_PA + noise_pa(k));
        });
        assert!(all.contains(&format!("are all one atmosphere {where_is} the twin")), "{all}");
    }
    let one = |other: &[(&str, &str)], change_pa: f64| {
        told(other, |k, values| values[pressures[0]] += change_pa + noise_pa(k))
    };
    assert!(one(&[], -ATMOSPHERE_PA).contains("p_a_1 is one atmosphere below the twin"));
    // Only what is read as a gauge pressure can be too large by an atmosphere.
    assert_eq!(one(&[], ATMOSPHERE_PA), "");
    assert!(one(&[("p_a_1", "barg")], ATMOSPHERE_PA).contains("p_a_1 is one atmosphere above"));
    // A unit that states absolute is believed.
    assert_eq!(one(&[("p_a_1", "bara")], -ATMOSPHERE_PA), "");
    assert_eq!(one(&[("p_a_1", "psia")], ATMOSPHERE_PA), "");
    // The bias of a sensor is no atmosphere.
    assert_eq!(one(&[], -2.0 * ATMOSPHERE_PA), "");
    assert_eq!(one(&[], -0.5 * ATMOSPHERE_PA), "");
    // Nor is a leak by which a chamber loses a bar and moves a little farther than its twin.
    let leak = told(&[], |k, values| {
        let wave = (0.05 * k as f64).sin();
        values[pressures[0]] += 0.003 * 2.5e7 * wave - ATMOSPHERE_PA + noise_pa(k);
    });
    assert_eq!(leak, "");
}

#[test]
fn a_ratio_of_units_is_told_and_the_gain_of_a_faulty_sensor_is_not() {
    let of = |id: &str, unit: &str, factor: f64| {
        let place = place(id);
        told(&[(id, unit)], |_, values| values[place] *= factor)
    };
    for (id, unit, factor, parts) in [
        ("x_p_1", "m", 1e3, ["to be in mm, not m", "1000 times"]),
        ("x_p_1", "mm", 1.0 / 25.4, ["to be in inches, not mm", "0.0394 times"]),
        ("x_p_1", "mm", 0.1, ["to be in cm, not mm", "0.1 times"]),
        ("x_p_1", "m", 1.0 / 25.4, ["to be inches read as mm", "factor = 25.4"]),
        ("x_p_1", "cm", 1.0 / 2.54, ["to be in inches, not cm", "0.394 times"]),
        ("p_a_1", "psi", 1.0 / 14.5038, ["to be in bar or", "not psi"]),
        ("p_a_1", "bar", 14.5038, ["to be in psi, not bar", "14.5 times"]),
    ] {
        let said = of(id, unit, factor);
        assert!(parts.iter().all(|part| said.contains(part)), "{id} {unit} {factor}: {said}");
    }
    for gain in [0.45, 0.5, 0.8, 0.95, 0.99, 1.05, 1.2, 2.0] {
        for (id, unit) in [("x_p_1", "mm"), ("p_a_1", "psi"), ("p_s_1", "bar"), ("x_v_1", "in")] {
            assert_eq!(of(id, unit, gain), "", "{id} {unit} {gain}");
        }
    }
}

#[test]
fn a_copy_of_a_sensor_is_told_and_two_sensors_that_are_alike_or_stuck_are_not() {
    let [a, b, x, y] = ["p_a_1", "p_b_1", "x_p_1", "x_p_3"].map(place);
    let look = |log: &dyn Fn(usize, &mut [f64])| told(&[], log);
    let copied = look(&|_, values| values[b] = values[a]);
    assert!(copied.starts_with("p_a_1 and p_b_1 have the same values: one is a copy"), "{copied}");
    let copied = look(&|_, values| values[y] = values[x]);
    assert!(copied.starts_with("x_p_1 and x_p_3 have the same values"), "{copied}");
    // One different value, or two sensors at the end of their range, are no copy.
    let alike = look(&|k, values| values[b] = values[a] + if k == 399 { 1e3 } else { 0.0 });
    assert!(!alike.contains("copy"), "{alike}");
    let stuck = look(&|_, values| (values[a], values[b]) = (0.0, 0.0));
    assert!(!stuck.contains("copy"), "{stuck}");
}
