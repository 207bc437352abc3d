//! The trees of a diagnoser of recordings as C99: each takes the features of a window and returns the number of a class.

use crate::error::ExportError;
use crate::notation::{quoted, write_array, write_list, write_numbers};
use crate::source_file::SourceFile;
use servotwin_diagnosis::classifiers::Model;
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::hierarchy::{Question, Stage};
use servotwin_diagnosis::tree::Tree;

const HEAD: &str = "/* Trained by servotwin; do not edit. */\n";

/// Walks a tree. A child comes after its parent, so a node without a left child is a leaf. A missing value is NaN.
const WALK: &str = "
static int walk(const double *row, const int *feature, const double *threshold, const int *left, const int *right,
                const int *missing_left) {
    int node = 0;
    while (left[node] > 0) {
        const double value = row[feature[node]];
        const int goes_left = missing_left[node] ? !(value > threshold[node]) : value <= threshold[node];
        node = goes_left ? left[node] : right[node];
    }
    return node;
}
";

/// The header and the source of the decision tree of a diagnoser. Forests are not exported.
///
/// # Errors
/// [`ExportError::Unsupported`] if it has no decision tree.
pub fn files(diagnoser: &Diagnoser) -> Result<[SourceFile; 2], ExportError> {
    let (trees, named) = (&diagnoser.lengths[0].panel.trees, diagnoser.names());
    let stage = trees.stage(Question::Actuator, 0, 0);
    let Some(Stage { place, classes, model: Model::Cart(tree), .. }) = stage else {
        return Err(ExportError::Unsupported(
            "the diagnoser of recordings has no decision tree (cart)",
        ));
    };
    let class = |&class: &u32| named.class_name(place.question, class).to_owned();
    let classes: Vec<String> = classes.iter().map(class).collect();
    let header = format!(
        "{HEAD}#ifndef SERVOTWIN_RECORDING_H\n#define SERVOTWIN_RECORDING_H\n\n#define SERVOTWIN_FEATURES {}\n\n\
         /* The names of the features of a row, in their order, and of the classes. */\n\
         extern const char *const servotwin_feature_names[{0}];\n\
         extern const char *const servotwin_classes[{}];\n\n\
         /* The number of the class of a row. */\n\
         int servotwin_answer(const double row[SERVOTWIN_FEATURES]);\n\n#endif\n",
        named.features.len(),
        classes.len()
    );
    let mut source = format!("{HEAD}#include \"servotwin_recording.h\"\n{WALK}");
    let names = |names: &[String]| names.iter().map(|name| quoted(name)).collect::<Vec<_>>();
    write_list(&mut source, "char *const", "feature_names", &names(&named.features), "0");
    write_list(&mut source, "char *const", "classes", &names(&classes), "0");
    write_tree(&mut source, tree);
    Ok([
        SourceFile { name: "servotwin_recording.h", text: header },
        SourceFile { name: "servotwin_recording.c", text: source },
    ])
}

