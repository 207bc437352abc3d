//! How C spells the constants of a table.

use servotwin_model::c_source::hexadecimal;
use std::collections::BTreeSet;
use std::fmt::{Display, Write};

/// Longest line of an array, in characters.
const LINE: usize = 110;

/// An index that may be missing.
pub(crate) fn place(place: Option<usize>) -> String {
    place.map_or("-1".into(), |place| place.to_string())
}

/// A struct or an array, whose values are in the order of the declaration.
pub(crate) fn record(values: &[String]) -> String {
    format!("{{ {} }}", values.join(", "))
}

/// Adds a constant of this file.
pub(crate) fn write_private(text: &mut String, kind: &str, name: &str, value: &str) {
    let _ = writeln!(text, "static const {kind} {name} = {value};");
}

/// Adds a constant for other files.
pub(crate) fn write_public(text: &mut String, kind: &str, name: &str, value: &str) {
    let _ = writeln!(text, "const {kind} servotwin_{name} = {value};");
}

/// Adds an array for other files, one line for each entry. C has no empty arrays: there `empty` is the only entry.
pub(crate) fn write_list(
    text: &mut String,
    kind: &str,
    name: &str,
    entries: &[String],
    empty: &str,
) {
    let all = if entries.is_empty() { empty.into() } else { entries.join(",\n    ") };
    let count = entries.len().max(1);
    let _ = writeln!(text, "\nconst {kind} servotwin_{name}[{count}] = {{\n    {all}\n}};");
}

/// Adds an array with its length for other files, one line for each entry, with its comment if it has one. An empty one gets
/// one zero.
pub(crate) fn write_commented_list(
    text: &mut String,
    kind: &str,
    (name, length): (&str, &str),
    entries: &[(String, String)],
) {
    let line = |(entry, comment): &(String, String)| match comment.is_empty() {
        true => format!("    {entry},\n"),
        false => format!("    {entry}, /* {comment} */\n"),
    };
    let lines: String = entries.iter().map(line).collect();
    let lines = if entries.is_empty() { "    0\n" } else { &lines };
    let _ = writeln!(text, "\nconst {kind} servotwin_{name}[{length}] = {{\n{lines}}};");
}

/// Adds an array of this file. An empty one gets one zero.
pub(crate) fn write_array<T: Display>(
    text: &mut String,
    kind: &str,
    name: &str,
    items: impl IntoIterator<Item = T>,
) {
    let mut items: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    if items.is_empty() {
        items.push("0".into());
    }
    let _ = writeln!(text, "static const {kind} {name}[{}] = {{", items.len());
    let mut line = String::new();
    for item in items {
        if !line.is_empty() && line.len() + item.len() + 1 > LINE {
            let _ = writeln!(text, "   {line}");
            line.clear();
        }
        let _ = write!(line, " {item},");
    }
    let _ = writeln!(text, "   {line}\n}};");
}

/// As [`write_array`], of numbers.
pub(crate) fn write_numbers(text: &mut String, name: &str, items: impl IntoIterator<Item = f64>) {
    write_array(text, "double", name, items.into_iter().map(hexadecimal));
}

/// A file with texts, sizes of arrays and indices by name, whose names begin with `prefix`.
pub(crate) fn sizes_text(
    head: &str,
    prefix: &str,
    texts: &[(&str, String)],
    sizes: &[(&str, usize)],
    indices: &[(&str, Vec<String>)],
) -> String {
    let define = |name: &str, value: &str| format!("#define {prefix}_{name} {value}\n");
    let texts: String = texts.iter().map(|(name, t)| define(name, &format!("\"{t}\""))).collect();
    let sizes: String = sizes.iter().map(|(name, size)| define(name, &size.to_string())).collect();
    let indices: String = indices.iter().map(|(what, names)| indices_text(what, names)).collect();
    format!(
        "{head}#ifndef {prefix}_SIZES_H\n#define {prefix}_SIZES_H\n\n#include \"servotwin_exact.h\"\n\n{texts}\n{sizes}\n\
         {indices}#endif\n"
    )
}

/// The index of each name of a list. Of names that are the same in capitals, later ones end in their index.
fn indices_text(what: &str, names: &[String]) -> String {
    let capital = |c: char| if c.is_ascii_alphanumeric() { c.to_ascii_uppercase() } else { '_' };
    let mut known = BTreeSet::new();
    let mut text = String::new();
    for (index, name) in names.iter().enumerate() {
        let mut name: String = name.chars().map(capital).collect();
        while !known.insert(name.clone()) {
            name = format!("{name}_{index}");
        }
        let _ = writeln!(text, "#define SERVOTWIN_{what}_{name} {index}");
    }
    text + "\n"
}

/// A name as a string literal with the same bytes.
pub(crate) fn quoted(name: &str) -> String {
    let byte = |byte: u8| match byte {
        b'"' | b'\\' | b'?' => format!("\\{}", char::from(byte)),
        b' '..=b'~' => char::from(byte).into(),
        _ => format!("\\{byte:03o}"),
    };
    format!("\"{}\"", name.bytes().map(byte).collect::<String>())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_broken_into_lines() {
        let mut text = String::new();
        write_array(&mut text, "int16_t", "roots", 1000..1040);
        assert!(text.starts_with("static const int16_t roots[40] = {\n    1000, 1001,"), "{text}");
        assert!(text.lines().all(|line| line.len() <= LINE + 4), "{text}");
        text.clear();
        write_array(&mut text, "int8_t", "none", [0_i8; 0]);
        assert_eq!(text, "static const int8_t none[1] = {\n    0,\n};\n");
    }

    #[test]
    fn names_become_literals_and_indices_that_differ() {
        assert_eq!(quoted("p?\"ä"), r#""p\?\"\303\244""#);
        let names = ["p a", "p_a", "ok"].map(String::from);
        let text = indices_text("SENSOR", &names);
        let lines: Vec<_> = text.lines().collect();
        let defined = ["P_A 0", "P_A_1 1", "OK 2", ""];
        let defined = defined.map(|line| match line {
            "" => String::new(),
            line => format!("#define SERVOTWIN_SENSOR_{line}"),
        });
        assert_eq!(lines, defined);
    }
}
