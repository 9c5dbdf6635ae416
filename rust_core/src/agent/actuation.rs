//! What lies between an agent and a valve or an amplifier: commands come late, change at most so fast, and are smoothed.

use std::collections::VecDeque;

use crate::numerics::lanes::lanes;
use crate::numerics::math::{clamp, exp};
use crate::signals::CONTROL_PERIOD_S;

lanes! {
    /// What lies between an agent and its knee unit remembers, but for its delay.
    pub struct Actuation, ActuationLanes {
        /// First number of the action in effect.
        action_0: f64,
        /// Second number.
        action_1: f64,
        /// Third number.
        action_2: f64,
        /// Gait phase that it was latched in; 0 before the first.
        phase: u8,
        /// Last command that was asked for.
        requested: f64,
        /// Last command to the knee unit.
        command: f64,
    }
}

/// The same of a block of walkers, with the commands under way to each, oldest first.
#[derive(Clone, Debug)]
pub struct Actuations<const L: usize> {
    /// Present actions and commands.
    pub now: ActuationLanes<L>,
    lines: [VecDeque<f64>; L],
}

impl<const L: usize> Default for Actuations<L> {
    fn default() -> Self {
        Self { now: ActuationLanes::default(), lines: std::array::from_fn(|_| VecDeque::new()) }
    }
}

impl<const L: usize> Actuations<L> {
    /// Those in `lane`.
    pub fn get(&self, lane: usize) -> (Actuation, VecDeque<f64>) {
        (self.now.get(lane), self.lines[lane].clone())
    }

    /// Replaces those in `lane`.
    pub fn set(&mut self, lane: usize, (now, line): (Actuation, VecDeque<f64>)) {
        self.now.set(lane, now);
        self.lines[lane] = line;
    }
}

/// Delay, rate limit and low-pass of commands.
#[derive(Clone, Copy, Debug)]
pub struct Lag {
    /// Control periods.
    delay: usize,
    /// Commands of a full action per second; 0 for no limit.
    rate_limit: f64,
    /// Share of its way to the new command that the low-pass goes in a control period.
    filter_share: f64,
}

impl Lag {
    /// Control periods of delay, commands of a full action per second, and time constant (s); 0 for none.
    pub fn new(delay: usize, rate_limit: f64, filter_s: f64) -> Self {
        let filter_share = if filter_s > 0.0 { 1.0 - exp(-CONTROL_PERIOD_S / filter_s) } else { 1.0 };
        Self { delay, rate_limit, filter_share }
    }

    /// What reaches the knee units of what is requested now, where `full` is the command of a full action.
    #[inline(always)]
    pub fn through<const L: usize>(
        &self,
        memory: &mut Actuations<L>,
        full: &[f64; L],
        requested: [f64; L],
    ) -> [f64; L] {
        let now = &mut memory.now;
        now.requested = requested;
        let mut command = requested;
        if self.delay > 0 {
            for (command, line) in command.iter_mut().zip(&mut memory.lines) {
                line.push_back(*command);
                // Nothing has been asked for before the start.
                *command = if line.len() > self.delay { line.pop_front().unwrap_or(0.0) } else { 0.0 };
            }
        }
        if self.rate_limit > 0.0 {
            for lane in 0..L {
                let largest = self.rate_limit * full[lane] * CONTROL_PERIOD_S;
                let change = command[lane] - now.command[lane];
                command[lane] = now.command[lane] + clamp(change, -largest, largest);
            }
        }
        if self.filter_share < 1.0 {
            for lane in 0..L {
                command[lane] = now.command[lane] + self.filter_share * (command[lane] - now.command[lane]);
            }
        }
        now.command = command;
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Commands that reach the knee of full actions, which are 20.
    fn step_response(lag: Lag, periods: usize) -> Vec<f64> {
        let mut memory = Actuations::default();
        (0..periods).map(|_| lag.through(&mut memory, &[20.0], [20.0])[0]).collect()
    }

    #[test]
    fn commands_come_late_by_exactly_the_delay() {
        assert_eq!(step_response(Lag::new(3, 0.0, 0.0), 6), [0.0, 0.0, 0.0, 20.0, 20.0, 20.0]);
    }

    #[test]
    fn the_rate_limit_is_kept_and_reached() {
        assert_eq!(step_response(Lag::new(0, 50.0, 0.0), 6), [5.0, 10.0, 15.0, 20.0, 20.0, 20.0]);
    }

    #[test]
    fn the_low_pass_has_come_63_percent_of_the_way_after_its_time_constant() {
        let commands = step_response(Lag::new(0, 0.0, 0.05), 10);
        assert!((commands[9] - 20.0 * (1.0 - (-1.0_f64).exp())).abs() < 1e-9);
    }
}
