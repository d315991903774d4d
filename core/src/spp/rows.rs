//! From an epoch to one row a satellite: which signal, where the satellite was, what is taken off its code.
//! Panic contract: never panics; what cannot be used is left out.

use super::Config;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::ephemeris::Ephemeris;
use crate::gnss::epoch::{EpochView, Observation};
use crate::gnss::orbit::SatelliteState;
use crate::gnss::orbit::store::EphemerisStore;
use crate::gnss::satellite::SatelliteId;
use crate::gnss::time::GpsTime;
use heapless::Vec;

/// Rows of up to `N` satellites: the workspace of single points.
pub type Rows<const N: usize> = Vec<Row, N>;

/// Pseudoranges that a receiver on or near the Earth can measure, its clock within 30 ms `[m]`. (Medium orbits are
/// 19 000–26 000 km away, geostationary ones up to 42 000 km.)
const PSEUDORANGES: core::ops::RangeInclusive<f64> = 1.0e7..=5.1e7;
/// A satellite that claims a worse accuracy than this is not used `[m]`.
const MAX_ACCURACY: f64 = 100.0;
/// Accuracy of satellites that do not claim one (GLONASS) `[m]`.
const UNKNOWN_ACCURACY: f64 = 5.0;
/// Tracking modes of a band, best first: those that the broadcast clocks and group delays refer to.
const ATTRIBUTES: &[u8] = b"CPIXLSZQBAWYMND ";

/// A satellite's measurements with all that is needed to use them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Row {
    /// Whose.
    pub satellite: SatelliteId,
    /// The satellite when it sent the signal.
    pub state: SatelliteState,
    /// Code, corrected for the satellite's group delay `[m]`.
    pub code: f64,
    /// Variance of `code` and of its model `[m²]`.
    pub code_variance: f64,
    /// Carrier frequency `[Hz]`.
    pub frequency: f64,
    /// Doppler `[Hz]`, positive approaching.
    pub doppler: Option<f64>,
    /// Variance of Doppler as a range rate `[m²/s²]`.
    pub doppler_variance: f64,
    /// Carrier to noise density `[dB-Hz]`.
    pub cn0: Option<f32>,
    /// Accuracy that the satellite claims for its orbit and clock `[m]`.
    pub accuracy: f64,
}

/// Fills `rows` from an epoch. Variances are those of an unknown elevation.
pub fn prepare<const E: usize, const N: usize>(
    epoch: EpochView<'_>,
    ephemerides: &EphemerisStore<E>,
    config: &Config,
    rows: &mut Rows<N>,
) {
    rows.clear();
    for observation in preferred(epoch, config) {
        let ephemeris = ephemerides.select(observation.satellite, epoch.time, &config.ephemerides);
        let Some(row) = ephemeris.and_then(|ephemeris| row(observation, ephemeris, epoch.time, config)) else {
            continue;
        };
        if rows.push(row).is_err() {
            break;
        }
    }
}

/// The observation to use of each satellite.
fn preferred<'a>(epoch: EpochView<'a>, config: &'a Config) -> impl Iterator<Item = &'a Observation> {
    let usable = |o: &Observation| {
        config.bands.get(o.satellite.constellation().index()) == Some(&o.signal.band())
            && o.code.is_some_and(|code| PSEUDORANGES.contains(&code))
    };
    let rank = |o: &Observation| ATTRIBUTES.iter().position(|&a| a == o.signal.attribute()).unwrap_or(usize::MAX);
    epoch.observations.iter().enumerate().filter_map(move |(at, observation)| {
        let better = |(other_at, other): (usize, &Observation)| {
            other.satellite == observation.satellite
                && (rank(other), other_at) < (rank(observation), at)
                && usable(other)
        };
        let best = usable(observation) && !epoch.observations.iter().enumerate().any(better);
        best.then_some(observation)
    })
}

fn row(observation: &Observation, ephemeris: &Ephemeris, time: GpsTime, config: &Config) -> Option<Row> {
    let code = observation.code?;
    let (accuracy, channel) = match ephemeris {
        Ephemeris::Kepler(kepler) => (kepler.accuracy, None),
        Ephemeris::Glonass(glonass) => (UNKNOWN_ACCURACY, Some(glonass.channel)),
    };
    if !ephemeris.healthy() || accuracy > MAX_ACCURACY {
        return None;
    }
    let group_delay = SPEED_OF_LIGHT * ephemeris.group_delay(observation.signal)?;
    let mut row = Row {
        satellite: observation.satellite,
        state: ephemeris.state_at_transmission(time, code).ok()?,
        code: code - group_delay,
        code_variance: 0.0,
        frequency: observation.signal.frequency(observation.satellite.constellation(), channel)?,
        doppler: observation.doppler.filter(|doppler| doppler.is_finite()),
        doppler_variance: 0.0,
        cn0: observation.cn0,
        accuracy: if accuracy > 0.0 { accuracy } else { UNKNOWN_ACCURACY },
    };
    row.code_variance = config.noise.coarse_code_variance(&row);
    row.doppler_variance = config.noise.doppler_variance(&row, core::f64::consts::FRAC_PI_4);
    Some(row)
}
