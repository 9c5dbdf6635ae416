//! The paper's joint coordinates.

/// The paper's joint coordinates of segment angles (or of their rates, with `mount` 0).
pub fn joint_coordinates(hip: [f64; 2], trunk: f64, [thigh, shank, foot]: [f64; 3], mount: f64) -> [f64; 8] {
    [hip[0], hip[1], trunk, thigh - trunk, shank - thigh, 0.0, 0.0, foot - shank - mount]
}
