//! Systems and studies that can be named without a file, wherever a file is asked for.

/// Systems: the name and the text of the file.
pub const SYSTEMS: [(&str, &str); 5] = [
    ("aileron_dual", include_str!("../../../systems/aileron_dual.toml")),
    ("spring_actuator", include_str!("../../../systems/spring_actuator.toml")),
    ("valve_and_cylinder", include_str!("../../../systems/valve_and_cylinder.toml")),
    ("press_axis", include_str!("../../../systems/press_axis.toml")),
    ("aileron_relief", include_str!("../../../systems/aileron_relief.toml")),
];

/// Studies: the name and the text of the file.
pub const STUDIES: [(&str, &str); 3] = [
    ("paper", include_str!("../../../studies/paper.toml")),
    ("spring_actuator", include_str!("../../../studies/spring_actuator.toml")),
    ("press_axis", include_str!("../../../studies/press_axis.toml")),
];

/// The text of a built-in system or study.
pub fn find(list: &[(&'static str, &'static str)], name: &str) -> Option<&'static str> {
    list.iter().find(|(known, _)| *known == name).map(|(_, text)| *text)
}
