//! The walker as a mechanical system: conservation laws, energy balance, and the fast stepper against the reference.

#[path = "hybrid_dynamics/table_1.rs"]
mod table_1;

use prosthesis_gym_core::config::{Config, SolverParams};
use prosthesis_gym_core::disturbance::{Push, TrunkPush};
use prosthesis_gym_core::energy_meter::EnergyMeter;
use prosthesis_gym_core::human_controller::gait_fsm::{IntactState, ResidualState};
use prosthesis_gym_core::human_controller::intent::{Knot, Profile};
use prosthesis_gym_core::human_prosthesis::{POWERS, Start};
use prosthesis_gym_core::hybrid_dynamics::chain::Chain;
use prosthesis_gym_core::hybrid_dynamics::general_walker::JointDrive;
use prosthesis_gym_core::hybrid_dynamics::walker::Motion;
use prosthesis_gym_core::hybrid_dynamics::walker_chain::walker_joints;
use prosthesis_gym_core::integrator::Stepper;
use prosthesis_gym_core::params::Span;
use prosthesis_gym_core::prosthesis_device::socket::SocketParams;
use prosthesis_gym_core::prosthesis_device::spring_damper::Connection;
use prosthesis_gym_core::prosthesis_device::{DeviceKind, DeviceParams};
use prosthesis_gym_core::scenario::{Episode, ScenarioParams, StartChoice};
use prosthesis_gym_core::signals::{CONTROL_PERIOD_S, GRAVITY};
use prosthesis_gym_core::simulation::Simulation;
use rand_pcg::Pcg64;

fn knot(time_s: f64, speed_m_s: f64, walk: bool) -> Knot {
    Knot { time_s, speed_m_s, walk }
}

/// One walker at the start of an undisturbed trial.
fn simulation(config: &Config, start: Start, knots: Vec<Knot>) -> Simulation<1> {
    let mut simulation = Simulation::new(config);
    simulation.start(0, Episode::undisturbed(start, Profile { knots }));
    simulation.observe_started(&[true]);
    simulation
}

fn with_solver(solver: SolverParams) -> Config {
    Config { solver, ..Config::default() }
}

fn periods(seconds: f64) -> usize {
    (seconds / CONTROL_PERIOD_S).round() as usize
}

/// No spring, damper, friction, stop or actuator acts between the segments.
fn limp() -> Config {
    let mut config = with_solver(SolverParams::REFERENCE);
    config.knee.spring_nm_rad = 0.0;
    config.knee.viscous_nms_rad = 0.0;
    config.knee.dry_friction_nm = 0.0;
    config.end_stop.half_compression_torque_nm = 0.0;
    config.ankle.stiffness_nm_rad = 0.0;
    config.ankle.damping_nms_rad = 0.0;
    config.human.hip_stiffness_nm_rad = 0.0;
    config.human.hip_damping_nms_rad = 0.0;
    config
}

/// A tumbling leg high above the ground; the trunk keeps its angle.
fn in_free_fall(config: &Config) -> Simulation<1> {
    let mut simulation = simulation(config, Start::Cyclic, vec![knot(0.0, 1.1, true)]);
    let posture = simulation.state.motion.get(0);
    simulation
        .state
        .motion
        .set(0, Motion { hip_y: 100.0, hip_vy: 3.0, thigh_rate: 4.0, shank_rate: -7.0, foot_rate: 12.0, ..posture });
    simulation.observe_started(&[true]);
    simulation
}

/// Mechanical energy, J.
fn energy(simulation: &Simulation<1>) -> f64 {
    let energy = simulation.plant.energy(&simulation.state, 0);
    energy.kinetic + energy.potential
}

/// Angular momentum about the centre of mass and linear momentum, by the general chain.
fn momentum(config: &Config, simulation: &Simulation<1>) -> [f64; 3] {
    let chain = Chain::new(walker_joints(&config.body, None), [0.0, -GRAVITY]).unwrap();
    let (m, trunk) = (simulation.state.motion.get(0), simulation.plant.prescribed(0));
    let mount = config.body.foot_mount_deg.to_radians();
    let q = table_1::joint_coordinates([m.hip_x, m.hip_y], trunk.angle, [m.thigh, m.shank, m.foot], mount);
    let rates = [m.thigh_rate, m.shank_rate, m.foot_rate];
    let qd = table_1::joint_coordinates([m.hip_vx, m.hip_vy], trunk.rate, rates, 0.0);
    let ([x, y], [about_origin, px, py]) = (chain.center_of_mass(&q).unwrap(), chain.momentum(&q, &qd).unwrap());
    [about_origin - (x * py - y * px), px, py]
}

