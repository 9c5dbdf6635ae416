//! Control periods in which the integration diverges are integrated again, for the walker alone that has diverged.

use prosthesis_gym_core::closed_loop::disturbance::{Disturbance, Push, TrunkPush};
use prosthesis_gym_core::closed_loop::episode::Episode;
use prosthesis_gym_core::closed_loop::repetition::Repeats;
use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::human::intent::Profile;
use prosthesis_gym_core::numerics::integrator::Stepper;
use prosthesis_gym_core::plant::solver::SolverParams;
use prosthesis_gym_core::plant::start::Start;
use prosthesis_gym_core::plant::state::WalkerState;
use prosthesis_gym_core::trial::Trial;

use super::{knot, periods, with_solver};

/// Far too long: impacts make it diverge.
const COARSE: SolverParams = SolverParams { stepper: Stepper::LinearlyImplicitEuler, steps: 1 };
const FINER: SolverParams = SolverParams { steps: 4, ..COARSE };
const LANES: usize = 8;

/// A walk that pushes of different sizes end in a hard fall.
fn pushed(lane: usize) -> Episode {
    let force = TrunkPush { x: 400.0 * lane as f64 - 1200.0, y: -300.0 * lane as f64 };
    let pushes = vec![Push::new(force, 0.2, 0.3, None)];
    let profile = Profile { knots: vec![knot(0.0, 1.2, true)] };
    let disturbance = Disturbance { pushes, ..Disturbance::default() };
    Episode { disturbance, ..Episode::undisturbed(Start::Cyclic, profile) }
}

fn stiff<const L: usize>() -> [f64; L] {
    [20.0; L]
}

#[test]
fn a_repeated_period_is_what_the_finer_solver_or_the_reference_makes_of_it() {
    let config = with_solver(COARSE);
    let [_, finer, reference] = config.solvers();
    assert_eq!(finer, FINER);
    let mut settled = Repeats::default();
    for lane in 0..LANES {
        let mut trial = Trial::new(&config, [pushed(lane)]);
        for _ in 0..periods(2.0) {
            let before = trial.clone();
            trial.advance(&stiff());
            if trial.diverged[0] {
                break;
            }
            let [by_finer, by_reference] = [finer, reference].map(|solver| {
                let mut again = Trial::new(&with_solver(solver), [pushed(lane)]);
                again.continue_from(&before);
                again.advance(&stiff());
                again.state.get(0)
            });
            let state = trial.state.get(0);
            if trial.repeats.finer > before.repeats.finer {
                assert_eq!(state, by_finer);
                settled.finer += 1;
            } else if trial.repeats.reference > before.repeats.reference {
                assert_eq!(state, by_reference);
                settled.reference += 1;
            }
        }
    }
    assert!(settled.finer > 0 && settled.reference > 0, "{settled:?}");
}

#[test]
fn neighbours_of_a_walker_that_repeats_its_period_walk_as_they_would_alone() {
    let config = with_solver(COARSE);
    let mut block = Trial::new(&config, std::array::from_fn::<_, LANES, _>(pushed));
    let mut alone = std::array::from_fn::<_, LANES, _>(|lane| Trial::new(&config, [pushed(lane)]));
    for _ in 0..periods(2.0) {
        block.advance(&stiff());
        for (lane, walker) in alone.iter_mut().enumerate() {
            walker.advance(&stiff());
            assert_eq!(bits(block.state.get(lane)), bits(walker.state.get(0)));
            assert_eq!(block.readings.get(lane).knee_angle.to_bits(), walker.readings.get(0).knee_angle.to_bits());
        }
    }
    let together = alone.iter().map(|walker| walker.repeats).fold(Repeats::default(), Repeats::plus);
    assert_eq!(block.repeats, together);
    assert!(together.finer > 0 && together.reference > 0, "{together:?}");
}

/// NaN equals NaN.
fn bits(state: WalkerState) -> String {
    format!("{state:?}")
}

#[test]
fn a_walk_of_the_default_solver_repeats_nothing() {
    for device in ["damper", "motor", "friction"] {
        let config = Config::from_deserializer(serde_json::json!({"device": {"kind": device}})).unwrap();
        let mut trial =
            Trial::new(&config, [Episode::undisturbed(Start::Cyclic, Profile { knots: vec![knot(0.0, 1.1, true)] })]);
        for _ in 0..periods(10.0) {
            trial.advance_controlled();
        }
        assert_eq!(trial.repeats, Repeats::default());
    }
}
