//! What a window length learns from: windows of recordings whose fault is known.
//!
//! The same windows, features and views as a session's, so what was learnt is what will be asked.

use servotwin_diagnosis::Error;
use servotwin_diagnosis::features::{Feature, Sensors, Views, features};
use servotwin_diagnosis::hierarchy::Names;
use servotwin_diagnosis::residual::Window;
use servotwin_learning::hierarchy::{Examples, Label};

/// Windows of one length as rows of features, with their labels.
pub struct Lessons {
    features: Vec<Feature>,
    views: Views,
    /// Row-major, one table for each view.
    rows: Vec<Vec<f64>>,
    labels: Vec<Label>,
    groups: Vec<u32>,
}

impl Lessons {
    /// No rows yet, of the features of these sensors that teach; seen from each of the actuators
    /// where their sensors correspond.
    ///
    /// # Errors
    /// As [`Views::new`].
    pub fn new(sensors: Sensors, actuators: usize) -> Result<Self, Error> {
        let mut features = features(&sensors);
        features.retain(|feature| feature.teaches.of_windows());
        let names: Vec<&str> = features.iter().map(|feature| feature.name.as_str()).collect();
        let views = if sensors.rotations(actuators).is_some() { actuators } else { 1 };
        let views = Views::new(sensors, &names, views)?;
        Ok(Lessons {
            rows: vec![vec![]; views.rows().1.len()],
            features,
            views,
            labels: vec![],
            groups: vec![],
        })
    }

    /// Adds a window. `group` says what it was recorded with (a flight): windows of one group are
    /// alike.
    ///
    /// # Errors
    /// As [`Views::compute`].
    pub fn take(&mut self, window: &Window, label: Label, group: u32) -> Result<(), Error> {
        let (_, rows) = self.views.compute(window)?;
        self.rows.iter_mut().zip(rows).for_each(|(all, row)| all.extend(row));
        self.labels.push(label);
        self.groups.push(group);
        Ok(())
    }

    /// What each row was recorded with.
    pub fn groups(&self) -> &[u32] {
        &self.groups
    }

    /// The rows as a hierarchy learns from them; of `names` the features are replaced by these. The
    /// stages of an actuator read what looks at it alone, if there is anything.
    ///
    /// # Errors
    /// As [`Examples::new`].
    pub fn examples(&self, names: &Names) -> Result<Examples, Error> {
        let names = Names {
            features: self.features.iter().map(|feature| feature.name.clone()).collect(),
            ..names.clone()
        };
        let read = (0..names.actuators.len()).map(|actuator| self.own(actuator)).collect();
        let views = self.rows.iter().map(|rows| self.columns(rows)).collect();
        Examples::new(names, read, views, self.labels.clone())
    }

    fn own(&self, actuator: usize) -> Vec<usize> {
        let all = 0..self.features.len();
        let own: Vec<usize> =
            all.clone().filter(|&column| self.features[column].actuators == [actuator]).collect();
        if own.is_empty() { all.collect() } else { own }
    }

    fn columns(&self, rows: &[f64]) -> Vec<f64> {
        let width = self.features.len();
        let column = |column: usize| rows.iter().skip(column).step_by(width.max(1)).copied();
        (0..width).flat_map(column).collect()
    }
}