#[test]
fn the_limp_mechanism_conserves_energy_and_linear_momentum_in_free_fall() {
    let config = limp();
    let mut simulation = in_free_fall(&config);
    let (start, [_, px, py]) = (energy(&simulation), momentum(&config, &simulation));
    let kinetic = simulation.plant.energy(&simulation.state, 0).kinetic;
    let mass = simulation.plant.body(0).mass;
    let mut largest = 0.0_f64;
    for period in 1..=periods(1.0) {
        simulation.advance(&[0.0]);
        let drift = (energy(&simulation) - start).abs() / kinetic;
        assert!(drift < 1e-9, "{drift:e}");
        largest = largest.max(drift);
        let [_, now_px, now_py] = momentum(&config, &simulation);
        let fallen = mass * GRAVITY * period as f64 * CONTROL_PERIOD_S;
        assert!((now_px - px).abs() < 1e-9 * px.abs());
        assert!((now_py - (py - fallen)).abs() < 1e-9 * fallen.max(py.abs()));
    }
    let turned = (simulation.state.motion.foot[0] - simulation.state.motion.shank[0]).abs();
    assert!(turned > 3.0, "the leg hardly moved: {turned}");
    println!("largest drift of the energy in 1 s: {largest:.1e} of the kinetic energy");
}

/// With its centre of mass in the hip, a trunk that does not turn needs no torque to keep it so.
#[test]
fn the_limp_mechanism_conserves_angular_momentum_in_free_fall() {
    let mut config = limp();
    config.body.trunk_com_y_m = 0.0;
    let mut simulation = in_free_fall(&config);
    let [start, ..] = momentum(&config, &simulation);
    assert!(start.abs() > 1.0);
    for _ in 0..periods(1.0) {
        simulation.advance(&[0.0]);
        let drift = (momentum(&config, &simulation)[0] - start).abs() / start.abs();
        assert!(drift < 1e-9, "{drift:e}");
    }
}

/// Against second differences of the sensors' positions, two periods apart.
#[test]
fn inertial_sensors_sense_their_own_acceleration_and_rate() {
    let mut config = limp();
    (config.sensors.thigh_imu_m, config.sensors.shank_imu_m) = (0.2, 0.15);
    let mut simulation = in_free_fall(&config);
    let samples: Vec<_> = (0..periods(0.3))
        .map(|_| {
            simulation.advance(&[0.0]);
            let m = simulation.state.motion.get(0);
            let below =
                |[x, y]: [f64; 2], angle: f64, length: f64| [x + length * angle.sin(), y - length * angle.cos()];
            let hip = [m.hip_x, m.hip_y];
            let thigh = below(hip, m.thigh, config.sensors.thigh_imu_m);
            let shank = below(below(hip, m.thigh, config.body.thigh_length_m), m.shank, config.sensors.shank_imu_m);
            let readings = simulation.readings.get(0);
            assert_eq!((readings.thigh_rate, readings.shank_rate), (m.thigh_rate, m.shank_rate));
            let sensed =
                [readings.thigh_force_x, readings.thigh_force_y, readings.shank_force_x, readings.shank_force_y];
            (thigh, shank, [m.thigh, m.shank], sensed)
        })
        .collect();
    let mut largest = 0.0_f64;
    for window in samples.windows(3) {
        let [before, now, after] = [&window[0], &window[1], &window[2]];
        let force = |before: [f64; 2], now: [f64; 2], after: [f64; 2], angle: f64| {
            let [ax, ay]: [f64; 2] =
                std::array::from_fn(|i| (after[i] - 2.0 * now[i] + before[i]) / CONTROL_PERIOD_S.powi(2));
            let (sin, cos) = angle.sin_cos();
            [ax * cos + (ay + GRAVITY) * sin, -ax * sin + (ay + GRAVITY) * cos]
        };
        let thigh = force(before.0, now.0, after.0, now.2[0]);
        let shank = force(before.1, now.1, after.1, now.2[1]);
        for (sensed, expected) in now.3.into_iter().zip(thigh.into_iter().chain(shank)) {
            assert!((sensed - expected).abs() < 0.1, "{sensed} m/s^2 sensed, {expected} expected");
            largest = largest.max(sensed.abs());
        }
    }
    assert!(largest > 10.0, "the leg hardly moved: {largest}");
}

