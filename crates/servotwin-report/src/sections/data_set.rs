//! The layout of the data set for training and evaluation (figure 8 of the seed paper).

use crate::Material;
use crate::excerpt::{Excerpt, ExcerptRow};
use crate::page::Page;
use crate::vocabulary::Vocabulary;
use crate::words::{chosen, number, spoken};
use servotwin_plot::sheet::{Group, LEFT_OUT, Sheet};

/// Writes the section, or nothing if the study has no content for it.
pub fn write(material: &Material, page: &mut Page) {
    let Some((setting, excerpt)) = material.excerpt else { return };
    let words = material.words();
    page.figure(
            "data_set",
            sheet(excerpt, &words).draw(),
            &format!(
                "Dataset structure after processing{}: an excerpt of the data set of setting {}. {} variants are left in it, \
                 whose residuals leave {}. It has a column for the intensity of each of {} faults, the classes that \
                 trees are to find, and {} features of the residuals.",
                words.paper(" (figure 8 of the seed paper)"),
                setting.name(),
                excerpt.detectable,
                words.fixed_band(),
                excerpt.faults,
                excerpt.features,
            ),
        );
}

/// The excerpt as a picture.
fn sheet(excerpt: &Excerpt, words: &Vocabulary) -> Sheet {
    let Excerpt { faults, features, shown_faults, shown_features, rows, .. } = excerpt;
    let group = |title: &str, columns: Vec<String>| Group { title: title.into(), columns };
    let unit = format!("failed {}", words.unit());
    let mut classes = vec!["command".to_owned(), "detail".to_owned()];
    if words.has_several() {
        classes.insert(0, unit);
    }
    let (first, last) = rows.split_at(rows.len().saturating_sub(1));
    let text = |row: &ExcerptRow| {
        let classes = row.classes.iter().skip(usize::from(!words.has_several()));
        let classes = classes.map(|class| spoken(class)).collect();
        [
            vec![row.variant.to_string()],
            dotted(row.intensities.iter().map(|&value| chosen(value)).collect(), *faults),
            classes,
            dotted(row.features.iter().map(|&value| number(value)).collect(), *features),
        ]
        .concat()
    };
    let groups = vec![
        group("Variant no.", vec![String::new()]),
        group("Fault intensities", dotted(shown_faults.clone(), *faults)),
        group("Fault classifier", classes),
        group("Residual features", dotted(shown_features.clone(), *features)),
    ];
    let width = groups.iter().map(|group| group.columns.len()).sum();
    let between = if first.is_empty() { vec![] } else { vec![vec!["⋮".to_owned(); width]] };
    let rows = first.iter().map(text).chain(between).chain(last.iter().map(text)).collect();
    Sheet { groups, rows }
}

/// Puts dots before the last text if some of the `of` texts are left out.
fn dotted(mut texts: Vec<String>, of: usize) -> Vec<String> {
    if texts.len() < of {
        texts.insert(texts.len().saturating_sub(1), LEFT_OUT.into());
    }
    texts
}
