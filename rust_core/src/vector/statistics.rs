//! Running statistics of observations, and their normalisation, so that nobody pays for them elsewhere.

/// Number, mean and variance of what has been seen so far, one mean and variance per component.
#[derive(Clone, Debug, PartialEq)]
pub struct Moments {
    /// Number of rows.
    pub count: f64,
    /// Mean of each component.
    pub mean: Vec<f64>,
    /// Variance of each component.
    pub variance: Vec<f64>,
}

impl Moments {
    /// Of nothing yet: mean 0 and variance 1, which leave observations as they are.
    pub fn new(size: usize) -> Self {
        Self { count: 0.0, mean: vec![0.0; size], variance: vec![1.0; size] }
    }

    /// Takes rows (n, size) into account. The result depends on the order of the rows alone.
    pub fn update(&mut self, rows: &[f32]) {
        let size = self.mean.len();
        let rows = rows.chunks_exact(size);
        let count = rows.len() as f64;
        if count == 0.0 {
            return;
        }
        // Sums about the present mean, or else the first row, lest large offsets cancel.
        if self.count == 0.0 {
            let first = rows.clone().next().unwrap_or_default();
            self.mean = first.iter().copied().map(f64::from).collect();
        }
        let (mut sum, mut squares) = (vec![0.0; size], vec![0.0; size]);
        for row in rows {
            for component in 0..size {
                let deviation = f64::from(row[component]) - self.mean[component];
                sum[component] += deviation;
                squares[component] += deviation * deviation;
            }
        }
        let total = self.count + count;
        for component in 0..size {
            let shift = sum[component] / count;
            let old = self.variance[component] * self.count;
            let new = squares[component] - shift * sum[component];
            self.variance[component] = (old + new + shift * shift * self.count * count / total) / total;
            self.mean[component] += shift * count / total;
        }
        self.count = total;
    }
}

/// Observations less their running mean, over their running standard deviation, limited.
#[derive(Clone, Debug, PartialEq)]
pub struct Normaliser {
    /// Statistics so far.
    pub moments: Moments,
    /// Whether observations change the statistics.
    pub learns: bool,
    /// Normalised observations lie within +- this.
    pub clip: f64,
    /// Added to the variance.
    pub epsilon: f64,
}

impl Normaliser {
    /// Takes rows (n, size) into account, unless it no longer learns.
    pub fn see(&mut self, rows: &[f32]) {
        if self.learns {
            self.moments.update(rows);
        }
    }

    /// Normalises rows (n, size) in place.
    pub fn normalise(&self, rows: &mut [f32]) {
        let scale: Vec<f64> =
            self.moments.variance.iter().map(|variance| 1.0 / (variance + self.epsilon).sqrt()).collect();
        for row in rows.chunks_exact_mut(scale.len()) {
            for component in 0..scale.len() {
                let deviation = f64::from(row[component]) - self.moments.mean[component];
                row[component] = (deviation * scale[component]).clamp(-self.clip, self.clip) as f32;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rows() -> Vec<f32> {
        (0..300_u16).flat_map(|i| [1e4 + (f32::from(i) * 0.7).sin(), f32::from(i) * 0.01]).collect()
    }

    #[test]
    fn moments_are_those_of_all_rows_at_once_however_they_come_in() {
        let rows = rows();
        let count = rows.len() as f64 / 2.0;
        for batch in [2, 14, 200, 600] {
            let mut moments = Moments::new(2);
            rows.chunks(batch).for_each(|rows| moments.update(rows));
            for component in 0..2 {
                let column = || rows.iter().skip(component).step_by(2).map(|&x| f64::from(x));
                let mean = column().sum::<f64>() / count;
                let variance = column().map(|x| (x - mean).powi(2)).sum::<f64>() / count;
                assert!((moments.mean[component] - mean).abs() < 1e-9, "{batch}");
                assert!((moments.variance[component] - variance).abs() < 1e-9, "{batch}");
            }
        }
    }

    #[test]
    fn normalised_rows_have_mean_0_and_variance_1_within_the_limit() {
        let mut rows = rows();
        let mut normaliser = Normaliser { moments: Moments::new(2), learns: true, clip: 1.2, epsilon: 1e-8 };
        normaliser.see(&rows);
        let seen = normaliser.moments.clone();
        let mut unlimited = rows.clone();
        Normaliser { clip: 10.0, ..normaliser.clone() }.normalise(&mut unlimited);
        let mut after = Moments::new(2);
        after.update(&unlimited);
        assert!(after.mean.iter().all(|mean| mean.abs() < 1e-4));
        assert!(after.variance.iter().all(|variance| (variance - 1.0).abs() < 1e-3));
        normaliser.learns = false;
        normaliser.see(&unlimited);
        assert_eq!(normaliser.moments, seen);
        normaliser.normalise(&mut rows);
        assert!(rows.iter().all(|x| x.abs() <= 1.2) && rows.iter().any(|x| x.abs() == 1.2));
    }
}
