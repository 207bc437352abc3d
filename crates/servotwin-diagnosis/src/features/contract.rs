//! Contract tests for every family.

use super::*;
use alloc::collections::BTreeSet;
use alloc::format;

fn two_actuators() -> Sensors {
    sensors_of(2)
}

/// Sensors of each actuator: two pressures, ram, spool, supply, return and current.
const OF_A_UNIT: usize = 7;

fn sensors_of(actuators: usize) -> Sensors {
    let mut sensors = Vec::new();
    for actuator in 0..actuators {
        for (quantity, name) in
            Quantity::ALL.iter().filter(|(q, _)| !matches!(q, Quantity::Other | Quantity::Surface))
        {
            let name = format!("{name}_{}", actuator + 1);
            // An actuator's first sensors are its pressures and its ram.
            let first = sensors.len() / OF_A_UNIT * OF_A_UNIT;
            let follows = match quantity {
                Quantity::Spool => alloc::vec![(first, -0.5), (first + 1, 0.5), (first + 2, -6.0)],
                _ => alloc::vec![],
            };
            sensors.push(Sensor {
                name,
                quantity: *quantity,
                actuator: Some(actuator),
                noise: 0.002,
                is_noisy: true,
                follows,
            });
        }
    }
    Sensors(sensors)
}

