//! Built-in systems and studies, which names select wherever a file is expected.

/// Systems: name and text of the file.
pub const SYSTEMS: [(&str, &str); 4] = [
    ("aileron_dual", include_str!("../../../systems/aileron_dual.toml")),
    ("spring_actuator", include_str!("../../../systems/spring_actuator.toml")),
    ("valve_and_cylinder", include_str!("../../../systems/valve_and_cylinder.toml")),
    ("press_axis", include_str!("../../../systems/press_axis.toml")),
];

/// Studies: name and text of the file.
pub const STUDIES: [(&str, &str); 3] = [
    ("paper", include_str!("../../../studies/paper.toml")),
    ("spring_actuator", include_str!("../../../studies/spring_actuator.toml")),
    ("press_axis", include_str!("../../../studies/press_axis.toml")),
];

/// The text of the built-in system or study with this name.
pub fn find(list: &[(&'static str, &'static str)], name: &str) -> Option<&'static str> {
    list.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
