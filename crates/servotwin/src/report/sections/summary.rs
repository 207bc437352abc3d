//! What came out, on one screen: findings in words, the settings side by side, and apart from them
//! the comparison with the seed paper.

use crate::evaluation::Evaluation;
use crate::evaluation::abstention::{Level, SHARES};
use crate::evaluation::protocol::Protocol;
use crate::evaluation::score::Rate;
use crate::job::Subject;
use crate::job::results::SubjectResult;
use crate::report::lines::{self, Measure, OF_PAPER, PAPER, RIGHT, SAFETY, Who};
use crate::report::page::{Grid, Page, Side};
use crate::report::words::{NONE, bracketed, number, percent, rate};
use crate::report::{Material, Section};

/// See the module.
pub struct Summary;

/// The share of answers withheld that the findings speak of.
const SILENT: f64 = 0.03;

impl Section for Summary {
    fn id(&self) -> &'static str {
        "summary"
    }

    fn title(&self) -> &'static str {
        "Summary"
    }

    fn write(&self, material: &Material, page: &mut Page) {
        let settings = lines::settings(material.results);
        let Some(hardest) = settings.last() else {
            return;
        };
        let study = material.study;
        page.text(&format!(
            "The virtual twin ({}) is compared with plants that have one of {} faults each, in {} \
             operating cases. From the differences between measured and expected sensor signals \
             (residuals), decision trees say which actuator failed (A), what the flight control \
             computer must do (B), and what is broken (C, D, E); a committee of boosted trees says \
             it too, and may be silent. Setting “{}”, with 95 % intervals:",
            study.system.title,
            study.faults.len(),
            study.cases.len(),
            hardest.title,
        ));
        let mut findings = findings(&hardest.evaluation);
        if let Some(text) = material.flights.and_then(super::flights::finding) {
            findings.push(("At work".into(), text));
        }
        page.findings(&findings);
        page.table(&side_by_side(&settings), &format!(
            "{} Intervals are 95 %: of answers from drawing kinds of fault at their intensities, because \
             rows of one are not independent; of what bands do from Wilson's formula. In shaded rows less \
             is better.",
            held_out(&hardest.evaluation)
        ));
        page.note(&bands_in_use(&settings));
        if let Some(remark) = tripping(material) {
            page.note(&remark);
        }
        seed_paper(material, page);
    }
}

/// How the rows of the headline were kept apart.
fn held_out(evaluation: &Evaluation) -> &'static str {
    match evaluation.headline().map(|result| result.protocol) {
        Some(Protocol::NewCommand) => {
            "New commands: trees and committee learned from training commands, none of which is flown \
             in the operating cases on which they are judged."
        }
        _ => "Grouped: the fault that is judged was never seen at its intensity.",
    }
}

/// The headline of a setting in words.
fn findings(evaluation: &Evaluation) -> Vec<(String, String)> {
    let mut list = vec![];
    let mut push = |about: &str, text: String| list.push((about.to_owned(), text));
    let detection = &evaluation.detection;
    push(
        "Detection",
        format!(
            "{} of all faults leave the bands; the others stay inside every band and are not diagnosed.",
            bracketed(Some(detection.detected)),
        ),
    );
    let about = match evaluation.headline().map(|result| result.protocol) {
        Some(Protocol::NewCommand) => "Commands never seen",
        _ => "Faults never seen at their intensity",
    };
    let both = |measure: &Measure| both(evaluation, measure);
    push(
        about,
        format!(
            "Of the detected faults actuator, command and failure are right for {}; actuator and command, \
         which are all that is acted on, for {}.",
            both(&RIGHT[1]),
            both(&RIGHT[0]),
        ),
    );
    let [wrong, missed, missed_of_all, needless] = &SAFETY;
    push("Wrong actuator shut down", format!("{} of the detected faults.", both(wrong)));
    push(
        "Shutdown missed",
        format!(
            "{} of the detected faults that need one; of all such faults, those never detected \
         included, {}.",
            both(missed),
            both(missed_of_all),
        ),
    );
    push("Needless shutdown", format!("{} of the faults that need less.", both(needless)));
    if let Some(alarms) = &evaluation.false_alarms {
        push(
            "False alarms",
            format!(
                "{} of {} healthy specimens leave the bands; the trees would shut an actuator down in {}, \
             the committee in {}.",
                bracketed(Some(alarms.alarms)),
                alarms.alarms.of,
                bracketed(Some(alarms.tree_shutdowns)),
                bracketed(Some(alarms.committee_shutdowns)),
            ),
        );
    }
    if let Some(level) = silent(evaluation) {
        push(
            "Silence",
            format!(
                "A committee that withholds the least certain {} of its answers is right about actuator \
             and command in {} of the others, shuts the wrong actuator down in {} and answers a fault \
             that needs a shutdown wrongly in {}.",
                percent(level.abstained.share),
                bracketed(Some(level.right_action)),
                bracketed(Some(level.wrong_actuator_shutdown)),
                bracketed(Some(level.shutdown_answered_wrongly)),
            ),
        );
    }
    if let Some((trees, committee)) = &evaluation.flips {
        push(
            "What sensors cannot show",
            format!(
                "Moved within the uncertainty of their windows, {} of the trees' answers about actuator and \
             command change, and {} of the committee's.",
                bracketed(Some(trees.action)),
                bracketed(Some(committee.action)),
            ),
        );
    }
    list
}

