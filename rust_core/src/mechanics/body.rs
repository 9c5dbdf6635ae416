//! Segments of the walker: masses, lengths and inertias (Table 1).

use crate::numerics::lanes::lanes;
use crate::schema::params::{above, params, within};

params! {
    /// Segments of the walker (Table 1). Centres of mass in the segment frame at its proximal joint, y up along the segment.
    pub struct BodyParams {
        /// Trunk mass, which includes head, arms and intact leg (Table 1).
        trunk_mass_kg: f64 = 62.5, "kg", above(0.0, 500.0);
        /// Trunk inertia about its centre of mass (Table 1).
        trunk_inertia_kg_m2: f64 = 4.401, "kg m^2", within(0.0, 100.0);
        /// Height of the trunk's centre of mass above the hip (Table 1).
        trunk_com_y_m: f64 = 0.325, "m", within(-1.0, 1.0);
        /// Top of the trunk above the hip: a contact point in a fall where the trunk is a forward joint.
        trunk_top_m: f64 = 0.6, "m", above(0.0, 2.0);
        /// Thigh mass (Table 1).
        thigh_mass_kg: f64 = 9.0, "kg", above(0.0, 100.0);
        /// Thigh inertia about its centre of mass (Table 1).
        thigh_inertia_kg_m2: f64 = 0.1337, "kg m^2", within(0.0, 10.0);
        /// Thigh centre of mass, forward (Table 1).
        thigh_com_x_m: f64 = 0.0, "m", within(-0.5, 0.5);
        /// Thigh centre of mass, up (Table 1).
        thigh_com_y_m: f64 = -0.18, "m", within(-1.0, 0.5);
        /// Hip to knee (Table 1).
        thigh_length_m: f64 = 0.42, "m", above(0.0, 1.0);
        /// Calf mass, prosthetic knee included (Table 1).
        calf_mass_kg: f64 = 2.8, "kg", above(0.0, 50.0);
        /// Calf inertia about its centre of mass (Table 1).
        calf_inertia_kg_m2: f64 = 0.03, "kg m^2", within(0.0, 5.0);
        /// Calf centre of mass, forward (Table 1).
        calf_com_x_m: f64 = -0.01, "m", within(-0.5, 0.5);
        /// Calf centre of mass, up (Table 1).
        calf_com_y_m: f64 = -0.12, "m", within(-1.0, 0.5);
        /// Knee to tube sensor (Table 1).
        calf_length_m: f64 = 0.28, "m", above(0.0, 1.0);
        /// Tube sensor to ankle (Table 1: shank minus calf).
        tube_length_m: f64 = 0.14, "m", above(0.0, 1.0);
        /// Foot mass (Table 1).
        foot_mass_kg: f64 = 0.7, "kg", above(0.0, 20.0);
        /// Foot inertia about its centre of mass (Table 1).
        foot_inertia_kg_m2: f64 = 0.0018, "kg m^2", within(0.0, 1.0);
        /// Foot centre of mass, forward of the ankle (Table 1).
        foot_com_x_m: f64 = 0.0625, "m", within(-0.5, 0.5);
        /// Foot centre of mass, up from the ankle (Table 1).
        foot_com_y_m: f64 = -0.0533, "m", within(-0.5, 0.5);
        /// Sole below the ankle (Table 1, y_foot).
        foot_height_m: f64 = 0.08, "m", above(0.0, 0.5);
        /// Heel contact point, forward of the ankle (Table 1).
        heel_x_m: f64 = -0.025, "m", within(-0.5, 0.5);
        /// Ball contact point, forward of the ankle (Table 1).
        ball_x_m: f64 = 0.15, "m", within(-0.5, 0.5);
        /// Contact points of the sole: heel, ball, and the others between them. Together they are as stiff as the paper's two.
        sole_points: usize = 2, "", within(2.0, 32.0);
        /// Radius of the arc from heel to ball on which the points between them lie; 0 for a straight sole.
        sole_radius_m: f64 = 0.0, "m", within(0.0, 100.0);
        /// Toe-up mounting of the foot on the tube; the ankle spring rests there (section 5.2.1, q_8,0).
        foot_mount_deg: f64 = 4.0, "deg", within(-30.0, 30.0);
    }
}

impl BodyParams {
    /// Inertia of the foot about the tube sensor with its mass lumped at the ankle's distance, kg m^2.
    pub fn foot_inertia_about_tube(&self) -> f64 {
        let square = |x: f64| x * x;
        self.foot_inertia_kg_m2
            + self.foot_mass_kg * (square(self.foot_com_x_m) + square(self.foot_com_y_m) + square(self.tube_length_m))
    }

