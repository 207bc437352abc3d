//! How a language writes the constants of a table.

use crate::language::Language;
use crate::precision::Precision;
use servotwin_model::c_source::{hexadecimal, hexadecimal_single};
use std::fmt::{Display, Write};

/// Longest line of an array, in characters.
const LINE: usize = 110;

/// The name of a field that only C has: a slice of Rust knows its length.
pub(crate) const COUNT: &str = "";

/// How the constants of an export are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Notation {
    /// The language.
    pub language: Language,
    /// The precision of its numbers.
    pub precision: Precision,
}

/// A type name in snake case.
fn snake_case(name: &str) -> String {
    let mut text = String::new();
    for (place, c) in name.chars().enumerate() {
        if c.is_uppercase() && place > 0 {
            text.push('_');
        }
        text.extend(c.to_lowercase());
    }
    text
}

impl Notation {
    /// C in double precision.
    pub const C: Self = Notation { language: Language::C, precision: Precision::F64 };

    /// Rust, which has double precision alone.
    pub const RUST: Self = Notation { language: Language::Rust, precision: Precision::F64 };

    /// C in a precision.
    pub fn c(precision: Precision) -> Self {
        Notation { language: Language::C, precision }
    }

    /// A type, given as Rust writes it.
    fn kind(self, kind: &str) -> String {
        if self.language == Language::Rust {
            return kind.into();
        }
        match kind {
            "f64" => self.precision.c_type().into(),
            "u8" | "bool" => "uint8_t".into(),
            "u16" => "uint16_t".into(),
            "u32" | "usize" => "int32_t".into(),
            "i16" => "int16_t".into(),
            "Option<u8>" => "int8_t".into(),
            "&str" => "char *const".into(),
            name => format!("servotwin_{}", snake_case(name)),
        }
    }

    /// The name of a constant.
    fn name(self, name: &str) -> String {
        match self.language {
            Language::C => name.into(),
            Language::Rust => name.to_uppercase(),
        }
    }

    /// A finite number: with the same bits in double precision, the nearest one in single precision.
    pub fn number(self, number: f64) -> String {
        match (self.language, self.precision) {
            (Language::C, Precision::F64) => hexadecimal(number),
            (Language::C, Precision::F32) => hexadecimal_single(number),
            (Language::Rust, _) => format!("{number:?}"),
        }
    }

    /// A threshold, such that every number of this precision is on the same side of it as it was in training.
    pub fn threshold(self, threshold: f64) -> String {
        self.number(self.precision.not_above(threshold))
    }

    /// An integer without a sign.
    pub fn unsigned(self, number: impl Display) -> String {
        let ending = if self.language == Language::C { "U" } else { "" };
        format!("{number}{ending}")
    }

    /// A truth value of a struct.
    pub fn truth(self, truth: bool) -> String {
        match self.language {
            Language::C => u8::from(truth).to_string(),
            Language::Rust => truth.to_string(),
        }
    }

    /// An index that may be missing.
    pub fn place(self, place: Option<usize>) -> String {
        match (self.language, place) {
            (Language::C, None) => "-1".into(),
            (Language::C, Some(place)) => place.to_string(),
            (Language::Rust, place) => format!("{place:?}"),
        }
    }

    /// A variant of an enum without data.
    pub fn variant(self, kind: &str, name: &str) -> String {
        match self.language {
            Language::C => format!("SERVOTWIN_{}", snake_case(name).to_uppercase()),
            Language::Rust => format!("{kind}::{name}"),
        }
    }

    /// An array of numbers within a struct.
    pub fn numbers(self, numbers: &[f64]) -> String {
        let numbers: Vec<String> = numbers.iter().map(|&number| self.number(number)).collect();
        let [begin, end] = if self.language == Language::C { ["{ ", " }"] } else { ["[", "]"] };
        format!("{begin}{}{end}", numbers.join(", "))
    }

    /// A reference to an array.
    pub fn array(self, name: &str) -> String {
        match self.language {
            Language::C => name.into(),
            Language::Rust => self.pointer(name),
        }
    }

    /// A reference to a struct.
    pub fn pointer(self, name: &str) -> String {
        format!("&{}", self.name(name))
    }

    /// A struct with named fields, which are in the order of the declaration.
    pub fn record(self, kind: &str, fields: &[(&str, String)]) -> String {
        match self.language {
            Language::C => {
                let values: Vec<&str> = fields.iter().map(|(_, value)| value.as_str()).collect();
                format!("{{ {} }}", values.join(", "))
            }
            Language::Rust => {
                let fields = fields.iter().filter(|(name, _)| *name != COUNT);
                let fields: Vec<String> =
                    fields.map(|(name, value)| format!("{name}: {value}")).collect();
                format!("{kind} {{ {} }}", fields.join(", "))
            }
        }
    }

    /// Adds a constant of this file.
    pub fn write_private(self, text: &mut String, kind: &str, name: &str, value: &str) {
        let (name, kind) = (self.name(name), self.kind(kind));
        let _ = match self.language {
            Language::C => writeln!(text, "static const {kind} {name} = {value};"),
            Language::Rust => writeln!(text, "static {name}: {kind} = {value};"),
        };
    }

    /// Adds a constant for other files.
    pub fn write_public(self, text: &mut String, kind: &str, name: &str, value: &str) {
        let (name, kind) = (self.name(name), self.kind(kind));
        let _ = match self.language {
            Language::C => writeln!(text, "const {kind} servotwin_{name} = {value};"),
            Language::Rust => writeln!(text, "pub static {name}: {kind} = {value};"),
        };
    }

