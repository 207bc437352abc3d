//! Reduces a running simulation to the windows of all variants that it serves, in every requested scenario.

use super::{Campaign, Images};
use crate::ensemble::Sink;
use crate::signal::random::Random;
use crate::system::imperfection::Imperfections;
use servotwin_diagnosis::residual::Window;

/// The twin in an operating case.
pub(super) struct Twin {
    /// Its signals, ordered by sample.
    pub samples: Vec<f64>,
    /// The solver's steps per simulated second.
    pub steps_per_s: f64,
    /// Whether it began without a steady state.
    pub is_moving: bool,
}

/// Creates the sinks of simulated variants.
pub(super) struct Observer<'c> {
    campaign: &'c Campaign<'c>,
    images: &'c Images,
    scales: Vec<f64>,
    imperfections: Imperfections,
}

impl<'c> Observer<'c> {
    pub fn new(campaign: &'c Campaign<'c>, images: &'c Images) -> Self {
        let study = campaign.study;
        let imperfections = Imperfections::of(&study.system, &study.measured);
        Self { campaign, images, scales: study.scales(), imperfections }
    }

    /// The sink of a simulated variant. `planned` is the length of each scenario's plan.
    pub fn watch<'w>(&'w self, simulated: usize, twin: &'w Twin, planned: &[usize]) -> Watch<'w> {
        let mut views = Vec::new();
        for (setting, &variants) in planned.iter().enumerate() {
            let own = self.images.served(simulated).filter(|&variant| variant < variants);
            views.extend(own.map(|variant| self.view(setting, variant)));
        }
        let count = self.scales.len();
        Watch {
            observer: self,
            views,
            twin,
            measured: vec![0.0; count],
            expected: vec![0.0; count],
        }
    }

    fn view(&self, setting: usize, variant: usize) -> View<'_> {
        let Campaign { study, role, .. } = *self.campaign;
        let count = study.measured.len();
        let realism = study.realism.as_ref();
        let has_noise = self.campaign.settings[setting].has_noise();
        let noise = realism.filter(|_| has_noise).map(|r| r.noise(role.into(), variant));
        View {
            setting,
            variant,
            order: self.images.order(variant),
            noise,
            window: Window::watching(count, study.base_sensors()),
            trace: self.campaign.keep_traces.then(|| vec![Vec::new(); count]),
        }
    }
}

/// One variant as its sensors show it in one scenario.
pub(super) struct View<'w> {
    /// The index of the scenario in the campaign's list.
    pub setting: usize,
    pub variant: usize,
    order: Option<&'w [usize]>,
    noise: Option<Random>,
    pub window: Window,
    /// The measured values, if they are stored.
    pub trace: Option<Vec<Vec<f64>>>,
}

/// Compares the sensors of a simulation with the twin's, sample by sample.
pub(super) struct Watch<'w> {
    observer: &'w Observer<'w>,
    pub views: Vec<View<'w>>,
    pub twin: &'w Twin,
    measured: Vec<f64>,
    expected: Vec<f64>,
}

impl Sink for Watch<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        let twin = &self.twin.samples[index * values.len()..][..values.len()];
        for view in &mut self.views {
            match view.order {
                None => {
                    self.measured.copy_from_slice(values);
                    self.expected.copy_from_slice(twin);
                }
                Some(order) => {
                    copy_in_order(&mut self.measured, values, order);
                    copy_in_order(&mut self.expected, twin, order);
                }
            }
            if let Some(noise) = &mut view.noise {
                self.observer.imperfections.apply(&mut self.measured, noise);
            }
            if let Some(trace) = &mut view.trace {
                for (column, &value) in trace.iter_mut().zip(&self.measured) {
                    column.push(value);
                }
            }
            view.window.add(&self.measured, &self.expected, &self.observer.scales);
        }
    }
}

fn copy_in_order(target: &mut [f64], values: &[f64], order: &[usize]) {
    for (slot, &sensor) in target.iter_mut().zip(order) {
        *slot = values[sensor];
    }
}
