//! Simulates flights in lanes: each plant's sensor values are observed together with the twin of its environment.
//!
//! In the scenario *fitted*, one specimen flies all flights of an environment, and the environment's twin is fitted to
//! its calibration flight. Otherwise every flight has another specimen, compared with the nominal twin. The plants may
//! have a system of their own ([`FlightCampaign::with_plants`]), and their twins may be fitted to them as well
//! ([`FlightCampaign::beside_fitted_twins`]).

use super::fitted_twins::{self, CalibrationRecords};
use super::other_plant::OtherPlants;
use super::plan::{self, Flight, Purpose};
use crate::campaign::{Calibrating, CampaignError, Overrides, ensemble};
use crate::ensemble::{Ensemble, Rows, Sink, Variant};
use crate::parallel::Workers;
use crate::signal::random::Random;
use crate::study::flights::Environment;
use crate::study::other_plant::apply_draws;
use crate::study::{Flights, Lot, Plants, Setting, Study};
use crate::system::imperfection::Imperfections;
use servotwin_model::program::Slot;
use servotwin_model::solver::{Failure, Settings, Statistics};
use std::borrow::Cow;
use std::collections::BTreeSet;

/// The purpose of the random numbers of a specimen's draws.
const DRAWS: u64 = 0x6472_6177_0000_0000;

/// Observes a flight.
pub trait Observer: Send {
    /// Takes a sample: the sensor values, the twin's expected values and the inputs; SI.
    fn sample(&mut self, index: usize, measured: &[f64], twin: &[f64], inputs: &[f64]);

    /// Takes the tracked variables of the plant and of its twin at the same sample, before [`Observer::sample`].
    fn track(&mut self, _index: usize, _plant: &[f64], _twin: &[f64]) {}
}

/// Specimens and variables of a campaign whose flights were chosen rather than drawn.
#[derive(Clone, Debug, Default)]
pub struct ChosenSpecimens {
    /// For each environment, the deviation of its specimen in each tolerance, in standard deviations.
    pub deviations: Vec<Vec<f64>>,
    /// Variables of plant and twin that observers track.
    pub tracked: Vec<Slot>,
}

/// A calibrated actuator: the deviating parameters of the plant and of its twin.
pub(super) struct Actuator {
    pub parameters: Overrides,
    pub twin: Overrides,
}

/// Flights for one purpose in one scenario.
pub struct FlightCampaign<'s> {
    pub(super) study: &'s Study,
    pub(super) environments: Cow<'s, [Environment]>,
    purpose: Purpose,
    seed: u64,
    /// The scenario in which they are flown.
    pub setting: Setting,
    ensemble: Ensemble<'s>,
    /// Plants with a system of their own, and the ensemble that flies them.
    pub(super) others: Option<(&'s OtherPlants, Ensemble<'s>)>,
    /// All planned flights.
    pub plan: Vec<Flight>,
    /// The indices of the flights whose twins were simulated.
    pub which: Vec<usize>,
    /// For each environment, the twin's sensors and inputs, ordered by sample.
    twins: Vec<Vec<f64>>,
    /// The environments whose twins began without a steady state.
    moving_twins: BTreeSet<usize>,
    pub(super) sensors: usize,
    pub(super) imperfections: Imperfections,
    /// How many times as large as declared the deviations of drawn specimens are.
    scatter: f64,
    /// The deviations of the specimen of each environment; `None` where specimens are drawn.
    deviations: Option<Vec<Vec<f64>>>,
    /// The actuator of each environment; empty where twins are not fitted.
    calibrated: Vec<Actuator>,
}

impl<'s> FlightCampaign<'s> {
    /// Plans the flights and simulates their twins. The study's extra sensor is not observed.
    ///
    /// # Errors
    /// A twin cannot be simulated.
    pub fn new(
        study: &'s Study,
        flights: &'s Flights,
        purpose: Purpose,
        setting: Setting,
        workers: Workers<'s>,
    ) -> Result<Self, CampaignError> {
        FlightCampaign::where_it_is(study, flights, purpose, setting, |_| true, workers)
    }

