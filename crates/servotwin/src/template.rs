//! A system and a study to begin with: a servo actuator that runs as it is.

const SYSTEM: &str = include_str!("template/system.toml");
const STUDY: &str = include_str!("template/study.toml");

/// Both files under a name of the user's.
pub struct Template {
    name: String,
}

impl Template {
    /// `None` where a system cannot have this name.
    pub fn new(name: &str) -> Option<Self> {
        let good = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        let fits = !name.is_empty() && name.chars().all(good);
        fits.then(|| Self { name: name.into() })
    }

    /// The system's file name.
    pub fn system_name(&self) -> String {
        format!("{}.toml", self.name)
    }

    /// The study's file name.
    pub fn study_name(&self) -> String {
        format!("{}_study.toml", self.name)
    }

    /// The system file.
    pub fn system(&self) -> String {
        SYSTEM.replace("NAME", &self.name)
    }

    /// The study file, which looks for the system beside itself.
    pub fn study(&self) -> String {
        STUDY.replace("NAME", &self.name)
    }
}
