//! Conservation laws of the limp mechanism in free fall, and what inertial sensors sense of it.

use prosthesis_gym_core::mechanics::chain::Chain;
use prosthesis_gym_core::mechanics::motion::Motion;
use prosthesis_gym_core::mechanics::walker_chain::walker_joints;
use prosthesis_gym_core::signals::GRAVITY;

use super::*;

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
fn in_free_fall(config: &Config) -> Trial<1> {
    let mut trial = trial(config, Start::Cyclic, vec![knot(0.0, 1.1, true)]);
    let mut state = trial.state.clone();
    let posture = state.motion.get(0);
    let motion = Motion { hip_y: 100.0, hip_vy: 3.0, thigh_rate: 4.0, shank_rate: -7.0, foot_rate: 12.0, ..posture };
    state.motion.set(0, motion);
    trial.set_state(state);
    trial
}

/// Angular momentum about the centre of mass and linear momentum, by the general chain.
fn momentum(config: &Config, trial: &Trial<1>) -> [f64; 3] {
    let chain = Chain::new(walker_joints(&config.body, None), [0.0, -GRAVITY]).unwrap();
    let (m, trunk) = (trial.state.motion.get(0), trial.plant().prescribed(0));
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
    let mut trial = in_free_fall(&config);
    let (start, [_, px, py]) = (energy(&trial), momentum(&config, &trial));
    let kinetic = trial.plant().energy(0).kinetic;
    let mass = trial.plant().body(0).mass;
    let mut largest = 0.0_f64;
    for period in 1..=periods(1.0) {
        trial.advance(&[0.0]);
        let drift = (energy(&trial) - start).abs() / kinetic;
        assert!(drift < 1e-9, "{drift:e}");
        largest = largest.max(drift);
        let [_, now_px, now_py] = momentum(&config, &trial);
        let fallen = mass * GRAVITY * period as f64 * CONTROL_PERIOD_S;
        assert!((now_px - px).abs() < 1e-9 * px.abs());
        assert!((now_py - (py - fallen)).abs() < 1e-9 * fallen.max(py.abs()));
    }
    let turned = (trial.state.motion.foot[0] - trial.state.motion.shank[0]).abs();
    assert!(turned > 3.0, "the leg hardly moved: {turned}");
    println!("largest drift of the energy in 1 s: {largest:.1e} of the kinetic energy");
}

/// With its centre of mass in the hip, a trunk that does not turn needs no torque to keep it so.
#[test]
fn the_limp_mechanism_conserves_angular_momentum_in_free_fall() {
    let mut config = limp();
    config.body.trunk_com_y_m = 0.0;
    let mut trial = in_free_fall(&config);
    let [start, ..] = momentum(&config, &trial);
    assert!(start.abs() > 1.0);
    for _ in 0..periods(1.0) {
        trial.advance(&[0.0]);
        let drift = (momentum(&config, &trial)[0] - start).abs() / start.abs();
        assert!(drift < 1e-9, "{drift:e}");
    }
}

/// Against second differences of the sensors' positions, two periods apart.
#[test]
fn inertial_sensors_sense_their_own_acceleration_and_rate() {
    let mut config = limp();
    (config.sensors.thigh_imu_m, config.sensors.shank_imu_m) = (0.2, 0.15);
    let mut trial = in_free_fall(&config);
    let samples: Vec<_> = (0..periods(0.3))
        .map(|_| {
            trial.advance(&[0.0]);
            let m = trial.state.motion.get(0);
            let below =
                |[x, y]: [f64; 2], angle: f64, length: f64| [x + length * angle.sin(), y - length * angle.cos()];
            let hip = [m.hip_x, m.hip_y];
            let thigh = below(hip, m.thigh, config.sensors.thigh_imu_m);
            let shank = below(below(hip, m.thigh, config.body.thigh_length_m), m.shank, config.sensors.shank_imu_m);
            let readings = trial.readings.get(0);
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
    let mut trial = trial(&Config::default(), Start::Standing, vec![knot(0.0, 1.1, false)]);
    for _ in 0..periods(20.0) {
        trial.advance(&[0.0]);
    }
    let (motion, readings) = (trial.state.motion.get(0), trial.readings.get(0));
    for (angle, forward, up) in [
        (motion.thigh, readings.thigh_force_x, readings.thigh_force_y),
        (motion.shank, readings.shank_force_x, readings.shank_force_y),
    ] {
        assert!((forward - GRAVITY * angle.sin()).abs() < 1e-2, "{forward}");
        assert!((up - GRAVITY * angle.cos()).abs() < 1e-2, "{up}");
    }
}
