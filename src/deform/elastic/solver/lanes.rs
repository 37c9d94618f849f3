//! Eight numbers at a time, in plain arrays that the compiler turns into vectors. They round as single numbers do, so all
//! processors leave the same bits.

use std::ops::{Add, Div, Mul, Neg, Sub};

/// How many cells are relaxed at a time.
pub(super) const LANES: usize = 8;

/// A number of each of eight cells.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(32))]
pub(super) struct Lanes(pub [f32; LANES]);

impl Lanes {
    pub const ZERO: Self = Self([0.0; LANES]);

    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub fn max(self, other: Self) -> Self {
        let mut made = self;
        for (a, b) in made.0.iter_mut().zip(other.0) {
            *a = if *a > b { *a } else { b };
        }
        made
    }

    #[inline(always)]
    pub fn min(self, other: Self) -> Self {
        let mut made = self;
        for (a, b) in made.0.iter_mut().zip(other.0) {
            *a = if *a < b { *a } else { b };
        }
        made
    }

    #[inline(always)]
    pub fn sqrt(self) -> Self {
        let mut made = self;
        for a in &mut made.0 {
            *a = a.sqrt();
        }
        made
    }
}

macro_rules! operator {
    ($($of:ident $name:ident $sign:tt)*) => {
        $(impl $of for Lanes {
            type Output = Self;

            #[inline(always)]
            fn $name(self, other: Self) -> Self {
                let mut made = self;
                for (a, b) in made.0.iter_mut().zip(other.0) {
                    *a $sign b;
                }
                made
            }
        })*
    };
}

operator! { Add add += Sub sub -= Mul mul *= Div div /= }

impl Neg for Lanes {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self::ZERO - self
    }
}

/// A vector of each of eight cells.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lanes3 {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

impl Lanes3 {
    pub const ZERO: Self = Self { x: Lanes::ZERO, y: Lanes::ZERO, z: Lanes::ZERO };

    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }
}

impl Add for Lanes3 {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl Sub for Lanes3 {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl Mul<Lanes> for Lanes3 {
    type Output = Self;

    #[inline(always)]
    fn mul(self, by: Lanes) -> Self {
        Self { x: self.x * by, y: self.y * by, z: self.z * by }
    }
}