    /// The flights of one environment only, with the same numbers as among all flights.
    ///
    /// # Errors
    /// The twin cannot be simulated.
    pub fn in_environment(
        study: &'s Study,
        flights: &'s Flights,
        purpose: Purpose,
        setting: Setting,
        environment: usize,
        workers: Workers<'s>,
    ) -> Result<Self, CampaignError> {
        let own = |flown: usize| flown == environment;
        FlightCampaign::where_it_is(study, flights, purpose, setting, own, workers)
    }

    /// The flights of selected environments.
    ///
    /// # Errors
    /// A twin cannot be simulated.
    pub fn where_it_is(
        study: &'s Study,
        flights: &'s Flights,
        purpose: Purpose,
        setting: Setting,
        is_chosen: impl Fn(usize) -> bool,
        workers: Workers<'s>,
    ) -> Result<Self, CampaignError> {
        let environments = Cow::Borrowed(purpose.environments(flights));
        let plan = plan::flights(study, flights, purpose);
        let flown = |&place: &usize| is_chosen(plan[place].environment);
        let which = (0..plan.len()).filter(flown).collect();
        let lot = (purpose, flights.seed);
        FlightCampaign::of(study, environments, (plan, which), lot, setting, None, workers)
    }

    /// The same for given flights and environments, with a purpose and a seed.
    ///
    /// # Errors
    /// A twin cannot be simulated.
    pub fn planned(
        study: &'s Study,
        environments: Cow<'s, [Environment]>,
        plan: Vec<Flight>,
        lot: (Purpose, u64),
        setting: Setting,
        workers: Workers<'s>,
    ) -> Result<Self, CampaignError> {
        let all = (0..plan.len()).collect();
        FlightCampaign::of(study, environments, (plan, all), lot, setting, None, workers)
    }

    /// The same with chosen specimens.
    ///
    /// # Errors
    /// A twin cannot be simulated.
    pub fn chosen(
        study: &'s Study,
        environments: Vec<Environment>,
        plan: Vec<Flight>,
        lot: (Purpose, u64),
        setting: Setting,
        specimens: ChosenSpecimens,
        workers: Workers<'s>,
    ) -> Result<Self, CampaignError> {
        let (all, environments) = ((0..plan.len()).collect(), Cow::Owned(environments));
        FlightCampaign::of(study, environments, (plan, all), lot, setting, Some(specimens), workers)
    }

    fn of(
        study: &'s Study,
        environments: Cow<'s, [Environment]>,
        (plan, which): (Vec<Flight>, Vec<usize>),
        (purpose, seed): (Purpose, u64),
        setting: Setting,
        specimens: Option<ChosenSpecimens>,
        workers: Workers<'s>,
    ) -> Result<Self, CampaignError> {
        let (threads, cancel) = (workers.threads(), workers.cancel());
        let mut ensemble = Ensemble { threads, cancel, ..ensemble(study) };
        let sensors = study.base_sensors();
        ensemble.record.truncate(sensors);
        let (deviations, tracked) =
            specimens.map(|chosen| (chosen.deviations, chosen.tracked)).unzip();
        ensemble.record.extend(tracked.into_iter().flatten());
        let mut flown = FlightCampaign {
            study,
            environments,
            purpose,
            seed,
            setting,
            ensemble,
            others: None,
            plan,
            which,
            twins: vec![],
            moving_twins: BTreeSet::new(),
            sensors,
            imperfections: Imperfections::of(&study.system, &study.measured[..sensors]),
            scatter: 1.0,
            deviations,
            calibrated: vec![],
        };
        if setting.plants() == Plants::Pool {
            flown.calibrated = flown.calibrate(workers)?;
        }
        (flown.twins, flown.moving_twins) = flown.simulate_twins()?;
        Ok(flown)
    }

