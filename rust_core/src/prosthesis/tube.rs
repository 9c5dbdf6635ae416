//! Tube of the prosthesis with its force and moment sensor: rigid, or with the tube's own stiffness (footnote 1 of section 3.1).

use crate::prosthesis::spring_damper::{Connection, SpringDamper};
use crate::schema::params::{ANY, above, params, within};

params! {
    /// Joints 6 and 7 of the tube sensor (section 3.1).
    pub struct TubeParams {
        /// Whether the tube gives way at its sensor; if rigid, its force and moment come from inverse dynamics.
        connection: Connection = Connection::Rigid, "", ANY;
        /// Stiffness along the tube. A softer one stands for foot and liner; that of an aluminium tube is tens of MN/m.
        stiffness_n_m: f64 = 1e6, "N/m", above(0.0, 1e9);
        /// Stiffness against bending.
        bending_stiffness_nm_rad: f64 = 1e4, "N m/rad", above(0.0, 1e8);
        /// Damping ratio of the foot's oscillation on either.
        damping_ratio: f64 = 0.5, "1", within(0.0, 10.0);
    }
}

/// Extension and bending of a tube that carries a foot of the given mass (kg) and inertia about the sensor (kg m^2).
pub fn tube(p: &TubeParams, foot_mass: f64, foot_inertia: f64) -> [SpringDamper; 2] {
    [
        SpringDamper::with_ratio(p.stiffness_n_m, foot_mass, p.damping_ratio),
        SpringDamper::with_ratio(p.bending_stiffness_nm_rad, foot_inertia, p.damping_ratio),
    ]
}