    /// Contact points of the sole in the foot frame, m: heel, ball, then those between them from back to front.
    pub fn sole(&self) -> Vec<[f64; 2]> {
        let (half, middle) = (0.5 * (self.ball_x_m - self.heel_x_m), 0.5 * (self.ball_x_m + self.heel_x_m));
        let chord = -self.foot_height_m;
        let below_chord = |x: f64| {
            let radius = self.sole_radius_m;
            if radius == 0.0 { 0.0 } else { (radius * radius - x * x).sqrt() - (radius * radius - half * half).sqrt() }
        };
        let between = (1..self.sole_points - 1).map(|i| {
            let x = half * (2.0 * i as f64 / (self.sole_points - 1) as f64 - 1.0);
            [middle + x, chord - below_chord(x)]
        });
        [[self.heel_x_m, chord], [self.ball_x_m, chord]].into_iter().chain(between).collect()
    }
}

lanes! {
    /// Mechanical constants of one walker, SI.
    pub struct Body, BodyLanes {
        /// Total mass, kg.
        mass: f64,
        /// Trunk mass, kg.
        trunk_mass: f64,
        /// First moment of the trunk about the hip, up, kg m.
        trunk_moment_y: f64,
        /// Inertia of the trunk about the hip, kg m^2.
        trunk_inertia: f64,
        /// First moment of thigh and all below it, lumped at the knee, about the hip, thigh frame, kg m.
        thigh_moment_x: f64,
        /// Same, along the thigh.
        thigh_moment_y: f64,
        /// First moment of calf and foot (lumped at the ankle) about the knee, shank frame, kg m.
        shank_moment_x: f64,
        /// Same, along the shank.
        shank_moment_y: f64,
        /// First moment of the foot about the ankle, foot frame, kg m.
        foot_moment_x: f64,
        /// Same, up.
        foot_moment_y: f64,
        /// Inertia about the hip of thigh and what hangs below, lumped at the knee, kg m^2.
        thigh_inertia: f64,
        /// Inertia about the knee of calf and foot, lumped at the ankle, kg m^2.
        shank_inertia: f64,
        /// Inertia of the foot about the ankle, kg m^2.
        foot_inertia: f64,
        /// Hip to knee, m.
        thigh_length: f64,
        /// Knee to ankle, m.
        shank_length: f64,
        /// Tube sensor to ankle, m.
        tube_length: f64,
        /// Foot mass, kg.
        foot_mass: f64,
        /// Heel forward of the ankle, foot frame, m.
        heel_x: f64,
        /// Ball forward of the ankle, foot frame, m.
        ball_x: f64,
        /// Sole above the ankle, foot frame (negative), m.
        sole_y: f64,
        /// Foot frame to tube at ankle rest, rad.
        foot_mount: f64,
    }
}

impl From<&BodyParams> for Body {
    fn from(p: &BodyParams) -> Self {
        let shank_length = p.calf_length_m + p.tube_length_m;
        let below_knee = p.calf_mass_kg + p.foot_mass_kg;
        let square = |x: f64, y: f64| x * x + y * y;
        Self {
            mass: p.trunk_mass_kg + p.thigh_mass_kg + below_knee,
            trunk_mass: p.trunk_mass_kg,
            trunk_moment_y: p.trunk_mass_kg * p.trunk_com_y_m,
            trunk_inertia: p.trunk_inertia_kg_m2 + p.trunk_mass_kg * p.trunk_com_y_m * p.trunk_com_y_m,
            thigh_moment_x: p.thigh_mass_kg * p.thigh_com_x_m,
            thigh_moment_y: p.thigh_mass_kg * p.thigh_com_y_m - below_knee * p.thigh_length_m,
            shank_moment_x: p.calf_mass_kg * p.calf_com_x_m,
            shank_moment_y: p.calf_mass_kg * p.calf_com_y_m - p.foot_mass_kg * shank_length,
            foot_moment_x: p.foot_mass_kg * p.foot_com_x_m,
            foot_moment_y: p.foot_mass_kg * p.foot_com_y_m,
            thigh_inertia: p.thigh_inertia_kg_m2
                + p.thigh_mass_kg * square(p.thigh_com_x_m, p.thigh_com_y_m)
                + below_knee * p.thigh_length_m * p.thigh_length_m,
            shank_inertia: p.calf_inertia_kg_m2
                + p.calf_mass_kg * square(p.calf_com_x_m, p.calf_com_y_m)
                + p.foot_mass_kg * shank_length * shank_length,
            foot_inertia: p.foot_inertia_kg_m2 + p.foot_mass_kg * square(p.foot_com_x_m, p.foot_com_y_m),
            thigh_length: p.thigh_length_m,
            shank_length,
            tube_length: p.tube_length_m,
            foot_mass: p.foot_mass_kg,
            heel_x: p.heel_x_m,
            ball_x: p.ball_x_m,
            sole_y: -p.foot_height_m,
            foot_mount: p.foot_mount_deg.to_radians(),
        }
    }
}
