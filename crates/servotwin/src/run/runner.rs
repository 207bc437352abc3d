//! Flies runs in lanes: each plant's sensor values are observed together with the twin of its environment.
//!
//! One simulation serves all scenarios with the same plants ([`Scenario::groups`]), and all healthy runs of an environment
//! that differ by the noise of their sensors alone.
//!
//! In the scenario *fitted*, one specimen flies all runs of an environment, and the environment's twin is fitted to
//! its calibration flight. Tests on the ground are such runs, and records have a pool of such specimens. Otherwise
//! every run has another specimen, compared with the nominal twin. The plants of a suite may have another structure
//! than their twins ([`OtherPlants`]), and the twins may be fitted to them as well.

use super::fitted_twins::{self, CalibrationRecords};
use super::other_plant::OtherPlants;
use super::plan::Run;
use super::specimen::fitted_specimen;
use super::{
    Observer, Overrides, RecordedRun, RunError, SensorChain, SpecimenDraw, Twins, Watch, ensemble,
    fit_twins, simulate_twins,
};
use crate::ensemble::{Ensemble, Sink, Variant};
use crate::parallel::Workers;
use crate::signal::random::NormalDeviates;
use crate::study::flights::Environment;
use crate::study::other_plant::apply_draws;
use crate::study::{Plants, Scenario, Seed, Stream, Study, Suite};
use servotwin_model::program::Slot;
use servotwin_model::solver::{SolverFailure, Statistics};
use std::collections::BTreeMap;
use std::sync::atomic::AtomicBool;

/// What is chosen rather than drawn.
#[derive(Clone, Debug, Default)]
pub(crate) struct Chosen {
    /// For each environment, the deviation of its specimen in each tolerance, in standard deviations; empty if specimens
    /// are drawn.
    pub(crate) deviations: Vec<Vec<f64>>,
    /// Variables of plant and twin that observers track.
    pub(crate) tracked: Vec<Slot>,
}

/// The twin of a run: its environment, and its specimen if the twin is fitted to it, else 0.
pub(crate) type TwinKey = (usize, usize);

/// An observer of a run in a scenario, after the run.
pub(crate) struct View<'r, O> {
    pub(crate) run: &'r Run,
    pub(crate) scenario: Scenario,
    pub(crate) observer: O,
}

/// Runs of a suite in scenarios with the same plants, with the twins of their environments.
pub struct Runner<'s> {
    study: &'s Study,
    suite: &'s Suite,
    scenarios: Vec<Scenario>,
    /// The number of the first environment.
    first: usize,
    pub(super) environments: Vec<Environment>,
    ensemble: Ensemble<'s>,
    /// Plants with a system of their own, and the ensemble that flies them.
    pub(super) others: Option<(&'s OtherPlants, Ensemble<'s>)>,
    /// The runs, by number.
    pub(crate) runs: Vec<Run>,
    /// What became of the calibration flights of plants with another structure.
    pub calibration: Option<CalibrationRecords>,
    twins: Twins<TwinKey>,
    pub(super) sensors: usize,
    deviations: Vec<Vec<f64>>,
    /// The parameters of the fitted twins, by specimen.
    fitted: BTreeMap<usize, Overrides>,
    /// Ends the runs early when it is set; without it those of cancelled workers end.
    pub(crate) stop: Option<&'s AtomicBool>,
}

