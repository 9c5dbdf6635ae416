//! How the human's joints are driven.

use serde::{Deserialize, Serialize};

use crate::schema::params::{ANY, Parameter, Range, params};

/// Whether a joint's force or its motion is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointDrive {
    /// Forward dynamics: an impedance pulls it to its reference.
    Forward,
    /// Inverse dynamics: it moves exactly like its reference, whatever force that takes.
    Inverse,
}

impl Parameter for JointDrive {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        format!("{self:?}").to_lowercase()
    }
    fn allowed(_: Range) -> String {
        "forward | inverse".to_owned()
    }
}

params! {
    /// How the human's joints are driven (section 3.1); the paper's walker is the default, and the fastest.
    pub struct MechanismParams {
        /// Trunk rotation: inverse follows its reference exactly, forward by an impedance.
        trunk: JointDrive = JointDrive::Inverse, "", ANY;
        /// Hip: forward follows its reference by an impedance, inverse exactly.
        hip: JointDrive = JointDrive::Forward, "", ANY;
    }
}
