//! The closed loop of Figure 1, one control period at a time.
//!
//! ```text
//!   scenario ── intent, push ─> human-prosthesis system (continuous: human_prosthesis.rs, integrator.rs)
//!                                  ^ command                  | true quantities
//!                                  |                          v
//!             prosthesis controller (state machine or agent) <── sensors        (200 Hz)
//! ```

use crate::config::{Config, SolverParams};
use crate::energy_meter::EnergyMeter;
use crate::human_prosthesis::{HumanProsthesis, State};
use crate::integrator::{self, HybridFlow, Workspace};
use crate::prosthesis_controller::{ReferenceController, ReferenceParams};
use crate::scenario::Episode;
use crate::sensors::Sensors;
use crate::signals::{CONTROL_PERIOD_S, Measurand, MeasurandLanes, ReadingsLanes};

/// A block of `L` walkers with their controllers' inputs and outputs.
#[derive(Clone, Debug)]
pub struct Simulation<const L: usize> {
    /// Human, mechanism, ground and device.
    pub plant: HumanProsthesis<L>,
    /// Continuous state.
    pub state: State<L>,
    /// What the sensors sense, at the last sample.
    pub truth: MeasurandLanes<L>,
    /// Sensors with their noise.
    pub sensors: Sensors<L>,
    /// Last sensor readings.
    pub readings: ReadingsLanes<L>,
    /// State machine of each walker: it listens even where an agent commands.
    pub state_machine: [ReferenceController; L],
    /// What the state machine commands from the last readings, in the knee unit's own unit.
    pub state_machine_command: [f64; L],
    /// Control periods since the start of the trial.
    pub sample: [u64; L],
    episode: [Option<Episode>; L],
    reference: ReferenceParams,
    solver: SolverParams,
}

/// Storage that one control period needs and leaves nothing in: threads share it among their blocks, which keeps those small.
#[derive(Clone, Debug)]
pub struct Scratch<const L: usize> {
    work: Workspace<State<L>>,
    rates: State<L>,
}

impl<const L: usize> Scratch<L> {
    /// Storage for simulations like this one.
    pub fn new(simulation: &Simulation<L>) -> Self {
        Self { work: Workspace::new(&simulation.state), rates: simulation.state.clone() }
    }
}

impl<const L: usize> Simulation<L> {
    /// Walkers that each wait for [`start`](Self::start).
    pub fn new(config: &Config) -> Self {
        let plant = HumanProsthesis::new(config);
        let state = plant.state();
        let reference = ReferenceParams::from(config);
        Self {
            plant,
            truth: MeasurandLanes::default(),
            sensors: Sensors::new(&config.sensors),
            readings: ReadingsLanes::default(),
            state_machine: [reference.start(); L],
            state_machine_command: [0.0; L],
            sample: [0; L],
            episode: std::array::from_fn(|_| None),
            reference,
            solver: config.solver,
            state,
        }
    }

    /// Starts `episode` in `lane`; call [`observe_started`](Self::observe_started) after the last start.
    pub fn start(&mut self, lane: usize, episode: Episode) {
        self.plant.profile[lane].clone_from(&episode.profile);
        self.plant.start(&mut self.state, lane, episode.start, episode.human);
        self.plant.command[lane] = 0.0;
        self.sensors.seed[lane] = episode.sensor_seed;
        self.state_machine[lane] = self.reference.start();
        self.sample[lane] = 0;
        self.episode[lane] = Some(episode);
    }

    /// First sample of the lanes that have just been started.
    pub fn observe_started(&mut self, started: &[bool; L]) {
        self.set_intent();
        self.disturb();
        self.plant.sense(&self.state);
        self.plant.rates(&self.state, &[0.0; L], &mut self.state.clone());
        for lane in (0..L).filter(|&lane| started[lane]) {
            self.truth.set(lane, self.measure(lane));
        }
        self.sensors.start(started, &self.truth, &mut self.readings);
        for lane in (0..L).filter(|&lane| started[lane]) {
            self.control(lane);
        }
    }

    /// The episode that runs in `lane`.
    pub fn episode(&self, lane: usize) -> Option<&Episode> {
        self.episode[lane].as_ref()
    }

    /// One control period with the given commands to the knee units.
    pub fn advance(&mut self, commands: &[f64; L]) {
        self.advance_with(commands, &mut Scratch::new(self));
    }

