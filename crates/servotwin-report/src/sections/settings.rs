//! The settings, and the effect of an additional sensor.

use crate::Material;
use crate::lines::{self, Who};
use crate::words::{change, percent, rate, stacked};
use servotwin::job::Subject;
use servotwin::job::results::SubjectResult;
use servotwin::learn::metrics::Rate;
use servotwin::learn::protocol::ProtocolResult;
use servotwin::measure;
use servotwin::records::data_features;
use servotwin::study::Purpose;
use servotwin_view::document::{Document, Table};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    if material.results.subjects.is_empty() {
        return;
    }
    if let Some(realism) = &material.study.realism {
        page.text(format!(
                "Ideal: the plant is the twin with one fault, and sensors are perfect. Noise: the same \
                 plant, with the noise and quantisation of the sensors that the system declares. \
                 Realistic: sensors likewise, and another specimen for every variant, whose parameters \
                 differ from the twin's by the tolerances of the study file (seed {}); the twin is not \
                 fitted to the specimen. There are {} fault-free specimens in each judged operating case.",
                material.study.seed, realism.healthy
            ));
    }
    let is_there = material.results.of(Subject::Fitted).is_some();
    if let Some(calibration) = material.study.calibration.as_ref().filter(|_| is_there) {
        page.text(format!(
                "Fitted: specimens with the same tolerances, each of which first has a healthy calibration \
                 run of {} s with another command and other noise; its twin is fitted to what the sensors \
                 showed then, and the faults are judged beside the fitted twin. {} specimens take turns where \
                 faults are judged, {} others where it is learned.",
                calibration.duration_s,
                calibration.specimens(Purpose::Test),
                calibration.specimens(Purpose::Train)
            ));
    }
    let of = |subject| material.results.of(subject);
    if let Some((without, with)) = of(Subject::Realistic).zip(of(Subject::ExtraSensor)) {
        third_sensor(material, without, with, page);
    }
}

fn third_sensor(
    material: &Material,
    without: &SubjectResult,
    with: &SubjectResult,
    page: &mut Document,
) {
    let title = material.study.extra_sensor.as_deref().unwrap_or("an additional sensor");
    page.heading(format!("The additional sensor: {title}"));
    let [before, after] = [without, with].map(|result| Who::Trees.headline(&result.evaluation));
    if let Some((before, after)) = before.zip(after) {
        page.text(verdict(before, after, &used(material, with)));
    }
    let mut grid = Table::headed(["", "by", &without.title, &with.title, "change, points"]);
    let mut push = |title: &str, who: Who, of: &dyn Fn(&ProtocolResult) -> Option<Rate>| {
        let both = [without, with].map(|result| who.headline(&result.evaluation).and_then(of));
        if both.iter().any(Option::is_some) {
            let [before, after] = both;
            let (who, change) = (who.title().to_owned(), change(before, after));
            grid.push(vec![title.to_owned(), who, stacked(before), stacked(after), change]);
        }
    };
    let words = &material.words();
    for measure in lines::SAFETY.into_iter().chain(lines::RIGHT) {
        let of = |result: &ProtocolResult| result.rates.counted(measure);
        push(&words.measure(measure), Who::Trees, &of);
        push("", Who::Committee, &of);
    }
    let trees: Vec<&ProtocolResult> = before.into_iter().chain(after).collect();
    for (letter, title) in lines::stages(words, &trees) {
        let of = |result: &ProtocolResult| result.stage(&letter).map(|score| score.accuracy);
        push(&format!("{letter}  {title}"), Who::Trees, &of);
    }
    page.table("", grid.captioned("The same faults, specimens and protocol with and without the sensor. Intervals are \
        95 %; both columns are of the same rows, so that a change well inside them is still measured, but \
        need not hold for other specimens."));
}

/// The features of the additional sensor that the trees use, with the share of the impurity that each removes in its
/// tree.
fn used(material: &Material, with: &SubjectResult) -> Vec<String> {
    let extra: Vec<String> = data_features(material.study)
        .into_iter()
        .filter(|known| known.extra)
        .map(|known| known.feature.name)
        .collect();
    let mut used = vec![];
    for stage in &with.evaluation.stages {
        let own = stage.importances.iter().filter(|(name, _)| extra.contains(name));
        used.extend(own.map(|(name, share)| {
            format!("{name} in tree {} ({})", stage.stage, percent(Some(*share)))
        }));
    }
    used
}

/// Describes the gain from the sensor, and the trees' use of its features.
fn verdict(before: &ProtocolResult, after: &ProtocolResult, used: &[String]) -> String {
    let [first, second] = [before, after].map(|own| own.rates.counted(&measure::END_TO_END));
    let overlaps =
        |(first, second): (Rate, Rate)| first.low <= second.high && second.low <= first.high;
    let gain = match first.zip(second).is_none_or(overlaps) {
        true => "The intervals overlap: no gain is shown.",
        false => "The intervals do not overlap.",
    };
    let asked = match used {
        [] => "They ask for none of its features.".to_owned(),
        used => format!("Of its features they ask for {}.", used.join(", ")),
    };
    format!(
        "The trees are right end to end in {} without it and in {} with it ({} points). {gain} {asked}",
        rate(first),
        rate(second),
        change(first, second)
    )
}
