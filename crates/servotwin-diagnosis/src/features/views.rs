//! The features that a diagnosis reads from one window, in every view.
//!
//! View `k` of a window rotates the actuators until actuator `k` comes first ([`crate::hierarchy`]). The constructor
//! looks names up once.

use super::{Sensors, features, values_into};
use crate::error::{Error, same_length};
use crate::residual::{Statistics, Window};
use alloc::vec;
use alloc::vec::Vec;

/// A window in a view, some of whose sensors have stand-in values.
struct Seen<'w> {
    window: &'w Window,
    stands_in: &'w [bool],
    /// The order of the sensors in the view; `None` for the own one.
    order: Option<&'w [usize]>,
}

impl Statistics for Seen<'_> {
    type Number = f64;

    fn samples(&self) -> f64 {
        self.window.samples()
    }

    fn mean(&self, sensor: usize) -> f64 {
        self.window.mean(sensor)
    }

    fn twin_mean(&self, sensor: usize) -> f64 {
        self.window.twin_mean(sensor)
    }

    fn covariance_of(&self, a: usize, b: usize) -> f64 {
        self.window.covariance_of(a, b)
    }

    fn largest(&self, sensor: usize) -> f64 {
        self.window.largest(sensor)
    }

    fn stands_in(&self, sensor: usize) -> f64 {
        let place = self.order.map_or(sensor, |order| order[sensor]);
        if self.stands_in[place] { 1.0 } else { 0.0 }
    }

    fn sensors(&self) -> usize {
        self.window.sensors()
    }
}

/// The largest residual of a healthy sensor in a window, in standard deviations.
const LARGEST_OF_STAND_IN: f64 = 3.0;

/// A window as if the unpaired sensors had stand-in values, too.
struct Paired<'w> {
    window: &'w Window,
    sensors: &'w Sensors,
    stands_in: &'w [bool],
    unpaired: &'w [bool],
}

impl Paired<'_> {
    /// Whether a channel is the residual of an unpaired sensor.
    fn is_hidden(&self, channel: usize) -> bool {
        self.unpaired.get(channel).is_some_and(|unpaired| *unpaired)
    }
}

impl Statistics for Paired<'_> {
    type Number = f64;

    fn samples(&self) -> f64 {
        self.window.samples()
    }

    fn mean(&self, sensor: usize) -> f64 {
        if self.unpaired[sensor] { 0.0 } else { self.window.mean(sensor) }
    }

    fn twin_mean(&self, sensor: usize) -> f64 {
        self.window.twin_mean(sensor)
    }

    fn covariance_of(&self, a: usize, b: usize) -> f64 {
        match self.is_hidden(a) || self.is_hidden(b) {
            true if a == b => {
                let noise = self.sensors.0[a].noise_of_stand_in();
                // As C divides the sum that it stores.
                noise * noise * self.samples() / self.samples()
            }
            true => 0.0,
            false => self.window.covariance_of(a, b),
        }
    }

    fn largest(&self, sensor: usize) -> f64 {
        match self.unpaired[sensor] {
            true => LARGEST_OF_STAND_IN * self.sensors.0[sensor].noise_of_stand_in(),
            false => self.window.largest(sensor),
        }
    }

    fn stands_in(&self, sensor: usize) -> f64 {
        if self.stands_in[sensor] || self.unpaired[sensor] { 1.0 } else { 0.0 }
    }

    fn sensors(&self) -> usize {
        self.window.sensors()
    }
}

/// Computes feature rows from windows in preallocated memory.
#[derive(Debug, Clone)]
pub struct Views {
    sensors: Sensors,
    /// The order of the sensors in each view beyond the first.
    orders: Vec<Vec<usize>>,
    /// Index of each read feature among all features.
    places: Vec<usize>,
    moved: Window,
    /// The sensors with a stand-in value that looks healthy.
    stands_in: Vec<bool>,
    /// The sensors that another actuator lacks.
    unpaired: Vec<bool>,
    all: Vec<f64>,
    rows: Vec<Vec<f64>>,
    /// The row that reads no unpaired sensor.
    paired: Vec<f64>,
}

impl Views {
    /// Prepares these features for the views of this many actuators.
    ///
    /// # Errors
    /// [`Error::UnknownFeature`] for a feature that the sensors do not give; [`Error::CorruptModel`] if the actuators'
    /// sensors do not correspond.
    pub fn new<N: AsRef<str>>(sensors: Sensors, names: &[N], views: usize) -> Result<Self, Error> {
        let known = features(&sensors);
        let find = |name: &N| {
            let place = known.iter().position(|feature| feature.name == name.as_ref());
            place.ok_or_else(|| Error::UnknownFeature { name: name.as_ref().into() })
        };
        let places = names.iter().map(find).collect::<Result<Vec<_>, _>>()?;
        let unlike =
            Error::CorruptModel { broken: "the sensors of the actuators do not correspond" };
        let orders = sensors.rotations(views).ok_or(unlike)?;
        Ok(Views {
            orders,
            moved: Window::new(sensors.0.len()),
            stands_in: vec![false; sensors.0.len()],
            unpaired: vec![false; sensors.0.len()],
            all: Vec::with_capacity(known.len()),
            rows: vec![vec![0.0; places.len()]; views.max(1)],
            paired: vec![0.0; places.len()],
            places,
            sensors,
        })
    }

    /// Sets which sensors have a stand-in value that looks healthy, and which are unpaired: another actuator lacks them.
    /// Relations between sensors with a stand-in value and others mean nothing.
    ///
    /// # Panics
    /// If a length is not the number of sensors.
    pub(crate) fn stand_in(&mut self, stands_in: &[bool], unpaired: &[bool]) {
        self.stands_in.copy_from_slice(stands_in);
        self.unpaired.copy_from_slice(unpaired);
    }

    /// Computes the rows of a window: the one that reads no unpaired sensor, and one for each view. Does not allocate.
    ///
    /// # Errors
    /// [`Error::LengthMismatch`] for a window with another number of sensors.
    pub fn compute(&mut self, window: &Window) -> Result<(&[f64], &[Vec<f64>]), Error> {
        same_length("sensors", self.sensors.0.len(), window.sensors())?;
        self.compute_views(window);
        if self.has_unpaired() {
            let Views { sensors, stands_in, unpaired, all, paired, .. } = self;
            values_into(sensors, &Paired { window, sensors, stands_in, unpaired }, all);
            for (value, &place) in paired.iter_mut().zip(&self.places) {
                *value = all[place];
            }
        }
        Ok(self.rows())
    }

    fn has_unpaired(&self) -> bool {
        self.unpaired.contains(&true)
    }

    fn compute_views(&mut self, window: &Window) {
        for (view, row) in self.rows.iter_mut().enumerate() {
            if let Some(order) = view.checked_sub(1).map(|place| &self.orders[place]) {
                window.reorder_into(order, &mut self.moved);
            }
            let window = if view == 0 { window } else { &self.moved };
            let order = view.checked_sub(1).map(|place| &*self.orders[place]);
            let seen = Seen { window, stands_in: &self.stands_in, order };
            values_into(&self.sensors, &seen, &mut self.all);
            for (value, &place) in row.iter_mut().zip(&self.places) {
                *value = self.all[place];
            }
        }
    }

    /// The rows of the last computed window, as [`Views::compute`] gives them.
    pub fn rows(&self) -> (&[f64], &[Vec<f64>]) {
        let paired = if self.has_unpaired() { &self.paired } else { &self.rows[0] };
        (paired, &self.rows)
    }
}
