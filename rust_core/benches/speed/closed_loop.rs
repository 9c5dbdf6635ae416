//! Steps of the integrator and control periods of the closed loop, state machines in command.

use std::hint::black_box;
use std::slice::from_mut;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput};

use prosthesis_gym_core::closed_loop::simulation::{LoopModel, Scratch, Simulation};
use prosthesis_gym_core::numerics::integrator::{self, HybridFlow, Stepper, Workspace};
use prosthesis_gym_core::plant::model::PlantModel;
use prosthesis_gym_core::plant::signals::Signals;
use prosthesis_gym_core::plant::solver::SolverParams;
use prosthesis_gym_core::plant::state::State;
use prosthesis_gym_core::plant::system::HumanProsthesis;
use prosthesis_gym_core::plant::walkers::Walkers;
use prosthesis_gym_core::prosthesis::knee::kind::DeviceKind;
use prosthesis_gym_core::signals::CONTROL_PERIOD_S;

use crate::walk::{Block, LANES, config, run, steady};

/// Integrator and closed loop.
pub fn all(criterion: &mut Criterion) {
    let fast = SolverParams::default();
    let euler = SolverParams { stepper: Stepper::LinearlyImplicitEuler, ..fast };
    for (name, solver) in [("rk4", SolverParams::REFERENCE), ("linearly_implicit_euler", euler), ("two_stage_w", fast)]
    {
        let name = format!("integrator steps/{name}");
        steps::<1>(criterion, &name, solver);
        steps::<LANES>(criterion, &name, solver);
    }
    for kind in [DeviceKind::Damper, DeviceKind::Motor, DeviceKind::Friction] {
        let name = format!("control period/{kind:?}").to_lowercase();
        period::<1>(criterion, &name, kind);
        period::<LANES>(criterion, &name, kind);
    }
}

/// Walkers in stride under their state machines, each at its own speed; once more is one control period.
struct ClosedLoop<const L: usize> {
    simulation: Simulation<L>,
    scratch: Scratch<L>,
}

impl<const L: usize> ClosedLoop<L> {
    fn new(kind: DeviceKind) -> (LoopModel<L>, Self) {
        const SETTLING_PERIODS: usize = 500;
        let config = config(kind);
        let model = LoopModel::new(&config.loop_params(), config.solvers());
        let (mut simulation, mut scratch) = (Simulation::new(&model), Scratch::new(&model));
        for lane in 0..L {
            simulation.start(&model, lane, steady(1.1 + 0.02 * lane as f64), &mut scratch);
        }
        simulation.observe_started(&model, &[true; L], &mut scratch);
        let mut walkers = Self { simulation, scratch };
        for _ in 0..SETTLING_PERIODS {
            run(&model, from_mut(&mut walkers));
        }
        (model, walkers)
    }
}

impl<const L: usize> Block for ClosedLoop<L> {
    type Constants = LoopModel<L>;

    #[inline(always)]
    fn run(&mut self, model: &LoopModel<L>) {
        let commands = self.simulation.state_machine_command;
        self.simulation.advance(model, &commands, &[true; _], &mut self.scratch);
    }
}

fn period<const L: usize>(criterion: &mut Criterion, name: &str, kind: DeviceKind) {
    let (model, mut walkers) = ClosedLoop::<L>::new(kind);
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(L as u64));
    group.bench_function(BenchmarkId::from_parameter(L), |bencher| {
        bencher.iter(|| run(&model, from_mut(black_box(&mut walkers))));
    });
}

/// Knee unit of the integrator's steps.
const KIND: DeviceKind = DeviceKind::Damper;

/// The integrator's steps of one control period, from one moment of a walk.
#[derive(Clone)]
struct Steps<const L: usize> {
    state: State<L>,
    walkers: Walkers<L>,
    signals: Signals<L>,
    work: Workspace<State<L>>,
    solver: SolverParams,
}

impl<const L: usize> Steps<L> {
    fn new(model: &PlantModel<L>, simulation: &Simulation<L>, solver: SolverParams) -> Self {
        let Simulation { state, walkers, .. } = simulation;
        let (mut walkers, mut signals) = (walkers.clone(), Signals::new(model));
        HumanProsthesis { model, walkers: &mut walkers, signals: &mut signals }.sense(state);
        let solver = SolverParams { steps: solver.steps_with(KIND), ..solver };
        Self { state: state.clone(), walkers, signals, work: Workspace::new(state), solver }
    }
}

impl<const L: usize> Block for Steps<L> {
    type Constants = PlantModel<L>;

    #[inline(always)]
    fn run(&mut self, model: &PlantModel<L>) {
        let SolverParams { stepper, steps } = self.solver;
        let mut plant = HumanProsthesis { model, walkers: &mut self.walkers, signals: &mut self.signals };
        integrator::advance(&mut plant, &mut self.state, &mut self.work, stepper, CONTROL_PERIOD_S, steps);
    }
}

fn steps<const L: usize>(criterion: &mut Criterion, name: &str, solver: SolverParams) {
    let (model, walkers) = ClosedLoop::<L>::new(KIND);
    let period = Steps::new(&model.plant, &walkers.simulation, solver);
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements((L * period.solver.steps) as u64));
    group.bench_function(BenchmarkId::from_parameter(L), |bencher| {
        // A batch of periods would leave the caches, which the threads of a batch do not.
        let routine = |period: &mut Steps<L>| run(&model.plant, from_mut(period));
        bencher.iter_batched_ref(|| period.clone(), routine, BatchSize::PerIteration);
    });
}