fn write_tree(text: &mut String, tree: &Tree) {
    let nodes = || 0..tree.nodes();
    let split = |node: usize| tree.split(node).unwrap_or((0, 0.0));
    let children = |node: usize| tree.children(node).unwrap_or((0, 0));
    text.push('\n');
    write_array(text, "int", "feature", nodes().map(|node| split(node).0));
    // A question whether there is a value has a threshold above all numbers.
    let limit = |node: usize| split(node).1.clamp(f64::MIN, f64::MAX);
    write_numbers(text, "threshold", nodes().map(limit));
    write_array(text, "int", "left", nodes().map(|node| children(node).0));
    write_array(text, "int", "right", nodes().map(|node| children(node).1));
    let missing = |node: usize| u8::from(tree.branches().missing_left(node));
    write_array(text, "int", "missing_left", nodes().map(missing));
    write_array(text, "int", "decision", nodes().map(|node| tree.decision(node)));
    *text += "
int servotwin_answer(const double row[SERVOTWIN_FEATURES]) {
    return decision[walk(row, feature, threshold, left, right, missing_left)];
}
";
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::compile::{Workplace, compilers};
    use servotwin::parallel::Workers;
    use servotwin::recordings::RecordingStudy;
    use servotwin::table::{Column, Table};
    use servotwin_diagnosis::classifiers::Classifier;
    use std::process::Command;

    const STUDY: &str = "format = 1\nwindow_rows = 3\nresiduals = [\"y\", \"z\"]\nfamilies = [\"moments\", \"deviation\"]\n\
        [[targets]]\ncolumn = \"state\"\n";

    /// Three states that overlap; z is silent in every fourth window.
    fn records() -> Table {
        let rows = 0..900_usize;
        let y = |row: usize| (row * 37 % 101) as f64 / 50.0 + (row / 30 % 3) as f64;
        let z =
            |row: usize| if row / 3 % 4 == 1 { f64::NAN } else { (row * 13 % 29) as f64 * y(row) };
        let state = |row: usize| format!("state {}", row / 30 % 3);
        Table::from_columns(vec![
            Column::new("y", "", rows.clone().map(y).collect::<Vec<_>>()),
            Column::new("z", "", rows.clone().map(z).collect::<Vec<_>>()),
            Column::new("state", "", rows.map(state).collect::<Vec<_>>()),
        ])
        .unwrap()
    }

    #[test]
    fn c_answers_as_the_tree_also_without_a_sensor() {
        let judged = RecordingStudy::parse(STUDY, "study.toml").unwrap();
        let judged = judged.judge(STUDY, &records(), Workers::new(1)).unwrap();
        let (_, diagnoser) = &judged.diagnosers[0];
        let mut row = vec![0.0; diagnoser.names().features.len()];
        let columns = &judged.windows.columns()[judged.windows.columns().len() - row.len()..];
        let (mut rows, mut expected) = (String::new(), String::new());
        for window in 0..judged.windows.row_count() {
            for (slot, column) in row.iter_mut().zip(columns) {
                *slot = column.numbers().unwrap()[window];
                rows += &if slot.is_nan() { "NAN, ".into() } else { format!("{slot:e}, ") };
            }
            expected += &format!(
                "{}\n",
                diagnoser.lengths[0].panel.trees.stages[0].model.predict_row(&row)
            );
        }
        assert!(rows.contains("NAN") && ["0\n", "1\n", "2\n"].iter().all(|c| expected.contains(c)));
        let count = judged.windows.row_count();
        let main = format!(
            "#include <math.h>\n#include <stdio.h>\n#include \"servotwin_recording.h\"\n\
             static const double rows[] = {{ {rows} }};\n\
             int main(void) {{ for (int k = 0; k < {count}; k++) \
             printf(\"%d\\n\", servotwin_answer(rows + k * SERVOTWIN_FEATURES)); return 0; }}\n"
        );
        let workplace = Workplace::new(&files(diagnoser).unwrap(), None).unwrap();
        workplace.write("main.c", &main).unwrap();
        let compiler = compilers().next().expect("a C compiler is installed");
        let sources = ["main.c", "servotwin_recording.c", "-o", "main"];
        let strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];
        workplace.run(compiler, compiler, strict.into_iter().chain(sources)).unwrap();
        let said = Command::new(workplace.path("main")).output().unwrap();
        assert_eq!(String::from_utf8(said.stdout).unwrap(), expected);
        let text =
            STUDY.replacen("format = 1\n", "format = 1\nclassifiers = [\"random_forest\"]\n", 1);
        let forest = RecordingStudy::parse(&text, "study.toml").unwrap();
        let forest = forest.judge(&text, &records(), Workers::new(1)).unwrap();
        assert!(matches!(files(&forest.diagnosers[0].1), Err(ExportError::Unsupported(_))));
    }
}
