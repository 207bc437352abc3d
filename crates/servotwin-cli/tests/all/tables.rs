//! Tables as a test engineer brings them: what docs/tables.md says, command by command, and what the
//! commands say about tables that do not serve.

use crate::{Folder, json, servotwin, stderr, stdout};
use std::process::{Command, Output};

const DOCS: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../docs");

/// The fenced blocks of a document: what stands behind the fence, and the text.
fn blocks(document: &str) -> Vec<(String, String)> {
    let mut blocks = vec![];
    let mut lines = document.lines();
    while let Some(line) = lines.next() {
        if let Some(kind) = line.strip_prefix("```") {
            let text: Vec<&str> = lines.by_ref().take_while(|line| *line != "```").collect();
            blocks.push((kind.to_owned(), text.join("\n") + "\n"));
        }
    }
    blocks
}

fn servotwin_in(folder: &Folder, arguments: &[&str]) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_servotwin"));
    command.current_dir(&folder.0).args(arguments).output().expect("the binary can be run")
}

#[test]
fn every_command_of_the_document_works() {
    let folder = Folder::new("document");
    let document = std::fs::read_to_string(format!("{DOCS}/tables.md")).unwrap();
    let mut run = 0;
    for (kind, text) in blocks(&document) {
        if let Some((_, name)) = kind.split_once(' ') {
            std::fs::write(folder.file(name), text).unwrap();
            continue;
        }
        for line in text.lines().filter(|_| kind == "sh") {
            let arguments: Vec<&str> = line.split_whitespace().skip(1).collect();
            let output = servotwin_in(&folder, &arguments);
            assert!(output.status.success(), "{line}: {}", stderr(&output));
            run += 1;
            let (out, notes) = (stdout(&output), stderr(&output));
            let says = |text: &str, what: &str| assert!(text.contains(what), "{line}: {text}");
            match arguments[0] {
                "train" if line.contains("runs.csv") => {
                    says(&notes, "semicolons between cells, decimal commas");
                    says(&notes, "column 'run' is not used: it counts the rows");
                    says(&out, "always saying");
                }
                "train" if line.contains("windows.csv") => {
                    says(&out, "(52.91 % … 97.76 % at 95 %), 7 of 8 rows")
                }
                "predict" => says(&out, "(no answer)"),
                "explain" => says(&out, "(line 9): class is leak (right)"),
                _ => {}
            }
        }
    }
    assert_eq!(run, 9);
    let windows = servotwin::table::read(folder.file("windows.csv")).unwrap();
    let mean = windows.f64("mean_p").unwrap();
    let states = windows.text("state").unwrap().iter().zip(&*mean);
    let leaks: Vec<f64> = states.filter(|(state, _)| *state == "leak").map(|(_, m)| *m).collect();
    assert_eq!(leaks.len(), 2);
    assert!(leaks.iter().all(|mean| (mean + 0.04).abs() < 2e-3), "{mean:?}");
    let said = servotwin::table::read(folder.file("said.csv")).unwrap();
    assert_eq!(said.row_count(), 12);
    let page = std::fs::read_to_string(folder.file("runs.html")).unwrap();
    for part in ["12</td>", "seed 1", "rows of one rig together", "seal = worn", "Every group"] {
        assert!(page.contains(part), "{part}");
    }
    let page = std::fs::read_to_string(folder.file("judged.html")).unwrap();
    for part in ["judged by", "model.json", "Every group"] {
        assert!(page.contains(part), "{part}");
    }
    assert!(!page.contains("held out"), "a model is judged by every row");
}

fn write(folder: &Folder, name: &str, text: &str) -> String {
    let path = folder.file(name);
    std::fs::write(&path, text).unwrap();
    path
}

/// Rows of two classes in four batches, with a column that says which rows test.
fn table(head: &str, line: impl Fn(usize) -> String) -> String {
    (0..40).fold(format!("{head}\n"), |text, row| text + &line(row) + "\n")
}

