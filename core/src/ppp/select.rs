//! From the observations of an epoch to one pair of bands a satellite.
//!
//! Codes are chosen so that they fit the clocks of precise products, which refer to the P(Y) codes of GPS and GLONASS, unless
//! biases are at hand; phases so that they are tracked best. Panic contract: none; what is incomplete is left out.

use crate::gnss::epoch::Observation;
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::signal::Signal;
use crate::model::combination::FrequencyPair;
use heapless::Vec;

/// The two bands used of each constellation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BandPairs {
    /// RINEX band digits as ASCII by [`Constellation::index`], 0 and 0 where a constellation is not used.
    pub bands: [[u8; 2]; 5],
}

impl BandPairs {
    /// L1/L2, E1/E5a, B1I/B3I, L1/L2, G1/G2: what clocks of most analysis centres refer to.
    pub const DEFAULT: Self = Self { bands: [*b"12", *b"15", *b"26", *b"12", *b"12"] };

    /// Bands of a constellation, `None` where it is not used.
    pub fn of(&self, constellation: Constellation) -> Option<[u8; 2]> {
        self.bands.get(constellation.index()).copied().filter(|[a, b]| *a != 0 && *b != 0 && a != b)
    }

    /// Leaves out a constellation.
    pub fn without(mut self, constellation: Constellation) -> Self {
        if let Some(bands) = self.bands.get_mut(constellation.index()) {
            *bands = [0, 0];
        }
        self
    }
}

/// One band of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BandReading {
    /// The signal whose code is used.
    pub code_signal: Signal,
    /// The signal whose phase is used.
    pub phase_signal: Signal,
    /// Carrier frequency `[Hz]`.
    pub frequency: f64,
    /// Code `[m]`.
    pub code: f64,
    /// Phase `[cycles]`.
    pub phase: f64,
    /// Lock may have been lost, or half a cycle is open.
    pub loss_of_lock: bool,
    /// Carrier to noise density `[dB-Hz]`.
    pub cn0: Option<f32>,
}

/// Both bands of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PairReading {
    /// Whose.
    pub satellite: SatelliteId,
    /// The two bands, codes and phases complete.
    pub bands: [BandReading; 2],
    /// Their frequencies.
    pub pair: FrequencyPair,
}

impl PairReading {
    /// Codes `[m]`.
    pub fn codes(&self) -> [f64; 2] {
        self.bands.map(|band| band.code)
    }

    /// Phases `[cycles]`.
    pub fn cycles(&self) -> [f64; 2] {
        self.bands.map(|band| band.phase)
    }

    /// Phases `[m]`.
    pub fn phases(&self) -> [f64; 2] {
        self.pair.metres(self.cycles())
    }
}

/// Pseudoranges that a receiver on or near the Earth can measure, its clock within 30 ms `[m]`.
const PSEUDORANGES: core::ops::RangeInclusive<f64> = 1.0e7..=5.1e7;
/// Phases that can be kept to the millimetre in `f64` `[cycles]`.
const PHASES: core::ops::RangeInclusive<f64> = -1e11..=1e11;
/// The two codes of a satellite differ by no more than this `[m]`: the ionosphere and the receiver.
const CODES_APART: f64 = 300.0;

/// Attributes of a band in the order in which their *codes* are taken where nothing is known of their biases: those that the
/// clocks refer to first.
fn code_order(constellation: Constellation, band: u8) -> &'static [u8] {
    match (constellation, band) {
        (Constellation::Gps, b'1') => b"WPYCLXSMND",
        (Constellation::Gps, b'2') => b"WPYCLXSDMN",
        (Constellation::Glonass, _) => b"PC",
        (Constellation::Galileo, b'1') => b"CXBZA",
        (Constellation::BeiDou, _) => b"IXQDPAN",
        _ => b"CQXILSPWZDBAYMN",
    }
}

/// Attributes of a band in the order in which their *phases* are taken: signals tracked without a secret code first.
fn phase_order(constellation: Constellation, band: u8) -> &'static [u8] {
    match (constellation, band) {
        (Constellation::Gps, b'1') => b"CLXSWPYMND",
        (Constellation::Gps, b'2') => b"WPYCLXSDMN",
        (Constellation::Glonass, _) => b"CP",
        _ => code_order(constellation, band),
    }
}

/// The same where the biases of the codes are known: those of GPS that are tracked without a secret code have less noise.
fn corrected_order(constellation: Constellation, band: u8) -> &'static [u8] {
    match (constellation, band) {
        (Constellation::Gps, b'1' | b'2') => b"CLXSWPYDMN",
        _ => code_order(constellation, band),
    }
}

fn rank(order: &[u8], signal: Signal) -> usize {
    order.iter().position(|&attribute| attribute == signal.attribute()).unwrap_or(order.len())
}

