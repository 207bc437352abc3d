//! The features that a diagnosis reads, of one window in every view.
//!
//! View `k` of a window is the window with the units moved round until unit `k` stands first
//! ([`crate::hierarchy`]). Names are looked up once, when this is made.

use super::{Sensors, features, values_into};
use crate::error::{Error, same_length};
use crate::residual::Window;
use alloc::vec;
use alloc::vec::Vec;

/// Makes rows of features from windows, in memory that is there from the beginning.
#[derive(Debug, Clone)]
pub struct Views {
    sensors: Sensors,
    /// The order of the sensors in each view beyond the first.
    orders: Vec<Vec<usize>>,
    /// Where each feature that is read stands among all.
    places: Vec<usize>,
    moved: Window,
    /// The sensors in whose place something stands that looks healthy.
    stands_in: Vec<bool>,
    all: Vec<f64>,
    rows: Vec<Vec<f64>>,
}

impl Views {
    /// The features of these names, seen from each of so many like units.
    ///
    /// # Errors
    /// [`Error::UnknownFeature`] for one that the sensors do not give; [`Error::CorruptModel`] if
    /// the sensors of the units do not correspond.
    pub fn new<N: AsRef<str>>(sensors: Sensors, names: &[N], views: usize) -> Result<Self, Error> {
        let known = features(&sensors);
        let find = |name: &N| {
            let place = known.iter().position(|feature| feature.name == name.as_ref());
            place.ok_or_else(|| Error::UnknownFeature { name: name.as_ref().into() })
        };
        let places = names.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let unlike = Error::CorruptModel { broken: "the sensors of the units do not correspond" };
        let orders = sensors.rotations(views).ok_or(unlike)?;
        Ok(Views {
            orders,
            moved: Window::new(sensors.0.len()),
            stands_in: vec![false; sensors.0.len()],
            all: Vec::with_capacity(known.len()),
            rows: vec![vec![0.0; places.len()]; views.max(1)],
            places,
            sensors,
        })
    }

    /// Says of each sensor whether something stands in its place that looks healthy, from now on: what is said of it
    /// beside others means nothing then.
    ///
    /// # Panics
    /// If there are not as many as sensors.
    pub fn stand_in(&mut self, stands_in: &[bool]) {
        self.stands_in.copy_from_slice(stands_in);
    }

    /// The rows of a window, one for each view. Does not allocate.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] for a window of other sensors.
    pub fn compute(&mut self, window: &Window) -> Result<&[Vec<f64>], Error> {
        same_length("sensors", self.sensors.0.len(), window.sensors())?;
        for (view, row) in self.rows.iter_mut().enumerate() {
            if let Some(order) = view.checked_sub(1).map(|place| &self.orders[place]) {
                window.reorder_into(order, &mut self.moved);
            }
            let seen = if view == 0 { window } else { &self.moved };
            for (place, sensor) in self.sensors.0.iter_mut().enumerate() {
                let here = if view == 0 { place } else { self.orders[view - 1][place] };
                sensor.stands_in = self.stands_in[here];
            }
            values_into(&self.sensors, seen, &mut self.all);
            for (value, &place) in row.iter_mut().zip(&self.places) {
                *value = self.all[place];
            }
        }
        Ok(&self.rows)
    }

    /// The rows of the window that was computed last.
    pub fn rows(&self) -> &[Vec<f64>] {
        &self.rows
    }
}
