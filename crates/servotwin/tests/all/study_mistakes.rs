//! Study files: each broken one is told what is wrong, exactly as in the `.expected` file beside it.
//!
//! `UPDATE=1 cargo test -p servotwin --test all study_mistakes` writes the expected files anew.

use crate::golden;
use servotwin::built_in;
use servotwin::study::Study;
use servotwin::system::System;
use servotwin::template::{Like, Template};
use servotwin_io::toml_text::TomlError;

#[test]
fn broken_studies_are_told_what_is_wrong() {
    let parse = |text: &str, name: &str| Study::parse(text, name).map(drop);
    golden::assert_mistakes("tests/broken_studies", 9, parse);
}

/// The detail of the class, `leakage`, stands two lines above the fault and is part of its name.
#[test]
fn a_misspelt_fault_of_a_template_is_marked_where_it_stands() {
    for like in Like::ALL {
        let template = Template::new("trial", like).unwrap();
        let system = System::parse(&template.system(), "trial.toml").unwrap();
        let study = template.study();
        assert!(study.contains("detail = \"leakage\""), "{like:?}");
        let (right, wrong) = ("\"leakage_a.leakage\"", "\"leakage_x.leakage\"");
        let text = study.replace(right, wrong);
        let lines = text.lines().zip(1..);
        let (column, line) =
            lines.filter_map(|(text, n)| Some((text.find(wrong)?, n))).next().unwrap();
        let Err(TomlError::Mistakes { mistakes, .. }) =
            Study::parse_for(&text, "trial_study.toml", system)
        else {
            panic!("{like:?}: no mistake")
        };
        let places: Vec<_> = mistakes.iter().map(|m| (m.line, m.column, m.width)).collect();
        assert_eq!(places, [(line, column + 1, wrong.len())], "{like:?}");
    }
}

#[test]
fn a_temperature_at_which_a_liquid_would_be_too_soft_is_refused_where_it_is_varied() {
    let own = "kind = \"own\"\nbulk_modulus_pa = 6e8\nbulk_modulus_change = -1.6e7";
    let text = built_in::SYSTEMS[0].1.replace("kind = \"phosphate_ester\"", own);
    let soft = || System::parse(&text, "soft.toml").unwrap();
    let system = soft();
    let supply = system.parameter("actuator_1.supply.temperature_k").unwrap();
    let set = |kelvin| system.possible_with(&[(supply.0, supply.1, kelvin)]);
    let would_be = "at 345.65 K the bulk modulus of its liquid would be 8e7 Pa";
    let allowed = "allowed are 253.15 … 338.15 K; ";
    assert!(set(345.65).unwrap_err().ends_with(&format!("{allowed}{would_be}")));
    assert!(set(500.0).unwrap_err().ends_with("allowed are 253.15 … 338.15 K"));
    let study = |hot: &str| {
        let on_ground = built_in::STUDIES[0].1.replace("[233.15, 343.15]", "[253.15, 338.15]");
        let text = on_ground.replace("[253.15, 343.15]", &format!("[253.15, {hot}]"));
        Study::parse_for(&text, "hot.toml", soft()).err()
    };
    assert!(study("338.15").is_none());
    let Some(TomlError::Mistakes { mistakes, .. }) = study("345.65") else { panic!() };
    let told: Vec<String> = mistakes.iter().map(|mistake| mistake.message.clone()).collect();
    let field = "supply.temperature_k = 345.65 is out of range: allowed are";
    assert!(told[0].starts_with(field) && told[0].ends_with(would_be), "{told:?}");
    assert!(mistakes[0].source.contains("supply.temperature_k"), "{}", mistakes[0].source);
}

/// None of twelve draws comes near that end, and no ramp is flown for so long.
#[test]
fn draws_beyond_what_an_input_may_become_are_told_at_their_place() {
    let study = |from: &str, to: &str| {
        Study::parse(&built_in::STUDIES[2].1.replacen(from, to, 1), "drawn.toml").unwrap()
    };
    assert_eq!(study("", "").warnings_in_words(), [""; 0]);
    let told = study("to={0.04..0.1}m", "to={0.5..11.2}m").warnings_in_words();
    let beyond =
        "drawn.toml:88:27: 'to' is drawn up to 11.2 m, but 'command' may only become -10 … 10 m";
    assert_eq!(told, [beyond]);
}

