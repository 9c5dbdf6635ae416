//! How the human's joints are driven.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantNames};

use crate::schema::params::{ANY, Choice, params};

/// Whether a joint's force or its motion is given.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum JointDrive {
    /// Forward dynamics: an impedance pulls it to its reference.
    Forward,
    /// Inverse dynamics: it moves exactly like its reference, whatever force that takes.
    Inverse,
}

impl Choice for JointDrive {}

params! {
    /// How the human's joints are driven (section 3.1); the paper's walker is the default, and the fastest.
    pub struct MechanismParams {
        /// Trunk rotation: inverse follows its reference exactly, forward by an impedance.
        trunk: JointDrive = JointDrive::Inverse, "", ANY;
        /// Hip: forward follows its reference by an impedance, inverse exactly.
        hip: JointDrive = JointDrive::Forward, "", ANY;
    }
}
