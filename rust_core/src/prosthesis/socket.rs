//! Socket between stump and prosthesis: pistoning and tilt of linear springs and dampers half-way down the thigh (section 5.2.3).

use crate::prosthesis::spring_damper::{Connection, SpringDamper};
use crate::schema::params::{ANY, above, params, within};
use crate::signals::GRAVITY;

params! {
    /// Socket (section 5.2.3). Its stiffness is stated by the deflection under a reference load: a socket half as stiff deflects
    /// twice as far.
    pub struct SocketParams {
        /// Whether stump and socket move against each other.
        connection: Connection = Connection::Rigid, "", ANY;
        /// Place of the socket's joints between hip (0) and knee (1).
        place: f64 = 0.5, "1", within(0.0, 1.0);
        /// Pistoning under one body weight, which sets k_5 = m g / d.
        pistoning_m: f64 = 0.01, "m", above(0.0, 1.0);
        /// Tilt under 0.5 N m per kg of body mass, which sets k_6 = 0.5 m / d.
        tilt_rad: f64 = 0.01, "rad", above(0.0, 1.0);
        /// Damping ratio of both joints. It refers to the body mass in pistoning, and in tilt to 0.25 kg m^2 of inertia per kg of body mass.
        damping_ratio: f64 = 1.0, "1", within(0.0, 10.0);
    }
}

/// Pistoning and tilt of the socket of a walker of `mass` kg.
pub fn socket(p: &SocketParams, mass: f64) -> [SpringDamper; 2] {
    const MOMENT_PER_MASS: f64 = 0.5;
    const INERTIA_PER_MASS: f64 = 0.25;
    [
        SpringDamper::with_ratio(mass * GRAVITY / p.pistoning_m, mass, p.damping_ratio),
        SpringDamper::with_ratio(MOMENT_PER_MASS * mass / p.tilt_rad, INERTIA_PER_MASS * mass, p.damping_ratio),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_socket_of_75_kg_has_the_constants_of_section_5_2_3_with_its_tilt_by_its_own_formula() {
        let [pistoning, tilt] = socket(&SocketParams::default(), 75.0);
        assert!((pistoning.stiffness - 74e3).abs() < 0.5e3 && (pistoning.damping - 4.7e3).abs() < 0.05e3);
        // The paper prints 4.7 kN m/rad; 0.5 m / 0.01 is 3.75, and its printed damping of 530 is close to this one's.
        assert!((tilt.stiffness - 3.75e3).abs() < 1e-9 && (tilt.damping - 530.0).abs() < 1.0);
    }
}
