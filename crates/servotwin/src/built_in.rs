//! Systems and studies that can be named without a file, wherever a file is asked for.

/// Systems: the name and the text of the file.
pub const SYSTEMS: [(&str, &str); 3] = [
    ("aileron_dual", include_str!("../../../systems/aileron_dual.toml")),
    ("spring_actuator", include_str!("../../../systems/spring_actuator.toml")),
    ("valve_and_cylinder", include_str!("../../../systems/valve_and_cylinder.toml")),
];

/// Studies: the name and the text of the file.
pub const STUDIES: [(&str, &str); 2] = [
    ("paper", include_str!("../../../studies/paper.toml")),
    ("spring_actuator", include_str!("../../../studies/spring_actuator.toml")),
];

/// The text of a built-in system or study.
pub fn find(list: &[(&'static str, &'static str)], name: &str) -> Option<&'static str> {
    list.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}

/// What to say where a file is missing that is named like something built in.
pub fn hint(list: &[(&'static str, &'static str)]) -> String {
    list.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}
