//! The walker's five equations in segment angles against the eight joints of Table 1.

use prosthesis_gym_core::mechanics::body::Body;
use prosthesis_gym_core::mechanics::motion::{Acceleration, JointTorque, Loads, Motion, Point, PointForce, Prescribed};
use prosthesis_gym_core::mechanics::walker;

use super::*;

/// Table 1 with every entry changed by up to a fifth, and with the offsets that are zero there.
pub fn random_body(random: &mut Pcg64) -> BodyParams {
    let p = BodyParams::default();
    let mut about = |value: f64| value * random.random_range(0.8..=1.2);
    BodyParams {
        trunk_mass_kg: about(p.trunk_mass_kg),
        trunk_inertia_kg_m2: about(p.trunk_inertia_kg_m2),
        trunk_com_y_m: about(p.trunk_com_y_m),
        trunk_top_m: about(p.trunk_top_m),
        thigh_mass_kg: about(p.thigh_mass_kg),
        thigh_inertia_kg_m2: about(p.thigh_inertia_kg_m2),
        thigh_com_x_m: about(0.02),
        thigh_com_y_m: about(p.thigh_com_y_m),
        thigh_length_m: about(p.thigh_length_m),
        calf_mass_kg: about(p.calf_mass_kg),
        calf_inertia_kg_m2: about(p.calf_inertia_kg_m2),
        calf_com_x_m: about(p.calf_com_x_m),
        calf_com_y_m: about(p.calf_com_y_m),
        calf_length_m: about(p.calf_length_m),
        tube_length_m: about(p.tube_length_m),
        foot_mass_kg: about(p.foot_mass_kg),
        foot_inertia_kg_m2: about(p.foot_inertia_kg_m2),
        foot_com_x_m: about(p.foot_com_x_m),
        foot_com_y_m: about(p.foot_com_y_m),
        foot_height_m: about(p.foot_height_m),
        heel_x_m: about(p.heel_x_m),
        ball_x_m: about(p.ball_x_m),
        foot_mount_deg: about(p.foot_mount_deg),
        sole_points: p.sole_points,
        sole_radius_m: p.sole_radius_m,
    }
}

/// Loads in every field that an explicit step reads; derivatives as well, which must then not matter.
pub fn random_loads(random: &mut Pcg64) -> Loads {
    let mut to = |size: f64| uniform(random, size);
    let torque = |to: &mut dyn FnMut(f64) -> f64| JointTorque {
        torque: to(150.0),
        damping: to(100.0).abs(),
        stiffness: to(2000.0).abs(),
    };
    let force = |to: &mut dyn FnMut(f64) -> f64| {
        let (sin, cos) = to(1.0).sin_cos();
        PointForce {
            x: to(400.0),
            y: to(1000.0),
            damping_x: to(3000.0).abs(),
            damping_y: to(3000.0).abs(),
            stiffness_x: to(3e4).abs(),
            stiffness_y: to(3e4).abs(),
            sin,
            cos,
        }
    };
    Loads {
        trunk_x: to(500.0),
        trunk_y: to(1000.0),
        knee_x: to(200.0),
        knee_y: to(500.0),
        hip: torque(&mut to),
        hip_error_rate: to(3.0),
        knee: torque(&mut to),
        ankle: torque(&mut to),
        heel: force(&mut to),
        ball: force(&mut to),
    }
}

pub fn random_motion(random: &mut Pcg64) -> (Motion, Prescribed) {
    let mut to = |size: f64| uniform(random, size);
    let motion = Motion {
        hip_x: to(60.0),
        hip_y: 0.9 + to(0.3),
        thigh: to(2.0),
        shank: to(2.0),
        foot: to(2.0),
        hip_vx: to(3.0),
        hip_vy: to(2.0),
        thigh_rate: to(8.0),
        shank_rate: to(12.0),
        foot_rate: to(15.0),
    };
    let trunk = Prescribed { angle: to(1.0), rate: to(2.0), acceleration: to(20.0) };
    (motion, trunk)
}

