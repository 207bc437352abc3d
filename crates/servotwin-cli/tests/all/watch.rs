//! `watch` as its users run it: maps, streams, results, messages. What it finds is the runtime's business
//! and tested there.

use super::flights::learned;
use super::{Folder, json, met, servotwin, stderr, stdout};
use std::io::Write;
use std::process::{Child, Command, Stdio};

/// A flight as `simulate` writes it.
pub fn flight(folder: &Folder) -> String {
    flight_with(folder, "flight.csv", &[])
}

/// The same into a file, with more options.
fn flight_with(folder: &Folder, name: &str, more: &[&str]) -> String {
    let path = folder.file(name);
    let command = ["--command", "sine:amplitude=5deg,frequency=0.5Hz", "--duration", "8s"];
    let out = ["--rate", "50Hz", "--quiet", "--out", &path];
    let output = servotwin(&[&["simulate"], &command[..], &out, more].concat());
    assert!(output.status.success(), "{}", stderr(&output));
    path
}

/// The last samples before the repair were judged by windows of before, which raised the shutdown again for good.
#[test]
fn a_watch_that_goes_on_after_a_repair_judges_anew_once_its_alarm_is_reset() {
    let folder = Folder::new("watch-repair");
    let [study, model] = learned(&folder);
    let (log, checkpoint) = (folder.file("log.csv"), folder.file("c.json"));
    let fault = ["--fault", "actuator_1.servo_valve.bias_positive=1@3s"];
    let read = |path: String| std::fs::read_to_string(path).unwrap();
    let faulty = read(flight_with(&folder, "faulty.csv", &fault));
    let repaired = read(flight(&folder));
    let later = |row: &str| {
        let (time_s, rest) = row.split_once(',').unwrap();
        format!("{},{rest}\n", time_s.parse::<f64>().unwrap() + 100.0)
    };
    let whole = faulty.clone() + &repaired.lines().skip(1).map(later).collect::<String>();
    let with = ["--study", &study, "--model", &model, "--checkpoint", &checkpoint, "--json"];
    let changes = |rows: &str, more: &[&str]| {
        std::fs::write(&log, rows).unwrap();
        let output = servotwin(&[&["watch", &log], &with[..], more].concat());
        assert!(output.status.success(), "{}", stderr(&output));
        let text = stdout(&output);
        let lines = text.lines().map(|line| serde_json::from_str(line).unwrap());
        let lines: Vec<serde_json::Value> = lines.collect();
        lines.into_iter().filter(|line| line["document"].is_null()).collect::<Vec<_>>()
    };
    let shown = |finding: &serde_json::Value| {
        let text = |key: &str| finding[key].as_str().unwrap().to_owned();
        [text("state"), text("phase"), text("action")]
    };
    let raised = changes(&faulty, &[]);
    assert_eq!(shown(raised.last().unwrap()), ["isolated", "raised", "shut_down"]);
    let stored = std::fs::read(&checkpoint).unwrap();
    let standing = changes(&whole, &["--resume"]);
    assert_eq!(shown(standing.last().unwrap()), ["healthy", "raised", "shut_down"]);
    std::fs::write(&checkpoint, stored).unwrap();
    let reset = changes(&whole, &["--resume", "--reset"]);
    let shown: Vec<_> = reset.iter().map(shown).collect();
    assert_eq!(shown, [["no_data", "none", ""], ["healthy", "none", ""]]);
}

