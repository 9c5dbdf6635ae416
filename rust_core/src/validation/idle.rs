//! Which settings change nothing for a leg as it is configured: those of a part that it does not have, of a push that never
//! comes, of a sensor that nobody reads. To set them, or to draw them anew for every episode, would only look as if it did.

use crate::agent::action::{ActionMode, Latch};
use crate::agent::observation::Group;
use crate::config::Config;
use crate::episode::scenario::StartChoice;
use crate::mechanics::joint_drives::JointDrive;
use crate::prosthesis::knee::kind::DeviceKind;
use crate::prosthesis::spring_damper::Connection;
use crate::schema::distribution::Distribution;
use crate::validation::span::Span;

/// Why a setting changes nothing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Idle {
    /// What it needs, such as `socket.connection = 'compliant'`.
    pub needs: &'static str,
    /// The key that turns it on and off, beside which it may stand unread: the baseline of a sweep.
    pub switch: Option<&'static str>,
}

/// When some settings are read.
struct Use {
    /// Dotted keys, or sections of them.
    keys: &'static [&'static str],
    idle: Idle,
    /// Whether they may change any walker of a span.
    read: fn(&Span<'_>) -> bool,
}

const fn read_if(keys: &'static [&'static str], needs: &'static str, read: fn(&Span<'_>) -> bool) -> Use {
    Use { keys, idle: Idle { needs, switch: None }, read }
}

impl Use {
    const fn beside(mut self, switch: &'static str) -> Self {
        self.idle.switch = Some(switch);
        self
    }
}

/// Parts of the leg, of its world, and of what happens there.
const PARTS: &[Use] = &[
    // Knee units, their controllers and commands.
    read_if(
        &[
            "knee",
            "state_machine",
            "action.max_command_nms2_rad2",
            "action.residual_nms2_rad2",
            "action.constant_nms2_rad2",
        ],
        "device.kind = 'damper'",
        |walkers| walkers.has(DeviceKind::Damper),
    ),
    read_if(
        &[
            "motor",
            "motor_state_machine",
            "action.residual_a",
            "action.constant_a",
            "action.max_stiffness_nm_rad",
            "action.max_damping_nms_rad",
            "action.max_rest_angle_deg",
            "sensors.motor_position",
            "sensors.motor_speed",
            "sensors.motor_current",
            "reward.electricity",
        ],
        "device.kind = 'motor'",
        |walkers| walkers.has(DeviceKind::Motor),
    ),
    read_if(&["friction_knee", "action.residual_nm", "action.constant_nm"], "device.kind = 'friction'", |walkers| {
        walkers.has(DeviceKind::Friction)
    }),
    read_if(
        &["action.residual_nms2_rad2", "action.residual_a", "action.residual_nm"],
        "action.mode = 'residual'",
        |walkers| walkers.act_by(&[ActionMode::Residual]),
    ),
    read_if(
        &["action.constant_nms2_rad2", "action.constant_a", "action.constant_nm"],
        "action.mode = 'constant'",
        |walkers| walkers.act_by(&[ActionMode::Constant]),
    ),
    read_if(
        &["action.max_stiffness_nm_rad", "action.max_damping_nms_rad", "action.max_rest_angle_deg"],
        "action.mode = 'impedance'",
        |walkers| walkers.act_by(&[ActionMode::Impedance]),
    ),
    read_if(&["action.latch"], "action.mode = 'direct' or 'residual' or 'impedance'", |walkers| {
        walkers.act_by(&[ActionMode::Direct, ActionMode::Residual, ActionMode::Impedance])
    }),
    read_if(&["action.latch"], "a knee whose state machine tells the phases of the gait apart", |walkers| {
        walkers.low.action.latch == Latch::Step || !walkers.has(DeviceKind::Friction)
    }),
    read_if(&["sensors.motor_position"], "a controller that reads the motor's position, which none does", |_| false),
    // Joints and segments.
    read_if(
        &["socket.place", "socket.pistoning_m", "socket.tilt_rad", "socket.damping_ratio"],
        "socket.connection = 'compliant'",
        |walkers| walkers.low.socket.connection == Connection::Compliant,
    ),
    read_if(
        &["tube.stiffness_n_m", "tube.bending_stiffness_nm_rad", "tube.damping_ratio"],
        "tube.connection = 'compliant'",
        |walkers| walkers.low.tube.connection == Connection::Compliant,
    ),
    read_if(
        &[
            "body.trunk_inertia_kg_m2",
            "human.trunk_stiffness_nm_rad",
            "human.trunk_damping_nms_rad",
            "human.trunk_limit_nm_kg",
            "human.standing_trunk_stiffness_nm_rad",
            "human.standing_trunk_damping_nms_rad",
            "human.standing_trunk_limit_nm_kg",
        ],
        "mechanism.trunk = 'forward'",
        |walkers| walkers.low.mechanism.trunk == JointDrive::Forward,
    ),
    read_if(
        &[
            "human.hip_stiffness_nm_rad",
            "human.hip_damping_nms_rad",
            "human.hip_limit_nm_kg",
            "human.standing_hip_stiffness_nm_rad",
            "human.standing_hip_limit_nm_kg",
            "scenario.human.hip_stiffness_factor",
            "scenario.human.hip_damping_factor",
            "scenario.human.hip_limit_factor",
        ],
        "mechanism.hip = 'forward'",
        |walkers| walkers.low.mechanism.hip == JointDrive::Forward,
    ),
    read_if(&["body.sole_radius_m"], "body.sole_points of more than 2", |walkers| walkers.low.body.sole_points > 2),
    // Ground.
    read_if(&["ground.step_x_m"], "ground.step_height_m other than 0", |walkers| {
        walkers.ever(|config| config.ground.step_height_m)
    })
    .beside("ground.step_height_m"),
    read_if(
        &["ground.stair_run_m", "ground.stair_start_x_m", "ground.stair_count"],
        "ground.stair_rise_m other than 0",
        |walkers| walkers.ever(|config| config.ground.stair_rise_m),
    )
    .beside("ground.stair_rise_m"),
    read_if(&["ground.roughness_length_m", "ground.roughness_seed"], "ground.roughness_m other than 0", |walkers| {
        walkers.ever(|config| config.ground.roughness_m)
    })
    .beside("ground.roughness_m"),
    read_if(&["ground.edge_m"], "ground.step_height_m or ground.stair_rise_m other than 0", |walkers| {
        walkers.ever(|config| config.ground.step_height_m) || walkers.ever(|config| config.ground.stair_rise_m)
    }),
    // What happens in an episode. A list that is given with what it replaces may have been laid over it on purpose.
    read_if(&["scenario.push_s", "scenario.push_duration_s", "scenario.push_phase"], NO_PUSHES, |walkers| {
        walkers.low.scenario.pushes.pushes.is_empty()
    }),
    read_if(&["scenario.push_n"], NO_PUSHES, |walkers| walkers.low.scenario.pushes.pushes.is_empty())
        .beside("scenario.pushes"),
    read_if(
        &["scenario.push_s", "scenario.push_duration_s", "scenario.push_phase"],
        "scenario.push_n other than 0",
        |walkers| is_on(&walkers.low.scenario.push_n),
    )
    .beside("scenario.push_n"),
    read_if(&["scenario.gust.duration_s", "scenario.gust.pause_s"], "scenario.gust.force_n other than 0", |walkers| {
        is_on(&walkers.low.scenario.gust.force_n)
    })
    .beside("scenario.gust.force_n"),
    read_if(
        &["scenario.speed_m_s", "scenario.speed_change_s", "scenario.walk_s"],
        "an empty list scenario.profile",
        |walkers| walkers.low.scenario.profile.knots.is_empty(),
    )
    .beside("scenario.profile"),
    read_if(&["scenario.walk_s"], "scenario.start = 'standing' or 'random'", |walkers| {
        walkers.low.scenario.start != StartChoice::Cyclic
    })
    .beside("scenario.start"),
];