/// The band of a satellite, if one of its signals has a code and one a phase.
fn band_of(
    observations: &[Observation],
    satellite: SatelliteId,
    band: u8,
    channel: Option<i8>,
    has_bias: &dyn Fn(SatelliteId, Signal) -> bool,
) -> Option<BandReading> {
    let constellation = satellite.constellation();
    let own = || observations.iter().filter(|o| o.satellite == satellite && o.signal.band() == band);
    // A code that the products can correct comes before one that they cannot.
    let of_code = |o: &Observation| {
        let corrected = has_bias(satellite, o.signal);
        let order = if corrected { corrected_order(constellation, band) } else { code_order(constellation, band) };
        (!corrected, rank(order, o.signal))
    };
    let code = own().filter(|o| o.code.is_some_and(|code| PSEUDORANGES.contains(&code))).min_by_key(|o| of_code(o))?;
    let phases = phase_order(constellation, band);
    let phase = own()
        .filter(|o| o.phase.is_some_and(|phase| phase != 0.0 && PHASES.contains(&phase)))
        .min_by_key(|o| rank(phases, o.signal))?;
    Some(BandReading {
        code_signal: code.signal,
        phase_signal: phase.signal,
        frequency: phase.signal.frequency(constellation, channel)?,
        code: code.code?,
        phase: phase.phase?,
        loss_of_lock: phase.loss_of_lock || phase.half_cycle,
        cn0: phase.cn0,
    })
}

/// Fills `pairs` with the satellites of which both bands are complete; returns how many found no room.
///
/// `channel` gives GLONASS channels by slot number; `has_bias` tells whether products can correct a code.
pub fn select<const S: usize>(
    observations: &[Observation],
    plan: &BandPairs,
    channel: impl Fn(SatelliteId) -> Option<i8>,
    has_bias: &dyn Fn(SatelliteId, Signal) -> bool,
    pairs: &mut Vec<PairReading, S>,
) -> usize {
    pairs.clear();
    let mut overflow = 0;
    for observation in observations {
        let satellite = observation.satellite;
        let Some([first, second]) = plan.of(satellite.constellation()) else { continue };
        if observation.signal.band() != first || pairs.iter().any(|pair| pair.satellite == satellite) {
            continue;
        }
        let read = |band| band_of(observations, satellite, band, channel(satellite), has_bias);
        // BeiDou-2 sends no B3I that all receivers track: B2I instead.
        let second = read(second).or_else(|| match (satellite.constellation(), second) {
            (Constellation::BeiDou, b'6') => read(b'7'),
            _ => None,
        });
        let (Some(first), Some(second)) = (read(first), second) else { continue };
        let Some(pair) = FrequencyPair::new(first.frequency, second.frequency) else { continue };
        if libm::fabs(first.code - second.code) > CODES_APART {
            continue;
        }
        overflow += usize::from(pairs.push(PairReading { satellite, bands: [first, second], pair }).is_err());
    }
    overflow
}

#[cfg(test)]
mod tests {
    use super::*;

    fn observation(satellite: &str, signal: &str, code: f64) -> Observation {
        let mut observation = Observation::new(satellite.parse().unwrap(), signal.parse().unwrap());
        observation.code = Some(code);
        observation.phase = Some(code * 5.0);
        observation
    }

    fn chosen(observations: &[Observation], biases: &[&str]) -> heapless::Vec<PairReading, 8> {
        let mut pairs = heapless::Vec::new();
        let has_bias = |_: SatelliteId, signal: Signal| biases.contains(&signal.to_string().as_str());
        assert_eq!(select(observations, &BandPairs::DEFAULT, |_| Some(1), &has_bias, &mut pairs), 0);
        pairs
    }

    #[test]
    fn codes_fit_the_clocks_and_phases_are_those_tracked_best() {
        let all = [observation("G01", "1C", 2.1e7), observation("G01", "1W", 2.1e7), observation("G01", "2W", 2.1e7)];
        let pair = chosen(&all, &[])[0];
        let names = |band: BandReading| (band.code_signal.to_string(), band.phase_signal.to_string());
        assert_eq!(names(pair.bands[0]), ("1W".into(), "1C".into()));
        assert_eq!(names(chosen(&all, &["1C"])[0].bands[0]), ("1C".into(), "1C".into()));
        assert_eq!(names(chosen(&all, &["1W"])[0].bands[0]), ("1W".into(), "1C".into()));
        // Corrected, the civil code is the better one.
        assert_eq!(names(chosen(&all, &["1C", "1W"])[0].bands[0]), ("1C".into(), "1C".into()));
    }

    #[test]
    fn what_is_incomplete_or_absurd_is_left_out() {
        let mut all =
            vec![observation("G01", "1C", 2.1e7), observation("G02", "1C", 2.1e7), observation("E05", "1C", 9.0)];
        all.push(observation("G02", "2W", 2.2e7));
        all.push(observation("E05", "5Q", 2.2e7));
        assert!(chosen(&all, &[]).is_empty());
        all[3].code = Some(2.1e7 + 5.0);
        assert_eq!(chosen(&all, &[]).len(), 1);
        all[3].phase = Some(f64::NAN);
        assert!(chosen(&all, &[]).is_empty());
    }

    #[test]
    fn beidou_falls_back_to_its_second_pair() {
        let all = [observation("C06", "2I", 3.9e7), observation("C06", "7I", 3.9e7)];
        assert_eq!(chosen(&all, &[])[0].bands[1].phase_signal.to_string(), "7I");
    }

    #[test]
    fn a_full_list_is_counted() {
        let all: Vec<Observation> =
            ["G01", "G02"].iter().flat_map(|s| [observation(s, "1C", 2.1e7), observation(s, "2W", 2.1e7)]).collect();
        let mut pairs = heapless::Vec::<PairReading, 1>::new();
        assert_eq!(select(&all, &BandPairs::DEFAULT, |_| None, &|_, _| false, &mut pairs), 1);
    }

    use std::vec::Vec;
}