fn and_surface(mut sensors: Sensors) -> Sensors {
    sensors.0.push(Sensor {
        name: "x_s".into(),
        quantity: Quantity::Surface,
        actuator: None,
        noise: 0.002,
        is_noisy: true,
        follows: alloc::vec![],
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

#[test]
fn names_are_unique_and_values_as_many() {
    for actuators in [1, 2, 3, MAX_ACTUATORS] {
        let sensors = and_surface(sensors_of(actuators));
        let window = some_window(&sensors);
        let mut names = BTreeSet::new();
        for family in ALL {
            let features = family.features(&sensors);
            let compares = ["comparison", "balance", "vote"].contains(&family.name);
            assert_eq!(features.is_empty(), actuators == 1 && compares, "{}", family.name);
            let values = family.values(&sensors, &window).len();
            assert_eq!(features.len(), values, "{} of {actuators}", family.name);
            for f in features {
                assert!(names.insert(f.name.clone()), "{} twice", f.name);
                assert!(!f.meaning.is_empty() && !f.unit.is_empty());
                assert!(f.actuators.iter().all(|&actuator| actuator < actuators));
            }
        }
    }
}

#[test]
fn the_paper_has_thirty_six_features() {
    let mut sensors = two_actuators();
    sensors.0.retain(|sensor| sensor.quantity != Quantity::Current);
    assert_eq!(ALL[0].features(&sensors).len(), 36);
}

#[test]
fn empty_and_healthy_windows_give_finite_numbers() {
    let sensors = and_surface(sensors_of(3));
    let n = sensors.0.len();
    let empty = Window::new(n);
    let mut healthy = Window::new(n);
    for _ in 0..10 {
        healthy.add(&alloc::vec![0.5; n], &alloc::vec![0.5; n], &alloc::vec![1.0; n]);
    }
    for family in ALL {
        for window in [&empty, &healthy] {
            let values = family.values(&sensors, window);
            assert!(values.iter().all(|v| v.is_finite()), "{}: {values:?}", family.name);
        }
    }
}

#[test]
fn no_family_is_inert() {
    let sensors = and_surface(sensors_of(3));
    let n = sensors.0.len();
    let disturbed = some_window(&sensors);
    let mut healthy = Window::new(n);
    healthy.add(&alloc::vec![0.5; n], &alloc::vec![0.5; n], &alloc::vec![1.0; n]);
    for family in ALL {
        let a = family.values(&sensors, &disturbed);
        let b = family.values(&sensors, &healthy);
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
        actuator: Some(0),
        noise: 0.002,
        is_noisy: true,
        follows: alloc::vec![],
    }]);
    let window = some_window(&sensors);
    for family in ALL {
        assert_eq!(family.features(&sensors).len(), family.values(&sensors, &window).len());
    }
}

/// A feature's name with every actuator number one lower, and the first one last.
fn named_one_place_down(name: &str, actuators: usize) -> alloc::string::String {
    let word = |word: &str| match word.parse::<usize>() {
        Ok(number) => format!("{}", (number + actuators - 2) % actuators + 1),
        Err(_) => word.into(),
    };
    name.split('_').map(word).collect::<Vec<_>>().join("_")
}

/// Seen from the second actuator, each feature appears under the lower actuator number.
#[test]
fn moving_three_actuators_round_moves_their_features_round() {
    const ACTUATORS: usize = 3;
    let sensors = and_surface(sensors_of(ACTUATORS));
    let window = some_window(&sensors);
    let moved = window.reordered(&sensors.rotated(ACTUATORS, 1).unwrap());
    let names: Vec<_> = features(&sensors).into_iter().map(|feature| feature.name).collect();
    let (seen, from_second) = (values(&sensors, &window), values(&sensors, &moved));
    for (name, value) in names.iter().zip(&seen) {
        let other = named_one_place_down(name, ACTUATORS);
        let place = names.iter().position(|known| *known == other);
        let place = place.unwrap_or_else(|| panic!("{name} has no {other}"));
        let difference = (value - from_second[place]).abs();
        assert!(difference < 1e-9, "{name}: {value}, {other}: {}", from_second[place]);
    }
}

/// Every view puts another actuator first, and each comes once.
#[test]
fn every_unit_stands_first_in_a_view_of_its_own() {
    let sensors = and_surface(sensors_of(4));
    let orders = sensors.rotations(4).unwrap();
    let first: Vec<_> = orders.iter().map(|order| sensors.0[order[0]].actuator).collect();
    assert_eq!(first, [Some(1), Some(2), Some(3)]);
    assert_eq!(two_actuators().rotations(2).unwrap(), [two_actuators().exchanged(0, 1).unwrap()]);
    let mut unlike = sensors_of(3);
    unlike.0.pop();
    assert_eq!(unlike.rotations(3), None);
    assert_eq!(sensors_of(1).rotations(1), Some(alloc::vec![]));
}

/// With three actuators, each is compared with the others, and only the faulty one stands out.
#[test]
fn of_three_actuators_the_one_that_deviates_stands_out() {
    let sensors = and_surface(sensors_of(3));
    let known = features(&sensors);
    for at_fault in 0..3 {
        let mut window = Window::new(sensors.0.len());
        for sample in 0..100 {
            let wave = libm::sin(f64::from(sample) * 0.3);
            let size = |s: &Sensor| match s.actuator {
                Some(actuator) if actuator == at_fault => 0.2,
                Some(_) => 0.05,
                None => 0.0,
            };
            let twin = alloc::vec![0.3 * wave; sensors.0.len()];
            let measured = sensors.0.iter().map(|s| 0.3 * wave + size(s) * (1.0 + 0.3 * wave));
            let measured: Vec<f64> = measured.collect();
            window.add(&measured, &twin, &alloc::vec![1.0; sensors.0.len()]);
        }
        let values = values(&sensors, &window);
        let value =
            |name: &str| values[known.iter().position(|feature| feature.name == name).unwrap()];
        for actuator in 0..3 {
            for name in ["mean_excess_ram", "dev_excess_pressure_a", "mean_gap", "vote_contrast"] {
                let value = value(&format!("{name}_{}", actuator + 1));
                assert_eq!(value > 0.0, actuator == at_fault, "{name} of {actuator}: {value}");
            }
        }
    }
}

#[test]
fn exchanging_actuators_turns_comparisons_round() {
    let sensors = two_actuators();
    let window = some_window(&sensors);
    let mirrored = window.reordered(&sensors.exchanged(0, 1).unwrap());
    let family = find("comparison").unwrap();
    let a = family.values(&sensors, &window);
    let b = family.values(&sensors, &mirrored);
    for (a, b) in a.iter().zip(&b) {
        assert!((a + b).abs() < 1e-12, "{a} {b}");
    }
}

/// The running diagnosis relies on this: the existing capacity suffices, and the values are the same.
#[test]
fn values_come_in_the_room_that_is_there() {
    let sensors = and_surface(sensors_of(3));
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