/// A damaged file is told, whatever is left of it, and nothing that is told is built from it.
#[test]
fn damaged_studies_are_no_reason_to_panic() {
    let whole = built_in::STUDIES[1].1;
    let lines: Vec<&str> = whole.lines().collect();
    let mut told = 0;
    for skipped in (0..lines.len()).step_by(5) {
        let rest = lines.iter().enumerate().filter(|&(i, _)| i != skipped).map(|(_, line)| *line);
        if let Err(error) = Study::parse(&rest.collect::<Vec<_>>().join("\n"), "skipped.toml") {
            told += 1;
            let TomlError::Mistakes { mistakes, .. } = error else { panic!("{error}") };
            assert!(mistakes.iter().all(|mistake| mistake.line >= 1));
        }
    }
    assert!(told > 5, "{told}");
}

/// A readable study of one actuator: three signals by name, and whatever a test is about.
fn spring(intensities: &str, rest: &str) -> Result<Study, TomlError> {
    let text = format!(
        "format = 1\nname = \"tiny\"\ntitle = \"tiny\"\nsystem = \"spring_actuator\"\nduration_s = 4\nsample_hz = 100\n\
         intensities = {intensities}\nactuators = [\"\"]\n\
         command = {{ input = \"command\", signals.a = \"step:size=2deg\", signals.\"a/b\" = \"step:size=3deg\" }}\n\
         sensors.p_a = {{ quantity = \"pressure_a\", actuator = 1 }}\n\
         sensors.x_v = {{ quantity = \"spool\", actuator = 1 }}\n{rest}"
    );
    Study::parse(&text, "tiny.toml")
}

#[test]
fn a_study_whose_records_would_be_refused_is_incomplete_and_says_where() {
    let classes =
        "classes = [{ detail = \"leak\", action = \"stop\", faults = [\"leakage_a.leakage\"] }]\n";
    let flights = |repeats: usize| {
        format!(
            "[flights]\nduration_s = 6\nonset_s = [2, 3]\nwindows_s = [0.5]\ncommands = [\"step:size=2deg\"]\n\
             [suites]\n\
             learn = {{ environments = 1, repeats = {repeats}, healthy = 1 }}\n\
             judge = {{ environments = 1, repeats = 0, healthy = 1 }}\n"
        )
    };
    let realistic = "[realistic]\n";
    let refused = |intensities: &str, rest: &str| {
        let study = spring(intensities, rest).unwrap_or_else(|error| panic!("{error}"));
        study.complete().map_err(|error| error.to_string()).err().unwrap_or_default()
    };
    assert_eq!(refused("[0.5]", classes), "");
    assert_eq!(refused("[0.5]", &format!("{classes}{realistic}{}", flights(1))), "");
    let empty = refused("[]", classes);
    assert!(empty.starts_with("tiny.toml:7:15: 'intensities' is empty"), "{empty}");
    let none = refused("[0.5]", "");
    assert!(none.contains("the study has no faults") && none.contains("[[classes]]"), "{none}");
    let bare = refused("[0.5]", &format!("{classes}{}", flights(1)));
    assert!(bare.starts_with("tiny.toml:13:2: flights need the section 'realistic'"), "{bare}");
    let untaught = refused("[0.5]", &format!("{classes}{realistic}{}", flights(0)));
    assert!(
        untaught.contains("suites.learn.repeats = 0 is out of range: allowed are at least 1"),
        "{untaught}"
    );
}

#[test]
fn sensors_and_cases_that_results_could_not_tell_apart_are_refused() {
    let refused =
        |rest: &str| spring("[0.5]", rest).err().map(|e| e.to_string()).unwrap_or_default();
    let twice = refused("[extra_sensor]\nid = \"x_v\"\ntitle = \"again\"\n");
    assert!(twice.contains("13:6: the sensor 'x_v' stands twice"), "{twice}");
    let load = "[load]\ninput = \"supply_pressure\"\nvalues.\"b/c\" = 2e7\nvalues.c = 1.9e7\n";
    assert!(refused(load).contains("the case 'a/b/c' stands twice"), "{}", refused(load));
    let drawn = "[training]\nduration_s = 2\nsignals.T01 = \"step:size=2deg\"\n\
                 draws = [{ count = 1, signal = \"step:size=3deg\" }]\n";
    assert!(
        refused(drawn).contains("the training command 'T01' stands twice"),
        "{}",
        refused(drawn)
    );
}
