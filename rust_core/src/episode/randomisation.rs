//! Which parameters of the walker episodes draw anew.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::schema::distribution::Distribution;
use crate::schema::params::{Parameter, Range};

/// Distribution of each randomised parameter by its dotted path.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Randomised(pub BTreeMap<String, Distribution>);

/// Partial configurations of which every episode draws one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Variants(pub Vec<Value>);

impl Parameter for Randomised {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        "{}".to_owned()
    }
    fn allowed(_: Range) -> String {
        "{\"section.key\" = distribution}".to_owned()
    }
}

impl Parameter for Variants {
    fn numbers(&self) -> [f64; 2] {
        [0.0; 2]
    }
    fn text(&self) -> String {
        "[]".to_owned()
    }
    fn allowed(_: Range) -> String {
        "list of partial configurations".to_owned()
    }
}
