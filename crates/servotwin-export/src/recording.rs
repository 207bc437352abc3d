//! The tree of a diagnoser of recordings as C99: it takes the features of a window and returns the number of a class.

use crate::c;
use crate::error::ExportError;
use crate::notation::{quoted, write_array, write_list};
use crate::source_file::SourceFile;
use crate::tables::{HEAD, stage};
use servotwin_diagnosis::diagnoser::Diagnoser;
use servotwin_diagnosis::hierarchy::{Question, Stage};

/// The trees of a diagnoser, and the hand-written files that ask them.
///
/// # Errors
/// [`ExportError::Classifier`] for other classifiers than a decision tree or boosted trees;
/// [`ExportError::TooMany`]; [`ExportError::Unsupported`] for a diagnoser that decides nothing.
pub fn files(diagnoser: &Diagnoser) -> Result<Vec<SourceFile>, ExportError> {
    let (trees, named) = (&diagnoser.lengths[0].panel.trees, diagnoser.names());
    let stage = trees.stage(Question::Actuator, 0, 0);
    let stage = stage.ok_or(ExportError::Unsupported("the diagnoser decides nothing"))?;
    let class = |&class: &u32| quoted(named.class_name(stage.place.question, class));
    let classes: Vec<String> = stage.classes.iter().map(class).collect();
    let features: Vec<String> = named.features.iter().map(|name| quoted(name)).collect();
    let header = format!(
        "{HEAD}#ifndef SERVOTWIN_RECORDING_H\n#define SERVOTWIN_RECORDING_H\n\n#define SERVOTWIN_FEATURES {}\n\n\
         /* The names of the features of a row, in their order, and of the classes. */\n\
         extern const char *const servotwin_feature_names[{0}];\n\
         extern const char *const servotwin_classes[{}];\n\n\
         /* The number of the class of a row. A missing value is NaN. */\n\
         int servotwin_class_of(const double row[SERVOTWIN_FEATURES]);\n\n#endif\n",
        features.len(),
        classes.len()
    );
    let mut source = [HEAD, "#include \"servotwin_models.h\"\n#include \"servotwin_recording.h\"\n\n#include <stddef.h>\n"].concat();
    write_list(&mut source, "char *const", "feature_names", &features, "0");
    write_list(&mut source, "char *const", "classes", &classes, "0");
    let numbered = Stage { classes: (0..stage.classes.len() as u32).collect(), ..stage.clone() };
    let entry = stage::write(&mut source, "stage", &numbered)?;
    write_array(&mut source, "servotwin_stage", "stages", [entry]);
    source += "
int servotwin_class_of(const double row[SERVOTWIN_FEATURES])
{
    return (int)servotwin_decide(&stages[0], row).decided;
}
";
    let own = [("servotwin_recording.h", header), ("servotwin_recording.c", source)];
    let own = own.into_iter().map(|(name, text)| SourceFile { name, text });
    Ok(c::files_of_models().chain(own).collect())
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
             printf(\"%d\\n\", servotwin_class_of(rows + k * SERVOTWIN_FEATURES)); return 0; }}\n"
        );
        let workplace = Workplace::new(&files(diagnoser).unwrap(), None).unwrap();
        workplace.write("main.c", &main).unwrap();
        let compiler = compilers().next().expect("a C compiler is installed");
        let sources = ["main.c", "servotwin_recording.c", "servotwin_models.c", "servotwin_math.c"];
        let strict = ["-std=c99", "-Wall", "-Wextra", "-Wpedantic", "-Werror"];
        workplace
            .run(compiler, compiler, strict.into_iter().chain(sources).chain(["-o", "main"]))
            .unwrap();
        let said = Command::new(workplace.path("main")).output().unwrap();
        assert_eq!(String::from_utf8(said.stdout).unwrap(), expected);
        let text =
            STUDY.replacen("format = 1\n", "format = 1\nclassifiers = [\"random_forest\"]\n", 1);
        let forest = RecordingStudy::parse(&text, "study.toml").unwrap();
        let forest = forest.judge(&text, &records(), Workers::new(1)).unwrap();
        assert!(matches!(files(&forest.diagnosers[0].1), Err(ExportError::Classifier { .. })));
    }
}
