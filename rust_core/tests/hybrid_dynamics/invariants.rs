//! What holds for every chain, whatever its joints, and what is refused.

use super::*;

/// Joints of every kind in random places, every body with mass.
fn random_chain(random: &mut Pcg64) -> Chain {
    let n = random.random_range(1..=9);
    let joint = |random: &mut Pcg64| Joint {
        kind: [PrismaticX, PrismaticY, Revolute][random.random_range(0..3)],
        offset: [uniform(random, 0.5), uniform(random, 0.5)],
        angle: uniform(random, 3.0),
        mass: random.random_range(0.5..=20.0),
        com: [uniform(random, 0.3), uniform(random, 0.3)],
        inertia: random.random_range(0.01..=2.0),
    };
    let joints = (0..n).map(|_| joint(random)).collect();
    Chain::new(joints, [uniform(random, 10.0), uniform(random, 10.0)]).unwrap()
}

#[test]
fn hybrid_after_inverse_dynamics_is_the_identity_for_every_split() {
    let mut random = Pcg64::new(3, 1);
    for _ in 0..2000 {
        let chain = random_chain(&mut random);
        let n = chain.joints().len();
        let (q, qd, qdd) = (vector(&mut random, n, 3.0), vector(&mut random, n, 3.0), vector(&mut random, n, 10.0));
        let external = [force_on(&mut random, n - 1), force_on(&mut random, n / 2)];
        let tau = inverse(&chain, &q, &qd, &qdd, &external);
        let forward: Vec<bool> = (0..n).map(|_| random.random()).collect();
        let (found_qdd, found_tau) = hybrid(&chain, (&q, &qd), (&qdd, &tau), &forward, &external);
        assert_close(&found_qdd, &qdd, 1e-9);
        assert_close(&found_tau, &tau, 1e-9);
    }
}

/// Section 5.2.3: two joints at mid-thigh, between massless bodies, all of them with forces of their own.
#[test]
fn the_ten_joint_socket_chain_of_massless_bodies_can_be_split() {
    let mut joints = walker_joints(&BodyParams::default(), None);
    joints[CALF].offset = [0.0, -0.21];
    let socket = Joint { offset: [0.0, -0.21], ..Joint::massless(PrismaticY) };
    joints.splice(CALF..CALF, [socket, Joint::massless(Revolute)]);
    let chain = Chain::new(joints, DOWN).unwrap();
    let forward = [true, true, false, true, true, true, true, false, false, true];
    let mut random = Pcg64::new(4, 1);
    for _ in 0..200 {
        let (q, qd, qdd) = (vector(&mut random, 10, 0.5), vector(&mut random, 10, 3.0), vector(&mut random, 10, 10.0));
        let external = [force_on(&mut random, 9)];
        let tau = inverse(&chain, &q, &qd, &qdd, &external);
        let (found_qdd, found_tau) = hybrid(&chain, (&q, &qd), (&qdd, &tau), &forward, &external);
        assert_close(&found_qdd, &qdd, 1e-9);
        assert_close(&found_tau, &tau, 1e-9);
    }
}

#[test]
fn mass_matrix_is_symmetric_positive_definite_and_gives_the_kinetic_energy() {
    let mut random = Pcg64::new(5, 1);
    for _ in 0..500 {
        let chain = random_chain(&mut random);
        let n = chain.joints().len();
        let q = vector(&mut random, n, 3.0);
        let matrix = mass_matrix(&chain, &q);
        for i in 0..n {
            for j in 0..n {
                assert_eq!(matrix[i * n + j], matrix[j * n + i]);
            }
        }
        for _ in 0..5 {
            let qd = vector(&mut random, n, 3.0);
            let form: f64 = (0..n * n).map(|k| 0.5 * qd[k / n] * matrix[k] * qd[k % n]).sum();
            assert!(form > 0.0);
            assert_close(&[form], &[chain.kinetic_energy(&q, &qd).unwrap()], 1e-12);
        }
        // Column i is what accelerates joint i alone, above the bias.
        let mut bias = vec![0.0; n];
        chain.bias(&mut Workspace::default(), &q, &vec![0.0; n], &mut bias).unwrap();
        for i in 0..n {
            let unit: Vec<f64> = (0..n).map(|j| f64::from(u8::from(i == j))).collect();
            let column: Vec<f64> = (0..n).map(|j| bias[j] + matrix[j * n + i]).collect();
            assert_close(&inverse(&chain, &q, &vec![0.0; n], &unit, &[]), &column, 1e-12);
        }
    }
}

