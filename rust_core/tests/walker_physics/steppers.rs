//! The fast stepper against the reference, and the order of each on the walker.

use prosthesis_gym_core::human::gait_fsm::{IntactState, ResidualState};
use prosthesis_gym_core::mechanics::motion::Motion;
use prosthesis_gym_core::numerics::integrator::Stepper;

use super::*;

/// Steady gait, means over the last strides.
#[derive(Debug)]
struct Gait {
    stride_s: f64,
    hip_in_residual_stance_m: f64,
    hip_in_intact_stance_m: f64,
    knee_in_swing_deg: f64,
    knee_in_stance_deg: f64,
}

fn steady_gait(solver: SolverParams) -> Gait {
    const STRIDES: u32 = 5;
    let mut trial = trial(&with_solver(solver), Start::Standing, vec![knot(0.0, 1.1, false), knot(1.0, 1.1, true)]);
    while trial.sample[0] < periods(20.0) as u64 {
        trial.advance_controlled();
    }
    // From one residual heel strike to the fifth after it.
    let next_strike = |trial: &mut Trial<1>, peaks: &mut [f64; 4]| {
        let strikes = trial.walkers.memory(0).heel_strikes;
        while trial.walkers.memory(0).heel_strikes == strikes {
            trial.advance_controlled();
            let (motion, memory) = (trial.state.motion.get(0), trial.walkers.memory(0));
            let in_residual_stance = memory.intact == IntactState::Swing;
            let hip = &mut peaks[usize::from(!in_residual_stance)];
            *hip = hip.max(motion.hip_y);
            let early = trial.state.rest.time[0] - memory.step_start < 0.3 * memory.cycle;
            let knee = &mut peaks[2 + usize::from(early)];
            *knee = knee.max((motion.thigh - motion.shank).to_degrees());
        }
        trial.walkers.memory(0).step_start
    };
    let begin = next_strike(&mut trial, &mut [0.0; 4]);
    let (mut end, mut sums) = (begin, [0.0; 4]);
    for _ in 0..STRIDES {
        let mut peaks = [0.0; 4];
        end = next_strike(&mut trial, &mut peaks);
        for (sum, peak) in sums.iter_mut().zip(peaks) {
            *sum += peak / f64::from(STRIDES);
        }
    }
    assert_eq!(trial.walkers.memory(0).residual, ResidualState::StepCycle);
    let [hip_in_residual_stance_m, hip_in_intact_stance_m, knee_in_swing_deg, knee_in_stance_deg] = sums;
    let stride_s = (end - begin) / f64::from(STRIDES);
    Gait { stride_s, hip_in_residual_stance_m, hip_in_intact_stance_m, knee_in_swing_deg, knee_in_stance_deg }
}

#[test]
fn the_fast_stepper_walks_like_the_reference() {
    let (fast, reference) = (steady_gait(SolverParams::default()), steady_gait(SolverParams::REFERENCE));
    println!("fast      {fast:.4?}\nreference {reference:.4?}");
    for (name, fast, reference) in [
        ("stride time", fast.stride_s, reference.stride_s),
        ("hip peak in residual stance", fast.hip_in_residual_stance_m, reference.hip_in_residual_stance_m),
        ("hip peak in intact stance", fast.hip_in_intact_stance_m, reference.hip_in_intact_stance_m),
        ("knee peak in swing", fast.knee_in_swing_deg, reference.knee_in_swing_deg),
        ("knee peak in stance", fast.knee_in_stance_deg, reference.knee_in_stance_deg),
    ] {
        let difference = fast / reference - 1.0;
        println!("{name}: {:+.3} %", 100.0 * difference);
        assert!(difference.abs() < 0.01, "{name}: {fast} instead of {reference}");
    }
}

/// State after a stretch of stance on the flat foot, where nothing switches, by the given solver.
fn after_smooth_stretch(config: &Config, solver: SolverParams) -> Motion {
    const DAMPING: [f64; 1] = [10.0];
    let knots = vec![knot(0.0, 1.1, true)];
    let with_solver = |solver| Config { solver, ..config.clone() };
    let mut reference = trial(&with_solver(SolverParams::REFERENCE), Start::Cyclic, knots.clone());
    for _ in 0..periods(0.18) {
        reference.advance(&DAMPING);
    }
    let mut trial = trial(&with_solver(solver), Start::Cyclic, knots);
    trial.continue_from(&reference);
    for _ in 0..periods(0.06) {
        trial.advance(&DAMPING);
        assert!((0..2).all(|point| trial.plant().contact(point, 0).tangential_damping > 0.0), "the foot slips");
        assert_eq!(trial.plant().device(0).extension_stop, 0.0);
    }
    trial.state.motion.get(0)
}

/// Errors of the positions at the end of the stretch, for each number of steps per control period.
fn errors<const N: usize>(config: &Config, stepper: Stepper, steps: [usize; N]) -> [f64; N] {
    let positions = |solver| {
        let m = after_smooth_stretch(config, solver);
        [m.hip_x, m.hip_y, m.thigh, m.shank, m.foot]
    };
    let exact = positions(SolverParams { stepper: Stepper::Rk4, steps: 400 });
    let errors = steps.map(|steps| {
        let found = positions(SolverParams { stepper, steps });
        found.iter().zip(exact).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
    });
    println!("{stepper:?} with {steps:?} steps per control period: errors {errors:?}");
    errors
}

#[test]
fn the_error_of_the_fast_stepper_on_the_walker_falls_with_the_square_of_the_step() {
    for config in [Config::default(), with_socket(Config::default())] {
        for pair in errors(&config, Stepper::TwoStageW, [10, 20, 40, 80]).windows(2) {
            let ratio = pair[0] / pair[1];
            assert!((3.4..4.6).contains(&ratio), "{ratio}");
        }
    }
}

#[test]
fn the_error_of_the_linearly_implicit_euler_on_the_walker_halves_with_the_step() {
    for config in [Config::default(), with_socket(Config::default())] {
        for pair in errors(&config, Stepper::LinearlyImplicitEuler, [5, 10, 20, 40, 80]).windows(2) {
            let ratio = pair[0] / pair[1];
            assert!((1.9..2.1).contains(&ratio), "{ratio}");
        }
    }
}

#[test]
fn the_error_of_the_reference_on_the_walker_falls_with_the_fourth_power_of_the_step() {
    // The socket's dampers need smaller steps.
    for (config, steps) in [(Config::default(), [20, 40, 80]), (with_socket(Config::default()), [45, 90, 180])] {
        for pair in errors(&config, Stepper::Rk4, steps).windows(2) {
            let ratio = pair[0] / pair[1];
            assert!(ratio > 15.0, "{ratio}");
        }
    }
}
