//! What the benchmarks share: moments of a steady walk as inputs, and work on blocks of any width.

use criterion::{BenchmarkId, Criterion, Throughput};
use std::hint::black_box;

use prosthesis_gym_core::closed_loop::episode::Episode;
use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::human::intent::{Knot, Profile};
use prosthesis_gym_core::mechanics::compliant_ground::Contact;
use prosthesis_gym_core::mechanics::motion::{Motion, Point, Prescribed};
use prosthesis_gym_core::plant::start::Start;
use prosthesis_gym_core::prosthesis::knee::joint::JointMotion;
use prosthesis_gym_core::prosthesis::knee::kind::DeviceKind;
use prosthesis_gym_core::prosthesis::knee::motor::geared_motor::Rotor;
use prosthesis_gym_core::signals::Measurand;
use prosthesis_gym_core::trial::Trial;

/// Length of an implicit stage, s.
pub const STEP_S: f64 = 1e-3;

/// Lanes of a wide block.
pub const LANES: usize = prosthesis_gym_core::vector::block::LANES;

/// Blocks that single equations run over, so that neither dispatch nor timer counts.
pub const BLOCKS: usize = 16;

/// Work on a block of walkers, the same lines at any width.
pub trait Block {
    /// What the work leaves as it is.
    type Constants;

    /// Does the work once.
    fn run(&mut self, constants: &Self::Constants);
}

/// Runs blocks, compiled for the same vector units as the steps of a batch.
///
/// Constants and blocks are arguments of their own because only then does the compiler know them apart: else no lane loop that
/// reads the ones and writes the others becomes vector code.
#[multiversion::multiversion(targets(
    "x86_64+avx512f+avx512vl+avx512dq+avx512bw+avx512cd+fma+bmi1+bmi2",
    "x86_64+avx2+fma+bmi1+bmi2"
))]
pub fn run<B: Block>(constants: &B::Constants, blocks: &mut [B]) {
    for block in blocks {
        block.run(constants);
    }
}

/// Measures blocks of one walker and of [`LANES`] walkers, in walkers per second.
pub fn compare<N: Block, W: Block>(
    criterion: &mut Criterion,
    name: &str,
    (narrow_constants, mut narrow): (N::Constants, Vec<N>),
    (wide_constants, mut wide): (W::Constants, Vec<W>),
) {
    let mut group = criterion.benchmark_group(name);
    group.throughput(Throughput::Elements(narrow.len() as u64));
    group.bench_function(BenchmarkId::from_parameter(1), |bencher| {
        bencher.iter(|| run(black_box(&narrow_constants), black_box(&mut narrow)));
    });
    group.throughput(Throughput::Elements((wide.len() * LANES) as u64));
    group.bench_function(BenchmarkId::from_parameter(LANES), |bencher| {
        bencher.iter(|| run(black_box(&wide_constants), black_box(&mut wide)));
    });
}

/// The defaults with one of the knee units.
pub fn config(kind: DeviceKind) -> Config {
    let mut config = Config::default();
    config.device.kind = kind;
    config
}

/// An undisturbed walk at a constant speed, in stride from the start.
pub fn steady(speed_m_s: f64) -> Episode {
    Episode::undisturbed(Start::Cyclic, Profile { knots: vec![Knot { time_s: 0.0, speed_m_s, walk: true }] })
}

/// A moment of a walk.
#[derive(Clone, Copy, Debug)]
pub struct Moment {
    pub time_s: f64,
    pub motion: Motion,
    pub trunk: Prescribed,
    /// Heel and ball.
    pub points: [Point; 2],
    pub contacts: [Contact; 2],
    /// Deformation of the ground there, m.
    pub deformations: [f64; 2],
    pub knee: JointMotion,
    /// Hip angle to the trunk, rad, and its rate, rad/s.
    pub hip: [f64; 2],
    pub rotor: Rotor,
    /// Command of the state machine to the knee unit.
    pub command: f64,
    pub truth: Measurand,
}

/// Moments 10 ms apart, a little more than a stride of a walker at 1.1 m/s, after two strides.
pub fn stride(kind: DeviceKind) -> Vec<Moment> {
    const SETTLING_PERIODS: usize = 500;
    let mut trial = Trial::new(&config(kind), [steady(1.1)]);
    for _ in 0..SETTLING_PERIODS {
        trial.advance_controlled();
    }
    let moments = (0..BLOCKS * LANES).map(|_| {
        trial.advance_controlled();
        trial.advance_controlled();
        let plant = trial.plant();
        let (motion, rest) = (plant.motion(0), trial.state.rest.get(0));
        Moment {
            time_s: rest.time,
            motion,
            trunk: plant.prescribed(0),
            points: [plant.foot_point(0, 0), plant.foot_point(1, 0)],
            contacts: [plant.contact(0, 0), plant.contact(1, 0)],
            deformations: [rest.heel, rest.ball],
            knee: JointMotion { flexion: plant.knee_flexion(0), flexion_rate: motion.thigh_rate - motion.shank_rate },
            hip: [plant.joints(0).hip, plant.joints(0).hip_rate],
            rotor: plant.rotor(0),
            command: trial.state_machine_command[0],
            truth: trial.sampled().scratch.truth.get(0),
        }
    });
    moments.collect()
}

/// Makes [`BLOCKS`] blocks of moments spread over the whole stride.
pub fn blocks<const L: usize, B>(stride: &[Moment], block: impl Fn([&Moment; L]) -> B) -> Vec<B> {
    let apart = stride.len() / (BLOCKS * L);
    (0..BLOCKS).map(|i| block(std::array::from_fn(|lane| &stride[(i * L + lane) * apart]))).collect()
}

/// Columns of what moments have, made by their `set`.
macro_rules! columns {
    ($Columns:ident, $moments:expr, |$moment:ident| $value:expr) => {{
        let mut columns = $Columns::<L>::default();
        for (lane, $moment) in $moments.into_iter().enumerate() {
            columns.set(lane, $value);
        }
        columns
    }};
}
pub(crate) use columns;
