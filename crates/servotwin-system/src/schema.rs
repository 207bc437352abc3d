//! JSON Schema (draft 2020-12) of system and study files, from the declarations. Editors use it for completion and
//! checks. Only `servotwin check` reports mistakes that need the whole file, such as open ports and unknown names.

use crate::{format, signal, study, system};
use serde_json::{Map, Value};

/// The schema of system files.
pub fn system() -> Value {
    system::schema()
}

/// The schema of study files.
pub fn study() -> Value {
    let definitions = Map::from_iter([("signal".into(), signal::schema())]);
    format::schema("servotwin study file", study::keys(), definitions)
}
