//! The walker as a general chain.

use super::body::BodyParams;
use super::chain::Joint;
use super::chain::JointKind::{PrismaticX, PrismaticY, Revolute};

/// The eight joints of Table 1: 0 px, 1 py (the hip), 2 trunk, 3 hip, 4 knee, 5 tube extension, 6 tube rotation, 7 ankle.
pub fn walker_joints(p: &BodyParams) -> Vec<Joint> {
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
    let calf = Joint {
        offset: [0.0, -p.thigh_length_m],
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
    vec![
        Joint::massless(PrismaticX),
        Joint::massless(PrismaticY),
        trunk,
        thigh,
        calf,
        tube_extension,
        Joint::massless(Revolute),
        foot,
    ]
}
