//! Energy of the whole system changes by the work of all forces.

use prosthesis_gym_core::closed_loop::disturbance::{Push, TrunkPush};
use prosthesis_gym_core::closed_loop::energy_meter::EnergyMeter;
use prosthesis_gym_core::episode::scenario::StartChoice;
use prosthesis_gym_core::mechanics::joint_drives::JointDrive;
use prosthesis_gym_core::numerics::integrator::Stepper;
use prosthesis_gym_core::plant::powers::Powers;
use prosthesis_gym_core::prosthesis::knee::kind::{DeviceKind, DeviceParams};
use rand_pcg::Pcg64;

use super::lanes::restless;
use super::*;

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

/// Work of each of the [`Powers`] by name, J.
struct Work(EnergyMeter<1>);

impl Work {
    fn of(&self, name: &str) -> f64 {
        self.0.work[Powers::NAMES.iter().position(|&power| power == name).unwrap()][0]
    }
}

/// Walks on, at most until a fall; asserts that the energy of the system changes by the work of all forces.
/// Returns that work, and the time that it took.
fn metered(trial: &mut Trial<1>, duration_s: f64) -> (Work, f64) {
    let mut meter = EnergyMeter::default();
    let start = energy(trial);
    let mut end_s = 0.0;
    for period in 1..=periods(duration_s) {
        trial.advance_metered(&mut meter);
        end_s = period as f64 * CONTROL_PERIOD_S;
        if trial.state.motion.hip_y[0] < 0.6 {
            break;
        }
    }
    let gained = energy(trial) - start;
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
    let mut episode = scenario.draw(&mut Pcg64::new(1, 1), 1.0, |_| None);
    // Two pushes that the drawn one would not do: upward, and strong.
    for (time_s, force) in [(1.0, TrunkPush { x: 0.0, y: 150.0 }), (4.0, TrunkPush { x: 150.0, y: -100.0 })] {
        episode.disturbance.pushes.push(Push::new(force, time_s, 0.2, None));
    }
    let mut trial = Trial::new(&with_solver(SolverParams::REFERENCE), [episode]);
    let (work, end_s) = metered(&mut trial, 8.0);
    assert!(end_s == 8.0 && trial.state.motion.hip_x[0] > 5.0, "it did not walk");
    let push = Powers::NAMES.iter().position(|&power| power == "push").unwrap();
    assert!(work.0.exchanged[push][0] > 50.0, "{}", work.0.exchanged[push][0]);
}

/// Energy balance of the 40 s trial, or as far as it is walked.
fn energy_balance(config: &Config) -> (Work, f64) {
    let (work, end_s) = metered(&mut trial(config, Start::Standing, forty_second_trial()), 45.0);
    for dissipative in ["knee_friction", "contact_normal", "contact_tangential"] {
        assert!(work.of(dissipative) < 0.0, "{dissipative} {}", work.of(dissipative));
    }
    (work, end_s)
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