    /// Adds an array for other files, one line for each entry. C has no empty arrays: there `empty` is the only entry.
    pub fn write_list(
        self,
        text: &mut String,
        kind: &str,
        name: &str,
        entries: &[String],
        empty: &str,
    ) {
        let (name, kind) = (self.name(name), self.kind(kind));
        let _ = match self.language {
            Language::C => {
                let all = if entries.is_empty() { empty.into() } else { entries.join(",\n    ") };
                let count = entries.len().max(1);
                writeln!(text, "\nconst {kind} servotwin_{name}[{count}] = {{\n    {all}\n}};")
            }
            Language::Rust => {
                let (count, all) = (entries.len(), entries.join(",\n    "));
                writeln!(text, "\npub static {name}: [{kind}; {count}] = [\n    {all}\n];")
            }
        };
    }

    /// Adds an array with its length for other files, one line for each entry, with its comment if it has one. C has no
    /// empty arrays: there it gets one zero.
    pub fn write_commented_list(
        self,
        text: &mut String,
        kind: &str,
        (name, length): (&str, &str),
        entries: &[(String, String)],
    ) {
        let (name, kind) = (self.name(name), self.kind(kind));
        let [head, zero, end] = match self.language {
            Language::C => [
                format!("const {kind} servotwin_{name}[{length}] = {{"),
                "    0\n".into(),
                "}".into(),
            ],
            Language::Rust => {
                [format!("pub static {name}: [{kind}; {length}] = ["), String::new(), "]".into()]
            }
        };
        let line = |(entry, comment): &(String, String)| match (self.language, comment.is_empty()) {
            (_, true) => format!("    {entry},\n"),
            (Language::C, _) => format!("    {entry}, /* {comment} */\n"),
            (Language::Rust, _) => format!("    {entry}, // {comment}\n"),
        };
        let lines: String = entries.iter().map(line).collect();
        let lines = if entries.is_empty() { zero } else { lines };
        let _ = writeln!(text, "\n{head}\n{lines}{end};");
    }

    /// Adds an array of this file. C has no empty arrays: there it gets one zero.
    pub fn write_array<T: Display>(
        self,
        text: &mut String,
        kind: &str,
        name: &str,
        items: impl IntoIterator<Item = T>,
    ) {
        let mut items: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
        if items.is_empty() && self.language == Language::C {
            items.push("0".into());
        }
        let (name, kind, count) = (self.name(name), self.kind(kind), items.len());
        let _ = match self.language {
            Language::C => writeln!(text, "static const {kind} {name}[{count}] = {{"),
            Language::Rust => writeln!(text, "static {name}: [{kind}; {count}] = ["),
        };
        let mut line = String::new();
        for item in items {
            if !line.is_empty() && line.len() + item.len() + 1 > LINE {
                let _ = writeln!(text, "   {line}");
                line.clear();
            }
            let _ = write!(line, " {item},");
        }
        let end = if self.language == Language::C { "}" } else { "]" };
        let _ = writeln!(text, "   {line}\n{end};");
    }

    /// As [`write_array`](Self::write_array), of numbers.
    pub fn write_numbers(
        self,
        text: &mut String,
        name: &str,
        items: impl IntoIterator<Item = f64>,
    ) {
        self.write_array(text, "f64", name, items.into_iter().map(|item| self.number(item)));
    }

    /// A file with the sizes of arrays. `prefix` stands before the names in C.
    pub fn sizes(self, head: &str, prefix: &str, sizes: &[(&str, usize)]) -> String {
        let line = |(name, size): &(&str, usize)| match self.language {
            Language::C => format!("#define {prefix}_{name} {size}\n"),
            Language::Rust => format!("pub const {name}: usize = {size};\n"),
        };
        let lines: String = sizes.iter().map(line).collect();
        match self.language {
            Language::C => {
                format!(
                    "{head}#ifndef {prefix}_SIZES_H\n#define {prefix}_SIZES_H\n\n{lines}\n#endif\n"
                )
            }
            Language::Rust => format!("{head}\n{lines}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_broken_into_lines() {
        let mut text = String::new();
        Notation::C.write_array(&mut text, "i16", "roots", 1000..1040);
        assert!(text.starts_with("static const int16_t roots[40] = {\n    1000, 1001,"), "{text}");
        assert!(text.lines().all(|line| line.len() <= LINE + 4), "{text}");
        text.clear();
        Notation::C.write_array(&mut text, "Option<u8>", "none", [0_i8; 0]);
        assert_eq!(text, "static const int8_t none[1] = {\n    0,\n};\n");
        text.clear();
        Notation::RUST.write_numbers(&mut text, "bands", [0.1, 1e-7]);
        assert_eq!(text, "static BANDS: [f64; 2] = [\n    0.1, 1e-7,\n];\n");
    }

    #[test]
    fn a_record_of_rust_names_its_fields_and_has_no_counts() {
        let fields = [
            ("limit", "1.0".into()),
            (COUNT, "3".into()),
            ("lows", Notation::RUST.array("lows_0")),
        ];
        assert_eq!(Notation::RUST.record("Known", &fields), "Known { limit: 1.0, lows: &LOWS_0 }");
        assert_eq!(Notation::C.kind("CommonPair"), "servotwin_common_pair");
    }
}
