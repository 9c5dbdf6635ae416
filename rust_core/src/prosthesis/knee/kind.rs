//! Which knee unit the leg has.

use serde::{Deserialize, Serialize};

use crate::schema::params::{ANY, Parameter, Range, params};

/// Which knee unit the leg has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DeviceKind {
    /// Variable damper (section 5.2).
    #[default]
    Damper,
    /// Motor and strain-wave gear (section 5.3).
    Motor,
    /// Constant friction with extension assist.
    Friction,
}

impl DeviceKind {
    /// Whether the unit has a motor.
    pub fn has_motor(self) -> bool {
        self == Self::Motor
    }
}

impl Parameter for DeviceKind {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        format!("{self:?}").to_lowercase()
    }
    fn allowed(_: Range) -> String {
        "damper | motor | friction".to_owned()
    }
}

params! {
    /// Choice of the knee unit.
    pub struct DeviceParams {
        /// Knee unit of the leg.
        kind: DeviceKind = DeviceKind::Damper, "", ANY;
    }
}
