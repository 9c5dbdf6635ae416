//! The closed loop of Figure 1, one control period at a time.
//!
//! ```text
//!   scenario ── intent, push ─> human-prosthesis system (continuous: plant, numerics::integrator)
//!                                  ^ command                  | true quantities
//!                                  |                          v
//!             prosthesis controller (state machine or agent) <── sensors        (200 Hz)
//! ```

use crate::closed_loop::energy_meter::EnergyMeter;
use crate::closed_loop::episode::Episode;
use crate::closed_loop::measurand;
use crate::closed_loop::params::LoopParams;
use crate::closed_loop::repetition::{ATTEMPTS, Moment, Repeats};
use crate::numerics::integrator::{self, HybridFlow, Workspace};
use crate::numerics::lanes::vectorised;
use crate::numerics::prefetch::Ahead;
use crate::plant::model::PlantModel;
use crate::plant::outputs::PlantOutputs;
use crate::plant::signals::Signals;
use crate::plant::solver::SolverParams;
use crate::plant::state::State;
use crate::plant::system::HumanProsthesis;
use crate::plant::walkers::Walkers;
use crate::prosthesis::gait::GaitMemory;
use crate::prosthesis::reference_controller::ReferenceController;
use crate::sensors::{SensorModel, Sensors};
use crate::signals::{CONTROL_PERIOD_S, MeasurandLanes, ReadingsLanes};

/// Constants of the closed loop of a block of walkers. Blocks of equal walkers share one.
#[derive(Clone, Debug)]
pub struct LoopModel<const L: usize> {
    /// Human, mechanism, ground and device.
    pub plant: PlantModel<L>,
    sensors: SensorModel<L>,
    reference: ReferenceController<L>,
    /// The configured solver, and those that repeat a control period in which it diverges.
    solvers: [SolverParams; ATTEMPTS],
}

impl<const L: usize> LoopModel<L> {
    /// Memory of a block's constants.
    pub fn bytes(&self) -> usize {
        size_of::<Self>() + self.plant.heap_bytes()
    }

    /// Walkers with the given parameters.
    pub fn new(params: &LoopParams<'_>, solvers: [SolverParams; ATTEMPTS]) -> Self {
        Self {
            plant: PlantModel::new(&params.plant),
            sensors: SensorModel::new(params.sensors),
            reference: ReferenceController::new(&params.reference),
            solvers,
        }
    }

    /// Gives the walker in `lane` parameters of its own, which must make a walker of the same kind; `uneven` if any
    /// walker of the batch may meet uneven ground.
    pub fn set(&mut self, lane: usize, params: &LoopParams<'_>, uneven: bool) {
        self.plant.set(lane, &params.plant, uneven);
        self.sensors.set(lane, params.sensors);
        self.reference.set(lane, &params.reference);
    }
}

/// What a block of `L` walkers and their controllers keep between control periods.
#[derive(Clone, Debug)]
pub struct Simulation<const L: usize> {
    /// Continuous state.
    pub state: State<L>,
    /// Inputs and discrete state of the human-prosthesis system.
    pub walkers: Walkers<L>,
    /// Sensors with their noise.
    pub sensors: Sensors<L>,
    /// Last sensor readings.
    pub readings: ReadingsLanes<L>,
    /// Memory of each walker's reference controller: it listens even where an agent commands.
    pub state_machine: [GaitMemory; L],
    /// What the state machine commands from the last readings, in the knee unit's own unit.
    pub state_machine_command: [f64; L],
    /// Control periods since the start of the trial.
    pub sample: [u64; L],
    /// Whether the last control period has led where only a diverged integration does, by whatever solver.
    pub diverged: [bool; L],
    /// Control periods that had to be integrated again since these walkers were made.
    pub repeats: Repeats,
    /// Samples until which intent and disturbance stay what they are: far memory is not asked every time.
    pub(super) next_intent: [u64; L],
    pub(super) next_push: [u64; L],
    pub(super) episode: [Option<Episode>; L],
}

