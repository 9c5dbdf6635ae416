//! The general walker against the specialised one, and its own steps.

use prosthesis_gym_core::mechanics::body::Body;
use prosthesis_gym_core::mechanics::general_walker::{Deflection, GeneralWalker, Layout, WalkerWorkspace};
use prosthesis_gym_core::mechanics::motion::{Acceleration, JointTorque, Loads, Motion, PointForce, Prescribed};
use prosthesis_gym_core::mechanics::walker;

use super::walker::{random_body, random_loads, random_motion};
use super::*;

const USUAL: Layout = Layout { trunk_forward: false, hip_forward: true, socket: None, tube_forward: false };

/// The usual walker's loads on a general one.
fn load(general: &GeneralWalker, work: &mut WalkerWorkspace, trunk: &Prescribed, loads: &Loads, step: f64) {
    general.begin(work, trunk.acceleration, 0.0);
    general.drive_hip(work, &loads.hip, loads.hip_error_rate, step);
    general.drive_device(work, &loads.knee, &loads.ankle, step);
    general.push_trunk(work, loads.trunk_x, loads.trunk_y);
    let knee = PointForce { x: loads.knee_x, y: loads.knee_y, cos: 1.0, ..PointForce::default() };
    for (point, force) in [(0, &loads.heel), (1, &loads.ball), (2, &knee)] {
        general.push_point(work, point, force, step);
    }
    general.solve(work);
}

#[test]
fn with_the_usual_joints_the_general_walker_is_the_specialised_one_in_explicit_and_implicit_steps() {
    let mut random = Pcg64::new(11, 1);
    let mut worst = 0.0_f64;
    for case in 0..2000 {
        let params = random_body(&mut random);
        let (body, general) = (Body::from(&params), GeneralWalker::new(&params, &USUAL).unwrap());
        let (motion, mut trunk) = random_motion(&mut random);
        let loads = random_loads(&mut random);
        let step = if case % 2 == 0 { 0.0 } else { random.random_range(1e-5..=5e-3) };
        if step > 0.0 {
            // The specialised walker's implicit hip torque does not know the trunk's acceleration, the general one's does.
            trunk.acceleration = 0.0;
        }
        let kin = walker::kinematics(&body, &motion, trunk.angle);
        let expected = walker::acceleration::<false>(&body, &kin, &motion, &trunk, &loads, step);
        let mut work = WalkerWorkspace::default();
        general.assume(&mut work, &motion, &Deflection::default(), &Deflection::default(), &trunk);
        load(&general, &mut work, &trunk, &loads, step);
        let found = general.acceleration(&work);
        let list = |a: Acceleration| [a.hip_x, a.hip_y, a.thigh, a.shank, a.foot];
        assert_close(&list(found), &list(expected), 1e-10);
        worst = worst.max(relative_error(&list(found), &list(expected)));

        let heel = walker::foot_point(&motion, &kin, kin.heel_x, kin.heel_y);
        let point = general.point(&work, 0);
        assert_close(&[point.x, point.y, point.vx, point.vy], &[heel.x, heel.y, heel.vx, heel.vy], 1e-10);
        let energy = walker::energy(&body, &kin, &motion, &trunk);
        assert_close(&general.energy(&work), &[energy.kinetic, energy.potential], 1e-10);
        if step == 0.0 {
            let expected = walker::reactions(&body, &kin, &motion, &trunk, &loads, &expected);
            let forces = general.forces(&work);
            let (found, expected) = (
                [forces.trunk, forces.tube[0], forces.tube[1]],
                [expected.trunk_torque, expected.tube_force, expected.tube_torque],
            );
            assert_close(&found, &expected, 1e-10);
        }
    }
    println!("largest relative difference {worst:.1e}");
}

