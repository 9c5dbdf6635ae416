//! How a trial starts: from standing, or at the heel strike of a cyclic step.

use crate::human::gait_fsm::Memory;
use crate::human::reference::Reference;
use crate::human::variation::{HumanVariation, Individual};
use crate::mechanics::walker;
use crate::plant::posture::{STANDING_KNEE_DEG, foot_arm, posture, touch_down_posture};
use crate::plant::state::{Rest, State};
use crate::plant::system::HumanProsthesis;

/// Posture and speed that a trial starts from (section 5.1).
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Start {
    /// At rest on both legs.
    Standing,
    /// At the heel strike of a cyclic step.
    Cyclic,
}

/// Depth of the lowest contact point in the ground when a trial starts from standing, m.
const STANDING_DEPTH: f64 = 0.0037;
/// Hip speed at the cyclic start over the intended speed (section 5.1).
const CYCLIC_SPEED_FACTOR: f64 = 1.2;

impl<const L: usize> HumanProsthesis<'_, L> {
    /// Puts the walker in `lane` at the start of a trial with its current profile (sections 5.1 and 5.4 of the model).
    pub fn start(&mut self, state: &mut State<L>, lane: usize, start: Start, variation: HumanVariation) {
        let (body, human) = (self.model.body(lane), &self.model.human_params[lane]);
        let individual = Individual::new(human, variation);
        let speed = self.walkers.profile[lane].speed(0.0);
        let (mut motion, mut reference) = match start {
            Start::Standing => (posture(&body, 0.0, STANDING_KNEE_DEG.to_radians()), Reference::default()),
            Start::Cyclic => {
                let mut motion = touch_down_posture(&body, human);
                motion.hip_vx = CYCLIC_SPEED_FACTOR * speed;
                let trunk = individual.params.trunk_lean_deg.to_radians();
                (motion, Reference { trunk, hip: motion.thigh - trunk, ..Reference::default() })
            }
        };
        let kin = walker::kinematics(&body, &motion, reference.trunk);
        let (leg_x, leg_y) = (kin.thigh_x + kin.shank_x, kin.thigh_y + kin.shank_y);
        // Hip height that puts a point of the sole on the ground.
        let touching = |[x, y]: [f64; 2]| {
            let [arm_x, arm_y] = foot_arm(motion.foot, [x, y]);
            self.model.ground_height(lane, leg_x + arm_x) - (leg_y + arm_y)
        };
        motion.hip_y = match start {
            Start::Standing => {
                self.model.sole[lane].iter().copied().map(touching).fold(f64::NEG_INFINITY, f64::max) - STANDING_DEPTH
            }
            Start::Cyclic => touching(self.model.heel(lane)),
        };
        reference.trunk_rate = 0.0;
        state.motion.set(lane, motion);
        state.reference.set(lane, reference);
        state.rest.set(lane, Rest::default());
        Self::start_general(state, lane, reference.trunk);
        self.walkers.direction[lane] = 0.0;
        let rotor = self.model.unit.start(lane, motion.thigh - motion.shank);
        state.rotor.set(lane, rotor);
        self.walkers.memory[lane] = match start {
            Start::Standing => Memory::standing(&individual.params, speed),
            Start::Cyclic => Memory::cyclic(&individual.params, speed),
        };
        self.walkers.individual[lane] = individual;
        self.walkers.refresh_drive(self.model, lane);
    }
}
