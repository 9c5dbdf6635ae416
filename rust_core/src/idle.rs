//! Which parameters change nothing for a leg as it is configured: those of a part that it does not have. To draw them anew for
//! every episode would only look as if it did.

use crate::config::Config;
use crate::feasibility::Span;
use crate::hybrid_dynamics::general_walker::JointDrive;
use crate::prosthesis_device::DeviceKind;
use crate::prosthesis_device::spring_damper::Connection;

/// Parameters of an impedance that pulls the hip to its reference.
const HIP_IMPEDANCE: &[&str] = &[
    "human.hip_stiffness_nm_rad",
    "human.hip_damping_nms_rad",
    "human.standing_hip_stiffness_nm_rad",
    "human.hip_limit_nm_kg",
    "human.standing_hip_limit_nm_kg",
];
/// Parameters of one that pulls the trunk to its reference.
const TRUNK_IMPEDANCE: &[&str] = &[
    "human.trunk_stiffness_nm_rad",
    "human.trunk_damping_nms_rad",
    "human.trunk_limit_nm_kg",
    "human.standing_trunk_stiffness_nm_rad",
    "human.standing_trunk_damping_nms_rad",
    "human.standing_trunk_limit_nm_kg",
];

/// Why the number at `key` changes nothing for any walker of the span; `None` if it may change something.
pub fn reason(walkers: &Span<'_>, key: &str) -> Option<&'static str> {
    let config = walkers.low;
    let unit = |kind: DeviceKind, missing: &'static str| (config.device.kind != kind).then_some(missing);
    let never = |number: fn(&Config) -> f64| number(walkers.low) == 0.0 && number(walkers.high) == 0.0;
    let (section, rest) = key.split_once('.')?;
    match section {
        "knee" => unit(DeviceKind::Damper, "device.kind is not damper"),
        "motor" => unit(DeviceKind::Motor, "device.kind is not motor"),
        "friction_knee" => unit(DeviceKind::Friction, "device.kind is not friction"),
        "sensors" if rest.starts_with("motor_position.") => {
            Some("neither controllers nor agents read the motor's position")
        }
        "sensors" if rest.starts_with("motor_") => unit(DeviceKind::Motor, "device.kind is not motor"),
        "socket" => (config.socket.connection == Connection::Rigid).then_some("socket.connection = rigid"),
        "tube" => (config.tube.connection == Connection::Rigid).then_some("tube.connection = rigid"),
        "human" if HIP_IMPEDANCE.contains(&key) => {
            (config.mechanism.hip == JointDrive::Inverse).then_some("mechanism.hip = inverse")
        }
        "human" if TRUNK_IMPEDANCE.contains(&key) => {
            (config.mechanism.trunk == JointDrive::Inverse).then_some("mechanism.trunk = inverse")
        }
        "body" if rest == "trunk_inertia_kg_m2" => {
            (config.mechanism.trunk == JointDrive::Inverse).then_some("mechanism.trunk = inverse")
        }
        "body" if rest == "sole_radius_m" => (config.body.sole_points == 2).then_some("body.sole_points = 2"),
        "ground" => {
            let no_step = never(|config| config.ground.step_height_m);
            let no_stairs = never(|config| config.ground.stair_rise_m);
            match rest {
                "step_x_m" => no_step.then_some("ground.step_height_m = 0"),
                "edge_m" => (no_step && no_stairs).then_some("there is neither a step nor a stair"),
                "stair_run_m" | "stair_start_x_m" | "stair_count" => no_stairs.then_some("ground.stair_rise_m = 0"),
                "roughness_length_m" | "roughness_seed" => {
                    never(|config| config.ground.roughness_m).then_some("ground.roughness_m = 0")
                }
                _ => None,
            }
        }
        _ => None,
    }
}
