//! Mechanisms that textbooks solve.

use super::*;

/// A point mass that hangs `length` below its joint.
fn bob(offset: [f64; 2], mass: f64, length: f64) -> Joint {
    Joint { offset, mass, com: [0.0, -length], ..Joint::massless(Revolute) }
}

#[test]
fn pendulum_follows_its_closed_form() {
    let (mass, length, inertia) = (3.0, 0.7, 0.2);
    let chain = Chain::new(vec![Joint { inertia, ..bob([0.4, -0.1], mass, length) }], DOWN).unwrap();
    for (angle, rate, torque) in [(0.3, 0.0, 0.0), (-2.0, 5.0, 3.0), (1.5, -1.0, -7.0)] {
        let (qdd, _) = hybrid(&chain, (&[angle], &[rate]), (&[0.0], &[torque]), &[true], &[]);
        let about_joint = inertia + mass * length * length;
        let expected = (torque - mass * GRAVITY * length * f64::sin(angle)) / about_joint;
        assert_close(&qdd, &[expected], 1e-14);
        assert_close(&[chain.kinetic_energy(&[angle], &[rate]).unwrap()], &[0.5 * about_joint * rate * rate], 1e-14);
        let height = -0.1 - length * angle.cos();
        assert_close(&[chain.potential_energy(&[angle]).unwrap()], &[mass * GRAVITY * height], 1e-14);
    }
}

#[test]
fn double_pendulum_follows_its_closed_form() {
    let (m1, m2, l1, l2) = (2.0, 1.5, 0.8, 0.5);
    let chain = Chain::new(vec![bob([0.0; 2], m1, l1), bob([0.0, -l1], m2, l2)], DOWN).unwrap();
    let mut random = Pcg64::new(2, 1);
    for _ in 0..100 {
        let (q, qd) = (vector(&mut random, 2, 3.0), vector(&mut random, 2, 5.0));
        let (s1, s2, s12, c2) = (q[0].sin(), q[1].sin(), (q[0] + q[1]).sin(), q[1].cos());
        let coupling = m2 * l1 * l2;
        let h12 = m2 * l2 * l2 + coupling * c2;
        let h11 = m1 * l1 * l1 + m2 * (l1 * l1 + l2 * l2) + 2.0 * coupling * c2;
        let c_1 = -coupling * s2 * (2.0 * qd[0] + qd[1]) * qd[1] + GRAVITY * ((m1 + m2) * l1 * s1 + m2 * l2 * s12);
        let c_2 = coupling * s2 * qd[0] * qd[0] + GRAVITY * m2 * l2 * s12;
        assert_close(&mass_matrix(&chain, &q), &[h11, h12, h12, m2 * l2 * l2], 1e-14);
        let mut bias = [0.0; 2];
        chain.bias(&mut Workspace::default(), &q, &qd, &mut bias).unwrap();
        assert_close(&bias, &[c_1, c_2], 1e-13);
    }
}

#[test]
fn cart_with_pendulum_follows_its_closed_form_also_where_the_cart_is_prescribed() {
    let (cart, mass, length) = (5.0, 1.2, 0.6);
    let joints = vec![Joint { mass: cart, ..Joint::massless(PrismaticX) }, bob([0.0; 2], mass, length)];
    let chain = Chain::new(joints, DOWN).unwrap();
    let (q, qd) = ([0.7, 0.9_f64], [1.3, -4.0_f64]);
    let (sine, cosine) = q[1].sin_cos();
    let centripetal = mass * length * qd[1] * qd[1] * sine;

    let force = 11.0;
    let (qdd, _) = hybrid(&chain, (&q, &qd), (&[0.0; 2], &[force, 0.0]), &[true, true], &[]);
    let x = (force + centripetal + mass * GRAVITY * sine * cosine) / (cart + mass * sine * sine);
    assert_close(&qdd, &[x, -(x * cosine + GRAVITY * sine) / length], 1e-14);

    let (qdd, tau) = hybrid(&chain, (&q, &qd), (&[2.5, 0.0], &[0.0, 0.4]), &[false, true], &[]);
    let angular = (0.4 / (mass * length) - 2.5 * cosine - GRAVITY * sine) / length;
    assert_close(&qdd, &[2.5, angular], 1e-14);
    assert_close(&tau, &[(cart + mass) * 2.5 + mass * length * cosine * angular - centripetal, 0.4], 1e-14);
}

#[test]
fn a_sledge_slides_down_its_slope() {
    let slope = Joint { angle: 0.3, offset: [1.0, 2.0], mass: 4.0, ..Joint::massless(PrismaticX) };
    let chain = Chain::new(vec![slope], DOWN).unwrap();
    let (qdd, _) = hybrid(&chain, (&[0.5], &[1.0]), (&[0.0], &[0.0]), &[true], &[]);
    assert_close(&qdd, &[-GRAVITY * 0.3_f64.sin()], 1e-15);
    let position = chain.point_position(&[0.5], 0, [0.0; 2]).unwrap();
    assert_close(&position, &[1.0 + 0.5 * 0.3_f64.cos(), 2.0 + 0.5 * 0.3_f64.sin()], 1e-15);
}
