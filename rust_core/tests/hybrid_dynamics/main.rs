//! The general chain against closed forms and its own invariants, and the walkers against the chain and each other.

mod closed_forms;
mod general_walker;
mod invariants;
mod table_1;
mod walker;

use prosthesis_gym_core::mechanics::body::BodyParams;
use prosthesis_gym_core::mechanics::chain::JointKind::{PrismaticX, PrismaticY, Revolute};
use prosthesis_gym_core::mechanics::chain::{Chain, ExternalForce, Joint, Workspace};
use prosthesis_gym_core::mechanics::walker_chain::walker_joints;
use prosthesis_gym_core::signals::GRAVITY;
use rand::RngExt;
use rand_pcg::Pcg64;
use table_1::joint_coordinates;

const DOWN: [f64; 2] = [0.0, -GRAVITY];

/// Numbers uniform in +-size.
fn uniform(random: &mut Pcg64, size: f64) -> f64 {
    random.random_range(-size..=size)
}

fn vector(random: &mut Pcg64, n: usize, size: f64) -> Vec<f64> {
    (0..n).map(|_| uniform(random, size)).collect()
}

fn force_on(random: &mut Pcg64, body: usize) -> ExternalForce {
    ExternalForce {
        body,
        point: [uniform(random, 0.3), uniform(random, 0.3)],
        force: [uniform(random, 500.0), uniform(random, 500.0)],
    }
}

/// Largest difference over the largest magnitude (at least 1) of the expected values.
fn relative_error(found: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(found.len(), expected.len());
    let scale = expected.iter().fold(1.0, |scale: f64, x| scale.max(x.abs()));
    found.iter().zip(expected).map(|(a, b)| (a - b).abs() / scale).fold(0.0, worse)
}

/// The larger error; unlike [`f64::max`] it keeps a NaN.
fn worse(a: f64, b: f64) -> f64 {
    if a >= b || a.is_nan() { a } else { b }
}

#[track_caller]
fn assert_close(found: &[f64], expected: &[f64], tolerance: f64) {
    let error = relative_error(found, expected);
    assert!(error <= tolerance, "{found:?}\n{expected:?}\nrelative error {error:e}");
}

fn inverse(chain: &Chain, q: &[f64], qd: &[f64], qdd: &[f64], external: &[ExternalForce]) -> Vec<f64> {
    let mut tau = vec![0.0; q.len()];
    chain.inverse_dynamics(&mut Workspace::default(), q, qd, qdd, external, &mut tau).unwrap();
    tau
}

/// Acceleration and force of every joint, from those that are given.
fn hybrid(
    chain: &Chain,
    (q, qd): (&[f64], &[f64]),
    (qdd, tau): (&[f64], &[f64]),
    forward: &[bool],
    external: &[ExternalForce],
) -> (Vec<f64>, Vec<f64>) {
    // What is to be found starts as NaN: it must not be read.
    let hide = |values: &[f64], hidden: bool| -> Vec<f64> {
        values.iter().zip(forward).map(|(&value, &f)| if f == hidden { f64::NAN } else { value }).collect()
    };
    let (mut qdd, mut tau) = (hide(qdd, true), hide(tau, false));
    chain.hybrid_dynamics(&mut Workspace::default(), q, qd, &mut qdd, &mut tau, forward, external).unwrap();
    (qdd, tau)
}

fn mass_matrix(chain: &Chain, q: &[f64]) -> Vec<f64> {
    let mut matrix = vec![0.0; q.len() * q.len()];
    chain.mass_matrix(&mut Workspace::default(), q, &mut matrix).unwrap();
    matrix
}

const TRUNK: usize = 2;
const CALF: usize = 4;
const FOOT: usize = 7;
/// Joints 1, 2, 4, 5 and 8 of the paper.
const FORWARD: [bool; 8] = [true, true, false, true, true, false, false, true];
