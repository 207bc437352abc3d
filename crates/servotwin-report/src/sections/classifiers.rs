//! All classifiers, compared under the same protocol.

use crate::{Material, looks};
use servotwin::learn::Evaluation;
use servotwin::learn::protocol::Protocol;
use servotwin_diagnosis::hierarchy::Question;
use servotwin_view::Figure;
use servotwin_view::bars::{Bar, Bars};
use servotwin_view::document::Document;

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Document) {
    for result in &material.results.subjects {
        if result.evaluation.classifiers.is_empty() {
            continue;
        }
        let holding = result.settings.comparison_holding;
        let words = material.words();
        for (stage, question) in [("A", Question::Actuator), ("B", Question::Action)] {
            let asks = words.question(question);
            // With one actuator there is no actuator stage.
            if result.evaluation.classifiers.iter().all(|compared| compared.stage != stage) {
                continue;
            }
            let name = format!("classifiers_{}_{stage}", result.subject.name());
            page.figure(name.clone(), bars(&result.evaluation, stage), format!(
                    "Scenario: {}. Accuracy for {asks} (stage {stage}) of all classifiers with the \
                     same features and default settings; random thirds: {}. Strokes across the foot of a \
                     bar: the axis does not begin at zero. Whiskers: 95 %.",
                    result.title, holding.repeats
                ));
        }
    }
}

fn bars(evaluation: &Evaluation, stage: &str) -> Figure {
    let own = || evaluation.classifiers.iter().filter(|compared| compared.stage == stage);
    let hardest = evaluation.headline().map_or(Protocol::NewCommand, |result| result.protocol);
    let protocols = [Protocol::RandomThird, hardest];
    let mut figure = Bars::new("accuracy (%)", &protocols.map(Protocol::title));
    figure.looks = looks::plain();
    let mut titles: Vec<&str> = vec![];
    for compared in own() {
        if !titles.contains(&compared.title.as_str()) {
            titles.push(&compared.title);
        }
    }
    let mut least: f64 = 100.0;
    for title in titles {
        let bar = |protocol: Protocol| {
            let compared = own().find(|c| c.title == title && c.protocol == protocol)?;
            let rate = compared.score.accuracy;
            least = least.min(100.0 * rate.low);
            let percent = |share: f64| 100.0 * share;
            Some(Bar::with_interval(percent(rate.share?), percent(rate.low), percent(rate.high)))
        };
        figure = figure.with(title, protocols.map(bar).into());
    }
    figure.digits = 2;
    // Bars from zero would all look the same.
    figure.range = Some(((least / 10.0).floor() * 10.0, 100.0));
    figure.draw()
}