    /// The same flights by specimens whose tolerances and draws are `scatter` times as large as declared. Specimens
    /// that were chosen, or to which a twin is fitted, stay as they are.
    #[must_use]
    pub fn with_scatter(self, scatter: f64) -> Self {
        FlightCampaign { scatter, ..self }
    }

    /// The same flights by plants that differ from the twins in structure.
    #[must_use]
    pub fn with_plants(mut self, plants: &'s OtherPlants) -> Self {
        let slot = |&sensor: &usize| {
            let name = &plants.system.sensors[sensor].signal;
            plants.system.program.observable(name).expect("the same ports have the same names").slot
        };
        let record = self.study.measured[..self.sensors].iter().map(slot).collect();
        let Ensemble { program, compiled, .. } = Ensemble::of(&plants.system);
        self.others = Some((plants, Ensemble { program, compiled, record, ..self.ensemble }));
        self
    }

    /// The same with twins that are fitted to their plants: one specimen flies all flights of an environment, and the
    /// twin of the environment is fitted to a calibration flight of this specimen. Also returns what became of the fits.
    ///
    /// # Errors
    /// The study has no calibration flight, or a twin cannot be simulated.
    pub fn beside_fitted_twins(
        mut self,
        workers: Workers,
    ) -> Result<(Self, CalibrationRecords), CampaignError> {
        let (actuators, records) = fitted_twins::fit(&self, workers)?;
        self.calibrated = actuators;
        (self.twins, self.moving_twins) = self.simulate_twins()?;
        Ok((self, records))
    }

    /// The number from which the specimen of an environment is derived, where it flies all flights there.
    pub(super) fn number_of(&self, environment: usize) -> usize {
        environment + (self.seed as usize) * 1_000_000
    }

    /// The parameters of the specimen of each environment.
    pub(super) fn specimens(&self) -> Result<Vec<Overrides>, CampaignError> {
        let Some(realism) = &self.study.realism else {
            return Err(CampaignError::no_section(self.setting, self.study));
        };
        let lot = self.purpose.lot();
        let specimen = |place: usize| realism.specimen(self.study, lot, self.number_of(place));
        Ok((0..self.environments.len()).map(specimen).collect())
    }

    /// The noise in the calibration flight of an environment's specimen.
    pub(super) fn calibration_noise(&self, environment: usize) -> Option<Random> {
        // Test flights have other noise than training flights.
        let first = if self.purpose == Purpose::Judge { 500_000 } else { 0 };
        let number = first + self.number_of(environment);
        self.study.realism.as_ref().map(|r| r.noise(Lot::FlightsCalibrated, number))
    }

    /// Calibrates an actuator for each environment.
    fn calibrate(&self, workers: Workers) -> Result<Vec<Actuator>, CampaignError> {
        let specimens = self.specimens()?;
        let calibrating = Calibrating {
            study: self.study,
            solver: Settings::campaign(),
            threads: workers.threads(),
            cancel: workers.cancel(),
        };
        let noise = |place| self.calibration_noise(place).expect("there are tolerances");
        let found = calibrating.fit(&specimens, noise)?;
        let twins = found.specimens.into_iter().map(|specimen| specimen.overrides);
        let pairs = specimens.into_iter().zip(twins);
        Ok(pairs.map(|(parameters, twin)| Actuator { parameters, twin }).collect())
    }

