//! The README: its commands are understood, and its numbers stand in the measured results.

use super::Folder;
use super::book::{blocks, commands, is_understood};
use servotwin::prelude::*;

const REPOSITORY: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

fn read(file: &str) -> String {
    std::fs::read_to_string(format!("{REPOSITORY}/{file}"))
        .unwrap_or_else(|e| panic!("{file}: {e}"))
}

/// The text below a heading, up to the next one.
fn section<'t>(text: &'t str, heading: &str) -> &'t str {
    let (_, rest) = text.split_once(&format!("\n## {heading}\n")).expect("a heading");
    rest.split("\n## ").next().unwrap_or(rest)
}

/// The percentages of a text, as they are written.
fn percentages(text: &str) -> Vec<&str> {
    let number = |part: &'_ str| {
        part.rfind(|c: char| !c.is_ascii_digit() && c != '.').map_or(0, |at| at + 1)
    };
    let parts: Vec<&str> = text.split(" %").collect();
    parts[..parts.len() - 1].iter().map(|part| &part[number(part)..]).collect()
}

#[test]
fn the_program_understands_every_command_of_the_readme() {
    let folder = Folder::new("readme");
    let mut understood = 0;
    for (kind, text) in blocks(&read("README.md")) {
        if kind != "sh" {
            continue;
        }
        for line in commands(&text) {
            let line = line.replace("cargo run --release --", "servotwin");
            is_understood(&folder, &line);
            understood += usize::from(line.starts_with("servotwin "));
        }
    }
    assert!(understood >= 4, "{understood} commands");
}

/// The README's lines of Rust, which the compiler checks here; they would write a file.
#[expect(dead_code)]
#[rustfmt::skip]
fn lines_of_rust() -> Result<(), Box<dyn std::error::Error>> {
    let system = System::default();
    let leak = Simulation::new(&system).input("command", "step:size=5deg").fault("actuator_1.leakage_a.leakage", 0.5);
    leak.run()?.table()?.write("leak.csv")?;
    Ok(())
}

#[test]
fn the_compiler_has_checked_the_rust_of_the_readme() {
    let readme = read("README.md");
    let block = blocks(&readme).into_iter().find(|(kind, _)| kind == "rust").expect("Rust").1;
    for line in block.lines().filter(|line| !line.is_empty()) {
        assert!(include_str!("readme.rs").lines().any(|own| own.trim_start() == line), "{line}");
    }
}

#[test]
fn the_results_of_the_readme_stand_among_the_measured_ones() {
    let (readme, measured) = (read("README.md"), read("docs/measured.md"));
    let realistic = section(&measured, "Variants, scenario realistic");
    let found = percentages(section(&readme, "A study in one command"));
    assert_eq!(found.len(), 3, "{found:?}");
    for number in found {
        assert!(realistic.contains(&format!(" {number} % (")), "{number} %");
    }
}

#[test]
fn the_flights_of_the_readme_are_sums_of_the_measured_ones() {
    let (readme, measured) = (read("README.md"), read("docs/measured.md"));
    let flights = section(&measured, "Flights, scenario realistic");
    // An action's row: visible of flown, then right of visible in the third column.
    let row = |line: &str| -> Option<[u32; 2]> {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let [_, action, visible, _, isolated, ..] = cells[..] else { return None };
        let number = |text: &str, place: usize| text.split(" of ").nth(place)?.parse().ok();
        (!action.is_empty()).then_some([number(isolated, 0)?, number(visible, 1)?])
    };
    let rows: Vec<[u32; 2]> = flights.lines().filter_map(row).collect();
    let sum = |of: usize| rows.iter().map(|row| row[of]).sum::<u32>();
    let [right, shutdowns] = rows[0];
    let hours = flights.lines().find(|line| line.contains(" hours without a fault")).unwrap();
    for text in [
        format!("the right action comes first in {} of {}", sum(0), sum(1)),
        format!("{} of {shutdowns} shutdowns are missed", shutdowns - right),
        format!("no false alarm in {} hours", hours.split_whitespace().nth(1).unwrap()),
    ] {
        assert!(section(&readme, "A log in one command").contains(&text), "{text}");
    }
    assert!(hours.contains(" raised 0 false alarms"), "{hours}");
    let study = include_str!("../../../../studies/paper.toml");
    assert!(
        study.contains("{ air_speed = [0, 110],") && study.contains("{ air_speed = [160, 240],")
    );
}

#[test]
fn a_percentage_is_found_as_it_is_written() {
    assert_eq!(percentages("It is 99.5 %, not 0 % (1 of 3)."), ["99.5", "0"]);
}