impl<'s> Runner<'s> {
    /// Some runs of a suite, and the twins of all environments between theirs. The study's extra sensor is not observed. The
    /// plants are [`OtherPlants::of`] the suite.
    ///
    /// # Errors
    /// A command cannot be flown, or a twin cannot be simulated.
    pub fn new(
        study: &'s Study,
        suite: &'s Suite,
        (scenario, others): (Scenario, Option<&'s OtherPlants>),
        runs: Vec<Run>,
        workers: Workers<'s>,
    ) -> Result<Self, RunError> {
        let of = || runs.iter().map(|run| run.environment);
        let first = of().min().unwrap_or(0);
        let drawn = study.environments(suite, first..of().max().map_or(0, |last| last + 1))?;
        let mut runner =
            Runner { first, ..Runner::of(study, suite, scenario, (drawn, runs), workers) };
        if let Some(plants) = others {
            runner.fly_plants(plants);
        }
        runner.prepared(Chosen::default(), workers)
    }

    /// Records in scenarios with the same plants. All sensors are observed, and inputs are not. `fitted` are the parameters
    /// of the twins of the pool, empty without one.
    ///
    /// # Errors
    /// A twin cannot be simulated.
    pub(crate) fn of_records(
        study: &'s Study,
        suite: &'s Suite,
        scenarios: &[Scenario],
        (runs, fitted): (Vec<Run>, &[Overrides]),
        workers: Workers<'s>,
    ) -> Result<Self, RunError> {
        let environments = study.environments(suite, 0..suite.environments)?;
        let mut runner = Runner::of(study, suite, scenarios[0], (environments, runs), workers);
        runner.scenarios = scenarios.to_vec();
        runner.sensors = study.measured.len();
        let record = ensemble(study).record;
        runner.ensemble = Ensemble { record, ..runner.ensemble };
        runner.fitted = fitted.iter().cloned().enumerate().collect();
        runner.twins = runner.simulate_twins()?;
        Ok(runner)
    }

    /// Given runs in given environments.
    ///
    /// # Errors
    /// A twin cannot be simulated.
    pub(crate) fn chosen(
        study: &'s Study,
        suite: &'s Suite,
        scenario: Scenario,
        planned: (Vec<Environment>, Vec<Run>),
        chosen: Chosen,
        workers: Workers<'s>,
    ) -> Result<Self, RunError> {
        Runner::of(study, suite, scenario, planned, workers).prepared(chosen, workers)
    }

    fn of(
        study: &'s Study,
        suite: &'s Suite,
        scenario: Scenario,
        (environments, runs): (Vec<Environment>, Vec<Run>),
        workers: Workers<'s>,
    ) -> Self {
        let (threads, cancel) = (workers.threads(), workers.cancel());
        let sensors = study.base_sensors();
        let mut ensemble = Ensemble { threads, cancel, ..ensemble(study) };
        ensemble.record.truncate(sensors);
        Runner {
            study,
            suite,
            scenarios: vec![scenario],
            first: 0,
            environments,
            ensemble,
            others: None,
            runs,
            calibration: None,
            twins: Twins::new(),
            sensors,
            deviations: vec![],
            fitted: BTreeMap::new(),
            stop: None,
        }
    }

    /// Lets plants of another structure fly.
    fn fly_plants(&mut self, plants: &'s OtherPlants) {
        let record = plants.system.sensor_slots(&self.study.measured[..self.sensors]);
        let Ensemble { program, compiled, .. } = Ensemble::of(&plants.system);
        self.others = Some((plants, Ensemble { program, compiled, record, ..self.ensemble }));
    }

    /// Fits and simulates the twins.
    fn prepared(mut self, chosen: Chosen, workers: Workers) -> Result<Self, RunError> {
        self.deviations = chosen.deviations;
        self.ensemble.record.extend(chosen.tracked);
        let fitted = if self.suite.is_fitted {
            let (fitted, records) = fitted_twins::fit(&self, workers)?;
            self.calibration = Some(records);
            fitted
        } else if self.is_fitted() {
            self.fit_twins()?
        } else {
            vec![]
        };
        self.fitted = (self.first..).zip(fitted).collect();
        self.twins = self.simulate_twins()?;
        Ok(self)
    }

    fn draw(&self, seed: Seed) -> SpecimenDraw<'s> {
        SpecimenDraw { study: self.study, scenario: self.scenario(), seed }
    }

    /// The seed of an environment, and of a specimen that makes all runs there; by its place in this runner.
    pub(super) fn seed_of_environment(&self, place: usize) -> Seed {
        self.suite.seed_of_environment(self.first + place)
    }

    /// The parameters of the specimen of each environment.
    pub(super) fn specimens(&self) -> Vec<Overrides> {
        let specimen = |place: usize| {
            let seed = self.seed_of_environment(place);
            let mut specimen = self.draw(seed).parameters(self.scatter());
            self.draw_further(seed, &mut specimen);
            specimen
        };
        (0..self.environments.len()).map(specimen).collect()
    }

    /// Whether twins are fitted to their specimens.
    fn is_fitted(&self) -> bool {
        let is_pooled = self.scenario().plants() == Plants::Pool && self.others.is_none();
        is_pooled || self.suite.is_fitted
    }

    /// The factor of all tolerances and draws.
    fn scatter(&self) -> f64 {
        if self.is_fitted() { 1.0 } else { self.suite.scatter }
    }

    /// Draws what a specimen has besides its tolerances. Other plants have draws of their own, and specimens of records have
    /// tolerances alone.
    fn draw_further(&self, seed: Seed, overrides: &mut Overrides) {
        let is_drawn = self.others.is_none() && !self.suite.is_records;
        if let Some(flights) = self.study.flights.as_ref().filter(|_| is_drawn)
            && self.scenario().has_tolerances()
        {
            let parts = &self.study.system.network().components;
            let mut random = seed.stream(Stream::Draws);
            apply_draws(&flights.draws, self.scatter(), parts, &mut random, overrides);
        }
    }