/// Storage that one control period needs: threads share it among their blocks, which keeps those small. What is in it counts for
/// one step of a block.
#[derive(Clone, Debug)]
pub struct Scratch<const L: usize> {
    work: Workspace<State<L>>,
    rates: State<L>,
    /// Where the present control period began.
    begin: Moment<L>,
    /// Where it has led the walkers that are settled while others repeat it.
    settled: Moment<L>,
    /// Signals of the last evaluation.
    signals: Signals<L>,
    /// What the sensors sense, at the last sample.
    pub truth: MeasurandLanes<L>,
    /// Fetched into the caches while walkers advance: what comes after them.
    pub ahead: Ahead,
}

impl<const L: usize> Scratch<L> {
    /// Storage for walkers like these.
    pub fn new(model: &LoopModel<L>) -> Self {
        let state = model.plant.state();
        Self {
            work: Workspace::new(&state),
            begin: Moment::new(&state),
            settled: Moment::new(&state),
            rates: state,
            signals: Signals::new(&model.plant),
            truth: MeasurandLanes::default(),
            ahead: Ahead::default(),
        }
    }
}

/// A block of walkers after a control period, for those who read and record: everything was evaluated at the present state.
#[derive(Clone, Copy, Debug)]
pub struct Sampled<'a, const L: usize> {
    /// Constants.
    pub model: &'a LoopModel<L>,
    /// The walkers.
    pub simulation: &'a Simulation<L>,
    /// Signals.
    pub scratch: &'a Scratch<L>,
}

impl<'a, const L: usize> Sampled<'a, L> {
    /// The human-prosthesis system.
    #[inline(always)]
    pub fn plant(&self) -> PlantOutputs<'a, L> {
        self.simulation.evaluated(self.model, self.scratch)
    }
}

impl<const L: usize> Simulation<L> {
    /// Walkers that each wait for [`start`](Self::start).
    pub fn new(model: &LoopModel<L>) -> Self {
        Self {
            state: model.plant.state(),
            walkers: Walkers::default(),
            sensors: Sensors::default(),
            readings: ReadingsLanes::default(),
            state_machine: [GaitMemory::default(); L],
            state_machine_command: [0.0; L],
            sample: [0; L],
            diverged: [false; L],
            repeats: Repeats::default(),
            next_intent: [0; L],
            next_push: [0; L],
            episode: std::array::from_fn(|_| None),
        }
    }

    /// Starts `episode` in `lane`; call [`observe_started`](Self::observe_started) after the last start.
    pub fn start(&mut self, model: &LoopModel<L>, lane: usize, episode: Episode, scratch: &mut Scratch<L>) {
        self.walkers.profile[lane].clone_from(&episode.profile);
        let (mut plant, state) = self.plant(model, scratch);
        plant.start(state, lane, episode.start, episode.human);
        self.walkers.command[lane] = 0.0;
        self.sensors.seed[lane] = episode.sensor_seed;
        self.state_machine[lane] = GaitMemory::default();
        self.sample[lane] = 0;
        self.diverged[lane] = false;
        (self.next_intent[lane], self.next_push[lane]) = (0, 0);
        self.episode[lane] = Some(episode);
    }

    /// Memory beside itself of what the present episodes and the walkers' further joints hold, sensors apart.
    pub fn heap_bytes(&self) -> usize {
        let profiles = self.walkers.profile.iter().chain(self.episode.iter().flatten().map(|episode| &episode.profile));
        let pushes = self.episode.iter().flatten().map(|episode| size_of_val(&*episode.disturbance.pushes));
        let drawn = self.episode.iter().flatten().filter_map(|episode| episode.drawn.as_ref());
        let numbers = drawn.map(|drawn| size_of_val(&*drawn.numbers));
        profiles.map(|profile| size_of_val(&*profile.knots)).chain(pushes).chain(numbers).sum::<usize>()
            + self.state.heap_bytes()
    }