#[test]
fn inertial_sensors_of_a_resting_leg_sense_gravity_in_the_frames_of_its_segments() {
    let mut simulation = simulation(&Config::default(), Start::Standing, vec![knot(0.0, 1.1, false)]);
    for _ in 0..periods(20.0) {
        simulation.advance(&[0.0]);
    }
    let (motion, readings) = (simulation.state.motion.get(0), simulation.readings.get(0));
    for (angle, forward, up) in [
        (motion.thigh, readings.thigh_force_x, readings.thigh_force_y),
        (motion.shank, readings.shank_force_x, readings.shank_force_y),
    ] {
        assert!((forward - GRAVITY * angle.sin()).abs() < 1e-2, "{forward}");
        assert!((up - GRAVITY * angle.cos()).abs() < 1e-2, "{up}");
    }
}

/// Speed profile of the 40 s trial of section 5.2.2.
fn forty_second_trial() -> Vec<Knot> {
    vec![
        knot(0.0, 1.1, false),
        knot(1.0, 1.1, true),
        knot(10.0, 1.1, true),
        knot(10.0, 1.4, true),
        knot(15.0, 1.4, true),
        knot(15.0, 1.1, true),
        knot(20.0, 1.1, true),
        knot(25.0, 1.4, true),
        knot(35.0, 0.8, true),
        knot(40.0, 0.8, false),
    ]
}

/// Work of each of [`POWERS`] by name, J.
struct Work(EnergyMeter<1>);

impl Work {
    fn of(&self, name: &str) -> f64 {
        self.0.work[POWERS.iter().position(|&power| power == name).unwrap()][0]
    }
}

/// Walks on, at most until a fall; asserts that the energy of the system changes by the work of all forces.
/// Returns that work, and the time that it took.
fn metered(simulation: &mut Simulation<1>, duration_s: f64) -> (Work, f64) {
    let mut meter = EnergyMeter::default();
    let start = energy(simulation);
    let mut end_s = 0.0;
    for period in 1..=periods(duration_s) {
        simulation.advance_metered(&[simulation.state_machine_command[0]], &mut meter);
        end_s = period as f64 * CONTROL_PERIOD_S;
        if simulation.state.motion.hip_y[0] < 0.6 {
            break;
        }
    }
    let gained = energy(simulation) - start;
    let work: f64 = meter.work.iter().map(|lanes| lanes[0]).sum();
    let exchanged: f64 = meter.exchanged.iter().map(|lanes| lanes[0]).sum();
    let imbalance = (gained - work).abs() / exchanged;
    println!(
        "{end_s:.2} s: energy gained {gained:.3} J, work {work:.3} J, exchanged {exchanged:.0} J, imbalance {imbalance:.1e}"
    );
    assert!(imbalance < 1e-6, "{imbalance:e}");
    (Work(meter), end_s)
}

#[test]
fn the_energy_balance_of_a_restless_walk_closes() {
    let mut scenario = restless();
    scenario.start = StartChoice::Standing;
    let mut episode = scenario.draw(&mut Pcg64::new(1, 1));
    // Two pushes that the drawn one would not do: upward, and strong.
    for (time_s, force) in [(1.0, TrunkPush { x: 0.0, y: 150.0 }), (4.0, TrunkPush { x: 150.0, y: -100.0 })] {
        episode.disturbance.pushes.push(Push::new(force, time_s, 0.2, None));
    }
    let mut simulation = Simulation::new(&with_solver(SolverParams::REFERENCE));
    simulation.start(0, episode);
    simulation.observe_started(&[true]);
    let (work, end_s) = metered(&mut simulation, 8.0);
    assert!(end_s == 8.0 && simulation.state.motion.hip_x[0] > 5.0, "it did not walk");
    let push = POWERS.iter().position(|&power| power == "push").unwrap();
    assert!(work.0.exchanged[push][0] > 50.0, "{}", work.0.exchanged[push][0]);
}

/// Energy balance of the 40 s trial, or as far as it is walked.
fn energy_balance(config: &Config) -> (Work, f64) {
    let (work, end_s) = metered(&mut simulation(config, Start::Standing, forty_second_trial()), 45.0);
    for dissipative in ["knee_friction", "contact_normal", "contact_tangential"] {
        assert!(work.of(dissipative) < 0.0, "{dissipative} {}", work.of(dissipative));
    }
    (work, end_s)
}

