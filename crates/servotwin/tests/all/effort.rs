//! What records say of the simulations themselves: which ring, and which began on the move.

use crate::folder::Folder;
use servotwin::job::Folder as Results;
use servotwin::job::manifest;
use servotwin::parallel::Workers;
use servotwin::records::Records;
use servotwin::study::{Purpose, Scenario, Study};
use servotwin::table::Table;

const FAULTS: &str = "\n[[classes]]\ndetail = \"part\"\naction = \"warning\"\nfaults = \
    [\"servo_valve.damping_loss\", \"sensor_ram.lag\", \"servo_valve.gain_low\"]\n\
    [realistic]\nhealthy = 2\ntolerances = []\n";

fn study() -> Study {
    let text = include_str!("../tiny.toml").replace("0.4, 0.6, 0.8, 1.0", "0.4, 1.0");
    let text = text.replace("[load]", "signals.held = \"5deg\"\n[load]");
    Study::parse(&(text + FAULTS), "tiny.toml").unwrap()
}

/// The data sets that one simulation gives, with perfect sensors and with noise.
fn data_sets(study: &Study, folder: &Folder) -> [Table; 2] {
    let scenarios = [Scenario::Ideal, Scenario::Noise];
    let suite = (Purpose::Test, scenarios.into());
    let records = Records::new(&folder.0, study, suite, Workers::new(2)).unwrap();
    let outcome = records.run(&|_, _| ()).unwrap();
    assert!(outcome.failed.is_empty(), "{:?}", outcome.failed);
    scenarios.map(|scenario| {
        Table::read(folder.file(&format!("dataset-{}.parquet", scenario.name()))).unwrap()
    })
}

/// The kinds and intensities that a column flags under a command.
fn flagged(table: &Table, column: &str, command: &str) -> Vec<(String, f64)> {
    let (kinds, intensities) = (table.text("kind").unwrap(), table.f64("intensity").unwrap());
    let (flags, flown) = (table.bool(column).unwrap(), table.text("flown").unwrap());
    let rows = (0..table.row_count()).filter(|&row| flags[row] && flown[row] == command);
    rows.map(|row| (kinds[row].clone(), intensities[row])).collect()
}

#[test]
fn a_limit_cycle_is_flagged_in_both_units_and_all_settings() {
    let (study, folder) = (study(), Folder::new("effort"));
    for table in data_sets(&study, &folder) {
        // The valve without damping rings for ever. Away from the center the loop whose sensor answers late comes to
        // rest, but long implicit steps alone do not find it.
        let both = |kind: &str| vec![(kind.to_owned(), 1.0); 2];
        assert_eq!(flagged(&table, "rings", "S1"), both("servo_valve.damping_loss"));
        for command in ["S1", "held"] {
            assert_eq!(flagged(&table, "began_on_the_move", command), []);
            assert_eq!(flagged(&table, "limit_cycle", command), []);
        }
        // Steps end on every sample.
        let steps = table.f64("steps_per_s").unwrap();
        let least = study.sample_period_s.recip() - 1e-9;
        assert!(steps.iter().all(|&steps| steps >= least), "{steps:?}");
    }
}

#[test]
fn the_manifest_counts_what_data_sets_hold() {
    let (study, folder) = (study(), Folder::new("effort-manifest"));
    let tables = data_sets(&study, &folder);
    for name in ["study.toml", "system.toml"] {
        std::fs::write(folder.file(name), "").unwrap();
    }
    let manifest = manifest::write(&Results::new(&folder.0), &study).unwrap();
    assert_eq!(manifest.data_sets.len(), tables.len());
    for (counted, table) in manifest.data_sets.iter().zip(&tables) {
        let rows = 0..table.row_count();
        let (kinds, seen) = (table.text("kind").unwrap(), table.bool("detectable").unwrap());
        let healthy = rows.clone().filter(|&row| kinds[row] == "healthy").count();
        let hidden = rows.filter(|&row| kinds[row] != "healthy" && !seen[row]).count();
        let expected = (table.row_count(), healthy, hidden);
        assert_eq!((counted.variants, counted.healthy, counted.undetectable), expected);
        assert!(counted.failed.is_empty() && hidden > 0);
    }
}

#[test]
fn a_damaged_part_is_named_and_made_anew() {
    let (study, folder) = (study(), Folder::new("damaged"));
    let before = data_sets(&study, &folder);
    let part = folder.file("parts/noise-0000.parquet");
    let whole = std::fs::read(&part).unwrap();
    let suite = (Purpose::Test, vec![Scenario::Noise]);
    let stored = Records::new(&folder.0, &study, suite, Workers::new(1)).unwrap();
    let mut named = 0;
    for place in (0..whole.len()).step_by(whole.len().div_ceil(20)) {
        let mut bytes = whole.clone();
        bytes[place] ^= 4;
        std::fs::write(&part, bytes).unwrap();
        match stored.windows() {
            // A bit of the file that holds no value, such as a statistic of a column.
            Ok(_) => assert!(data_sets(&study, &folder) == before),
            Err(error) => {
                let error = error.to_string();
                assert!(error.contains("noise-0000.parquet is damaged"), "{error}");
                named += 1;
            }
        }
    }
    assert!(named > 5, "{named} of 20");
    std::fs::write(&part, &whole[..whole.len() / 2]).unwrap();
    assert!(data_sets(&study, &folder) == before);
}
