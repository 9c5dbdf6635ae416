//! Steps of the integrator and control periods of the closed loop, state machines in command.

use std::hint::black_box;

use criterion::{BatchSize, BenchmarkId, Criterion, Throughput};

use prosthesis_gym_core::config::SolverParams;
use prosthesis_gym_core::human_prosthesis::{HumanProsthesis, Model as PlantModel, Signals, State, Walkers};
use prosthesis_gym_core::integrator::{self, HybridFlow, Stepper, Workspace};
use prosthesis_gym_core::prosthesis_device::DeviceKind;
use prosthesis_gym_core::signals::CONTROL_PERIOD_S;
use prosthesis_gym_core::simulation::{Model, Scratch, Simulation};

use crate::walk::{Kernel, LANES, config, run_wide, steady};

/// Integrator and closed loop.
pub fn all(criterion: &mut Criterion) {
    let fast = SolverParams::default();
    let euler = SolverParams { stepper: Stepper::LinearlyImplicitEuler, ..fast };
    for (name, solver) in [("rk4", SolverParams::REFERENCE), ("linearly_implicit_euler", euler), ("two_stage_w", fast)]
    {
        let name = format!("integrator steps/{name}");
        steps(criterion, &name, &ClosedLoop::<1>::new(DeviceKind::Damper), solver, Kernel::run);
        steps(criterion, &name, &ClosedLoop::<LANES>::new(DeviceKind::Damper), solver, run_wide);
    }
    for kind in [DeviceKind::Damper, DeviceKind::Motor, DeviceKind::Friction] {
        let name = format!("control period/{kind:?}").to_lowercase();
        period(criterion, &name, ClosedLoop::<1>::new(kind), Kernel::run);
        period(criterion, &name, ClosedLoop::<LANES>::new(kind), run_wide);
    }
}

/// Walkers in stride under their state machines, each at its own speed; once more is one control period.
struct ClosedLoop<const L: usize> {
    model: Model<L>,
    simulation: Simulation<L>,
    scratch: Scratch<L>,
}

impl<const L: usize> ClosedLoop<L> {
    fn new(kind: DeviceKind) -> Self {
        const SETTLING_PERIODS: usize = 500;
        let model = Model::new(&config(kind));
        let (mut simulation, mut scratch) = (Simulation::new(&model), Scratch::new(&model));
        for lane in 0..L {
            simulation.start(&model, lane, steady(1.1 + 0.02 * lane as f64), &mut scratch);
        }
        simulation.observe_started(&model, &[true; L], &mut scratch);
        let mut walkers = Self { model, simulation, scratch };
        for _ in 0..SETTLING_PERIODS {
            walkers.run();
        }
        walkers
    }
}

impl<const L: usize> Kernel for ClosedLoop<L> {
    #[inline(always)]
    fn run(&mut self) {
        let commands = self.simulation.state_machine_command;
        self.simulation.advance(&self.model, &commands, &mut self.scratch);
    }
}

fn period<const L: usize>(
    criterion: &mut Criterion,
    name: &str,
    mut walkers: ClosedLoop<L>,
    run: fn(&mut ClosedLoop<L>),
) {
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(L as u64));
    group.bench_function(BenchmarkId::from_parameter(L), |bencher| bencher.iter(|| run(black_box(&mut walkers))));
}

/// The integrator's steps of one control period, from one moment of a walk.
#[derive(Clone)]
struct Steps<'a, const L: usize> {
    model: &'a PlantModel<L>,
    state: State<L>,
    walkers: Walkers<L>,
    signals: Signals<L>,
    work: Workspace<State<L>>,
    solver: SolverParams,
}

impl<'a, const L: usize> Steps<'a, L> {
    fn new(from: &'a ClosedLoop<L>, solver: SolverParams) -> Self {
        let Simulation { state, walkers, .. } = &from.simulation;
        let model = &from.model.plant;
        let mut period = Self {
            model,
            state: state.clone(),
            walkers: walkers.clone(),
            signals: Signals::new(model),
            work: Workspace::new(state),
            solver,
        };
        HumanProsthesis { model, walkers: &mut period.walkers, signals: &mut period.signals }.sense(&period.state);
        period
    }
}

impl<const L: usize> Kernel for Steps<'_, L> {
    #[inline(always)]
    fn run(&mut self) {
        let mut plant = HumanProsthesis { model: self.model, walkers: &mut self.walkers, signals: &mut self.signals };
        let SolverParams { stepper, steps } = self.solver;
        integrator::advance(&mut plant, &mut self.state, &mut self.work, stepper, CONTROL_PERIOD_S, steps);
    }
}

fn steps<'a, const L: usize>(
    criterion: &mut Criterion,
    name: &str,
    from: &'a ClosedLoop<L>,
    solver: SolverParams,
    run: fn(&mut Steps<'a, L>),
) {
    let period = Steps::new(from, solver);
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements((L * solver.steps) as u64));
    group.bench_function(BenchmarkId::from_parameter(L), |bencher| {
        // A batch of periods would leave the caches, which the threads of a batch do not.
        bencher.iter_batched_ref(|| period.clone(), run, BatchSize::PerIteration);
    });
}
