//! Human intent: walk or stand, and the intended speed over time.

use serde::{Deserialize, Serialize};

use crate::schema::error::{Error, Result};
use crate::schema::params::{Parameter, Range, within};

/// One instant of a profile. Speed is linear between knots (two knots at one time make a step); the intent holds from its knot on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Knot {
    /// Time since the start of the trial, s.
    pub time_s: f64,
    /// Intended speed v_I, m/s.
    pub speed_m_s: f64,
    /// Intent: walk (true) or stand.
    pub walk: bool,
}

/// Intent and intended speed as functions of time.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Profile {
    /// Knots in the order of time.
    pub knots: Vec<Knot>,
}

impl Parameter for Profile {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        "[]".to_owned()
    }
    fn allowed(_: Range) -> String {
        "list of {time_s, speed_m_s, walk}, speed_m_s in [0.2, 3]".to_owned()
    }
    /// Checks ranges and order of the knots.
    fn check(&self, path: &str) -> Result<()> {
        for (i, knot) in self.knots.iter().enumerate() {
            within(0.0, 1e6).check(&format!("{path}[{i}].time_s"), knot.time_s, "s")?;
            within(0.2, 3.0).check(&format!("{path}[{i}].speed_m_s"), knot.speed_m_s, "m/s")?;
            if i > 0 && knot.time_s < self.knots[i - 1].time_s {
                return Err(Error::Schema {
                    key: format!("{path}[{i}].time_s"),
                    reason: format!("{} comes before the previous knot's {}", knot.time_s, self.knots[i - 1].time_s),
                });
            }
        }
        Ok(())
    }
}

impl Profile {
    /// Index of the last knot at or before `time`; 0 before the first.
    fn last_knot(&self, time: f64) -> usize {
        self.knots.iter().rposition(|knot| knot.time_s <= time).unwrap_or(0)
    }

    /// Intended speed, m/s.
    pub fn speed(&self, time: f64) -> f64 {
        let Some(&here) = self.knots.get(self.last_knot(time)) else { return 0.0 };
        match self.knots.get(self.last_knot(time) + 1) {
            Some(next) if time > here.time_s => {
                let share = (time - here.time_s) / (next.time_s - here.time_s);
                here.speed_m_s + share * (next.speed_m_s - here.speed_m_s)
            }
            _ => here.speed_m_s,
        }
    }

    /// Time of the first knot after `time`, s; infinite after the last.
    pub fn next_knot_s(&self, time: f64) -> f64 {
        self.knots.iter().map(|knot| knot.time_s).find(|&knot_s| knot_s > time).unwrap_or(f64::INFINITY)
    }

    /// Whether the human intends to walk.
    pub fn walks(&self, time: f64) -> bool {
        self.knots.get(self.last_knot(time)).is_some_and(|knot| knot.time_s <= time && knot.walk)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn knot(time_s: f64, speed_m_s: f64, walk: bool) -> Knot {
        Knot { time_s, speed_m_s, walk }
    }

    #[test]
    fn speed_steps_at_double_knots_and_ramps_between_single_ones() {
        let knots = vec![
            knot(0.0, 1.1, false),
            knot(1.0, 1.1, true),
            knot(10.0, 1.1, true),
            knot(10.0, 1.4, true),
            knot(20.0, 0.8, true),
        ];
        let profile = Profile { knots };
        assert_eq!(profile.speed(9.999), 1.1);
        assert_eq!(profile.speed(10.0), 1.4);
        assert!((profile.speed(15.0) - 1.1).abs() < 1e-12);
        assert_eq!(profile.speed(99.0), 0.8);
        assert!(!profile.walks(0.999) && profile.walks(1.0) && profile.walks(50.0));
    }

    #[test]
    fn knots_out_of_order_or_of_range_are_named() {
        let unordered = Profile { knots: vec![knot(1.0, 1.1, true), knot(0.5, 1.1, true)] };
        assert!(unordered.check("profile").unwrap_err().to_string().contains("profile[1].time_s"));
        let nan = Profile { knots: vec![knot(1.0, f64::NAN, true)] };
        assert!(nan.check("profile").unwrap_err().to_string().contains("speed_m_s"));
    }
}