    /// The samples of the twins by environment, and the environments whose twins began without a steady state.
    fn simulate_twins(&self) -> Result<(Vec<Vec<f64>>, BTreeSet<usize>), CampaignError> {
        let externals = self.study.system.program.externals();
        let inputs = externals.map(|slot| slot as Slot);
        let record = self.ensemble.record.iter().copied().chain(inputs).collect();
        let longest = self.plan.iter().map(|flight| flight.duration_s).fold(0.0, f64::max);
        let ensemble = Ensemble { record, duration_s: longest, ..self.ensemble };
        let mut twins = vec![vec![]; self.environments.len()];
        let flown: BTreeSet<usize> = self.which.iter().map(|&k| self.plan[k].environment).collect();
        let flown: Vec<usize> = flown.into_iter().collect();
        let (mut error, mut moving) = (None, BTreeSet::new());
        let variant = |job: usize| {
            let place = flown[job];
            let environment = &self.environments[place];
            let fitted = self.calibrated.get(place).map_or(&[][..], |actuator| &actuator.twin);
            Variant {
                overrides: [&environment.parameters, fitted].concat(),
                inputs: environment.inputs.iter().collect(),
                duration_s: self.longest_s(place),
                ..Variant::default()
            }
        };
        ensemble.run(
            flown.len(),
            variant,
            |_| Rows::default(),
            |job, rows, outcome| match outcome {
                Ok(work) => {
                    twins[flown[job]] = rows.0;
                    moving.extend((work.unsettled > 0).then_some(flown[job]));
                }
                Err(failure) => error = Some((flown[job], failure)),
            },
        );
        match error {
            Some((place, failure)) => Err(CampaignError::Twin {
                case: self.environments[place].name.clone(),
                reason: format!("{} at {:.4} s", failure.cause, failure.time_s),
            }),
            None => Ok((twins, moving)),
        }
    }

    /// Whether a flight, or the twin of its environment, began without a steady state.
    pub fn is_on_the_move(&self, flight: &Flight, work: &Statistics) -> bool {
        work.unsettled > 0 || self.moving_twins.contains(&flight.environment)
    }

    fn longest_s(&self, environment: usize) -> Option<f64> {
        let here = self.plan.iter().filter(|flight| flight.environment == environment);
        here.map(|flight| flight.duration_s).reduce(f64::max)
    }

