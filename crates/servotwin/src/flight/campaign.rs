//! Simulates flights in lanes: each plant's sensor values are observed together with the twin of its environment.
//!
//! In the scenario *fitted*, one specimen flies all flights of an environment, and the environment's twin is fitted to
//! its calibration flight. Otherwise every flight has another specimen, compared with the nominal twin. The plants may
//! have a system of their own ([`FlightCampaign::with_plants`]), and their twins may be fitted to them as well
//! ([`FlightCampaign::beside_fitted_twins`]).

pub use crate::experiment::Observer;

use super::fitted_twins::{self, CalibrationRecords};
use super::other_plant::OtherPlants;
use super::plan::{self, PlannedFlight, Purpose};
use crate::ensemble::{Ensemble, Variant};
use crate::experiment::{
    CampaignError, Overrides, SensorChain, SpecimenDraw, Twins, Watch, ensemble, fit_twins,
    simulate_twins,
};
use crate::parallel::Workers;
use crate::signal::random::NormalDeviates;
use crate::study::flights::Environment;
use crate::study::other_plant::apply_draws;
use crate::study::{Flights, Lot, Plants, Setting, Study};
use servotwin_model::program::Slot;
use servotwin_model::solver::{SolverFailure, Statistics};
use std::borrow::Cow;

/// The purpose of the random numbers of a specimen's draws.
const DRAWS: u64 = 0x6472_6177_0000_0000;

/// Specimens and variables of a campaign whose flights were chosen rather than drawn.
#[derive(Clone, Debug, Default)]
pub struct ChosenSpecimens {
    /// For each environment, the deviation of its specimen in each tolerance, in standard deviations.
    pub deviations: Vec<Vec<f64>>,
    /// Variables of plant and twin that observers track.
    pub tracked: Vec<Slot>,
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
    pub plan: Vec<PlannedFlight>,
    /// The indices of the flights whose twins were simulated.
    pub which: Vec<usize>,
    /// The twins by environment.
    twins: Twins<usize>,
    pub(super) sensors: usize,
    /// How many times as large as declared the deviations of drawn specimens are.
    scatter: f64,
    /// The deviations of the specimen of each environment; `None` where specimens are drawn.
    deviations: Option<Vec<Vec<f64>>>,
    /// The parameters of the twin of each environment, whose specimen flies all flights there; empty where twins are not
    /// fitted.
    fitted: Vec<Overrides>,
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