    /// The human-prosthesis system and its state.
    #[inline(always)]
    fn plant<'a>(
        &'a mut self,
        model: &'a LoopModel<L>,
        scratch: &'a mut Scratch<L>,
    ) -> (HumanProsthesis<'a, L>, &'a mut State<L>) {
        let plant = HumanProsthesis { model: &model.plant, walkers: &mut self.walkers, signals: &mut scratch.signals };
        (plant, &mut self.state)
    }

    /// First sample of the lanes that have just been started. The others stay what they are: between two control periods there is
    /// nothing that they react to or draw.
    pub fn observe_started(&mut self, model: &LoopModel<L>, started: &[bool; L], scratch: &mut Scratch<L>) {
        self.set_intent(started);
        self.disturb(started);
        self.evaluate(model, scratch);
        self.sensors.start(&model.sensors, started, &scratch.truth, &mut self.readings);
        for lane in (0..L).filter(|&lane| started[lane]) {
            self.control(model, lane);
        }
    }

    /// What there is to read off the human-prosthesis system at the present state.
    #[inline(always)]
    fn evaluated<'a>(&'a self, model: &'a LoopModel<L>, scratch: &'a Scratch<L>) -> PlantOutputs<'a, L> {
        PlantOutputs::new(&model.plant, &self.walkers, &scratch.signals, &self.state)
    }

    /// Fills `scratch` with the signals at the present state, as the last control period left them.
    pub fn evaluate(&mut self, model: &LoopModel<L>, scratch: &mut Scratch<L>) {
        evaluate(self, model, scratch);
    }

    /// The episode that runs in `lane`.
    pub fn episode(&self, lane: usize) -> Option<&Episode> {
        self.episode[lane].as_ref()
    }

    /// One control period with the given commands to the knee units.
    ///
    /// A walker whose integration diverges repeats the period from its start, in finer steps and then by the reference, unless
    /// nobody looks at it any more: `live` says at whom somebody does.
    #[inline(always)]
    pub fn advance(&mut self, model: &LoopModel<L>, commands: &[f64; L], live: &[bool; L], scratch: &mut Scratch<L>) {
        self.begin_period(model, commands, scratch);
        scratch.begin.keep(&self.state, &self.walkers);
        self.diverged = *live;
        // One loop around a single call of the integrator: what that evaluates is a large part of an instruction cache.
        for (attempt, solver) in model.solvers.iter().enumerate() {
            if attempt > 0 {
                scratch.settled.keep(&self.state, &self.walkers);
                self.go_back(model, scratch);
            }
            self.integrate(model, solver, scratch);
            let open = self.diverged;
            for lane in 0..L {
                self.diverged[lane] = open[lane] & self.evaluated(model, scratch).diverged(lane);
            }
            if attempt > 0 {
                self.settle(model, attempt, &open, scratch);
            }
            if !self.diverged.contains(&true) {
                break;
            }
        }
        self.finish_period(model, scratch);
    }

    /// Integrates over a control period.
    #[inline(always)]
    fn integrate(&mut self, model: &LoopModel<L>, solver: &SolverParams, scratch: &mut Scratch<L>) {
        let Scratch { work, signals, ahead, .. } = scratch;
        let mut plant = HumanProsthesis { model: &model.plant, walkers: &mut self.walkers, signals };
        let SolverParams { stepper, steps } = *solver;
        let step_s = CONTROL_PERIOD_S / steps as f64;
        for step in 1..=steps {
            ahead.fetch(step, steps);
            integrator::advance(&mut plant, &mut self.state, work, stepper, step_s, 1);
        }
    }

    /// Goes back to where the control period began.
    fn go_back(&mut self, model: &LoopModel<L>, scratch: &mut Scratch<L>) {
        scratch.begin.restore(&model.plant, &[true; L], &mut self.state, &mut self.walkers);
        let (mut plant, state) = self.plant(model, scratch);
        plant.sense(state);
        plant.note_touch();
    }

    /// Counts what has come of the `open` lanes in an `attempt`, and puts the others back where they had been before it.
    fn settle(&mut self, model: &LoopModel<L>, attempt: usize, open: &[bool; L], scratch: &mut Scratch<L>) {
        self.repeats.count(attempt, open, &self.diverged);
        scratch.settled.restore(&model.plant, &open.map(|open| !open), &mut self.state, &mut self.walkers);
        let (mut plant, state) = self.plant(model, scratch);
        plant.sense(state);
    }

    /// Like [`advance`](Self::advance), and integrates the work of all forces beside the state. Repeats nothing: the meter shows
    /// what the configured solver does.
    #[inline(always)]
    pub fn advance_metered(
        &mut self,
        model: &LoopModel<L>,
        commands: &[f64; L],
        scratch: &mut Scratch<L>,
        meter: &mut EnergyMeter<L>,
    ) {
        self.begin_period(model, commands, scratch);
        let (mut plant, state) = self.plant(model, scratch);
        meter.advance(&mut plant, state, &model.solvers[0]);
        for lane in 0..L {
            self.diverged[lane] = self.evaluated(model, scratch).diverged(lane);
        }
        self.finish_period(model, scratch);
    }

    #[inline(always)]
    fn begin_period(&mut self, model: &LoopModel<L>, commands: &[f64; L], scratch: &mut Scratch<L>) {
        self.walkers.command = *commands;
        self.walkers.extension_stop_peak = [0.0; L];
        self.set_intent(&[true; L]);
        let (mut plant, state) = self.plant(model, scratch);
        plant.sense(state);
        // Lets the human react to inputs that have just changed.
        let fired = plant.fired(state);
        if fired.contains(&true) {
            plant.transition(state, &fired);
        }
        plant.note_touch();
        self.disturb(&[true; L]);
    }

    /// Intent of `lanes` in the control period that begins now.
    #[inline(always)]
    fn set_intent(&mut self, lanes: &[bool; L]) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let sample = self.sample[lane];
            if sample >= self.next_intent[lane] {
                let (time, profile) = (sample as f64 * CONTROL_PERIOD_S, &self.walkers.profile[lane]);
                self.walkers.intent[lane] = f64::from(u8::from(profile.walks(time)));
                // Rounded down: a sample too early only means to look again.
                self.next_intent[lane] = ((profile.next_knot_s(time) / CONTROL_PERIOD_S) as u64).max(sample + 1);
            }
        }
    }

    /// Disturbances of `lanes` in the control period that begins now, in a step that may have begun just now.
    #[inline(always)]
    fn disturb(&mut self, lanes: &[bool; L]) {
        for lane in (0..L).filter(|&lane| lanes[lane]) {
            let sample = self.sample[lane];
            if sample < self.next_push[lane] {
                continue;
            }
            let Some(episode) = &mut self.episode[lane] else { continue };
            let memory = self.walkers.memory(lane);
            let push = episode.disturbance.force(sample, |phase| memory.time_at(phase));
            (self.walkers.push_x[lane], self.walkers.push_y[lane]) = (push.x, push.y);
            self.next_push[lane] = episode.disturbance.next_change(sample);
        }
    }

    #[inline(always)]
    fn finish_period(&mut self, model: &LoopModel<L>, scratch: &mut Scratch<L>) {
        for lane in 0..L {
            // The sum of many small steps drifts; the grid does not.
            self.sample[lane] += 1;
            self.state.rest.time[lane] = self.sample[lane] as f64 * CONTROL_PERIOD_S;
        }
        let (mut plant, state) = self.plant(model, scratch);
        plant.sense_trunk_forces(state);
        self.measure(model, scratch);
        self.sensors.sample(&model.sensors, &scratch.truth, &mut self.readings);
        for lane in 0..L {
            self.control(model, lane);
        }
    }

    /// Evaluates the sensed state, and what the sensors see of it.
    #[inline(always)]
    fn measure(&mut self, model: &LoopModel<L>, scratch: &mut Scratch<L>) {
        let Scratch { signals, rates, .. } = scratch;
        HumanProsthesis { model: &model.plant, walkers: &mut self.walkers, signals }.rates(
            &self.state,
            &[0.0; L],
            rates,
        );
        for lane in 0..L {
            let plant = Sampled { model, simulation: self, scratch }.plant();
            let measurand = measurand::measurand(&plant, &model.sensors, lane);
            scratch.truth.set(lane, measurand);
        }
    }

    /// Lets the state machine hear the last readings.
    #[inline(always)]
    fn control(&mut self, model: &LoopModel<L>, lane: usize) {
        let readings = self.readings.get(lane);
        self.state_machine_command[lane] = model.reference.update(lane, &mut self.state_machine[lane], &readings);
    }
}

vectorised! {
    fn evaluate<const L: usize>(simulation: &mut Simulation<L>, model: &LoopModel<L>, scratch: &mut Scratch<L>) {
        let (mut plant, state) = simulation.plant(model, scratch);
        plant.sense(state);
        simulation.measure(model, scratch);
    }
}