#[test]
fn jacobian_gives_velocities_forces_and_the_change_of_positions() {
    let mut random = Pcg64::new(6, 1);
    for _ in 0..300 {
        let chain = random_chain(&mut random);
        let n = chain.joints().len();
        let (q, qd, qdd) = (vector(&mut random, n, 3.0), vector(&mut random, n, 3.0), vector(&mut random, n, 5.0));
        let body = random.random_range(0..n);
        let load = force_on(&mut random, body);
        let mut jacobian = vec![f64::NAN; 2 * n];
        chain.point_jacobian(&q, load.body, load.point, &mut jacobian).unwrap();
        let (row_x, row_y) = jacobian.split_at(n);

        let velocity = chain.point_velocity(&q, &qd, load.body, load.point).unwrap();
        let along = |row: &[f64]| row.iter().zip(&qd).map(|(j, v)| j * v).sum::<f64>();
        assert_close(&[along(row_x), along(row_y)], &velocity, 1e-13);

        let e = 1e-6;
        let at = |sign: f64| {
            let moved: Vec<f64> = q.iter().zip(&qd).map(|(q, v)| q + sign * e * v).collect();
            chain.point_position(&moved, load.body, load.point).unwrap()
        };
        let ([ax, ay], [bx, by]) = (at(-1.0), at(1.0));
        assert_close(&[(bx - ax) / (2.0 * e), (by - ay) / (2.0 * e)], &velocity, 1e-7);

        let (free, loaded) = (inverse(&chain, &q, &qd, &qdd, &[]), inverse(&chain, &q, &qd, &qdd, &[load]));
        let expected: Vec<f64> =
            (0..n).map(|i| free[i] - row_x[i] * load.force[0] - row_y[i] * load.force[1]).collect();
        assert_close(&loaded, &expected, 1e-12);
    }
}

#[test]
fn work_of_joints_and_forces_becomes_energy() {
    let mut random = Pcg64::new(7, 1);
    for _ in 0..300 {
        let chain = random_chain(&mut random);
        let n = chain.joints().len();
        let (q, qd, qdd) = (vector(&mut random, n, 3.0), vector(&mut random, n, 3.0), vector(&mut random, n, 5.0));
        let load = force_on(&mut random, n - 1);
        let tau = inverse(&chain, &q, &qd, &qdd, &[load]);
        let velocity = chain.point_velocity(&q, &qd, load.body, load.point).unwrap();
        let power = tau.iter().zip(&qd).map(|(t, v)| t * v).sum::<f64>()
            + load.force[0] * velocity[0]
            + load.force[1] * velocity[1];
        let e = 1e-5;
        let energy = |t: f64| {
            let moved: Vec<f64> = (0..n).map(|i| q[i] + t * qd[i] + 0.5 * t * t * qdd[i]).collect();
            let rates: Vec<f64> = (0..n).map(|i| qd[i] + t * qdd[i]).collect();
            chain.kinetic_energy(&moved, &rates).unwrap() + chain.potential_energy(&moved).unwrap()
        };
        let rate = (energy(e) - energy(-e)) / (2.0 * e);
        assert!((rate - power).abs() < 1e-6 * (1.0 + energy(0.0).abs() + power.abs()), "{rate} {power}");
    }
}

#[test]
fn a_split_that_leaves_massless_motion_free_is_an_error_that_names_its_joints() {
    let refusal = |change: fn(&mut Joint), forward: [bool; 8]| {
        let mut joints = walker_joints(&BodyParams::default(), None);
        change(&mut joints[FOOT]);
        let chain = Chain::new(joints, DOWN).unwrap();
        let (mut qdd, mut tau) = ([1.0; 8], [2.0; 8]);
        let result =
            chain.hybrid_dynamics(&mut Workspace::default(), &[0.1; 8], &[0.2; 8], &mut qdd, &mut tau, &forward, &[]);
        assert_eq!((qdd, tau), ([1.0; 8], [2.0; 8]), "an error must leave the arguments alone");
        result.unwrap_err().to_string()
    };
    let message = refusal(|foot| (foot.mass, foot.inertia) = (0.0, 0.0), FORWARD);
    assert!(message.contains("forward: joints[7] (Revolute) can accelerate"), "{message}");
    // Tube rotation and ankle on one axis turn against each other without turning the foot.
    let message = refusal(|foot| foot.offset = [0.0; 2], [true; 8]);
    assert!(message.contains("forward: joints[6] (Revolute) with joints[7] (Revolute) can"), "{message}");
}

#[test]
fn impossible_chains_and_arguments_are_errors_that_name_the_value() {
    let message = |result: Result<Chain, _>| {
        result.map_err(|error: prosthesis_gym_core::schema::error::Error| error.to_string()).unwrap_err()
    };
    assert!(message(Chain::new(vec![], DOWN)).contains("at least one"));
    let heavy = |mass: f64| Chain::new(vec![Joint { mass, ..Joint::massless(Revolute) }], DOWN);
    assert!(message(heavy(-1.0)).contains("joints[0].mass = -1"));
    assert!(message(heavy(f64::NAN)).contains("joints[0].mass = NaN"));
    assert!(message(Chain::new(vec![Joint::massless(Revolute)], [0.0, f64::INFINITY])).contains("gravity[1] = inf"));

    let chain = heavy(1.0).unwrap();
    let error = chain.point_position(&[0.0, 0.0], 0, [0.0; 2]).unwrap_err().to_string();
    assert!(error.contains("q has 2 values"), "{error}");
    let error = chain.kinetic_energy(&[0.0], &[f64::NAN]).unwrap_err().to_string();
    assert!(error.contains("qd[0] = NaN"), "{error}");
    let error = chain.point_velocity(&[0.0], &[0.0], 1, [0.0; 2]).unwrap_err().to_string();
    assert!(error.contains("body = 1") && error.contains("[0, 0]"), "{error}");
}
