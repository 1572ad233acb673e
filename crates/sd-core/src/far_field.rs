//! The far field: mobility of force and dipole modes of finite spheres, and its inverse.

pub mod kernels;
pub mod unbounded;
