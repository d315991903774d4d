//! Precise orbits and clocks of satellites: tables of nodes, as analysis centres publish them, between the nodes.
//!
//! * [`orbit`]: a polynomial of degree 10 through 11 positions. SP3 positions are those of the *centre of mass*; the
//!   way to the antenna is in [`super::antenna`].
//! * [`clock`]: a straight line between two clock records. They leave out the periodic relativistic term
//!   ([`super::relativity::clock_correction`]).
//!
//! Both work on sorted slices, so that a host can hand over a day of a satellite and a device the few nodes of its
//! buffer. Nothing is extrapolated and no gap is bridged: an interpolation that cannot be good is refused.
//!
//! Panic contract: none, whatever the nodes: unsorted or absurd ones are refused, and what is returned is finite.

mod clock;
mod orbit;

pub use clock::{ClockNode, ClockValue, clock};
pub use orbit::{NODES, OrbitNode, PreciseOrbit, orbit};

use core::fmt;

/// Why there is no precise orbit or clock at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum PreciseError {
    /// There are no nodes at all.
    NoData,
    /// There are fewer nodes than an interpolation needs.
    TooFew,
    /// The time lies before the first or after the last node.
    Outside,
    /// A node is missing within those that the interpolation needs, or they are not in order.
    Gap,
    /// A node is not finite.
    NotFinite,
}

impl fmt::Display for PreciseError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NoData => "no precise data of the satellite",
            Self::TooFew => "too few nodes to interpolate",
            Self::Outside => "time outside of the precise data",
            Self::Gap => "gap in the precise data",
            Self::NotFinite => "precise data not finite",
        })
    }
}

impl core::error::Error for PreciseError {}