#[test]
fn a_flight_is_watched_from_its_file_and_from_a_stream() {
    let folder = Folder::new("watch");
    let log = flight(&folder);
    let [study, model] = learned(&folder);
    let with = ["--study", &study, "--model", &model];
    let (map, html) = (folder.file("map.toml"), folder.file("a.html"));
    let made = json(&["watch", &log, "--make-map", &map, "--json"]);
    assert_eq!((&made["verdict"]["sensors_found"], &made["time"]), (&13.into(), &true.into()));

    let run = |arguments: &[&str]| {
        let output = servotwin(&[arguments, &with].concat());
        assert!(output.status.success(), "{arguments:?}: {}", stderr(&output));
        stdout(&output)
    };
    let text = run(&["watch", &log, "--map", &map, "--json", "--html", &html]);
    let last = text.lines().last().unwrap();
    let summary: serde_json::Value = serde_json::from_str(last).unwrap();
    assert_eq!(summary["samples"], 401);
    assert!(summary["met"].as_array().unwrap().is_empty(), "{last}");
    assert!(std::fs::read_to_string(&html).unwrap().contains("from 0.00 s to 8.00 s"));

    let mut child = Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["watch", "-", "--map", &map, "--json", "--heartbeat", "0s"])
        .args(with)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let bytes = std::fs::read(&log).unwrap();
    child.stdin.take().unwrap().write_all(&bytes).unwrap();
    let streamed = child.wait_with_output().unwrap();
    assert!(streamed.status.success());
    assert_eq!(stdout(&streamed), text, "a stream says what its file says");

    // What no sensor shows is missing, and counted.
    let spiked = folder.file("spiked.csv");
    let rows = std::fs::read_to_string(&log).unwrap();
    let spike = |(row, line): (usize, &str)| {
        let mut cells: Vec<&str> = line.split(',').collect();
        match row {
            150 => cells[4] = "-1",
            250 => cells[2] = "1e300",
            _ => {}
        }
        cells.join(",") + "\n"
    };
    std::fs::write(&spiked, rows.lines().enumerate().map(spike).collect::<String>()).unwrap();
    let told = run(&["watch", &spiked, "--map", &map, "--json"]);
    let summary: serde_json::Value = serde_json::from_str(told.lines().last().unwrap()).unwrap();
    let missing = &summary["missing"];
    assert_eq!(met(&summary, "impossible")["count"], 2, "{summary}");
    assert_eq!(met(&summary, "impossible")["first"], "line 151: x_p_1 = -1 in SI");
    assert_eq!((&missing["x_p_1"], &missing["p_a_1"]), (&1.into(), &1.into()));
    assert_eq!(told.lines().count(), text.lines().count(), "the findings stay");

    // One row that is lost changes nothing; behind several nothing is judged, unless the inputs are to stand for them.
    let without = |lost: std::ops::Range<usize>, map: &str| {
        let left = rows.lines().enumerate().filter(|(row, _)| !lost.contains(row));
        let left = left.map(|(_, line)| line.to_owned() + "\n").collect::<String>();
        std::fs::write(&spiked, left).unwrap();
        run(&["watch", &spiked, "--map", map, "--json"])
    };
    assert!(!without(200..201, &map).contains("environment_invalid"));
    let lost = |map: &str| without(200..203, map);
    assert!(lost(&map).contains("environment_invalid"));
    let holding = folder.file("holding.toml");
    let text_of_map = std::fs::read_to_string(&map).unwrap();
    std::fs::write(&holding, text_of_map.replace(r#""rad" }"#, r#""rad", hold_s = 0.1 }"#))
        .unwrap();
    let told = lost(&holding);
    assert!(
        ["environment_invalid", "no_data", "raised"].iter().all(|word| !told.contains(word)),
        "{told}"
    );
}

/// A broker that ends with its test.
struct Broker(Child);

impl Drop for Broker {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The pipe of docs/watch.md. The broker keeps the messages for a client that subscribed before they came.
#[test]
fn val_mosquitto_messages_are_watched_through_a_pipe() {
    let folder = Folder::new("watch-mqtt");
    let (log, map, conf) = (flight(&folder), folder.file("map.toml"), folder.file("broker.conf"));
    let [study, model] = learned(&folder);
    let with = ["--map", &map, "--study", &study, "--model", &model, "--json"];
    json(&["watch", &log, "--make-map", &map, "--json"]);
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
    let port = free.local_addr().unwrap().port().to_string();
    drop(free);
    std::fs::write(&conf, format!("listener {port} 127.0.0.1\nallow_anonymous true\n")).unwrap();
    let path = std::env::var("PATH").unwrap_or_default() + ":/usr/sbin";
    let program = |name: &str| {
        let mut command = Command::new(name);
        command.env("PATH", &path).stderr(Stdio::null()).stdout(Stdio::null());
        command
    };
    let installed = "apt-get install mosquitto mosquitto-clients";
    let _broker = Broker(program("mosquitto").arg("-c").arg(&conf).spawn().expect(installed));
    let begun = std::time::Instant::now();
    while std::net::TcpStream::connect(format!("127.0.0.1:{port}")).is_err() {
        assert!(begun.elapsed().as_secs() < 60, "mosquitto does not start");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    let client = ["-p", &port, "-t", "rig/one", "-q", "1"];
    let kept = ["-i", "watch", "-c", "-F", "%p"];
    let publish = |more: &[&str]| {
        let input = std::fs::File::open(&log).unwrap();
        let sent = program("mosquitto_pub").args(client).args(more).stdin(input).status();
        assert!(sent.expect(installed).success());
    };
    publish(&["-r", "-m", "0,0,0,0 of yesterday"]);
    let subscribed = program("mosquitto_sub").args(client).args(kept).arg("-E").status();
    assert!(subscribed.expect(installed).success());
    publish(&["-l"]);
    let mut lines = program("mosquitto_sub")
        .args(client)
        .args(kept)
        .args(["-R", "-C", "402"])
        .stdout(Stdio::piped())
        .spawn()
        .expect(installed);
    let piped = Command::new(env!("CARGO_BIN_EXE_servotwin"))
        .args(["watch", "-", "--heartbeat", "0s"])
        .args(with)
        .stdin(lines.stdout.take().unwrap())
        .output()
        .unwrap();
    lines.wait().unwrap();
    assert!(piped.status.success(), "{}", stderr(&piped));
    let of_file = servotwin(&[&["watch", &log], &with[..]].concat());
    assert_eq!(stdout(&piped), stdout(&of_file), "messages say what their file says");
}

#[test]
fn without_a_diagnoser_the_aileron_is_watched_by_the_one_of_the_program() {
    let folder = Folder::new("watch-shipped");
    let here = |arguments: &[&str]| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_servotwin"));
        command.args(arguments).current_dir(&folder.0).output().unwrap()
    };
    let log = ["simulate", "--command", "1deg", "--duration", "2s", "-q", "--out", "a.csv"];
    assert!(here(&log).status.success());
    let watched = here(&["watch", "a.csv"]);
    let notes = stderr(&watched);
    assert!(watched.status.success() && notes.contains("comes with the program"), "{notes}");
    let text =
        "format = 1\nname = \"other\"\nsystem = \"aileron_dual\"\n[command]\ninput = \"command\"\n";
    std::fs::write(folder.file("other.toml"), text).unwrap();
    let other = stderr(&here(&["watch", "a.csv", "--study", "other.toml"]));
    assert!(other.contains("no such file") || other.contains("other.toml"), "{other}");
}

/// A table with dates as Parquet.
fn dated_parquet(folder: &Folder, csv: &str) -> String {
    let path = folder.file("dates.parquet");
    servotwin::table::Table::read(csv).unwrap().write(&path).unwrap();
    path
}

/// A table with dates as lines of JSON objects.
fn dated_lines(folder: &Folder, csv: &str) -> String {
    let text = std::fs::read_to_string(csv).unwrap();
    let mut rows = text.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let names = rows.next().unwrap();
    let object = |cells: Vec<&str>| {
        let value = |cell: &str| match cell.parse::<f64>() {
            Ok(number) => serde_json::json!(number),
            Err(_) => serde_json::json!(cell),
        };
        let pairs = names.iter().zip(cells).map(|(name, cell)| (name.to_string(), value(cell)));
        serde_json::Value::Object(pairs.collect()).to_string() + "\n"
    };
    let path = folder.file("dates.jsonl");
    std::fs::write(&path, rows.map(object).collect::<String>()).unwrap();
    path
}

#[test]
fn mistakes_in_watching_are_said_with_their_place() {
    let folder = Folder::new("watch-mistakes");
    let log = flight(&folder);
    let map = folder.file("map.toml");
    assert!(servotwin(&["watch", &log, "--make-map", &map]).status.success());
    let text = std::fs::read_to_string(&map).unwrap();
    let wrong = folder.file("wrong.toml");
    std::fs::write(&wrong, text.replace("p_a_1_pa", "p_a_1_bar")).unwrap();
    let [study, model] = learned(&folder);
    let with = ["--study", &study, "--model", &model];
    let rows = std::fs::read_to_string(&log).unwrap();
    let (header, dates) = (folder.file("header.csv"), folder.file("dates.csv"));
    std::fs::write(&header, rows.lines().next().unwrap()).unwrap();
    let dated = rows.lines().enumerate().map(|(row, line)| match row {
        0 => format!("{line}\n"),
        _ => format!(
            "2026-11-22T10:00:{:06.3}Z,{}\n",
            0.02 * row as f64,
            line.split_once(',').unwrap().1
        ),
    });
    std::fs::write(&dates, dated.collect::<String>()).unwrap();
    let spring = folder.file("spring.csv");
    let run =
        ["simulate", "spring_actuator", "--command", "1deg", "--duration", "1s", "-q", "--out"];
    assert!(servotwin(&[&run[..], &[&spring]].concat()).status.success());
    let other =
        format!("{model}: the diagnoser reads sensor 'p_a_1', which the study 'spring_actuator'");
    // A log without the numbers of sensors, and one that is too short.
    let (emptied, short) = (folder.file("emptied.csv"), folder.file("short.csv"));
    let head: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
    let alien = folder.file("alien.csv");
    std::fs::write(&alien, "Zeit,Druck\n0,1\n0.01,2\n").unwrap();
    let state = folder.file("c");
    let (alien_map, named_map) = (folder.file("alien.toml"), folder.file("named.toml"));
    let emptied_rows = rows.lines().map(|line| {
        let cell = |(cell, name): (&str, &&str)| match *name {
            "p_a_1_pa" | "p_b_1_pa" | "x_v_1_m" if cell != *name => String::new(),
            _ => cell.to_owned(),
        };
        line.split(',').zip(&head).map(cell).collect::<Vec<_>>().join(",") + "\n"
    });
    std::fs::write(&emptied, emptied_rows.collect::<String>()).unwrap();
    let reversed = folder.file("reversed.csv");
    let backwards: Vec<&str> = rows.lines().take(1).chain(rows.lines().rev()).collect();
    std::fs::write(&reversed, backwards.join("\n") + "\n").unwrap();
    let few: Vec<&str> = rows.lines().take(4).collect();
    std::fs::write(&short, few.join("\n") + "\n").unwrap();
    let cases: &[(&[&str], i32, &str)] = &[
        (&[&["watch", &header], &with[..]].concat(), 3, "nothing stands below the names"),
        (
            &[&["watch", &dates, "--map", &map], &with[..]].concat(),
            3,
            "unit = \"date\" below [time]",
        ),
        (&["watch", &spring, "--study", "spring_actuator", "--model", &model], 3, &other),
        (&["watch", &log, "--make-map", &map], 2, "exists already"),
        (&["watch", &alien, "--make-map", &alien_map], 3, "study 'paper' of the system"),
        (&["watch", &alien], 3, "it is taken where --study names none"),
        (&["watch", &alien, "--study", "press_axis"], 3, "--study names another"),
        (&["watch", &log, "--map", &wrong], 3, "has no column 'p_a_1_bar'"),
        (
            &[&["watch", &emptied], &with[..]].concat(),
            3,
            "without a value: p_a_1 in 401, p_b_1 in 401, x_v_1 in 401",
        ),
        (&[&["watch", &short], &with[..]].concat(), 3, "without a gap, the shortest window"),
        (&[&["watch", &reversed], &with[..]].concat(), 3, "too late: dropped in 400 of 401 lines"),
        (&["watch", "/nowhere/a.csv"], 3, "no such file"),
        // Outputs are looked at before a stream begins, and a checkpoint to continue from is an input.
        (&["watch", "-", "--map", &map, "--html", "/nowhere/a.html"], 1, "/nowhere does not exist"),
        (
            &["watch", "-", "--map", &map, "--checkpoint", "/nowhere/c"],
            1,
            "/nowhere does not exist",
        ),
        (&["watch", "-", "--map", &map, "--checkpoint", "/proc"], 1, "this is a folder"),
        (
            &[&["watch", &log, "--checkpoint", &state, "--resume"], &with[..]].concat(),
            3,
            "c: no such file",
        ),
        (&["watch", "ftp://rig"], 2, "names no source"),
        (&["watch", "udp://127.0.0.1:0"], 2, "needs --map"),
        (
            &["watch", "mqtt://me:geheim@rig/a", "--map", &map],
            2,
            "'mqtt://…@rig/a' names no source",
        ),
    ];
    // Of bytes that are no log little is shown, and nothing that a terminal would act on.
    let bytes: Vec<u8> =
        (0..4000_u32).map(|k| (k.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    std::fs::write(&alien, [&b"a\x1b[2J\x07,b\x00"[..], &bytes].concat()).unwrap();
    let told = stderr(&servotwin(&["watch", &alien]));
    assert!(told.chars().filter(|c| *c != '\n').all(|c| !c.is_control()), "{told:?}");
    assert!(told.len() < 2000 && told.contains("a\\u{1b}[2J"), "{told:?}");
    std::fs::write(&alien, "Zeit,Druck\n0,1\n0.01,2\n").unwrap();
    // What is to be filled in is written for a study that was named.
    let named = ["watch", &alien, "--study", "press_axis", "--make-map", &named_map];
    let output = servotwin(&named);
    assert!(output.status.success() && stderr(&output).contains("fill them in"), "{output:?}");
    assert!(std::fs::read_to_string(&named_map).unwrap().contains("# p_a = "));
    // Dates are found to be dates, in all kinds of files.
    let mut told = vec![];
    for log in [&dates, &dated_parquet(&folder, &dates), &dated_lines(&folder, &dates)] {
        let found = servotwin(&[&["watch", log, "--json"], &with[..]].concat());
        let (text, notes) = (stdout(&found), stderr(&found));
        let summary: serde_json::Value =
            serde_json::from_str(text.lines().last().unwrap_or_default()).unwrap();
        assert_eq!(summary["samples"], 401, "{log}: {notes}");
        assert!(
            !notes.contains("is assumed") && !notes.contains("column with the time"),
            "{notes}"
        );
        told.push(text.lines().filter(|line| line.contains("time_s")).count());
    }
    assert!(told[0] > 0 && told.iter().all(|count| *count == told[0]), "{told:?}");
    // Sensors that the log lacks are named, with the columns that may be them: without one less is judged, without
    // most of an actuator's nothing.
    let renamed = folder.file("renamed.csv");
    let without = |columns: &[&str]| {
        let other =
            |rows: String, column: &&str| rows.replacen(*column, &format!("other_{column}"), 1);
        std::fs::write(&renamed, columns.iter().fold(rows.clone(), other)).unwrap();
        servotwin(&[&["watch", &renamed], &with[..]].concat())
    };
    let output = without(&["x_v_2_m"]);
    let told = stderr(&output);
    for part in ["less can be judged without x_v_2,", "no sensor: other_x_v_2_m"] {
        assert!(told.contains(part), "{told}");
    }
    assert!(output.status.success(), "{told}");
    let output = without(&["p_a_2_pa", "p_b_2_pa", "x_p_2_m"]);
    let told = stderr(&output);
    let unjudged =
        "nothing could be judged, every period is 'no data': the log has no p_a_2, p_b_2, x_p_2";
    assert!(told.contains(unjudged), "{told}");
    assert_eq!(output.status.code(), Some(3), "{told}");
    assert!(stdout(&output).contains("401 lines became 401 samples"), "{}", stdout(&output));
    for (arguments, code, message) in cases {
        let output = servotwin(arguments);
        let text = stderr(&output);
        assert_eq!(output.status.code(), Some(*code), "{arguments:?}: {text}");
        assert!(text.contains(message), "{arguments:?}: {text}");
        assert!(!text.contains("panicked"), "{arguments:?}: {text}");
    }
}

/// A log with one column renamed, or its numbers changed.
fn rewritten(rows: &str, column: &str, name: &str, factor: f64) -> String {
    let place = rows.lines().next().unwrap().split(',').position(|n| n == column).unwrap();
    let line = |(row, line): (usize, &str)| {
        let mut cells: Vec<String> = line.split(',').map(str::to_owned).collect();
        cells[place] = match row {
            0 => name.to_owned(),
            _ => format!("{:e}", factor * cells[place].parse::<f64>().unwrap()),
        };
        cells.join(",") + "\n"
    };
    rows.lines().enumerate().map(line).collect()
}

#[test]
fn what_speaks_against_a_log_is_told_with_its_likely_reason() {
    let folder = Folder::new("watch-doubts");
    let rows = std::fs::read_to_string(flight(&folder)).unwrap();
    let [study, model] = learned(&folder);
    let log = folder.file("doubtful.csv");
    let watch = |rows: &str, more: &[&str]| {
        std::fs::write(&log, rows).unwrap();
        let first = ["watch", &log, "--study", &study, "--model", &model];
        let output = servotwin(&[&first[..], more].concat());
        (output.status.code(), stdout(&output), stderr(&output))
    };
    let every_second: String = rows
        .lines()
        .enumerate()
        .filter(|(row, _)| row % 2 == 0)
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    let of = |column: &str, factor: f64| rewritten(&rows, column, column, factor);
    let renamed = rewritten(&rows, "command_rad", "set_point", 1.0);
    let swapped = |one: &str, other: &str| {
        let (head, below) = rows.split_once('\n').unwrap();
        let name = |name: &str| match name {
            name if name == one => other.to_owned(),
            name if name == other => one.to_owned(),
            name => name.to_owned(),
        };
        head.split(',').map(name).collect::<Vec<_>>().join(",") + "\n" + below
    };
    let head: Vec<&str> = rows.lines().next().unwrap().split(',').collect();
    let gauge = rows.lines().enumerate().map(|(row, line)| {
        let cell = |(cell, name): (&str, &&str)| match name.ends_with("_pa") && row > 0 {
            true => (cell.parse::<f64>().unwrap() - 101_325.0).to_string(),
            false => cell.to_owned(),
        };
        line.split(',').zip(&head).map(cell).collect::<Vec<_>>().join(",") + "\n"
    });
    let gauge: String = gauge.collect();
    let lost: String = rows
        .lines()
        .enumerate()
        .filter(|(row, _)| *row != 200)
        .map(|(_, line)| format!("{line}\n"))
        .collect();
    let cases: &[(&str, i32, &[&str])] = &[
        (&rows, 0, &[]),
        (
            &renamed,
            3,
            &["no column is the input 'command'", "found for: set_point;", "{ value = 0.0"],
        ),
        (&of("command_rad", 1.0_f64.to_degrees()), 3, &["nothing could be judged", "in degrees"]),
        (&of("time_s", 1e3), 3, &["its times seem to be in ms"]),
        (&every_second, 3, &["usually 0.04 s apart", "log at 50 Hz", "at 25 Hz (sample_hz"]),
        (&of("x_p_1_m", 1e3), 3, &["x_p_1 seems to be in mm, not m: it is 1000 times"]),
        (&of("p_a_1_pa", 1e-5), 3, &["p_a_1 seems to be in bar or kgf/cm² or atm, not Pa"]),
        (&of("x_p_1_m", 1.0 / 25.4), 3, &["x_p_1 seems to be inches read as mm", "factor = 25.4"]),
        (&of("command_rad", 1.0_f64.to_radians()), 3, &["command seems to be rad read as degrees"]),
        (&of("x_p_1_m", -1.0), 3, &["x_p_1 moves against the twin", "factor = -1"]),
        (&of("command_rad", -1.0), 3, &["move against the twin: the sign of the command"]),
        (&swapped("p_a_1_pa", "p_b_1_pa"), 3, &["p_a_1 and p_b_1 look exchanged"]),
        (&swapped("p_s_2_pa", "p_t_2_pa"), 3, &["p_s_2 and p_t_2 look exchanged"]),
        (&gauge, 3, &["all one atmosphere below the twin", "barg"]),
        (&lost, 0, &["command has no value in 1 of 401 periods", "hold_s"]),
    ];
    for (rows, code, parts) in cases {
        let (found, text, told) = watch(rows, &[]);
        assert_eq!(found, Some(*code), "{parts:?}: {told}");
        assert!(parts.iter().all(|part| told.contains(part)), "{parts:?}: {told}");
        assert!(!parts.is_empty() || !told.contains("warning"), "{told}");
        assert!(!told.contains("p_a_1 moves against"), "a pressure has no sign: {told}");
        assert!(text.lines().count() < 40, "what goes to and fro is folded: {text}");
    }
    // A command that is meant to stand still is said to do so.
    let map = folder.file("constant.toml");
    std::fs::write(&log, &renamed).unwrap();
    let made = ["watch", &log, "--study", &study, "--make-map", &map];
    assert!(servotwin(&made).status.success());
    let (found, _, told) = watch(&renamed, &["--map", &map]);
    assert_eq!(found, Some(3), "{told}");
    let text = std::fs::read_to_string(&map).unwrap();
    std::fs::write(&map, text.replace("# command = ", "command = ")).unwrap();
    let (found, _, told) = watch(&renamed, &["--map", &map]);
    assert_eq!(found, Some(0), "{told}");
}

#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_is_told_with_the_file_that_is_on_it() {
    let folder = Folder::new("watch-full");
    let log = flight(&folder);
    let [study, model] = learned(&folder);
    let with = ["watch", &log, "--study", &study, "--model", &model, "--events", "/dev/full"];
    let output = servotwin(&with);
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr(&output).contains("/dev/full: the disk is full"), "{}", stderr(&output));
}
