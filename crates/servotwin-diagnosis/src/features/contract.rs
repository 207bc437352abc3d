//! Promises that every family keeps.

use super::*;
use alloc::collections::BTreeSet;
use alloc::format;

fn two_actuators() -> Sensors {
    let mut sensors = Vec::new();
    for unit in 0..2 {
        for (quantity, name) in
            Quantity::ALL.iter().filter(|(q, _)| !matches!(q, Quantity::Other | Quantity::Surface))
        {
            let name = format!("{name}_{}", unit + 1);
            sensors.push(Sensor {
                name,
                quantity: *quantity,
                unit: Some(unit),
                noise: 0.002,
                is_noisy: true,
            });
        }
    }
    Sensors(sensors)
}

fn with_surface() -> Sensors {
    let mut sensors = two_actuators();
    sensors.0.push(Sensor {
        name: "x_3".into(),
        quantity: Quantity::Surface,
        unit: None,
        noise: 0.002,
        is_noisy: true,
    });
    sensors
}

fn some_window(sensors: &Sensors) -> Window {
    let n = sensors.0.len();
    let mut window = Window::new(n);
    let mut random = 1u64;
    let mut next = || {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 11) as f64 / (1u64 << 53) as f64 - 0.4
    };
    for _ in 0..300 {
        let measured: Vec<f64> = (0..n).map(|_| next()).collect();
        let twin: Vec<f64> = (0..n).map(|_| next()).collect();
        window.add(&measured, &twin, &alloc::vec![2.0; n]);
    }
    window
}

fn compute(family: &dyn Family, sensors: &Sensors, window: &Window) -> Vec<f64> {
    let mut values = Vec::new();
    family.compute(sensors, window, &mut values);
    values
}

#[test]
fn names_are_unique_and_values_as_many() {
    let sensors = with_surface();
    let window = some_window(&sensors);
    let mut names = BTreeSet::new();
    for family in ALL {
        let features = family.features(&sensors);
        assert!(!features.is_empty(), "{}", family.name());
        assert_eq!(features.len(), compute(*family, &sensors, &window).len(), "{}", family.name());
        for f in features {
            assert!(names.insert(f.name.clone()), "{} twice", f.name);
            assert!(!f.meaning.is_empty() && !f.unit.is_empty());
        }
    }
}

#[test]
fn the_paper_has_thirty_six_features() {
    assert_eq!(ALL[0].features(&two_actuators()).len(), 36);
}

#[test]
fn empty_and_healthy_windows_give_finite_numbers() {
    let sensors = with_surface();
    let n = sensors.0.len();
    let empty = Window::new(n);
    let mut healthy = Window::new(n);
    for _ in 0..10 {
        healthy.add(&alloc::vec![0.5; n], &alloc::vec![0.5; n], &alloc::vec![1.0; n]);
    }
    for family in ALL {
        for window in [&empty, &healthy] {
            let values = compute(*family, &sensors, window);
            assert!(values.iter().all(|v| v.is_finite()), "{}: {values:?}", family.name());
        }
    }
}

#[test]
fn no_family_is_inert() {
    let sensors = with_surface();
    let n = sensors.0.len();
    let disturbed = some_window(&sensors);
    let mut healthy = Window::new(n);
    healthy.add(&alloc::vec![0.5; n], &alloc::vec![0.5; n], &alloc::vec![1.0; n]);
    for family in ALL {
        let a = compute(*family, &sensors, &disturbed);
        let b = compute(*family, &sensors, &healthy);
        let names = family.features(&sensors);
        for ((a, b), f) in a.iter().zip(&b).zip(names) {
            assert!(a != b, "{} does not move", f.name);
        }
    }
}

#[test]
fn unlike_sensors_give_only_what_needs_no_partner() {
    let sensors = Sensors(alloc::vec![Sensor {
        name: "flow".into(),
        quantity: Quantity::Other,
        unit: Some(0),
        noise: 0.002,
        is_noisy: true
    }]);
    let window = some_window(&sensors);
    for family in ALL {
        assert_eq!(family.features(&sensors).len(), compute(*family, &sensors, &window).len());
    }
}

#[test]
fn exchanging_actuators_turns_comparisons_round() {
    let sensors = two_actuators();
    let window = some_window(&sensors);
    let mirrored = window.reordered(&sensors.exchanged(0, 1).unwrap());
    let family = find("comparison").unwrap();
    let a = compute(family, &sensors, &window);
    let b = compute(family, &sensors, &mirrored);
    for (a, b) in a.iter().zip(&b) {
        assert!((a + b).abs() < 1e-12, "{a} {b}");
    }
}

/// What a diagnosis relies on while it runs: room that was there is used, and the same numbers come.
#[test]
fn values_come_in_the_room_that_is_there() {
    let sensors = with_surface();
    let window = some_window(&sensors);
    let expected = values(&sensors, &window);
    let mut room = Vec::with_capacity(expected.len());
    let start = room.as_ptr();
    for _ in 0..2 {
        values_into(&sensors, &window, &mut room);
        assert_eq!(room, expected);
    }
    assert_eq!(start, room.as_ptr());
    assert_eq!(features(&sensors).len(), expected.len());
}
