//! Arrays as C99 text.

use servotwin_model::c_source::hexadecimal;
use std::fmt::{Display, Write};

/// Longest line of an array, in characters.
const LINE: usize = 110;

/// Adds `static const KIND NAME[] = { … };`. An empty array gets one zero, because C has no empty arrays.
pub(crate) fn array<T: Display>(
    c: &mut String,
    kind: &str,
    name: &str,
    items: impl IntoIterator<Item = T>,
) {
    let mut texts: Vec<String> = items.into_iter().map(|item| item.to_string()).collect();
    if texts.is_empty() {
        texts.push("0".into());
    }
    let _ = writeln!(c, "static const {kind} {name}[{}] = {{", texts.len());
    let mut line = String::new();
    for text in texts {
        if line.len() + text.len() + 1 > LINE {
            let _ = writeln!(c, "   {line}");
            line.clear();
        }
        let _ = write!(line, " {text},");
    }
    let _ = writeln!(c, "   {line}\n}};");
}

/// As [`array`], of numbers.
pub(crate) fn numbers(c: &mut String, name: &str, items: impl IntoIterator<Item = f64>) {
    array(c, "double", name, items.into_iter().map(hexadecimal));
}

/// A header with `#define PREFIX_NAME SIZE` for every size.
pub(crate) fn sizes(head: &str, prefix: &str, sizes: &[(&str, usize)]) -> String {
    let mut h = format!("{head}#ifndef {prefix}_SIZES_H\n#define {prefix}_SIZES_H\n\n");
    for (name, size) in sizes {
        let _ = writeln!(h, "#define {prefix}_{name} {size}");
    }
    h + "\n#endif\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_array_is_broken_into_lines() {
        let mut c = String::new();
        array(&mut c, "int16_t", "roots", 1000..1040);
        assert!(c.starts_with("static const int16_t roots[40] = {\n    1000, 1001,"), "{c}");
        assert!(c.lines().all(|line| line.len() <= LINE + 4), "{c}");
        c.clear();
        array(&mut c, "int8_t", "none", [0_i8; 0]);
        assert_eq!(c, "static const int8_t none[1] = {\n    0,\n};\n");
    }
}
