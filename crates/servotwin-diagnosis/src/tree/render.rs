//! A tree as readable text.

use alloc::string::String;
use alloc::vec;
use core::fmt::Write;

use super::Tree;

impl Tree {
    /// The tree as indented text, one line for each side of a split and one for each leaf:
    ///
    /// ```text
    /// |- pressure_mean <= 0.031
    /// |  => healthy (rows 40, purity 1.000)
    /// |- pressure_mean > 0.031
    /// |  => leakage (rows 38, purity 0.974)
    /// ```
    ///
    /// A name that the lists lack appears as `feature 3` or `class 3`.
    pub fn text(&self, feature_names: &[String], class_names: &[String]) -> String {
        let mut text = String::new();
        // Stack of (node, line that leads to it); the next one is last.
        let mut stack = vec![(0, String::new())];
        while let Some((node, lead)) = stack.pop() {
            text.push_str(&lead);
            let indent = "|  ".repeat(self.node_depth(node));
            match self.split(node).zip(self.children(node)) {
                Some(((feature, threshold), (left, right))) => {
                    let name = name_of(feature_names, "feature", feature);
                    let missing = |is_here: bool| match self.branches().knows_missing() && is_here {
                        true => " or missing",
                        false => "",
                    };
                    let line = |sign, missing| {
                        alloc::format!("{indent}|- {name} {sign} {threshold}{missing}\n")
                    };
                    let missing_left = self.branches().missing_left(node);
                    stack.push((right, line(">", missing(!missing_left))));
                    stack.push((left, line("<=", missing(missing_left))));
                }
                None => {
                    let leaf = self.report(node);
                    let class = name_of(class_names, "class", leaf.class as usize);
                    let (rows, purity) = (leaf.rows, leaf.purity);
                    // Writing to a string cannot fail.
                    let _ = writeln!(text, "{indent}=> {class} (rows {rows}, purity {purity:.3})");
                }
            }
        }
        text
    }
}

fn name_of(names: &[String], kind: &str, place: usize) -> String {
    names.get(place).cloned().unwrap_or_else(|| alloc::format!("{kind} {place}"))
}
