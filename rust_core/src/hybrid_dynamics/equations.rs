//! The linear equations of the walker's accelerations, every entry by its name, and their solution.

use crate::hybrid_dynamics::walker::Acceleration;

/// A symmetric 2 x 2 matrix in world axes; `xy` is 0 on level ground and never looked at there.
#[derive(Clone, Copy)]
pub(super) struct Planar {
    pub xx: f64,
    pub xy: f64,
    pub yy: f64,
}

impl Planar {
    /// `along` and `across` a surface of the given slope, turned into world axes.
    #[inline(always)]
    pub fn turned<const LEVEL: bool>(along: f64, across: f64, sin: f64, cos: f64) -> Self {
        if LEVEL {
            return Self { xx: along, xy: 0.0, yy: across };
        }
        let (sin2, cos2) = (sin * sin, cos * cos);
        Self { xx: cos2 * along + sin2 * across, xy: sin * cos * (along - across), yy: sin2 * along + cos2 * across }
    }

    #[inline(always)]
    pub fn apply<const LEVEL: bool>(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        if LEVEL { [self.xx * x, self.yy * y] } else { [self.xx * x + self.xy * y, self.xy * x + self.yy * y] }
    }
}

#[inline(always)]
pub(super) fn dot([ax, ay]: [f64; 2], [bx, by]: [f64; 2]) -> f64 {
    ax * bx + ay * by
}

/// Lower triangle of a symmetric positive definite matrix over hip x, hip y, thigh, shank, foot, and a right-hand side.
///
/// Every entry has a name of its own: an array in a lane loop would keep the loop from becoming vector code.
pub(super) struct Equations {
    pub xx: f64,
    pub yx: f64,
    pub yy: f64,
    pub tx: f64,
    pub ty: f64,
    pub tt: f64,
    pub sx: f64,
    pub sy: f64,
    pub st: f64,
    pub ss: f64,
    pub fx: f64,
    pub fy: f64,
    pub ft: f64,
    pub fs: f64,
    pub ff: f64,
    pub x: f64,
    pub y: f64,
    pub t: f64,
    pub s: f64,
    pub f: f64,
}

impl Equations {
    /// Solution by an unrolled L D L^T decomposition; on level ground `yx` is 0 and left out.
    #[inline(always)]
    pub fn solve<const LEVEL: bool>(self) -> Acceleration {
        let Self {
            xx,
            yx,
            mut yy,
            tx,
            mut ty,
            mut tt,
            sx,
            mut sy,
            mut st,
            mut ss,
            fx,
            mut fy,
            mut ft,
            mut fs,
            mut ff,
            ..
        } = self;
        let Self { x, mut y, mut t, mut s, mut f, .. } = self;

        let inverse_x = 1.0 / xx;
        let (lt, ls, lf) = (tx * inverse_x, sx * inverse_x, fx * inverse_x);
        if !LEVEL {
            let ly = yx * inverse_x;
            yy -= ly * yx;
            y -= ly * x;
            ty -= lt * yx;
            sy -= ls * yx;
            fy -= lf * yx;
        }
        (tt, st, ss) = (tt - lt * tx, st - ls * tx, ss - ls * sx);
        (ft, fs, ff) = (ft - lf * tx, fs - lf * sx, ff - lf * fx);
        (t, s, f) = (t - lt * x, s - ls * x, f - lf * x);

        let inverse_y = 1.0 / yy;
        let (lt, ls, lf) = (ty * inverse_y, sy * inverse_y, fy * inverse_y);
        (tt, st, ss) = (tt - lt * ty, st - ls * ty, ss - ls * sy);
        (ft, fs, ff) = (ft - lf * ty, fs - lf * sy, ff - lf * fy);
        (t, s, f) = (t - lt * y, s - ls * y, f - lf * y);

        let inverse_t = 1.0 / tt;
        let (ls, lf) = (st * inverse_t, ft * inverse_t);
        (ss, fs, ff) = (ss - ls * st, fs - lf * st, ff - lf * ft);
        (s, f) = (s - ls * t, f - lf * t);

        let inverse_s = 1.0 / ss;
        let lf = fs * inverse_s;
        (ff, f) = (ff - lf * fs, f - lf * s);

        let foot = f / ff;
        let shank = (s - fs * foot) * inverse_s;
        let thigh = (t - st * shank - ft * foot) * inverse_t;
        let hip_y = (y - ty * thigh - sy * shank - fy * foot) * inverse_y;
        let left = x - tx * thigh - sx * shank - fx * foot;
        let hip_x = (if LEVEL { left } else { left - yx * hip_y }) * inverse_x;
        Acceleration { hip_x, hip_y, thigh, shank, foot }
    }
}