#[test]
fn splits_by_a_column_and_by_a_second_file_are_the_same() {
    let folder = Folder::new("splits");
    let line = |row: usize| {
        let class = if row.is_multiple_of(2) { "good" } else { "bad" };
        let value = (row * 7 % 40) as f64 / 10.0 + if row.is_multiple_of(2) { 3.0 } else { 0.0 };
        format!("{value},{},{class}", row * 3 % 11)
    };
    let part = |row: usize| if row % 4 < 2 { "train" } else { "test" };
    let one = write(&folder, "one.csv", &table("x,y,class,part", |r| line(r) + "," + part(r)));
    let half = |name: &str, side: &str| {
        let rows: String = (0..40).filter(|r| part(*r) == side).map(|r| line(r) + "\n").collect();
        write(&folder, name, &format!("x,y,class\n{rows}"))
    };
    let (train, test) = (half("train.csv", "train"), half("test.csv", "test"));
    let by_column = json(&["--json", "train", &one, "--label", "class", "--split-column", "part"]);
    let by_file = json(&["--json", "train", &train, "--label", "class", "--test", &test]);
    assert_eq!(by_column["score"], by_file["score"]);
    assert_eq!(by_column["score"]["accuracy"]["of"], 20);
    assert_eq!(by_column["baseline"]["accuracy"], 0.5);
    let refused = |arguments: &[&str], what: &str| {
        let output = servotwin(&[&["train", &one, "--label", "class"], arguments].concat());
        assert!(!output.status.success() && stderr(&output).contains(what), "{}", stderr(&output));
    };
    refused(&["--split-column", "y"], "must hold 'train' and 'test'");
    refused(&["--split-column", "part", "--test-value", "x"], "must hold 'x'");
    refused(&["--split-column", "part", "--group", "y"], "is in training and in test");
    refused(&["--split-column", "part", "--folds", "3"], "cannot be used with");
}

#[test]
fn tables_that_do_not_serve_are_refused_with_their_line() {
    let folder = Folder::new("unfit");
    let text = table("x,class,batch", |row| {
        format!("{},{},{}", row * 7 % 13, if row.is_multiple_of(2) { "a" } else { "b" }, row % 4)
    });
    let refused = |text: &str, what: &str| {
        let path = write(&folder, "unfit.csv", text);
        let output = servotwin(&["train", &path, "--label", "class", "--group", "batch"]);
        assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
        assert!(stderr(&output).contains(what), "{}", stderr(&output));
    };
    refused(
        &text.replace("\n7,b,1", "\n7,,1"),
        "unfit.csv: line 3, column 'class': the row has no class",
    );
    refused(&text.replace("\n7,b,1", "\n7,b,"), "line 3, column 'batch': the row has no group");
    refused(
        &text.replace("\n7,b,1", "\ninf,b,1"),
        "unfit.csv: line 3, column 'x': inf is no finite",
    );
    let model = folder.file("model.json");
    let good = write(&folder, "good.csv", &text);
    let trained = servotwin(&["train", &good, "--label", "class", "--out", &model]);
    assert!(trained.status.success(), "{}", stderr(&trained));
    let other = write(&folder, "other.csv", &text.replace("\n7,b,1", "\n7,c,1"));
    let output = servotwin(&["evaluate", &other, "--model", &model]);
    let told =
        "line 3: column 'class' holds 'c', which the model was not trained with; it knows a, b";
    assert_eq!(output.status.code(), Some(3), "{}", stderr(&output));
    assert!(stderr(&output).contains(told), "{}", stderr(&output));
    // What an option asks for, and the table does not have, is wrong use.
    let wrong_use = |arguments: &[&str], what: &str| {
        let output = servotwin(arguments);
        assert_eq!(output.status.code(), Some(2), "{}", stderr(&output));
        assert!(stderr(&output).contains(what), "{}", stderr(&output));
    };
    let train = ["train", &good, "--label", "class", "--folds", "100"];
    wrong_use(&train, "100 folds asked for");
    wrong_use(&[&train[..], &["--group", "batch"]].concat(), "batch");
    wrong_use(&["explain", "800", "--table", &good, "--model", &model], "there is no row 800");
    let measured = table("x,class,batch", |row| format!("{row},{},{}", row as f64 * 0.3, row % 4));
    refused(&measured, "--label-limits");
}