#[test]
fn the_specialised_walker_is_the_general_chain_of_table_1() {
    let mut random = Pcg64::new(8, 1);
    let mut worst = 0.0_f64;
    for case in 0..4000 {
        let params = if case % 2 == 0 { BodyParams::default() } else { random_body(&mut random) };
        let chain = Chain::new(walker_joints(&params, None), DOWN).unwrap();
        let body = Body::from(&params);

        let (motion, trunk) = random_motion(&mut random);
        let loads = random_loads(&mut random);

        let kin = walker::kinematics(&body, &motion, trunk.angle);
        let acceleration = walker::acceleration::<false>(&body, &kin, &motion, &trunk, &loads, 0.0);
        let reactions = walker::reactions(&body, &kin, &motion, &trunk, &loads, &acceleration);
        let energy = walker::energy(&body, &kin, &motion, &trunk);

        let angles = [motion.thigh, motion.shank, motion.foot];
        let rates = [motion.thigh_rate, motion.shank_rate, motion.foot_rate];
        let q =
            joint_coordinates([motion.hip_x, motion.hip_y], trunk.angle, angles, params.foot_mount_deg.to_radians());
        let qd = joint_coordinates([motion.hip_vx, motion.hip_vy], trunk.rate, rates, 0.0);
        let qdd = [0.0, 0.0, trunk.acceleration, 0.0, 0.0, 0.0, 0.0, 0.0];
        let tau = [0.0, 0.0, 0.0, loads.hip.torque, loads.knee.torque, 0.0, 0.0, loads.ankle.torque];
        let heel = [params.heel_x_m, -params.foot_height_m];
        let ball = [params.ball_x_m, -params.foot_height_m];
        let external = [
            ExternalForce { body: TRUNK, point: [0.0; 2], force: [loads.trunk_x, loads.trunk_y] },
            ExternalForce { body: CALF, point: [0.0; 2], force: [loads.knee_x, loads.knee_y] },
            ExternalForce { body: FOOT, point: heel, force: [loads.heel.x, loads.heel.y] },
            ExternalForce { body: FOOT, point: ball, force: [loads.ball.x, loads.ball.y] },
        ];
        let (qdd, tau) = hybrid(&chain, (&q, &qd), (&qdd, &tau), &FORWARD, &external);

        let mut compare = |found: &[f64], expected: &[f64]| {
            assert_close(found, expected, 1e-10);
            worst = worst.max(relative_error(found, expected));
        };
        let segments = [acceleration.thigh, acceleration.shank, acceleration.foot];
        let hip = [acceleration.hip_x, acceleration.hip_y];
        compare(&joint_coordinates(hip, trunk.acceleration, segments, 0.0), &qdd);
        compare(&[reactions.trunk_torque, reactions.tube_force, reactions.tube_torque], &[tau[2], tau[5], tau[6]]);
        let chain_energy = [chain.kinetic_energy(&q, &qd).unwrap(), chain.potential_energy(&q).unwrap()];
        compare(&[energy.kinetic, energy.potential], &chain_energy);

        for (point, arm) in [(heel, (kin.heel_x, kin.heel_y)), (ball, (kin.ball_x, kin.ball_y))] {
            let found = walker::foot_point(&motion, &kin, arm.0, arm.1);
            let ([x, y], [vx, vy]) =
                (chain.point_position(&q, FOOT, point).unwrap(), chain.point_velocity(&q, &qd, FOOT, point).unwrap());
            compare(&[found.x, found.y, found.vx, found.vy], &[x, y, vx, vy]);
        }
        let found = walker::knee_point(&motion, &kin);
        let ([x, y], [vx, vy]) =
            (chain.point_position(&q, CALF, [0.0; 2]).unwrap(), chain.point_velocity(&q, &qd, CALF, [0.0; 2]).unwrap());
        compare(&[found.x, found.y, found.vx, found.vy], &[x, y, vx, vy]);
    }
    println!("largest relative difference {worst:.1e}");
}

