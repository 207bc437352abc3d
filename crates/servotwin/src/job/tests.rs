//! Measurements behind the settings of subjects.

use super::*;
use crate::evaluation::data_set::TrainingFilter;
use crate::evaluation::run::{self, Scope};
use servotwin_learning::splits::Split;
use servotwin_learning::tree::Criterion;

/// Measures the share of right answers end to end, in four folds of the training commands, for trees of each criterion
/// and depth. Training uses healthy specimens that nearly leave a band, or only those that do:
/// `FOLDER=out SUBJECT=fitted cargo test --release measure_trees -- --ignored`.
#[test]
#[ignore = "a measurement: minutes"]
fn measure_trees() {
    let variable = |name: &str| std::env::var(name).unwrap();
    let (folder, name) = (Folder::new(variable("FOLDER")), variable("SUBJECT"));
    let subject = Subject::ALL.into_iter().find(|subject| subject.name() == name).unwrap();
    let study = folder.read_study().unwrap();
    let workers = Workers::new(2);
    let Prepared { data, .. } = Prepared::read(&folder, &study, subject, workers).unwrap();
    let judged =
        data.rows_where(Role::Training, |r| !r.is_healthy && r.is_detected() && r.moved == 0);
    let in_fold = |row: usize, fold: u32| data.rows[row].flown % 4 == fold;
    for healthy in [0.8, 1.0] {
        let lessons = TrainingFilter { healthy, ..subject.settings(&study).holding.lessons };
        let lesson = data.learnt_from(lessons).unwrap();
        let split = |fold| Split {
            train: lesson.iter().copied().filter(|&row| !in_fold(row, fold)).collect(),
            test: judged.iter().copied().filter(|&row| in_fold(row, fold)).collect(),
        };
        let splits: Vec<Split> = (0..4).map(split).collect();
        for criterion in [Criterion::Gini, Criterion::Entropy] {
            for depth in [7, 9, 10, 12] {
                let trees = run::settled(&data, &evaluation::trees(criterion, depth));
                let found = run::run(&data, &trees, &splits, Scope::All, workers).unwrap();
                let (mut right, mut of) = (0, 0);
                for outcome in found.iter().flatten() {
                    right += usize::from(run::first_error(&data, outcome).is_none());
                    of += 1;
                }
                let share = 100.0 * right as f64 / of as f64;
                println!("healthy {healthy}, {criterion:?} {depth}: {share:.2} % of {of}");
            }
        }
    }
}
