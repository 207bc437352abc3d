use super::decision::{ConditionTree, Vector};
use super::*;

const FILE: &str = "small.c";

fn read(text: &str) -> Result<Instrumented, ExportError> {
    instrument(&[SourceFile { name: FILE, text: text.into() }], &[FILE])
}

/// The decisions of a function with this body.
fn decisions_of(body: &str) -> Vec<Decision> {
    read(&format!("static int f(int a, int b, int c, int d)\n{{\n{body}\n}}\n")).unwrap().decisions
}

/// The evaluation of a decision by conditions that are all evaluated as C does.
fn evaluated(tree: &ConditionTree, values: u32) -> Vector {
    fn take(tree: &ConditionTree, values: u32, vector: &mut Vector) -> bool {
        match tree {
            ConditionTree::Condition(condition) => {
                let value = values >> condition & 1;
                vector.evaluated |= 1 << condition;
                vector.values |= value << condition;
                value == 1
            }
            ConditionTree::Not(inner) => !take(inner, values, vector),
            ConditionTree::And(sides) => {
                take(&sides[0], values, vector) && take(&sides[1], values, vector)
            }
            ConditionTree::Or(sides) => {
                take(&sides[0], values, vector) || take(&sides[1], values, vector)
            }
            ConditionTree::Cases => false,
        }
    }
    let mut vector = Vector { evaluated: 0, values: 0 };
    take(tree, values, &mut vector);
    vector
}

/// For each condition, whether these evaluations show it. A row has a digit for each condition, the first one first.
fn shown(decision: &Decision, rows: &[&str]) -> Vec<bool> {
    let vectors: Vec<Vector> = rows
        .iter()
        .map(|row| {
            let digits = row.bytes().enumerate();
            let values = digits.map(|(place, digit)| u32::from(digit == b'1') << place).sum();
            evaluated(&decision.tree, values)
        })
        .collect();
    (0..decision.conditions.len())
        .map(|condition| matches!(decision.find(condition, &vectors), Shown::Pair(_)))
        .collect()
}

#[test]
fn conditions_are_shown_by_the_evaluations_of_the_textbooks() {
    let both = &decisions_of("return a && b;")[0];
    assert_eq!(shown(both, &["11", "01", "10"]), [true, true]);
    assert_eq!(shown(both, &["11", "01"]), [true, false]);
    let nested = &decisions_of("if (a || (b && c)) { return 1; }\nreturn 0;")[0];
    assert_eq!((nested.kind, nested.conditions.len()), (DecisionKind::If, 3));
    assert_eq!(shown(nested, &["100", "011", "001", "010"]), [true; 3]);
    // Without b = 0 and c = 1, b never decides.
    assert_eq!(shown(nested, &["100", "011", "010"]), [true, false, true]);
    // With a true, b and c are not evaluated at all.
    assert_eq!(shown(nested, &["100", "111", "101"]), [false; 3]);
    let one = &decisions_of("return a ? b : c;")[0];
    assert_eq!((one.kind, shown(one, &["1"])), (DecisionKind::Choice, vec![false]));
    assert_eq!(shown(one, &["1", "0"]), [true]);
}

#[test]
fn a_condition_that_repeats_another_is_never_independent() {
    let twice = &decisions_of("return (a && b) || (a && c);")[0];
    let all = ["00", "01", "10", "11"]
        .map(|bc| ["0", "1"].map(|a| format!("{a}{}{a}{}", &bc[..1], &bc[1..])));
    let all: Vec<&str> = all.iter().flatten().map(String::as_str).collect();
    assert_eq!(shown(twice, &all), [true; 4], "masking lets another condition differ");
    // a || (!a && b): the second a is false whenever it is evaluated.
    let never = &decisions_of("return a || (!a && b);")[0];
    assert_eq!(never.conditions, ["a", "a", "b"]);
    assert_eq!(shown(never, &["000", "001", "110", "111"]), [true, false, true]);
}

#[test]
fn every_decision_of_a_function_is_found() {
    let found = decisions_of(
        "for (int i = 0; (i < a) && (b != 0); i++) {\n    const int is_low = (c < 1) || !(a && d);\n    a = \
         (int)(b > 0) + g(c ? 1 : 0, !d);\n}\nwhile (a < b) {\n    a++;\n}\nswitch (a) {\ncase 1:\ncase 2:\n    \
         break;\ndefault:\n    return (a & b) != 0;\n}\nreturn sizeof(int) * (size_t)-a;",
    );
    let all: Vec<(&str, usize, usize)> =
        found.iter().map(|d| (d.kind.name(), d.line, d.conditions.len())).collect();
    assert_eq!(
        all,
        [
            ("for", 3, 2),
            ("value", 4, 3),
            ("value", 5, 1),
            ("?:", 5, 1),
            ("value", 5, 1),
            ("while", 7, 1),
            ("switch", 10, 3),
            ("value", 15, 1)
        ]
    );
    assert_eq!(found[1].text, "(c < 1) || !(a && d)");
    assert_eq!(found[6].conditions, ["1", "2", "default"]);
}

#[test]
fn what_is_not_understood_is_refused_with_its_place() {
    for (text, line) in [
        ("int f(int a)\n{\n    do { a--; } while (a > 0);\n}\n", 3),
        ("int f(int a)\n{\n    if (a) goto end;\n}\n", 3),
        ("#define BOTH(a, b) ((a) && (b))\n", 1),
        ("#define TWICE(x) ((x) + (x))\n", 1),
        ("#define OTHER(x) ((double)(y))\n", 1),
        ("int f(int a)\n{\n    return (unknown)a;\n}\n", 3),
        ("int f(int a)\n{\n    int b = 1, c = 2;\n}\n", 3),
        ("int f(int a)\n{\n    switch (a) {\n    case 1:\n        break;\n    }\n}\n", 3),
        ("/* no end", 1),
        ("int f(int a)\n{\n    return a @ 1;\n}\n", 3),
    ] {
        match read(text).map(|read| read.decisions) {
            Err(ExportError::NotUnderstood { line: found, .. }) => {
                assert_eq!(found, line, "{text}")
            }
            other => panic!("{text}: {other:?}"),
        }
    }
}

#[test]
fn a_macro_that_casts_its_argument_is_a_call() {
    let read =
        read("#define REAL(x) ((double)(x))\nint f(double a)\n{\n    return a > REAL(1.0);\n}\n")
            .unwrap();
    assert_eq!(read.decisions[0].text, "a > REAL(1.0)");
}

#[test]
fn the_copy_has_the_text_and_what_records_it() {
    let Instrumented { files, .. } =
        read("int f(int a)\n{\n    return (a > 0) ? a : -a;\n}\n").unwrap();
    let expected = "#include \"mcdc.h\"\nint f(int a)\n{\n    return (mcdc_begin(0), mcdc_end(0, \
                    ((mcdc_condition(0, 0, (a > 0)))))) ? a : -a;\n}\n";
    assert_eq!(files[0].text, expected);
}
