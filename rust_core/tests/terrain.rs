//! The walker on ground that is not level: balance of energy and forces, and walking.

use prosthesis_gym_core::closed_loop::energy_meter::EnergyMeter;
use prosthesis_gym_core::closed_loop::episode::Episode;
use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::human::intent::{Knot, Profile};
use prosthesis_gym_core::mechanics::compliant_ground::GroundParams;
use prosthesis_gym_core::mechanics::terrain::{self, Terrain};
use prosthesis_gym_core::plant::powers::Powers;
use prosthesis_gym_core::plant::solver::SolverParams;
use prosthesis_gym_core::plant::start::Start;
use prosthesis_gym_core::signals::{CONTROL_PERIOD_S, GRAVITY};
use prosthesis_gym_core::trial::Trial;

fn periods(seconds: f64) -> usize {
    (seconds / CONTROL_PERIOD_S).round() as usize
}

/// A walker that starts from standing and walks at 1.1 m/s from `walk_s` on.
fn standing(config: &Config, walk_s: f64) -> Trial<1> {
    let knot = |time_s: f64, walk: bool| Knot { time_s, speed_m_s: 1.1, walk };
    let profile = Profile { knots: vec![knot(0.0, false), knot(walk_s, true)] };
    Trial::new(config, [Episode::undisturbed(Start::Standing, profile)])
}

fn on(ground: GroundParams, solver: SolverParams) -> Config {
    Config { ground, solver, ..Config::default() }
}

fn slope(slope_deg: f64) -> GroundParams {
    GroundParams { slope_deg, ..GroundParams::default() }
}

/// 10 m long and on the average of the given slope, half as steep again in its middle.
fn ramp(slope_deg: f64) -> GroundParams {
    let step_height_m = 10.0 * slope_deg.to_radians().tan();
    GroundParams { step_height_m, step_x_m: 4.0, edge_m: 10.0, ..GroundParams::default() }
}

/// A little of everything, which the walker manages.
fn uneven() -> GroundParams {
    GroundParams {
        slope_deg: -1.0,
        step_height_m: -0.02,
        edge_m: 0.2,
        stair_rise_m: 0.01,
        stair_run_m: 1.5,
        stair_start_x_m: 5.0,
        roughness_m: 0.003,
        ..GroundParams::default()
    }
}

#[test]
fn the_energy_balance_closes_on_uneven_ground() {
    for ground in [slope(1.0), ramp(-2.0), uneven()] {
        let mut trial = standing(&on(ground.clone(), SolverParams::REFERENCE), 1.0);
        let mut meter = EnergyMeter::default();
        let energy = |trial: &Trial<1>| {
            let energy = trial.plant().energy(0);
            energy.kinetic + energy.potential
        };
        let start = energy(&trial);
        for _ in 0..periods(12.0) {
            trial.advance_metered(&mut meter);
        }
        assert!(trial.state.motion.hip_x[0] > 9.0, "it did not walk on {ground:?}");
        let gained = energy(&trial) - start;
        let work: f64 = meter.work.iter().map(|lanes| lanes[0]).sum();
        let exchanged: f64 = meter.exchanged.iter().map(|lanes| lanes[0]).sum();
        let imbalance = (gained - work).abs() / exchanged;
        println!("gained {gained:.3} J, work {work:.3} J, exchanged {exchanged:.0} J, imbalance {imbalance:.1e}");
        assert!(imbalance < 1e-6, "{imbalance:e}");
        for (power, work) in Powers::NAMES.iter().zip(&meter.work) {
            assert!(!power.starts_with("contact") || work[0] < 0.0, "{power} {}", work[0]);
        }
    }
}

/// The foot is mounted for the slope: an ankle bent by it would tip the walker, who does not balance.
///
/// The pendulum leg carries half the weight, vertically: ground forces on the prosthesis must carry the other half, also
/// vertically, and hence along the slope with the sine of its angle.
#[test]
fn ground_forces_balance_the_weight_of_a_walker_that_stands_on_a_slope() {
    for slope_deg in [-4.0_f64, 0.0, 4.0] {
        let mut config = on(slope(slope_deg), SolverParams::REFERENCE);
        config.body.foot_mount_deg += slope_deg;
        let mut trial = standing(&config, 1e3);
        for _ in 0..periods(10.0) {
            trial.advance_controlled();
        }
        let half_weight = 0.5 * trial.plant().body(0).mass * GRAVITY;
        let (sin, cos) = slope_deg.to_radians().sin_cos();
        let contacts = [0, 1].map(|point| trial.plant().contact(point, 0));
        let normal: f64 = contacts.iter().map(|contact| contact.normal).sum();
        let along: f64 = contacts.iter().map(|contact| contact.tangential).sum();
        println!("{slope_deg} deg: normal {normal:.2} N, along {along:.2} N");
        assert!((normal - half_weight * cos).abs() < 0.005 * half_weight, "{slope_deg}: {normal}");
        assert!((along - half_weight * sin).abs() < 0.005 * half_weight, "{slope_deg}: {along}");
        assert!((0.88..0.93).contains(&trial.plant().hip_height(0)));
    }
}

#[test]
fn small_slopes_and_uneven_ground_are_walked() {
    for ground in [slope(1.0), slope(-1.0), ramp(2.0), ramp(-2.0), uneven()] {
        let mut trial = standing(&on(ground.clone(), SolverParams::default()), 1.0);
        for _ in 0..periods(20.0) {
            trial.advance_controlled();
            assert!(trial.plant().hip_height(0) > 0.8, "{ground:?}");
        }
        let motion = trial.state.motion.get(0);
        let rise = terrain::surface(&Terrain::from(&ground), motion.hip_x).height;
        println!("{:.2} m far, {rise:.2} m high", motion.hip_x);
        assert!(motion.hip_x > 18.0, "{ground:?}: {}", motion.hip_x);
        assert!((motion.hip_y - rise - 0.9).abs() < 0.06, "{ground:?}");
    }
}