/// A measure of the trees and of the committee, in words.
fn both(evaluation: &Evaluation, measure: &Measure) -> String {
    let of = |who: Who| who.headline(evaluation).and_then(measure.rate).filter(|rate| rate.of > 0);
    match (of(Who::Trees), of(Who::Committee)) {
        (None, None) => "none".into(),
        (trees, None) => format!("{} (trees)", bracketed(trees)),
        (trees, committee) => {
            format!("{} (trees), {} (committee)", bracketed(trees), bracketed(committee))
        }
    }
}

fn silent(evaluation: &Evaluation) -> Option<&Level> {
    let place = SHARES.iter().position(|share| *share == SILENT)?;
    evaluation.abstention.as_ref()?.levels.get(place)
}

/// Measures in rows, settings in columns.
fn side_by_side(settings: &[&SubjectResult]) -> Grid {
    let heads = [("".to_owned(), Side::Left), ("by".to_owned(), Side::Left)];
    let titles = settings.iter().map(|result| (result.title.clone(), Side::Right));
    let mut grid = Grid::new(heads.into_iter().chain(titles));
    let mut last = "";
    for row in lines::headline(settings) {
        let title = if row.title == last { "" } else { row.title };
        last = row.title;
        let mut cells = vec![title.to_owned(), row.who.to_owned()];
        cells.extend(row.rates.iter().map(|value| rate(*value)));
        match row.is_safety {
            true => grid.push_strong(cells),
            false => grid.push(cells),
        }
    }
    grid
}

/// Which band decides what is detected in each setting.
fn bands_in_use(settings: &[&SubjectResult]) -> String {
    let band = |result: &&SubjectResult| match lines::learned(result) {
        Some(bands) => {
            let widths = || bands.iter().map(|band| 100.0 * band.half_width);
            let (least, most) = (widths().fold(f64::MAX, f64::min), widths().fold(0.0, f64::max));
            format!(
                "{}: learned from healthy specimens, sensor by sensor, ±{} … {} % of scale",
                result.title,
                number(least),
                number(most)
            )
        }
        None => format!("{}: the seed paper's ±3 % of scale for every sensor", result.title),
    };
    format!("Bands in use. {}.", settings.iter().map(band).collect::<Vec<_>>().join("; "))
}

/// That tolerances trip the paper's band.
fn tripping(material: &Material) -> Option<String> {
    let ideal = material.results.of(Subject::Ideal)?;
    let realistic = material.results.of(Subject::Realistic)?;
    let alarms = realistic.evaluation.false_alarms.as_ref().filter(|a| a.paper_alarms.count > 0)?;
    Some(format!(
        "With the seed paper's ±3 % {} of faults would be detected in the realistic setting, against {} \
         in the ideal one. Part of that is no better detection: tolerances of the specimen trip the band, \
         as they do in {} of specimens without any fault.",
        percent(realistic.evaluation.paper_detection.share),
        percent(ideal.evaluation.paper_detection.share),
        rate(Some(alarms.paper_alarms)),
    ))
}

/// The seed paper's own test, apart from everything else.
fn seed_paper(material: &Material, page: &mut Page) {
    let Some(ideal) = material.results.of(Subject::Ideal) else {
        return;
    };
    let evaluation = &ideal.evaluation;
    let third = Protocol::RandomThird;
    let baseline = evaluation.baseline.iter().find(|result| result.protocol == third);
    let Some((baseline, trees)) = baseline.zip(evaluation.protocol(third)) else {
        return;
    };
    let is_papers = material.study.name == PAPER;
    let mut heads = vec![("", Side::Left)];
    if is_papers {
        heads.push(("seed paper", Side::Right));
    }
    heads.push(("its features, repeated here", Side::Right));
    heads.push(("trees of this report", Side::Right));
    let mut grid = Grid::new(heads);
    let mut push = |title: String, paper: Option<f64>, values: [Option<Rate>; 2]| {
        let mut row = vec![title];
        if is_papers {
            row.push(paper.map_or_else(|| NONE.into(), |paper| percent(Some(paper))));
        }
        row.extend(values.map(rate));
        grid.push(row);
    };
    for (letter, title) in &lines::STAGES[..2] {
        let of = |stage: &str| OF_PAPER.iter().find(|known| known.0 == stage).map(|known| known.1);
        let accuracy = |score: Option<&crate::evaluation::score::Score>| score.map(|s| s.accuracy);
        let values = [baseline, trees].map(|result| accuracy(result.stage(letter)));
        push(format!("{letter}  {title}"), of(letter), values);
    }
    push("end to end".into(), None, [baseline.end_to_end, trees.end_to_end]);
    page.table(&grid, "Apart: the seed paper's own test, which is another question. No noise, plants that \
        are the twin but for one fault, and a third of the variants held out at random, so that nearly \
        every one has a neighbour in training (the same fault at the same intensity in another operating \
        case). It is kind, and no figure in it compares with those above. The seed paper's features are \
        mean, variance and indicator of each residual, each actuator by itself.");
}