    /// The same with storage that the caller keeps.
    #[inline(always)]
    pub fn advance_with(&mut self, commands: &[f64; L], scratch: &mut Scratch<L>) {
        self.begin_period(commands);
        let Self { plant, state, solver, .. } = self;
        integrator::advance(plant, state, &mut scratch.work, solver.stepper, CONTROL_PERIOD_S, solver.steps);
        self.finish_period(&mut scratch.rates);
    }

    /// Like [`advance`](Self::advance), and integrates the work of all forces beside the state.
    pub fn advance_metered(&mut self, commands: &[f64; L], meter: &mut EnergyMeter<L>) {
        self.begin_period(commands);
        meter.advance(&mut self.plant, &mut self.state, &self.solver);
        self.finish_period(&mut self.state.clone());
    }

    #[inline(always)]
    fn begin_period(&mut self, commands: &[f64; L]) {
        self.plant.command = *commands;
        self.plant.extension_stop_peak = [0.0; L];
        self.set_intent();
        self.plant.sense_command(&self.state);
        self.react();
        self.disturb();
    }

    /// Intent in the control period that begins now.
    #[inline(always)]
    fn set_intent(&mut self) {
        for lane in 0..L {
            let time = self.sample[lane] as f64 * CONTROL_PERIOD_S;
            self.plant.intent[lane] = f64::from(u8::from(self.plant.profile[lane].walks(time)));
        }
    }

    /// Disturbances of the control period that begins now, in a step that may have begun just now.
    #[inline(always)]
    fn disturb(&mut self) {
        for lane in 0..L {
            let Some(episode) = &mut self.episode[lane] else { continue };
            let memory = self.plant.memory(lane);
            let push = episode.disturbance.force(self.sample[lane], |phase| memory.time_at(phase));
            (self.plant.push_x[lane], self.plant.push_y[lane]) = (push.x, push.y);
        }
    }

    /// Lets the human react to inputs that have just changed.
    #[inline(always)]
    fn react(&mut self) {
        let fired = self.plant.fired(&self.state);
        if fired.contains(&true) {
            self.plant.transition(&mut self.state, &fired);
        }
    }

    #[inline(always)]
    fn finish_period(&mut self, rates: &mut State<L>) {
        for lane in 0..L {
            // The sum of many small steps drifts; the grid does not.
            self.sample[lane] += 1;
            self.state.rest.time[lane] = self.sample[lane] as f64 * CONTROL_PERIOD_S;
        }
        self.plant.sense_trunk_forces(&self.state);
        self.plant.rates(&self.state, &[0.0; L], rates);
        for lane in 0..L {
            self.truth.set(lane, self.measure(lane));
        }
        self.sensors.sample(&self.truth, &mut self.readings);
        for lane in 0..L {
            self.control(lane);
        }
    }

    #[inline(always)]
    fn measure(&self, lane: usize) -> Measurand {
        let motion = self.state.motion.get(lane);
        let reactions = self.plant.reactions(&self.state, lane);
        let mass = self.plant.body(lane).mass;
        let [thigh_imu, shank_imu] = self.sensors.imu;
        let [thigh_force, shank_force] = self.plant.specific_forces(&self.state, lane, thigh_imu, shank_imu);
        Measurand {
            knee_angle: self.plant.knee_flexion(lane),
            tube_force_bw: -reactions.tube_force / (mass * crate::signals::GRAVITY),
            tube_moment_nm_kg: -reactions.tube_torque / mass,
            shank_angle: motion.shank,
            shank_rate: motion.shank_rate,
            shank_force_x: shank_force.forward,
            shank_force_y: shank_force.up,
            thigh_rate: motion.thigh_rate,
            thigh_force_x: thigh_force.forward,
            thigh_force_y: thigh_force.up,
            ankle_moment_nm_kg: -self.plant.device(lane).ankle / mass,
            motor_position: self.state.rotor.angle[lane],
            motor_speed: self.state.rotor.rate[lane],
            motor_current: self.plant.unit.motor_signals(lane).current,
        }
    }

    /// Lets the state machine hear the last readings.
    #[inline(always)]
    fn control(&mut self, lane: usize) {
        let readings = self.readings.get(lane);
        self.state_machine_command[lane] = self.state_machine[lane].update(&self.reference, &readings);
    }
}
