//! Reduces a running simulation to the windows of all variants that it serves, in every requested scenario.

use super::{Campaign, Images, Setting};
use crate::ensemble::Sink;
use crate::experiment::{Observer, RecordedRun, SensorChain, SpecimenDraw, Watch};
use servotwin_diagnosis::residual::Window;

/// Creates the sinks of simulated variants.
pub(super) struct Observers<'c> {
    campaign: &'c Campaign<'c>,
    images: &'c Images,
    scales: Vec<f64>,
}

impl<'c> Observers<'c> {
    pub fn new(campaign: &'c Campaign<'c>, images: &'c Images) -> Self {
        Self { campaign, images, scales: campaign.study.scales() }
    }

    /// The sink of a simulated variant. `planned` is the length of each scenario's plan.
    pub fn watch<'w>(
        &'w self,
        simulated: usize,
        twin: &'w RecordedRun,
        planned: &[usize],
    ) -> Views<'w> {
        let mut views = Vec::new();
        for (setting, &variants) in planned.iter().enumerate() {
            let own = self.images.served(simulated).filter(|&variant| variant < variants);
            views.extend(own.map(|variant| self.view(setting, variant, twin)));
        }
        Views(views)
    }

    /// One variant as its sensors show it in one scenario.
    fn view<'w>(
        &'w self,
        setting: usize,
        variant: usize,
        twin: &'w RecordedRun,
    ) -> Watch<'w, View<'w>> {
        let Campaign { study, role, .. } = *self.campaign;
        let count = study.measured.len();
        let drawn = self.campaign.settings[setting];
        let draw = SpecimenDraw { study, setting: drawn, lot: role.into(), number: variant };
        let view = View {
            setting,
            variant,
            scales: &self.scales,
            window: Window::watching(count, study.base_sensors()),
            trace: self.campaign.keep_traces.then(|| vec![Vec::new(); count]),
        };
        let order = self.images.order(variant).map_or_else(|| (0..count).collect(), Vec::from);
        Watch::new(twin, order, SensorChain::new(study, count, draw.noise()), view)
    }
}

/// The window of one variant in one scenario.
pub(super) struct View<'w> {
    /// The index of the scenario in the campaign's list.
    pub setting: usize,
    pub variant: usize,
    scales: &'w [f64],
    pub window: Window,
    /// The measured values, if they are stored.
    pub trace: Option<Vec<Vec<f64>>>,
}

impl Observer for View<'_> {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        if let Some(trace) = &mut self.trace {
            trace.sample(index, measured);
        }
        self.window.add(measured, twin, self.scales);
    }
}

/// All variants that one simulation serves.
pub(super) struct Views<'w>(pub Vec<Watch<'w, View<'w>>>);

impl Sink for Views<'_> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        self.0.iter_mut().for_each(|view| view.sample(index, values));
    }
}

impl Setting {
    /// Number of variants of a plan in the data set of a scenario. Without noise, healthy specimens equal the twin and
    /// are left out.
    pub(super) fn planned(self, plan: &[super::Planned]) -> usize {
        let faults = plan.iter().filter(|planned| planned.fault.is_some()).count();
        if self.has_noise() { plan.len() } else { faults }
    }
}
