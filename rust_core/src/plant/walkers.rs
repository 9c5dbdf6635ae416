//! What walkers keep from one control period to the next beside their continuous state: inputs and discrete state.

use crate::human::drive::DriveLanes;
use crate::human::gait_fsm::Memory;
use crate::human::guard::GuardLanes;
use crate::human::intent::Profile;
use crate::human::variation::Individual;
use crate::plant::model::PlantModel;

/// Inputs and discrete state of a block of walkers.
#[derive(Clone, Debug)]
pub struct Walkers<const L: usize> {
    // Inputs, constant over a control period.
    /// Command to the knee unit, in its own unit.
    pub command: [f64; L],
    /// Disturbance on the trunk, forward, N.
    pub push_x: [f64; L],
    /// Disturbance on the trunk, up, N.
    pub push_y: [f64; L],
    /// Intent, 0 stand or 1 walk.
    pub intent: [f64; L],
    /// Intent and intended speed over time.
    pub profile: [Profile; L],
    // Discrete state.
    /// Direction of rotation of the knee unit's rotor (-1, 0, 1).
    pub(super) direction: [f64; L],
    pub(super) drive: DriveLanes<L>,
    pub(super) guard: GuardLanes<L>,
    /// Largest extension-stop torque at the end of any step since it was last cleared, N m.
    pub extension_stop_peak: [f64; L],
    /// Memory of the human.
    pub(super) memory: [Memory; L],
    pub(super) individual: [Individual; L],
}

impl<const L: usize> Default for Walkers<L> {
    fn default() -> Self {
        Self {
            command: [0.0; L],
            push_x: [0.0; L],
            push_y: [0.0; L],
            intent: [0.0; L],
            profile: std::array::from_fn(|_| Profile::default()),
            direction: [0.0; L],
            drive: DriveLanes::default(),
            guard: GuardLanes::default(),
            extension_stop_peak: [0.0; L],
            memory: [Memory::default(); L],
            individual: std::array::from_fn(|_| Individual::default()),
        }
    }
}

/// Inputs and discrete state of one walker. Its profile and individual belong to its episode; the rest follows from these.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct WalkerMemory {
    command: f64,
    push: [f64; 2],
    intent: f64,
    direction: f64,
    extension_stop_peak: f64,
    human: Memory,
}

impl<const L: usize> Walkers<L> {
    /// The walker in `lane`.
    pub fn get(&self, lane: usize) -> WalkerMemory {
        WalkerMemory {
            command: self.command[lane],
            push: [self.push_x[lane], self.push_y[lane]],
            intent: self.intent[lane],
            direction: self.direction[lane],
            extension_stop_peak: self.extension_stop_peak[lane],
            human: self.memory[lane],
        }
    }

    /// Puts the walker in `lane`, who has started the same episode, where `walker` was.
    pub fn set(&mut self, model: &PlantModel<L>, lane: usize, walker: &WalkerMemory) {
        self.command[lane] = walker.command;
        [self.push_x[lane], self.push_y[lane]] = walker.push;
        self.intent[lane] = walker.intent;
        self.direction[lane] = walker.direction;
        self.extension_stop_peak[lane] = walker.extension_stop_peak;
        self.memory[lane] = walker.human;
        self.refresh_drive(model, lane);
    }

    /// Memory of the human in `lane`.
    pub fn memory(&self, lane: usize) -> &Memory {
        &self.memory[lane]
    }

    /// Pendulum foot of the intact leg, m, and whether it stands on the ground.
    pub fn pendulum_foot(&self, lane: usize) -> (f64, bool) {
        (self.drive.slip_foot_x[lane], self.drive.slip_stiffness[lane] > 0.0)
    }

    /// Derives from the human's memory what the continuous equations run on.
    pub(super) fn refresh_drive(&mut self, model: &PlantModel<L>, lane: usize) {
        let human = model.human.get(lane);
        let individual = &self.individual[lane];
        self.drive.set(lane, self.memory[lane].drive(&human, individual));
        self.guard.set(lane, self.memory[lane].guard(&human, &individual.params));
    }
}
