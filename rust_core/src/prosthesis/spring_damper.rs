//! Connections of the leg that are rigid in the paper's walker and can be made to give way.

use serde::{Deserialize, Serialize};
use strum::{IntoStaticStr, VariantNames};

use crate::schema::params::Choice;

/// Whether a connection gives way.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, IntoStaticStr, VariantNames)]
#[serde(rename_all = "snake_case")]
#[strum(serialize_all = "snake_case")]
pub enum Connection {
    /// It is rigid.
    #[default]
    Rigid,
    /// It gives way like a spring with a damper.
    Compliant,
}

impl Choice for Connection {}

/// A linear spring with a damper.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SpringDamper {
    /// N/m or N m/rad.
    pub stiffness: f64,
    /// N s/m or N m s/rad.
    pub damping: f64,
}

impl SpringDamper {
    /// A spring that damps the oscillation of `inertia` (kg or kg m^2) on it with the given ratio.
    pub fn with_ratio(stiffness: f64, inertia: f64, damping_ratio: f64) -> Self {
        Self { stiffness, damping: 2.0 * damping_ratio * (stiffness * inertia).sqrt() }
    }

    /// Force on the distal body at a displacement (m or rad) and rate.
    pub fn force(&self, displacement: f64, rate: f64) -> f64 {
        -self.stiffness * displacement - self.damping * rate
    }
}
