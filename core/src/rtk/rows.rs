//! Links as measurement rows: what each observation says of position and velocity.
//!
//! ```text
//! code:     code residual    = c_g − e·δp + noise
//! phase:    λφ residual      = c_g − e·δp − λ nᵢ + noise
//! Doppler:  range rate       = c   − e·v  + noise
//! ```
//! with a free common term c of the group, which [`crate::filter::common_term`] eliminates. Panic contract: none.

use super::channel::{Channel, group};
use super::link::Link;
use crate::gnss::satellite::SatelliteSet;
use nalgebra::Vector3;

/// One row on three kinematic states.
#[derive(Clone, Copy, Debug)]
pub(super) struct KinematicRow {
    /// States and coefficients.
    pub entries: [(usize, f64); 3],
    /// The residual `[m]` or `[m/s]`.
    pub value: f64,
    /// Its variance.
    pub variance: f64,
}

impl KinematicRow {
    /// The row −e on the states from `first` on.
    fn new(first: usize, direction: &Vector3<f64>, value: f64, variance: f64) -> Self {
        let entries = [(first, -direction.x), (first + 1, -direction.y), (first + 2, -direction.z)];
        Self { entries, value, variance }
    }
}

/// Range rates, one a satellite.
pub(super) fn doppler(links: &[Link]) -> impl Iterator<Item = KinematicRow> {
    let mut done = SatelliteSet::EMPTY;
    links.iter().filter_map(move |link| {
        let rate = link.doppler.filter(|_| done.insert(link.satellite))?;
        Some(KinematicRow::new(3, &link.direction, rate, link.doppler_variance))
    })
}

/// Phases of a group that were not rejected, less the offset of their channels; the ambiguity is for the caller.
pub(super) fn phase<'a>(
    links: &'a [Link],
    channels: &'a [Channel],
    group: usize,
) -> impl Iterator<Item = (KinematicRow, &'a Channel)> {
    links.iter().filter(|link| !link.phase_rejected).filter_map(move |link| {
        let channel = channels.get(link.channel?).filter(|channel| channel.group() == group)?;
        let value = link.phase? - channel.wavelength * channel.offset;
        Some((KinematicRow::new(0, &link.direction, value, link.phase_variance), channel))
    })
}

/// Codes of a group that were not rejected.
pub(super) fn code(links: &[Link], of: usize) -> impl Iterator<Item = KinematicRow> {
    links.iter().filter(move |link| !link.code_rejected).filter_map(move |link| {
        let code = link.code.filter(|_| group(link.satellite.constellation(), link.slot) == of)?;
        Some(KinematicRow::new(0, &link.direction, code, link.code_variance))
    })
}