fn with_socket(config: Config) -> Config {
    Config { socket: SocketParams { connection: Connection::Compliant, ..SocketParams::default() }, ..config }
}

fn with_motor() -> Config {
    let device = DeviceParams { kind: DeviceKind::Motor };
    Config { device, ..with_solver(SolverParams::REFERENCE) }
}

#[test]
fn the_energy_balance_of_the_damper_closes_over_the_40_s_trial() {
    let (work, end_s) = energy_balance(&with_solver(SolverParams::REFERENCE));
    assert_eq!(end_s, 45.0, "it fell");
    assert!(work.of("knee_command") < 0.0 && work.of("socket") == 0.0 && work.of("tube") == 0.0);
}

#[test]
fn the_energy_balance_of_the_damper_with_a_socket_closes_over_the_40_s_trial() {
    let (work, end_s) = energy_balance(&with_socket(with_solver(SolverParams::REFERENCE)));
    assert_eq!(end_s, 45.0, "it fell");
    assert!(work.of("knee_command") < 0.0 && work.of("socket") < 0.0);
}

/// Without recovery transitions its state machine does not survive the step to 1.4 m/s.
#[test]
fn the_energy_balance_of_the_motor_closes_until_its_fall() {
    let (work, end_s) = energy_balance(&with_motor());
    assert!(end_s > 10.0 && work.of("socket") == 0.0);
}

#[test]
fn the_energy_balance_of_the_motor_with_a_socket_closes_until_its_fall() {
    let (work, end_s) = energy_balance(&with_socket(with_motor()));
    assert!(end_s > 10.0 && work.of("socket") < 0.0);
}

#[test]
fn the_energy_balance_closes_with_every_joint_and_contact_point_that_a_general_walker_can_have() {
    let mut config = with_socket(with_solver(SolverParams { stepper: Stepper::Rk4, steps: 100 }));
    config.mechanism.trunk = JointDrive::Forward;
    config.tube.connection = Connection::Compliant;
    (config.body.sole_points, config.body.sole_radius_m) = (5, 0.3);
    config.ground.slope_deg = -1.0;
    let (work, end_s) = energy_balance(&config);
    // So much compliance does not walk far.
    assert!(end_s > 4.0 && work.of("socket") < 0.0 && work.of("tube") < 0.0);
}

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
    let mut simulation =
        simulation(&with_solver(solver), Start::Standing, vec![knot(0.0, 1.1, false), knot(1.0, 1.1, true)]);
    while simulation.sample[0] < periods(20.0) as u64 {
        simulation.advance(&[simulation.state_machine_command[0]]);
    }
    // From one residual heel strike to the fifth after it.
    let next_strike = |simulation: &mut Simulation<1>, peaks: &mut [f64; 4]| {
        let strikes = simulation.plant.memory(0).heel_strikes;
        while simulation.plant.memory(0).heel_strikes == strikes {
            simulation.advance(&[simulation.state_machine_command[0]]);
            let (motion, memory) = (simulation.state.motion.get(0), simulation.plant.memory(0));
            let in_residual_stance = memory.intact == IntactState::Swing;
            let hip = &mut peaks[usize::from(!in_residual_stance)];
            *hip = hip.max(motion.hip_y);
            let early = simulation.state.rest.time[0] - memory.step_start < 0.3 * memory.cycle;
            let knee = &mut peaks[2 + usize::from(early)];
            *knee = knee.max((motion.thigh - motion.shank).to_degrees());
        }
        simulation.plant.memory(0).step_start
    };
    let begin = next_strike(&mut simulation, &mut [0.0; 4]);
    let (mut end, mut sums) = (begin, [0.0; 4]);
    for _ in 0..STRIDES {
        let mut peaks = [0.0; 4];
        end = next_strike(&mut simulation, &mut peaks);
        for (sum, peak) in sums.iter_mut().zip(peaks) {
            *sum += peak / f64::from(STRIDES);
        }
    }
    assert_eq!(simulation.plant.memory(0).residual, ResidualState::StepCycle);
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
    let mut reference = simulation(&with_solver(SolverParams::REFERENCE), Start::Cyclic, knots.clone());
    for _ in 0..periods(0.18) {
        reference.advance(&DAMPING);
    }
    let mut simulation = simulation(&with_solver(solver), Start::Cyclic, knots);
    simulation.plant = reference.plant;
    simulation.state = reference.state;
    simulation.sample = reference.sample;
    for _ in 0..periods(0.06) {
        simulation.advance(&DAMPING);
        assert!((0..2).all(|point| simulation.plant.contact(point, 0).tangential_damping > 0.0), "the foot slips");
        assert_eq!(simulation.plant.device(0).extension_stop, 0.0);
    }
    simulation.state.motion.get(0)
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

