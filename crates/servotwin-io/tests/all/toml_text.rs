//! Mistakes in TOML files are few and short, however many and long they are in the file.

use servotwin_io::toml_text::{Collector, Diagnostic, TomlText};

fn mistakes(text: &str) -> Vec<Diagnostic> {
    let mut found = Collector::default();
    TomlText::parse(text, 1, &mut found);
    found.locate(text)
}

#[test]
fn mistakes_at_every_byte_take_no_more_memory_than_a_hundred() {
    let length = 64 << 10;
    let bombs = [",", "\0", "[", "a=", "é", "\"", "=\n", "[[", "{"].map(|part| part.repeat(length));
    for text in bombs.iter().chain([&format!("a = [{}", ",".repeat(length))]) {
        let found = mistakes(text);
        assert!((1..=100).contains(&found.len()), "{} mistakes", found.len());
        let kept: usize = found.iter().map(|one| one.source.len() + one.message.len()).sum();
        assert!(kept < 100_000, "{kept} bytes of {:?} …", &text[..4]);
    }
}

#[test]
fn a_name_as_long_as_the_file_is_clipped_and_the_caret_stands_below_its_character() {
    let mut found = Collector::default();
    let key = "k".repeat(50_000);
    let text = format!("x = 1\n{key} = oops");
    found.note(&(50_009..50_013), Diagnostic::new(format!("'{key}' must be a finite number")));
    let shown = found.refuse("a.toml", &text).to_string();
    assert!(shown.len() < 3_000, "{} bytes", shown.len());
    let [source, caret] = [3, 2]
        .map(|line| shown.lines().rev().nth(line).unwrap().split_once("| ").unwrap().1.to_owned());
    assert_eq!(&source[caret.find('^').unwrap()..], "oops", "{source}\n{caret}");
}