/// `acceleration` with a step solves `M a = f` for the loads at the step's end: torques and forces less damping times
/// `h a` and stiffness times `h (v + h a)`, v and a the relative motion of the joint or that of the point along and across
/// its surface.
#[test]
fn an_implicit_step_is_the_explicit_dynamics_under_the_loads_that_it_ends_with() {
    let mut random = Pcg64::new(9, 1);
    for _ in 0..2000 {
        let body = Body::from(&random_body(&mut random));
        let (motion, trunk) = random_motion(&mut random);
        let loads = random_loads(&mut random);
        let step = random.random_range(1e-5..=5e-3);
        let kin = walker::kinematics(&body, &motion, trunk.angle);
        let a = walker::acceleration::<false>(&body, &kin, &motion, &trunk, &loads, step);

        let end = |damping: f64, stiffness: f64, v: f64, a: f64| step * (damping * a + stiffness * (v + step * a));
        let joint = |load: JointTorque, v: f64, a: f64| JointTorque {
            torque: load.torque - end(load.damping, load.stiffness, v, a),
            ..load
        };
        // The rates of a motion whose rates are accelerations: a point's acceleration without its centripetal part.
        let accelerating = Motion {
            hip_vx: a.hip_x,
            hip_vy: a.hip_y,
            thigh_rate: a.thigh,
            shank_rate: a.shank,
            foot_rate: a.foot,
            ..motion
        };
        let point = |load: PointForce, x: f64, y: f64| {
            let v = walker::foot_point(&motion, &kin, x, y);
            let a = walker::foot_point(&accelerating, &kin, x, y);
            let along = |p: &Point| load.cos * p.vx + load.sin * p.vy;
            let across = |p: &Point| load.cos * p.vy - load.sin * p.vx;
            let less_along = end(load.damping_x, load.stiffness_x, along(&v), along(&a));
            let less_across = end(load.damping_y, load.stiffness_y, across(&v), across(&a));
            PointForce {
                x: load.x - (load.cos * less_along - load.sin * less_across),
                y: load.y - (load.sin * less_along + load.cos * less_across),
                ..load
            }
        };
        let at_end = Loads {
            hip: joint(loads.hip, loads.hip_error_rate, a.thigh),
            knee: joint(loads.knee, motion.shank_rate - motion.thigh_rate, a.shank - a.thigh),
            ankle: joint(loads.ankle, motion.foot_rate - motion.shank_rate, a.foot - a.shank),
            heel: point(loads.heel, kin.heel_x, kin.heel_y),
            ball: point(loads.ball, kin.ball_x, kin.ball_y),
            ..loads
        };
        let explicit = walker::acceleration::<false>(&body, &kin, &motion, &trunk, &at_end, 0.0);
        let list = |a: Acceleration| [a.hip_x, a.hip_y, a.thigh, a.shank, a.foot];
        assert_close(&list(a), &list(explicit), 1e-10);
    }
}

#[test]
fn on_level_surfaces_the_short_cut_for_level_ground_changes_nothing() {
    let mut random = Pcg64::new(10, 1);
    for _ in 0..500 {
        let body = Body::from(&BodyParams::default());
        let (motion, trunk) = random_motion(&mut random);
        let mut loads = random_loads(&mut random);
        for point in [&mut loads.heel, &mut loads.ball] {
            (point.sin, point.cos) = (0.0, 1.0);
        }
        let kin = walker::kinematics(&body, &motion, trunk.angle);
        let level = walker::acceleration::<true>(&body, &kin, &motion, &trunk, &loads, 1e-3);
        assert_eq!(level, walker::acceleration::<false>(&body, &kin, &motion, &trunk, &loads, 1e-3));
    }
}