/// Sensors that neither the state machine, whose phases are recorded whoever drives the knee, nor the agent listens to. They
/// may be drawn all the same: agents change.
const READERS: &[Use] = &[
    read_if(
        &["sensors.knee_encoder", "sensors.knee_speed_cutoff_hz"],
        "the group knee in observation.groups",
        |walkers| walkers.observe(Group::Knee) || !walkers.has(DeviceKind::Friction),
    ),
    read_if(&["sensors.tube_force", "sensors.tube_moment"], "the group load in observation.groups", |walkers| {
        walkers.observe(Group::Load) || walkers.has(DeviceKind::Damper)
    }),
    read_if(&["sensors.shank_inclination", "sensors.shank_rate"], "the group shank in observation.groups", |walkers| {
        walkers.observe(Group::Shank)
    }),
    read_if(&["sensors.shank_specific_force"], "the group shank_force in observation.groups", |walkers| {
        walkers.observe(Group::ShankForce)
    }),
    read_if(
        &["sensors.thigh_rate", "sensors.thigh_specific_force"],
        "the group thigh in observation.groups",
        |walkers| walkers.observe(Group::Thigh),
    ),
    read_if(
        &["sensors.ankle_moment", "sensors.ankle_moment_rate_cutoff_hz"],
        "the group ankle in observation.groups",
        |walkers| walkers.observe(Group::Ankle) || walkers.has(DeviceKind::Motor),
    ),
    read_if(&["sensors.motor_current"], "the group motor in observation.groups", |walkers| {
        walkers.observe(Group::Motor)
    }),
];

const NO_PUSHES: &str = "an empty list scenario.pushes";

/// Why to draw the number at `key` changes nothing for any walker of the span; `None` if it may change something.
pub fn drawn(walkers: &Span<'_>, key: &str) -> Option<Idle> {
    reason(PARTS, walkers, key)
}

/// Why to set what is at `key` changes nothing for any walker of all spans; of several reasons the first.
pub fn set(spans: &[Span<'_>], key: &str) -> Option<Idle> {
    let reason = |walkers| reason(PARTS, walkers, key).or_else(|| reason(READERS, walkers, key));
    spans.iter().map(reason).collect::<Option<Vec<_>>>()?.first().copied()
}

fn reason(uses: &[Use], walkers: &Span<'_>, key: &str) -> Option<Idle> {
    let is_part = |of: &str| key.strip_prefix(of).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
    let idle = |one: &&Use| one.keys.iter().any(|of| is_part(of)) && !(one.read)(walkers);
    uses.iter().find(idle).map(|one| one.idle)
}

fn is_on(force: &Distribution) -> bool {
    force.bounds() != [0.0; 2]
}

/// Questions about all walkers of a span, which differ in numbers alone.
impl Span<'_> {
    fn has(&self, kind: DeviceKind) -> bool {
        self.low.device.kind == kind
    }

    /// Whether a number is other than 0 in any of them.
    fn ever(&self, number: fn(&Config) -> f64) -> bool {
        number(self.low) != 0.0 || number(self.high) != 0.0
    }

    fn act_by(&self, modes: &[ActionMode]) -> bool {
        modes.contains(&self.low.action.mode)
    }

    fn observe(&self, group: Group) -> bool {
        self.low.observation.groups.0.contains(&group)
    }
}
