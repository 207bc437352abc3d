//! A table as texts.

use servotwin_io::table::TableError;
use servotwin_io::table::csv::texts::{Texts, read};

fn read_text(text: &[u8]) -> Result<Texts, TableError> {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), text).unwrap();
    read(file.path())
}

#[test]
fn cells_stay_as_they_are_written() {
    let text = "a;b;\n1e-7;\"x; \"\"y\"\"\"\n\n;NA\n".replace("\n;NA\n", "\n;NA;\n");
    let text = text.replace("\"\"\"\n", "\"\"\";\n");
    let found = read_text(text.as_bytes()).unwrap();
    assert_eq!(found.columns, ["a", "b"]);
    assert_eq!(found.rows[0].cells, ["1e-7", "x; \"y\""]);
    assert_eq!((found.rows[1].line, &found.rows[1].cells[1][..]), (4, "NA"));
}

#[test]
fn latin_letters_are_understood_and_ragged_rows_are_not() {
    assert_eq!(read_text(b"a,b\n\xb5,2\n").unwrap().rows[0].cells, ["µ", "2"]);
    let error = read_text(b"a,b\n1\n").unwrap_err().to_string();
    assert!(error.contains("line 2 has 1 cells, the header has 2"), "{error}");
    assert!(read_text(b"").unwrap_err().to_string().contains("the file is empty"));
}