    /// The flights of selected environments, with the same numbers as among all flights.
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
        plan: Vec<PlannedFlight>,
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
        plan: Vec<PlannedFlight>,
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
        (plan, which): (Vec<PlannedFlight>, Vec<usize>),
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
            twins: Twins::new(),
            sensors,
            scatter: 1.0,
            deviations,
            fitted: vec![],
        };
        if setting.plants() == Plants::Pool {
            flown.fitted = flown.fit_twins()?;
        }
        flown.twins = flown.simulate_twins()?;
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
        let record = plants.system.sensor_slots(&self.study.measured[..self.sensors]);
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
        let (fitted, records) = fitted_twins::fit(&self, workers)?;
        self.fitted = fitted;
        self.twins = self.simulate_twins()?;
        Ok((self, records))
    }

    /// The number from which the specimen of an environment is derived, where it flies all flights there.
    pub(super) fn number_of(&self, environment: usize) -> usize {
        environment + (self.seed as usize) * 1_000_000
    }

    /// A draw of specimen or noise for these flights.
    fn draw(&self, number: usize) -> SpecimenDraw<'s> {
        let (study, setting, lot) = (self.study, self.setting, self.purpose.lot());
        SpecimenDraw { study, setting, lot, number }
    }

    /// The parameters of the specimen of each environment.
    pub(super) fn specimens(&self) -> Vec<Overrides> {
        let specimen = |place: usize| self.draw(self.number_of(place)).parameters();
        (0..self.environments.len()).map(specimen).collect()
    }

    /// The noise in the calibration flight of an environment's specimen.
    pub(super) fn calibration_noise(&self, environment: usize) -> Option<NormalDeviates> {
        // Test flights have other noise than training flights.
        let first = if self.purpose == Purpose::Judge { 500_000 } else { 0 };
        let draw = self.draw(first + self.number_of(environment));
        SpecimenDraw { lot: Lot::FlightsCalibrated, ..draw }.noise()
    }

    /// Fits the twin of each environment to its specimen.
    fn fit_twins(&self) -> Result<Vec<Overrides>, CampaignError> {
        let noise = |environment| self.calibration_noise(environment);
        let found = fit_twins(self.study, &self.ensemble, &self.specimens(), noise)?;
        Ok(found.specimens.into_iter().map(|specimen| specimen.overrides).collect())
    }

    /// Simulates the twins of the flights' environments.
    fn simulate_twins(&self) -> Result<Twins<usize>, CampaignError> {
        let externals = self.study.system.program.externals();
        let inputs = externals.map(|slot| slot as Slot);
        let record = self.ensemble.record.iter().copied().chain(inputs).collect();
        let longest = self.plan.iter().map(|flight| flight.duration_s).fold(0.0, f64::max);
        let ensemble = Ensemble { record, duration_s: longest, ..self.ensemble };
        let twin = |place: usize| {
            let environment = &self.environments[place];
            let fitted = self.fitted.get(place).map_or(&[][..], Vec::as_slice);
            Variant {
                overrides: [&environment.parameters, fitted].concat(),
                inputs: environment.inputs.iter().collect(),
                duration_s: self.longest_s(place),
                ..Variant::default()
            }
        };
        let wanted = self.which.iter().map(|&flight| self.plan[flight].environment).collect();
        simulate_twins(&ensemble, wanted, twin, |place| &self.environments[place].name)
    }

    /// Whether a flight, or the twin of its environment, began without a steady state.
    pub fn is_on_the_move(&self, flight: &PlannedFlight, work: &Statistics) -> bool {
        self.twins[&flight.environment].is_on_the_move(work)
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
        observer: impl Fn(&PlannedFlight) -> O + Sync,
        done: impl FnMut(&PlannedFlight, O, Result<Statistics, SolverFailure>) + Send,
    ) {
        self.fly_altered(which, |_, _| (), observer, done);
    }

    /// The same with modified plants; their twins are unchanged.
    pub fn fly_altered<'f, O: Observer>(
        &'f self,
        which: &[usize],
        alter: impl Fn(&PlannedFlight, &mut Variant<'f>) + Sync,
        observer: impl Fn(&PlannedFlight) -> O + Sync,
        mut done: impl FnMut(&PlannedFlight, O, Result<Statistics, SolverFailure>) + Send,
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

    fn variant(&self, flight: &PlannedFlight) -> Variant<'_> {
        let environment = &self.environments[flight.environment];
        let draw = self.draw(self.plant(flight));
        let specimen = match &self.deviations {
            _ if !self.fitted.is_empty() => draw.parameters(),
            Some(all) => draw.parameters_with(&all[flight.environment]),
            None => draw.scattered_parameters(self.scatter),
        };
        let mut overrides = [&environment.parameters[..], &specimen].concat();
        // Other plants have draws of their own, and twins of the scenario *fitted* know only tolerances.
        if self.setting.plants() == Plants::Specimens && self.others.is_none() {
            let stream = (draw.lot as u64) << 48 ^ draw.number as u64;
            let seed = self.study.realism.as_ref().map_or(0, |realism| realism.seed);
            let mut random = NormalDeviates::stream(DRAWS ^ seed, stream);
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

    /// The number from which the noise of a flight is derived.
    fn number(&self, flight: &PlannedFlight) -> usize {
        flight.number + (self.seed as usize) * 1_000_000
    }

    /// The number from which the specimen of a flight is derived, and the draws of another plant.
    fn plant(&self, flight: &PlannedFlight) -> usize {
        match self.fitted.is_empty() {
            true => self.number(flight),
            false => self.number_of(flight.environment),
        }
    }

    fn watch<O>(&self, flight: &PlannedFlight, observer: O) -> Watch<'_, O> {
        let noise = self.draw(self.number(flight)).noise();
        let mut chain = SensorChain::new(self.study, self.sensors, noise);
        if let Some((plants, _)) = self.others {
            chain = chain.with_latencies(plants.latencies(self.plant(flight), self.sensors));
        }
        Watch::new(&self.twins[&flight.environment], self.sensors, chain, observer)
    }
}