    /// Draws the changes of a specimen since its first test on the ground.
    fn draw_wear(&self, run: &Run, overrides: &mut Overrides) {
        if let Some(flights) = self.study.flights.as_ref().filter(|_| !self.suite.is_records) {
            let parts = &self.study.system.network().components;
            let mut random = self.suite.seed_of(run.number).stream(Stream::Wear);
            apply_draws(&flights.wear, self.suite.scatter, parts, &mut random, overrides);
        }
    }

    /// Changes a variant of the twin's system to a plant of this seed.
    pub(super) fn alter_plant(&self, seed: Seed, variant: &mut Variant) {
        if let Some((plants, _)) = self.others {
            plants.alter(self.study, seed, variant);
        }
    }

    /// The sensors of the plant of this seed.
    pub(super) fn sensors_of(&self, seed: Seed, noise: Option<NormalDeviates>) -> SensorChain {
        let chain = SensorChain::new(self.study, self.sensors, noise);
        match self.others {
            Some((plants, _)) => chain.with_latencies(plants.latencies(seed, self.sensors)),
            None => chain,
        }
    }

    /// The noise in the calibration flight of an environment's specimen.
    pub(super) fn calibration_noise(&self, place: usize) -> Option<NormalDeviates> {
        self.draw(self.seed_of_environment(place)).noise(Stream::Calibration)
    }

    /// Fits the twin of each environment to its specimen.
    fn fit_twins(&self) -> Result<Vec<Overrides>, RunError> {
        let noise = |environment| self.calibration_noise(environment);
        let plants = (fitted_twins::unknowns(self), &self.specimens()[..]);
        let (found, _) = fit_twins(self.study, &self.ensemble, plants, noise)?;
        Ok(found.into_iter().map(|specimen| specimen.overrides).collect())
    }

    /// Simulates the twins beside which there are runs.
    fn simulate_twins(&self) -> Result<Twins<TwinKey>, RunError> {
        let mut record = self.ensemble.record.clone();
        if !self.suite.is_records {
            record.extend(self.study.system.program.externals().map(|slot| slot as Slot));
        }
        // Twins last as long as the longest run of the suite, so that a run has the same twin alone and among others.
        let ensemble = Ensemble { record, duration_s: self.suite.longest_s(), ..self.ensemble };
        let twin = |(number, specimen): TwinKey| {
            let environment = self.environment(number);
            let fitted = self.fitted.get(&specimen).map_or(&[][..], Vec::as_slice);
            Variant {
                overrides: [&environment.parameters, fitted].concat(),
                inputs: environment.inputs.iter().collect(),
                ..Variant::default()
            }
        };
        let wanted = self.runs.iter().map(|run| self.beside(run)).collect();
        simulate_twins(&ensemble, wanted, twin, |(number, _)| &self.environment(number).name)
    }

    fn beside(&self, run: &Run) -> TwinKey {
        let specimen = fitted_specimen(self.study, self.suite, self.scenario(), run);
        (run.environment, specimen.unwrap_or(0))
    }

    /// The twin beside which a run is observed.
    pub(crate) fn twin(&self, run: &Run) -> &RecordedRun {
        &self.twins[&self.beside(run)]
    }

    /// The first of the scenarios, which all have the same plants.
    pub(crate) fn scenario(&self) -> Scenario {
        self.scenarios[0]
    }

    fn environment(&self, number: usize) -> &Environment {
        &self.environments[number - self.first]
    }

    /// Whether a run, or the twin of its environment, began without a steady state.
    pub(crate) fn is_on_the_move(&self, run: &Run, work: &Statistics) -> bool {
        self.twin(run).is_on_the_move(work)
    }

