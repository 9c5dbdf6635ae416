//! A lane of a block is the scalar simulation, bit for bit.

use prosthesis_gym_core::closed_loop::disturbance::{Push, TrunkPush};
use prosthesis_gym_core::closed_loop::simulation::{LoopModel, Scratch, Simulation};
use prosthesis_gym_core::episode::scenario::ScenarioParams;
use prosthesis_gym_core::mechanics::compliant_ground::GroundParams;
use prosthesis_gym_core::prosthesis::knee::kind::DeviceKind;
use prosthesis_gym_core::schema::distribution::Distribution;
use rand_pcg::Pcg64;

use super::*;

/// Everything that a lane carries. Shortest decimals that read back as the same number: equal text is equal bits.
fn fingerprint<const L: usize>(trial: &Trial<L>, lane: usize) -> String {
    let Simulation { walkers, state, readings, state_machine, state_machine_command, .. } = &**trial;
    let plant = trial.plant();
    let motion = (state.motion.get(lane), state.reference.get(lane), state.rest.get(lane));
    let signals = (readings.get(lane), state_machine[lane], state_machine_command[lane]);
    let forces = (plant.reactions(lane), plant.device(lane), walkers.extension_stop_peak[lane]);
    format!("{motion:?}\n{signals:?}\n{forces:?}\n{:?}", walkers.memory(lane))
}

/// A scenario of gusts, pushes at a gait phase and a human who does everything otherwise than the paper's.
pub fn restless() -> ScenarioParams {
    let mut scenario = ScenarioParams {
        speed_m_s: Distribution::Fixed(1.1),
        push_n: Distribution::Uniform([20.0, 60.0]),
        push_phase: Distribution::Uniform([0.0, 0.8]),
        ..ScenarioParams::default()
    };
    scenario.gust.force_n = Distribution::Uniform([-40.0, 40.0]);
    let human = &mut scenario.human;
    human.hip_lift_m = Distribution::Uniform([0.0, 0.02]);
    human.swing_flexion_deg = Distribution::Uniform([0.0, 15.0]);
    human.thigh_extension_change_deg = Distribution::Uniform([0.0, 3.0]);
    human.stance_asymmetry = Distribution::Uniform([0.0, 0.2]);
    human.step_delay_s = Distribution::Uniform([0.0, 0.03]);
    human.touch_down_delay_s = Distribution::Uniform([0.0, 0.03]);
    human.hip_stiffness_factor = Distribution::Uniform([0.8, 1.2]);
    human.pendulum_stiffness_factor = Distribution::Uniform([1.0, 1.4]);
    scenario
}

/// Eight different episodes, half of them restless, one of which ends in a fall.
fn episodes() -> [Episode; 8] {
    let scenarios = [ScenarioParams::default(), restless()];
    let mut episodes =
        std::array::from_fn(|lane| scenarios[lane % 2].draw(&mut Pcg64::new(1, lane as u128), 1.0, |_| None));
    episodes[5].disturbance.pushes = vec![Push::new(TrunkPush { x: -900.0, y: 0.0 }, 0.5, 0.3, None)];
    episodes
}

/// Also after lanes have fallen on knee and hip.
fn assert_lanes_equal_scalar_runs(config: &Config, duration_s: f64) -> Trial<8> {
    let episodes = episodes();
    let mut block = Trial::new(config, episodes.clone());
    let mut alone = episodes.map(|episode| Trial::new(config, [episode]));
    let mut lowest = f64::INFINITY;
    for period in 0..periods(duration_s) {
        block.advance_controlled();
        lowest = (0..8).map(|lane| block.plant().hip_height(lane)).fold(lowest, f64::min);
        for (lane, trial) in alone.iter_mut().enumerate() {
            trial.advance_controlled();
            let time = period as f64 * CONTROL_PERIOD_S;
            assert_eq!(fingerprint(&block, lane), fingerprint(trial, 0), "lane {lane} after {time:.3} s");
        }
    }
    assert!(lowest < 0.5, "nobody fell: {lowest}");
    block
}

fn assert_walked(block: &Trial<8>) {
    assert!(block.walkers.memory(0).heel_strikes + block.walkers.memory(1).heel_strikes > 2);
}

#[test]
fn a_lane_of_a_block_is_the_scalar_simulation_bit_for_bit_with_the_fast_stepper() {
    assert_walked(&assert_lanes_equal_scalar_runs(&with_solver(SolverParams::default()), 6.0));
}

#[test]
fn a_lane_of_a_block_is_the_scalar_simulation_bit_for_bit_with_the_reference_stepper() {
    assert_walked(&assert_lanes_equal_scalar_runs(&with_solver(SolverParams::REFERENCE), 4.0));
}

#[test]
fn a_lane_on_uneven_ground_is_the_scalar_simulation_bit_for_bit() {
    let ground = GroundParams {
        slope_deg: 3.0,
        step_height_m: -0.02,
        edge_m: 0.2,
        stair_rise_m: 0.01,
        stair_run_m: 1.5,
        stair_start_x_m: 5.0,
        roughness_m: 0.02,
        ..GroundParams::default()
    };
    assert_lanes_equal_scalar_runs(&Config { ground, ..Config::default() }, 6.0);
}

/// `Trial` runs on the best vector unit; the same called from here is compiled for the plainest processor.
#[test]
fn a_walker_has_the_same_bits_without_a_vector_unit() {
    for kind in [DeviceKind::Damper, DeviceKind::Motor] {
        let mut config = Config::default();
        config.device.kind = kind;
        let [.., episode] = episodes();
        let mut trial = Trial::new(&config, [episode.clone()]);
        let model = LoopModel::new(&config.loop_params(), config.solvers());
        let (mut plain, mut scratch) = (Simulation::<1>::new(&model), Scratch::new(&model));
        plain.start(&model, 0, episode, &mut scratch);
        plain.observe_started(&model, &[true], &mut scratch);
        for period in 0..periods(3.0) {
            trial.advance_controlled();
            let commands = plain.state_machine_command;
            plain.advance(&model, &commands, &[true; _], &mut scratch);
            let state = |simulation: &Simulation<1>| format!("{:?}", (&simulation.state, &simulation.readings));
            assert_eq!(state(&trial), state(&plain), "{kind:?}, period {period}");
        }
    }
}
