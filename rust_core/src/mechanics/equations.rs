//! The linear equations of the walker's accelerations, every entry by its name, and their solution.

use crate::mechanics::motion::Acceleration;
use crate::numerics::math::FusedSum;

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
    (ax * bx).plus(ay, by)
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
            yy = yy.minus(ly, yx);
            y = y.minus(ly, x);
            ty = ty.minus(lt, yx);
            sy = sy.minus(ls, yx);
            fy = fy.minus(lf, yx);
        }
        (tt, st, ss) = (tt.minus(lt, tx), st.minus(ls, tx), ss.minus(ls, sx));
        (ft, fs, ff) = (ft.minus(lf, tx), fs.minus(lf, sx), ff.minus(lf, fx));
        (t, s, f) = (t.minus(lt, x), s.minus(ls, x), f.minus(lf, x));

        let inverse_y = 1.0 / yy;
        let (lt, ls, lf) = (ty * inverse_y, sy * inverse_y, fy * inverse_y);
        (tt, st, ss) = (tt.minus(lt, ty), st.minus(ls, ty), ss.minus(ls, sy));
        (ft, fs, ff) = (ft.minus(lf, ty), fs.minus(lf, sy), ff.minus(lf, fy));
        (t, s, f) = (t.minus(lt, y), s.minus(ls, y), f.minus(lf, y));

        let inverse_t = 1.0 / tt;
        let (ls, lf) = (st * inverse_t, ft * inverse_t);
        (ss, fs, ff) = (ss.minus(ls, st), fs.minus(lf, st), ff.minus(lf, ft));
        (s, f) = (s.minus(ls, t), f.minus(lf, t));

        let inverse_s = 1.0 / ss;
        let lf = fs * inverse_s;
        (ff, f) = (ff.minus(lf, fs), f.minus(lf, s));

        let foot = f / ff;
        let shank = s.minus(fs, foot) * inverse_s;
        let thigh = t.minus(ft, foot).minus(st, shank) * inverse_t;
        let hip_y = y.minus(fy, foot).minus(sy, shank).minus(ty, thigh) * inverse_y;
        let left = x.minus(fx, foot).minus(sx, shank).minus(tx, thigh);
        let hip_x = (if LEVEL { left } else { left.minus(yx, hip_y) }) * inverse_x;
        Acceleration { hip_x, hip_y, thigh, shank, foot }
    }
}
