//! Statements in scopes of limited depth.
//!
//! In Rust every `let` opens a scope within that of the one before. With debug information, a function with thousands of
//! them overflows the stack of the compiler (rustc 1.95). So long functions are printed in blocks, each of which returns
//! the values that later blocks use; the statements and their order stay the same.

use crate::symbol::{Expression, Operand};
use alloc::format;
use alloc::string::String;
use alloc::vec;
use alloc::vec::Vec;

/// The expressions of a function in blocks.
pub(super) struct Scopes {
    nodes: Vec<usize>,
    most: usize,
    /// The values of each block that are used after it.
    kept: Vec<Vec<usize>>,
}

impl Scopes {
    /// Divides the needed expressions into blocks of at most so many. `is_result` marks the values that are used after all blocks.
    pub fn new(
        expressions: &[Expression],
        needed: &[bool],
        most: usize,
        is_result: impl Fn(Operand) -> bool,
    ) -> Self {
        let nodes: Vec<usize> = (0..expressions.len()).filter(|&node| needed[node]).collect();
        let mut last_use = vec![0; expressions.len()];
        for (place, &node) in nodes.iter().enumerate() {
            for used in expressions[node].needs() {
                last_use[used as usize] = place / most;
            }
        }
        let is_kept = |node: usize, block: usize| {
            let is_variable = matches!(expressions[node], Expression::Variable(..));
            let is_used = last_use[node] > block || is_result(Operand::Node(node as u32));
            is_used && !is_variable
        };
        let blocks = nodes.chunks(most).enumerate();
        let kept = blocks
            .map(|(block, own)| own.iter().copied().filter(|&node| is_kept(node, block)).collect());
        let kept = kept.collect();
        Self { nodes, most, kept }
    }

    /// The number of blocks.
    pub fn count(&self) -> usize {
        self.kept.len()
    }

    /// The expressions of a block.
    pub fn nodes(&self, block: usize) -> &[usize] {
        let first = block * self.most;
        &self.nodes[first..self.nodes.len().min(first.saturating_add(self.most))]
    }

    /// A single block is the function itself.
    fn has_brackets(&self) -> bool {
        self.count() > 1
    }

    /// The values that a block returns, as a pattern or a tuple.
    fn names(&self, block: usize) -> String {
        let names: Vec<String> = self.kept[block].iter().map(|node| format!("v{node}")).collect();
        if names.len() == 1 { names.concat() } else { format!("({})", names.join(", ")) }
    }

    /// The line before a block.
    pub fn head(&self, block: usize) -> Option<String> {
        self.has_brackets().then(|| match self.kept[block].is_empty() {
            true => "{".into(),
            false => format!("let {} = {{", self.names(block)),
        })
    }

    /// The lines after a block.
    pub fn tail(&self, block: usize) -> Option<String> {
        self.has_brackets().then(|| match self.kept[block].is_empty() {
            true => "}".into(),
            false => format!("{}\n    }};", self.names(block)),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::printer::Stores;
    use super::super::statements::{RustStatements, print_statements};
    use crate::symbol::Graph;
    use alloc::string::String;
    use alloc::vec;

    #[test]
    fn a_long_function_consists_of_blocks_that_return_what_later_ones_use() {
        let graph = Graph::new();
        let x = graph.variable("a", 0);
        let (mut sum, first) = (x, x * x);
        for _ in 0..100 {
            sum = sum + first;
        }
        let stores = Stores::from([(sum.operand(), vec![("into", 0)])]);
        let mut text = String::new();
        print_statements(&mut text, RustStatements, &graph.expressions(), &stores);
        assert!(text.starts_with("    let (v1, v63) = {\n    let v1 = a[0] * a[0];\n"), "{text}");
        assert!(text.contains("    (v1, v63)\n    };\n    {\n    let v64 = v1 + v63;\n"), "{text}");
        assert!(text.ends_with("    into[0] = v101;\n    }\n"), "{text}");
    }
}