/// Hip and trunk driven by the torques that their prescribed motion takes move just as prescribed.
#[test]
fn forward_trunk_hip_and_tube_under_the_forces_of_inverse_ones_move_as_those_do() {
    let mut random = Pcg64::new(12, 1);
    let params = BodyParams::default();
    for place in [None, Some(0.5)] {
        let layout =
            |forward: bool| Layout { trunk_forward: forward, hip_forward: forward, socket: place, tube_forward: false };
        let (inverse, forward) =
            (GeneralWalker::new(&params, &layout(false)).unwrap(), GeneralWalker::new(&params, &layout(true)).unwrap());
        for _ in 0..500 {
            let (motion, trunk) = random_motion(&mut random);
            let loads = random_loads(&mut random);
            let mut to = |size: f64| uniform(&mut random, size);
            let deflection = Deflection {
                trunk: trunk.angle,
                socket_shift: to(0.02),
                socket_tilt: to(0.1),
                ..Deflection::default()
            };
            let rates = Deflection { trunk: trunk.rate, socket_shift: to(0.5), socket_tilt: to(2.0), ..deflection };
            let rates = Deflection { tube_shift: 0.0, tube_tilt: 0.0, ..rates };
            let hip_acceleration = to(50.0);
            let given = |general: &GeneralWalker, drives: [f64; 2]| {
                let mut work = WalkerWorkspace::default();
                general.assume(&mut work, &motion, &deflection, &rates, &trunk);
                general.begin(&mut work, trunk.acceleration, hip_acceleration);
                let [trunk, hip] = drives.map(|torque| JointTorque { torque, ..JointTorque::default() });
                general.drive_trunk(&mut work, &trunk, 0.0, 0.0);
                general.drive_hip(&mut work, &hip, 0.0, 0.0);
                general.drive_device(&mut work, &loads.knee, &loads.ankle, 0.0);
                general.drive_socket(&mut work, [(7e4, 4e3), (4e3, 500.0)], 0.0);
                general.push_trunk(&mut work, loads.trunk_x, loads.trunk_y);
                general.push_point(&mut work, 0, &loads.heel, 0.0);
                general.solve(&mut work);
                work
            };
            let prescribed = given(&inverse, [0.0; 2]);
            let forces = inverse.forces(&prescribed);
            let driven = given(&forward, [forces.trunk, forces.hip]);
            let list = |general: &GeneralWalker, work: &WalkerWorkspace| {
                let (a, d) = (general.acceleration(work), general.deflection_acceleration(work));
                [a.hip_x, a.hip_y, a.thigh, a.shank, a.foot, d.trunk, d.socket_shift, d.socket_tilt]
            };
            assert_close(&list(&forward, &driven), &list(&inverse, &prescribed), 1e-9);
        }
    }
}

/// Second differences of a sensor's position along an exact motion.
#[test]
fn specific_forces_are_accelerations_less_gravity_in_the_frame_of_the_segment() {
    let layout = Layout { socket: Some(0.5), trunk_forward: true, tube_forward: true, ..USUAL };
    let params = BodyParams::default();
    let general = GeneralWalker::new(&params, &layout).unwrap();
    let mut random = Pcg64::new(13, 1);
    for _ in 0..50 {
        let (motion, trunk) = random_motion(&mut random);
        let mut work = WalkerWorkspace::default();
        let deflection = Deflection { trunk: 0.1, socket_shift: 0.02, socket_tilt: 0.1, ..Deflection::default() };
        let rates = Deflection { trunk: 0.5, socket_shift: 0.3, socket_tilt: -2.0, ..Deflection::default() };
        general.assume(&mut work, &motion, &deflection, &rates, &trunk);
        general.begin(&mut work, 0.0, 0.0);
        general.push_trunk(&mut work, 100.0, 500.0);
        general.solve(&mut work);
        let (a, d) = (general.acceleration(&work), general.deflection_acceleration(&work));

        // The shank's sensor `t` seconds from now, from the geometry alone.
        let below = 0.15;
        let sensor = |t: f64| {
            let at = |x: f64, v: f64, a: f64| x + v * t + 0.5 * a * t * t;
            let thigh = at(motion.thigh, motion.thigh_rate, a.thigh);
            let shank = at(motion.shank, motion.shank_rate, a.shank);
            let lower = thigh + at(deflection.socket_tilt, rates.socket_tilt, d.socket_tilt);
            let shift = at(deflection.socket_shift, rates.socket_shift, d.socket_shift);
            let half = 0.5 * params.thigh_length_m;
            let down = |angle: f64, length: f64| [length * angle.sin(), -length * angle.cos()];
            let parts = [down(thigh, half - shift), down(lower, half), down(shank, below)];
            let hip = [at(motion.hip_x, motion.hip_vx, a.hip_x), at(motion.hip_y, motion.hip_vy, a.hip_y)];
            parts.iter().fold(hip, |sum, part| [sum[0] + part[0], sum[1] + part[1]])
        };
        let h = 1e-4;
        let (before, now, after) = (sensor(-h), sensor(0.0), sensor(h));
        let [ax, ay]: [f64; 2] = std::array::from_fn(|i| (after[i] - 2.0 * now[i] + before[i]) / (h * h));
        let (sin, cos) = motion.shank.sin_cos();
        let expected = [ax * cos + (ay + GRAVITY) * sin, -ax * sin + (ay + GRAVITY) * cos];
        let [_, found] = general.specific_forces(&work, 0.3, below);
        assert_close(&found, &expected, 1e-4);
    }
    // A motion that is not finite has accelerations that are not: it ends its own episode.
    let mut work = WalkerWorkspace::default();
    let broken = Motion { thigh: f64::NAN, ..Motion::default() };
    let (rest, trunk) = (Deflection::default(), Prescribed::default());
    general.assume(&mut work, &Motion::default(), &rest, &rest, &trunk);
    general.assume(&mut work, &broken, &rest, &rest, &trunk);
    general.begin(&mut work, 0.0, 0.0);
    general.solve(&mut work);
    assert!(general.acceleration(&work).thigh.is_nan() && general.point(&work, 0).x.is_nan());
}
