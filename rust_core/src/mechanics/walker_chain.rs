//! The walker as a general chain.

use crate::mechanics::body::BodyParams;
use crate::mechanics::chain::Joint;
use crate::mechanics::chain::JointKind::{PrismaticX, PrismaticY, Revolute};

/// Index of the trunk's rotation.
pub const TRUNK: usize = 2;
/// Index of the hip.
pub const HIP: usize = 3;

/// The eight joints of Table 1: 0 px, 1 py (the hip), 2 trunk, 3 hip, 4 knee, 5 tube extension, 6 tube rotation, 7 ankle.
///
/// A `socket` at that share of the thigh's length comes before the knee as joints 4 (pistoning) and 5 (tilt); knee, tube
/// and ankle are then joints 6 to 9, and the thigh's mass stays above it (section 5.2.3).
pub fn walker_joints(p: &BodyParams, socket: Option<f64>) -> Vec<Joint> {
    let trunk = Joint {
        mass: p.trunk_mass_kg,
        com: [0.0, p.trunk_com_y_m],
        inertia: p.trunk_inertia_kg_m2,
        ..Joint::massless(Revolute)
    };
    let thigh = Joint {
        mass: p.thigh_mass_kg,
        com: [p.thigh_com_x_m, p.thigh_com_y_m],
        inertia: p.thigh_inertia_kg_m2,
        ..Joint::massless(Revolute)
    };
    let mut joints = vec![Joint::massless(PrismaticX), Joint::massless(PrismaticY), trunk, thigh];
    if let Some(place) = socket {
        let pistoning = Joint { offset: [0.0, -place * p.thigh_length_m], ..Joint::massless(PrismaticY) };
        joints.extend([pistoning, Joint::massless(Revolute)]);
    }
    let calf = Joint {
        offset: [0.0, -(1.0 - socket.unwrap_or(0.0)) * p.thigh_length_m],
        mass: p.calf_mass_kg,
        com: [p.calf_com_x_m, p.calf_com_y_m],
        inertia: p.calf_inertia_kg_m2,
        ..Joint::massless(Revolute)
    };
    let tube_extension = Joint { offset: [0.0, -p.calf_length_m], ..Joint::massless(PrismaticY) };
    let foot = Joint {
        offset: [0.0, -p.tube_length_m],
        angle: p.foot_mount_deg.to_radians(),
        mass: p.foot_mass_kg,
        com: [p.foot_com_x_m, p.foot_com_y_m],
        inertia: p.foot_inertia_kg_m2,
        ..Joint::massless(Revolute)
    };
    joints.extend([calf, tube_extension, Joint::massless(Revolute), foot]);
    joints
}
