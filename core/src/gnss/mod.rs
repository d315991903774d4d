//! The GNSS vocabulary: exact time, satellites, signals, epochs of observations, broadcast ephemerides and the models
//! that turn them into ranges. No estimation happens here.
//!
//! Frames are ECEF (WGS 84 / ITRF, metres) of the stated epoch unless a name says otherwise; angles are radians.

pub mod antenna;
pub mod atmosphere;
pub mod attitude;
pub mod baseline;
pub mod bias;
pub mod celestial;
pub mod earth_rotation;
pub mod ephemeris;
pub mod epoch;
pub mod geodesy;
pub mod orbit;
pub mod precise;
pub mod relativity;
pub mod satellite;
pub mod signal;
pub mod solution;
pub mod tide;
pub mod time;
pub mod wind_up;

/// Speed of light in vacuum `[m/s]` (exact by definition of the metre; IS-GPS-200 20.3.3.3.3).
pub const SPEED_OF_LIGHT: f64 = 299_792_458.0;