    /// The study of the plants and their twins.
    pub(crate) fn study(&self) -> &'s Study {
        self.study
    }

    /// The suite of the runs.
    pub(crate) fn suite(&self) -> &'s Suite {
        self.suite
    }

    /// Time between samples, s.
    pub(crate) fn period_s(&self) -> f64 {
        self.ensemble.sample_period_s
    }

    /// Simulates all runs, each with a separate observer. `done` is called when a run ends, one call at a time, in
    /// arbitrary order.
    pub fn fly<O: Observer>(
        &self,
        observer: impl Fn(&Run) -> O + Sync,
        done: impl FnMut(&Run, O, &Result<Statistics, SolverFailure>) + Send,
    ) {
        self.fly_altered(|_, _| (), observer, done);
    }

    /// The same with modified plants, apart from healthy ones; their twins are unchanged.
    pub(crate) fn fly_altered<'f, O: Observer>(
        &'f self,
        alter: impl Fn(&Run, &mut Variant<'f>) + Sync,
        observer: impl Fn(&Run) -> O + Sync,
        mut done: impl FnMut(&Run, O, &Result<Statistics, SolverFailure>) + Send,
    ) {
        let views = |run: &Run, _| Some(observer(run));
        self.fly_views(alter, views, |views, ended| {
            views.into_iter().for_each(|view| done(view.run, view.observer, &ended));
        });
    }

    /// The runs of each simulation: one, or healthy runs of an environment that differ by the noise of their sensors alone.
    /// Those with full intensity come first: a few of them take a hundred times as long as the others, and would occupy a
    /// single lane at the end.
    fn simulations(&self) -> Vec<Vec<usize>> {
        let equals_twin = self.scenario().plants() == Plants::Twin
            && self.others.is_none()
            && self.deviations.is_empty();
        let (mut alone, mut shared) = (vec![], BTreeMap::<usize, Vec<usize>>::new());
        for (place, run) in self.runs.iter().enumerate() {
            match run.is_healthy() && equals_twin {
                true => shared.entry(run.environment).or_default().push(place),
                false => alone.push(vec![place]),
            }
        }
        let is_full = |fault: usize| self.study.faults[fault].at.intensity >= 1.0;
        alone.sort_by_key(|runs| !self.runs[runs[0]].fault.is_some_and(is_full));
        alone.extend(shared.into_values());
        alone
    }

    /// The same with an observer for each run and scenario that `observer` wants to see. `done` is called when a simulation
    /// ends, which may serve several runs.
    pub(crate) fn fly_views<'f, O: Observer>(
        &'f self,
        alter: impl Fn(&Run, &mut Variant<'f>) + Sync,
        observer: impl Fn(&Run, Scenario) -> Option<O> + Sync,
        mut done: impl FnMut(Vec<View<'f, O>>, Result<Statistics, SolverFailure>) + Send,
    ) {
        let ensemble = self.others.as_ref().map_or(&self.ensemble, |(_, ensemble)| ensemble);
        let simulations = self.simulations();
        ensemble.prepare(simulations.len());
        let (record, cancel) = (ensemble.record.clone(), self.stop.or(ensemble.cancel));
        let ensemble = Ensemble { record, cancel, ..*ensemble };
        let first = |simulation: usize| &self.runs[simulations[simulation][0]];
        ensemble.run(
            simulations.len(),
            |simulation| {
                let run = first(simulation);
                let mut variant = self.variant(run);
                alter(run, &mut variant);
                self.alter_plant(self.plant(run), &mut variant);
                variant
            },
            |simulation| {
                let runs = simulations[simulation].iter().map(|&place| &self.runs[place]);
                let all = runs.flat_map(|run| self.scenarios.iter().map(move |of| (run, *of)));
                let watched = all.filter_map(|(run, scenario)| {
                    Some((run, scenario, self.watch(run, scenario, observer(run, scenario)?)))
                });
                Views(watched.collect())
            },
            |_, Views(watched), ended| {
                let views = watched.into_iter().map(|(run, scenario, watch)| View {
                    run,
                    scenario,
                    observer: watch.observer,
                });
                done(views.collect(), ended);
            },
        );
    }

    fn variant(&self, run: &Run) -> Variant<'_> {
        let environment = self.environment(run.environment);
        let seed = self.plant(run);
        let specimen = match self.deviations.get(run.environment - self.first) {
            Some(deviations) => self.draw(seed).parameters_with(deviations),
            None => self.draw(seed).parameters(self.scatter()),
        };
        let mut overrides = [&environment.parameters[..], &specimen].concat();
        self.draw_further(seed, &mut overrides);
        self.draw_wear(run, &mut overrides);
        Variant {
            faults: run.at_start(self.study),
            later: run.later(self.study),
            overrides,
            inputs: environment.inputs.iter().collect(),
            duration_s: Some(run.duration_s),
            ..Variant::default()
        }
    }

    /// The seed of the specimen of a run.
    fn plant(&self, run: &Run) -> Seed {
        SpecimenDraw::of(self.study, self.suite, self.scenario(), run).seed
    }

    fn watch<O>(&self, run: &Run, scenario: Scenario, observer: O) -> Watch<'_, O> {
        let seed = self.suite.seed_of(run.number);
        let noise = SpecimenDraw { study: self.study, scenario, seed }.noise(Stream::Sensors);
        let chain = self.sensors_of(self.plant(run), noise);
        Watch::new(self.twin(run), self.sensors, chain, observer)
    }
}

/// The observers that one simulation serves.
struct Views<'r, O>(Vec<(&'r Run, Scenario, Watch<'r, O>)>);

impl<O: Observer> Sink for Views<'_, O> {
    fn sample(&mut self, index: usize, values: &[f64]) {
        self.0.iter_mut().for_each(|(.., watch)| watch.sample(index, values));
    }
}