    /// The study of the plants and their twins.
    pub fn study(&self) -> &'s Study {
        self.study
    }

    /// Time between samples, s.
    pub fn period_s(&self) -> f64 {
        self.ensemble.sample_period_s
    }

    /// Simulates some of the planned flights, each with a separate observer. `done` is called when a flight ends, one
    /// call at a time, in arbitrary order.
    pub fn fly<O: Observer>(
        &self,
        which: &[usize],
        observer: impl Fn(&Flight) -> O + Sync,
        done: impl FnMut(&Flight, O, Result<Statistics, Failure>) + Send,
    ) {
        self.fly_altered(which, |_, _| (), observer, done);
    }

    /// The same with modified plants; their twins are unchanged.
    pub fn fly_altered<'f, O: Observer>(
        &'f self,
        which: &[usize],
        alter: impl Fn(&Flight, &mut Variant<'f>) + Sync,
        observer: impl Fn(&Flight) -> O + Sync,
        mut done: impl FnMut(&Flight, O, Result<Statistics, Failure>) + Send,
    ) {
        let flight = |job: usize| &self.plan[which[job]];
        let ensemble = self.others.as_ref().map_or(&self.ensemble, |(_, ensemble)| ensemble);
        ensemble.run(
            which.len(),
            |job| {
                let mut variant = self.variant(flight(job));
                alter(flight(job), &mut variant);
                if let Some((plants, _)) = self.others {
                    plants.alter(self.study, self.plant(flight(job)), &mut variant);
                }
                variant
            },
            |job| self.watch(flight(job), observer(flight(job))),
            |job, watch, outcome| done(flight(job), watch.observer, outcome),
        );
    }

    fn variant(&self, flight: &Flight) -> Variant<'_> {
        let environment = &self.environments[flight.environment];
        let lot = self.purpose.lot();
        let realism = self.study.realism.as_ref().filter(|_| self.setting.has_tolerances());
        let specimen = match (self.calibrated.get(flight.environment), &self.deviations) {
            (Some(actuator), _) => Some(actuator.parameters.clone()),
            (_, Some(all)) => {
                realism.map(|r| r.specimen_with(self.study, &all[flight.environment]))
            }
            _ => realism.map(|r| {
                r.scattered_specimen(self.study, lot, self.specimen(flight), self.scatter)
            }),
        };
        let overrides =
            environment.parameters.iter().copied().chain(specimen.into_iter().flatten());
        let mut overrides: Vec<_> = overrides.collect();
        // Other plants have draws of their own, and twins of the scenario *fitted* know only tolerances.
        if self.setting.plants() == Plants::Specimens && self.others.is_none() {
            let stream = (lot as u64) << 48 ^ self.specimen(flight) as u64;
            let mut random = Random::stream(DRAWS ^ realism.map_or(0, |r| r.seed), stream);
            let parts = &self.study.system.network().components;
            let draws = &self.study.flight_draws;
            apply_draws(draws, self.scatter, parts, &mut random, &mut overrides);
        }
        Variant {
            later: flight.later(self.study),
            overrides,
            inputs: environment.inputs.iter().collect(),
            duration_s: Some(flight.duration_s),
            ..Variant::default()
        }
    }

    /// The number from which specimen and noise are derived.
    fn specimen(&self, flight: &Flight) -> usize {
        flight.number + (self.seed as usize) * 1_000_000
    }

    /// The number from which the draws of another plant are derived.
    fn plant(&self, flight: &Flight) -> usize {
        match self.calibrated.is_empty() {
            true => self.specimen(flight),
            false => self.number_of(flight.environment),
        }
    }

    fn watch<O>(&self, flight: &Flight, observer: O) -> Watch<'_, O> {
        let realism = self.study.realism.as_ref().filter(|_| self.setting.has_noise());
        let noise = realism.map(|realism| realism.noise(self.purpose.lot(), self.specimen(flight)));
        let twin = &self.twins[flight.environment];
        let latencies = self
            .others
            .as_ref()
            .map(|(plants, _)| Latencies::new(plants.latencies(self.plant(flight), self.sensors)));
        Watch { flown: self, twin, noise, latencies, measured: vec![0.0; self.sensors], observer }
    }
}

struct Watch<'f, O> {
    flown: &'f FlightCampaign<'f>,
    twin: &'f [f64],
    noise: Option<Random>,
    latencies: Option<Latencies>,
    measured: Vec<f64>,
    observer: O,
}

/// Latencies of at most one sample, by linear interpolation between samples.
pub(super) struct Latencies {
    /// The latency of each sensor, in samples.
    samples: Vec<f64>,
    /// The values of the sample before.
    before: Vec<f64>,
}

impl Latencies {
    pub fn new(samples: Vec<f64>) -> Self {
        Self { samples, before: vec![] }
    }

    pub fn apply(&mut self, values: &mut [f64]) {
        if self.before.is_empty() {
            self.before = values.to_vec();
        }
        let both = values.iter_mut().zip(&mut self.before).zip(&self.samples);
        for ((value, before), share) in both {
            let now = *value;
            *value = now + (*before - now) * share;
            *before = now;
        }
    }
}

impl<O: Observer> Sink for Watch<'_, O> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        let sensors = self.flown.sensors;
        let width = values.len() + self.flown.study.system.program.externals().len();
        let (twin, inputs) = self.twin[index * width..][..width].split_at(values.len());
        let (twin, tracked_twin) = twin.split_at(sensors);
        let (values, tracked) = values.split_at(sensors);
        self.observer.track(index, tracked, tracked_twin);
        self.measured.copy_from_slice(values);
        if let Some(latencies) = &mut self.latencies {
            latencies.apply(&mut self.measured);
        }
        if let Some(noise) = &mut self.noise {
            self.flown.imperfections.apply(&mut self.measured, noise);
        }
        self.observer.sample(index, &self.measured, twin, inputs);
    }
}
