//! Disturbances: forces on the trunk that the human did not intend (section 4.3).

/// One push on the trunk, on the 200 Hz grid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Push {
    /// Forward force, N.
    pub force_x_n: f64,
    /// First control sample that it acts in.
    pub first_sample: u64,
    /// First control sample after it.
    pub end_sample: u64,
}

impl Push {
    /// Forward force during the control period that starts at `sample`, N.
    pub fn force_x(&self, sample: u64) -> f64 {
        if (self.first_sample..self.end_sample).contains(&sample) { self.force_x_n } else { 0.0 }
    }
}
