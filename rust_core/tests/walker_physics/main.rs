//! The walker as a mechanical system: conservation laws, energy balance, steppers against each other, independent lanes.

mod conservation;
mod energy;
mod lanes;
mod repetition;
mod steppers;
#[path = "../hybrid_dynamics/table_1.rs"]
mod table_1;

use prosthesis_gym_core::closed_loop::episode::Episode;
use prosthesis_gym_core::config::Config;
use prosthesis_gym_core::human::intent::{Knot, Profile};
use prosthesis_gym_core::plant::solver::SolverParams;
use prosthesis_gym_core::plant::start::Start;
use prosthesis_gym_core::prosthesis::socket::SocketParams;
use prosthesis_gym_core::prosthesis::spring_damper::Connection;
use prosthesis_gym_core::signals::CONTROL_PERIOD_S;
use prosthesis_gym_core::trial::Trial;

fn knot(time_s: f64, speed_m_s: f64, walk: bool) -> Knot {
    Knot { time_s, speed_m_s, walk }
}

/// One walker at the start of an undisturbed trial.
fn trial(config: &Config, start: Start, knots: Vec<Knot>) -> Trial<1> {
    Trial::new(config, [Episode::undisturbed(start, Profile { knots })])
}

fn with_solver(solver: SolverParams) -> Config {
    Config { solver, ..Config::default() }
}

fn periods(seconds: f64) -> usize {
    (seconds / CONTROL_PERIOD_S).round() as usize
}

fn with_socket(config: Config) -> Config {
    Config { socket: SocketParams { connection: Connection::Compliant, ..SocketParams::default() }, ..config }
}

/// Mechanical energy, J.
fn energy(trial: &Trial<1>) -> f64 {
    let energy = trial.plant().energy(0);
    energy.kinetic + energy.potential
}
