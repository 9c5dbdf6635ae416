//! Walkers that are taken out of a simulation and put back.

use crate::closed_loop::disturbance::Progress;
use crate::closed_loop::episode::Episode;
use crate::closed_loop::simulation::{LoopModel, Scratch, Simulation};
use crate::plant::state::WalkerState;
use crate::plant::walkers::WalkerMemory;
use crate::prosthesis::gait::GaitMemory;
use crate::sensors::SensorMemory;
use crate::signals::Readings;

/// One walker between two control periods, but for what its episode says.
#[derive(Clone, Debug, serde::Serialize, serde::Deserialize)]
pub struct SavedWalker {
    state: WalkerState,
    memory: WalkerMemory,
    sensors: SensorMemory,
    readings: Readings,
    state_machine: GaitMemory,
    state_machine_command: f64,
    sample: u64,
    disturbance: Progress,
}

impl<const L: usize> Simulation<L> {
    /// The walker in `lane`; `None` before its first episode.
    pub fn save(&self, lane: usize) -> Option<SavedWalker> {
        Some(SavedWalker {
            state: self.state.get(lane),
            memory: self.walkers.get(lane),
            sensors: self.sensors.get(lane),
            readings: self.readings.get(lane),
            state_machine: self.state_machine[lane],
            state_machine_command: self.state_machine_command[lane],
            sample: self.sample[lane],
            disturbance: self.episode[lane].as_ref()?.disturbance.progress(),
        })
    }

    /// Puts a walker in `lane` where another one of the same `episode` was.
    pub fn restore(
        &mut self,
        model: &LoopModel<L>,
        lane: usize,
        mut episode: Episode,
        saved: &SavedWalker,
        scratch: &mut Scratch<L>,
    ) {
        episode.disturbance.resume(&saved.disturbance);
        self.start(model, lane, episode, scratch);
        self.state.set(lane, &saved.state);
        self.walkers.set(&model.plant, lane, &saved.memory);
        self.sensors.set(lane, &saved.sensors);
        self.readings.set(lane, saved.readings);
        self.state_machine[lane] = saved.state_machine;
        self.state_machine_command[lane] = saved.state_machine_command;
        self.sample[lane] = saved.sample;
        (self.next_intent[lane], self.next_push[lane]) = (0, 0);
    }
}
