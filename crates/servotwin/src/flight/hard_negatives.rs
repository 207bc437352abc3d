//! Searches many environments for hard negatives: healthy windows that leave their bands.
//!
//! Trees and committee are only asked about windows that leave their bands. Few healthy windows do: a few hundred in
//! all healthy flights of a study, most of them in a few environments. Additional flights, one in each of many
//! environments, provide more such windows; nothing else of them is kept.

use super::campaign::{FlightCampaign, Observer};
use super::plan::{PlannedFlight, Purpose};
use super::training_windows::{BaselineCorrected, Cut, TrainingWindow, TrainingWindows};
use super::windows::{self, WindowKind};
use crate::experiment::CampaignError;
use crate::parallel::Workers;
use crate::study::{Flights, Setting, Study};
use servotwin_diagnosis::sliding::{Sliding, WindowSpan};

/// Number of environments whose twins are in memory at a time.
const BATCH: usize = 200;

/// Flies the additional flights of a study. Windows that leave the bands of `lessons` are added to `lessons`.
///
/// # Errors
/// A twin cannot be simulated, or the run was cancelled.
pub fn add(
    study: &Study,
    flights: &Flights,
    setting: Setting,
    lessons: &mut TrainingWindows,
    pools: &[usize],
    workers: Workers,
) -> Result<(), CampaignError> {
    let kinds = windows::kinds(flights, setting);
    lessons.sort();
    let bands = (0..kinds.len()).map(|kind| lessons.bands(kind, pools));
    let Some(bands) = bands.collect::<Option<Vec<Vec<f64>>>>() else { return Ok(()) };
    let all = flights.learned.len();
    for from in (flights.learn.environments..all).step_by(BATCH) {
        let batch = from..all.min(from + BATCH);
        let is_chosen = |environment: usize| batch.contains(&environment);
        let flown = FlightCampaign::where_it_is(
            study,
            flights,
            Purpose::Learn,
            setting,
            is_chosen,
            workers,
        )?;
        let seeking = Seeking::new(study, flights, setting, &kinds, &bands);
        flown.fly(
            &flown.which,
            |flight| Seeking { flight: Some(*flight), ..seeking.clone() },
            |flight, seeking, outcome| match outcome {
                Ok(work) if flown.is_on_the_move(flight, &work) => lessons.leave_out(flight),
                Ok(_) => seeking.found.into_iter().for_each(|lesson| lessons.push(lesson)),
                Err(_) => lessons.failed += 1,
            },
        );
        if workers.is_cancelled() {
            return Err(CampaignError::Cancelled);
        }
    }
    Ok(())
}

/// Searches for windows that leave their bands, at the places where a diagnosis looks.
#[derive(Clone)]
struct Seeking<'s> {
    kinds: &'s [WindowKind],
    bands: &'s [Vec<f64>],
    flight: Option<PlannedFlight>,
    scales: Vec<f64>,
    /// Windows of the absolute residuals.
    absolute: Sliding,
    /// Windows of the baseline-corrected residuals.
    baseline_corrected: Option<(BaselineCorrected, Sliding)>,
    found: Vec<TrainingWindow>,
}

impl<'s> Seeking<'s> {
    fn new(
        study: &Study,
        flights: &Flights,
        setting: Setting,
        kinds: &'s [WindowKind],
        bands: &'s [Vec<f64>],
    ) -> Self {
        let scales = study.scales()[..study.base_sensors()].to_vec();
        let period_s = study.sample_period_s;
        let sliding = |is_baseline_corrected: bool| {
            let own =
                kinds.iter().filter(|kind| kind.is_baseline_corrected == is_baseline_corrected);
            let spans: Vec<WindowSpan> =
                own.map(|kind| windows::span(kind.window_s, period_s)).collect();
            Sliding::new(scales.len(), scales.len(), &spans).expect("usual windows")
        };
        let baseline = windows::baseline(flights, setting, period_s);
        let corrected =
            baseline.map(|settings| BaselineCorrected::new(settings, scales.len(), usize::MAX));
        let absolute = sliding(false);
        let baseline_corrected = corrected.map(|corrected| (corrected, sliding(true)));
        Seeking { kinds, bands, flight: None, scales, absolute, baseline_corrected, found: vec![] }
    }

    /// Returns the newest window of a kind if it is new and leaves its band.
    fn look(&self, kind: usize, index: usize) -> Option<TrainingWindow> {
        let is_baseline_corrected = self.kinds[kind].is_baseline_corrected;
        let sliding = match &self.baseline_corrected {
            Some((_, baseline_corrected)) if is_baseline_corrected => baseline_corrected,
            _ => &self.absolute,
        };
        let place = self.kinds[..kind]
            .iter()
            .filter(|k| k.is_baseline_corrected == is_baseline_corrected)
            .count();
        if !sliding.has_ended(place) || !sliding.is_full(place) {
            return None;
        }
        let window = sliding.window(place);
        let mut bands = self.bands[kind].iter().enumerate();
        let has_left = bands.any(|(sensor, band)| window.largest(sensor) > *band);
        let (from, to) = (index + 1 - window.count() as usize, index + 1);
        let cut = Cut { kind, from, to, is_faulty: false };
        self.flight.filter(|_| has_left).map(|flight| TrainingWindow::new(cut, &flight, window))
    }
}

impl Observer for Seeking<'_> {
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], _inputs: &[f64]) {
        let mut has_new = self.absolute.add(measured, twin, &self.scales, &[]);
        if let Some((corrected, sliding)) = &mut self.baseline_corrected {
            let is_settled = corrected.baseline.is_settled();
            corrected.take(index, measured, twin, &self.scales);
            if is_settled {
                has_new |= sliding.add(&corrected.measured, twin, &self.scales, &[]);
            }
        }
        if has_new {
            let found = (0..self.kinds.len()).filter_map(|kind| self.look(kind, index));
            let found: Vec<TrainingWindow> = found.collect();
            self.found.extend(found);
        }
    }
}