/// Everything that a lane carries. Shortest decimals that read back as the same number: equal text is equal bits.
fn fingerprint<const L: usize>(simulation: &Simulation<L>, lane: usize) -> String {
    let Simulation { plant, state, readings, state_machine, state_machine_command, .. } = simulation;
    let motion = (state.motion.get(lane), state.reference.get(lane), state.rest.get(lane));
    let signals = (readings.get(lane), state_machine[lane], state_machine_command[lane]);
    let forces = (plant.reactions(state, lane), plant.device(lane), plant.extension_stop_peak[lane]);
    format!("{motion:?}\n{signals:?}\n{forces:?}\n{:?}", plant.memory(lane))
}

/// A scenario of gusts, pushes at a gait phase and a human who does everything otherwise than the paper's.
fn restless() -> ScenarioParams {
    let mut scenario = ScenarioParams {
        speed_m_s: Span::Fixed(1.1),
        push_n: Span::Uniform([20.0, 60.0]),
        push_phase: Span::Uniform([0.0, 0.8]),
        ..ScenarioParams::default()
    };
    scenario.gust.force_n = Span::Uniform([-40.0, 40.0]);
    let human = &mut scenario.human;
    human.hip_lift_m = Span::Uniform([0.0, 0.02]);
    human.swing_flexion_deg = Span::Uniform([0.0, 15.0]);
    human.thigh_extension_change_deg = Span::Uniform([0.0, 3.0]);
    human.stance_asymmetry = Span::Uniform([0.0, 0.2]);
    human.step_delay_s = Span::Uniform([0.0, 0.03]);
    human.touch_down_delay_s = Span::Uniform([0.0, 0.03]);
    human.hip_stiffness_factor = Span::Uniform([0.8, 1.2]);
    human.pendulum_stiffness_factor = Span::Uniform([1.0, 1.4]);
    scenario
}

/// Eight different episodes, half of them restless, one of which ends in a fall.
fn episodes() -> [Episode; 8] {
    let scenarios = [ScenarioParams::default(), restless()];
    let mut episodes = std::array::from_fn(|lane| scenarios[lane % 2].draw(&mut Pcg64::new(1, lane as u128)));
    episodes[5].disturbance.pushes = vec![Push::new(TrunkPush { x: -900.0, y: 0.0 }, 0.5, 0.3, None)];
    episodes
}

fn assert_lanes_equal_scalar_runs(solver: SolverParams, duration_s: f64) {
    let config = with_solver(solver);
    let mut block = Simulation::<8>::new(&config);
    for (lane, episode) in episodes().into_iter().enumerate() {
        block.start(lane, episode);
    }
    block.observe_started(&[true; 8]);
    let mut alone = episodes().map(|episode| {
        let mut simulation = Simulation::<1>::new(&config);
        simulation.start(0, episode);
        simulation.observe_started(&[true]);
        simulation
    });
    let mut lowest = f64::INFINITY;
    for period in 0..periods(duration_s) {
        block.advance(&block.state_machine_command.clone());
        lowest = lowest.min(block.state.motion.hip_y[5]);
        for (lane, simulation) in alone.iter_mut().enumerate() {
            simulation.advance(&simulation.state_machine_command.clone());
            let time = period as f64 * CONTROL_PERIOD_S;
            assert_eq!(fingerprint(&block, lane), fingerprint(simulation, 0), "lane {lane} after {time:.3} s");
        }
    }
    println!("hips after {duration_s} s: {:.3?}", block.state.motion.hip_y);
    assert!(lowest < 0.6, "the push was to make it fall");
    assert!(block.plant.memory(0).heel_strikes + block.plant.memory(1).heel_strikes > 2);
}

#[test]
fn a_lane_of_a_block_is_the_scalar_simulation_bit_for_bit_with_the_fast_stepper() {
    assert_lanes_equal_scalar_runs(SolverParams::default(), 6.0);
}

#[test]
fn a_lane_of_a_block_is_the_scalar_simulation_bit_for_bit_with_the_reference_stepper() {
    assert_lanes_equal_scalar_runs(SolverParams::REFERENCE, 4.0);
}
