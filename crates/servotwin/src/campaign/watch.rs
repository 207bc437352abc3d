//! Reduces a running simulation to the windows of all variants that it serves, in every requested scenario.

use super::{Campaign, PreparedCampaign};
use crate::ensemble::Sink;
use crate::experiment::{Observer, RecordedRun, SensorChain, SpecimenDraw, Watch};
use servotwin_diagnosis::residual::Window;

impl Campaign<'_> {
    /// The sink of a simulated variant. `scales` are the study's.
    pub(super) fn watch<'w>(
        &self,
        PreparedCampaign { images, counts, .. }: &PreparedCampaign,
        simulated: usize,
        twin: &'w RecordedRun,
        scales: &'w [f64],
    ) -> Views<'w> {
        let Campaign { study, role, .. } = *self;
        let sensors = study.measured.len();
        let mut views = Vec::new();
        for (place, (&setting, &planned)) in self.settings.iter().zip(counts).enumerate() {
            let own = images.served(simulated).filter(|&variant| variant < planned);
            views.extend(own.map(|number| {
                let draw = SpecimenDraw { study, setting, lot: role.into(), number };
                let view = View {
                    setting: place,
                    variant: number,
                    scales,
                    window: Window::watching(sensors, study.base_sensors()),
                    trace: self.keep_traces.then(|| vec![Vec::new(); sensors]),
                };
                let chain = SensorChain::new(study, sensors, draw.noise());
                Watch::new(twin, images.order(number, sensors), chain, view)
            }));
        }
        Views(views)
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
