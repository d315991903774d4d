//! Biases of satellites' signals: what they mean, and how to take them out of observations.
//!
//! Sign: *observed = true + bias*, for code and phase alike, in metres. An absolute bias (OSB of Bias-SINEX: S. Schaer,
//! *SINEX_BIAS – Solution (Software/technique) INdependent EXchange Format for GNSS Biases*, version 1.00, 2016) is
//! **subtracted** from the observation of its signal. A difference (DSB there, DCB of CODE's monthly files) is
//! bias(first) − bias(second): P1C1 is bias(P1) − bias(C1), so that C1 + P1C1 is consistent with P1.
//!
//! Absolute biases only exist against a clock. Satellite clocks of precise products and of the broadcast contain the
//! ionosphere-free biases of a pair of signals ([`clock_references`]): of these, α B₁ + β B₂ = 0 with
//! α = f₁²/(f₁² − f₂²), β = −f₂²/(f₁² − f₂²). [`absolute`] makes absolute biases of differences so that this holds:
//! with D = B₁ − B₂, B₁ = β D and B₂ = −α D, and the other signals follow along the differences that link them.
//!
//! Absolute biases of a product are subtracted from *all* signals, those of the pair too: where the clocks are made from
//! phases (CODE's repro3 and its products with phase biases), the pair's biases cancel on average over the satellites
//! only; those of single satellites were found up to 0.8 ns in the ionosphere-free combination. Differences cannot
//! tell that, nor how two pairs of one constellation differ (Galileo's 1X/5X and 1C/5Q: 0.23 ns rms in CODE's products).
//!
//! Biases and clocks must come from the same product, or from products with the same reference pair. Cost: a look-up is a
//! binary search; [`absolute`] walks the differences of a satellite at most 24 times. Panic contract: none.

use super::satellite::{Constellation, SatelliteId};
use super::signal::Signal;
use heapless::Vec;

/// Most signals of one satellite that [`absolute`] can link.
const MOST_SIGNALS: usize = 24;

/// Code or carrier phase.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Observable {
    /// Pseudorange.
    Code,
    /// Carrier phase.
    Phase,
}

/// What a bias belongs to, in the order of sorted lists.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BiasKey {
    /// The satellite.
    pub satellite: SatelliteId,
    /// Code or phase.
    pub observable: Observable,
    /// The signal.
    pub signal: Signal,
}

/// The absolute bias of a signal of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct AbsoluteBias {
    /// What it belongs to.
    pub key: BiasKey,
    /// Observed minus true `[m]`: subtract it.
    pub value: f64,
}

/// The difference of two code biases of a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct BiasDifference {
    /// The first signal.
    pub first: Signal,
    /// The second signal.
    pub second: Signal,
    /// bias(first) − bias(second) `[m]`.
    pub value: f64,
}

/// The bias of `key` in a list sorted by key, or else that of the signal that stands in for it ([`stand_in`]).
pub fn find(sorted: &[AbsoluteBias], key: BiasKey) -> Option<f64> {
    let exactly = |key: BiasKey| {
        let at = sorted.binary_search_by_key(&key, |bias| bias.key).ok()?;
        sorted.get(at).map(|bias| bias.value)
    };
    let other = || stand_in(key.satellite.constellation(), key.signal).map(|signal| BiasKey { signal, ..key });
    exactly(key).or_else(|| exactly(other()?))
}

/// Absolute biases of up to `N` signals, in fixed memory: 24 N bytes. Some 200 for the codes of two constellations.
#[derive(Clone, Debug, Default)]
pub struct BiasTable<const N: usize> {
    /// Sorted by key.
    biases: Vec<AbsoluteBias, N>,
}

impl<const N: usize> BiasTable<N> {
    /// An empty table.
    pub const fn new() -> Self {
        Self { biases: Vec::new() }
    }

    /// Takes a bias in, in the place of one with the same key if there is one. Gives it back if the table is full.
    pub fn insert(&mut self, bias: AbsoluteBias) -> Result<(), AbsoluteBias> {
        match self.biases.binary_search_by_key(&bias.key, |bias| bias.key) {
            Ok(at) => {
                if let Some(old) = self.biases.get_mut(at) {
                    *old = bias;
                }
                Ok(())
            }
            Err(at) => self.biases.insert(at, bias),
        }
    }

    /// The bias of `key` `[m]`, as [`find`] has it.
    pub fn get(&self, key: BiasKey) -> Option<f64> {
        find(&self.biases, key)
    }

    /// All biases, sorted by key.
    pub fn as_slice(&self) -> &[AbsoluteBias] {
        &self.biases
    }

    /// Forgets all biases.
    pub fn clear(&mut self) {
        self.biases.clear();
    }
}

/// A signal that is as good as another where that one's bias is not listed: L2C of GPS and QZSS by any component for the
/// `2C` of CODE's products, and P(Y) of GPS for however a receiver tracks it.
pub fn stand_in(constellation: Constellation, signal: Signal) -> Option<Signal> {
    use Constellation::{Gps, Qzss};
    match (constellation, signal.band(), signal.attribute()) {
        (Gps | Qzss, b'2', b'L' | b'S' | b'X') => Signal::new(b'2', b'C'),
        (Gps, band @ (b'1' | b'2'), b'P' | b'Y') => Signal::new(band, b'W'),
        _ => None,
    }
}

const fn pair(first: [u8; 2], second: [u8; 2]) -> [Signal; 2] {
    let ([band, attribute], [other_band, other_attribute]) = (first, second);
    match (Signal::new(band, attribute), Signal::new(other_band, other_attribute)) {
        (Some(first), Some(second)) => [first, second],
        _ => panic!("not a pair of signals"),
    }
}

const GPS: [[Signal; 2]; 1] = const { [pair(*b"1W", *b"2W")] };
const GALILEO: [[Signal; 2]; 2] = const { [pair(*b"1C", *b"5Q"), pair(*b"1X", *b"5X")] };
const BEIDOU: [[Signal; 2]; 2] = const { [pair(*b"2I", *b"6I"), pair(*b"2I", *b"7I")] };
const QZSS: [[Signal; 2]; 3] = const { [pair(*b"1C", *b"2L"), pair(*b"1X", *b"2X"), pair(*b"1C", *b"5Q")] };
const GLONASS: [[Signal; 2]; 1] = const { [pair(*b"1P", *b"2P")] };

/// The pairs of signals that satellite clocks of IGS products refer to, the usual one first; a later one is for signals
/// that no difference links to an earlier one (Galileo receivers track either pilots or both components).
pub const fn clock_references(constellation: Constellation) -> &'static [[Signal; 2]] {
    match constellation {
        Constellation::Gps => &GPS,
        Constellation::Galileo => &GALILEO,
        Constellation::BeiDou => &BEIDOU,
        Constellation::Qzss => &QZSS,
        Constellation::Glonass => &GLONASS,
    }
}

/// Absolute code biases `[m]` of all signals of a satellite that `differences` links to one of the `references` of its
/// clocks ([`clock_references`]).
///
/// Where a pair's own difference is not among them (CODE's P1C1 alone), both of its biases count as 0: combinations of
/// the pair are right all the same, while the uncombined observations keep β D and −α D, which an estimated ionosphere
/// takes up. Differences that contradict each other around a loop are not adjusted: the first that reaches a signal holds.
pub fn absolute(
    constellation: Constellation,
    references: &[[Signal; 2]],
    differences: &[BiasDifference],
) -> Vec<(Signal, f64), MOST_SIGNALS> {
    let mut known = Vec::new();
    for &[first, second] in references {
        let of_pair = |signal: Signal| signal == first || signal == second;
        let linked = differences.iter().any(|difference| of_pair(difference.first) || of_pair(difference.second));
        if !linked || known.iter().any(|&(signal, _)| of_pair(signal)) {
            continue;
        }
        let start = known.len();
        let _ = known.push((first, 0.0)); // (a full list knows enough)
        spread(&mut known, differences);
        match of(&known, second) {
            Some(bias) => {
                let shift = ionosphere_free_shift(constellation, [first, second]).unwrap_or(0.0) * -bias;
                known.iter_mut().skip(start).for_each(|(_, value)| *value += shift);
            }
            None => {
                let _ = known.push((second, 0.0));
                spread(&mut known, differences);
            }
        }
    }
    known
}

/// β of a pair: −f₂²/(f₁² − f₂²). (The ratio of GLONASS' frequencies is 9/7 in each channel.)
fn ionosphere_free_shift(constellation: Constellation, [first, second]: [Signal; 2]) -> Option<f64> {
    let square = |signal: Signal| signal.frequency(constellation, Some(0)).map(|hz| hz * hz);
    let (first, second) = (square(first)?, square(second)?);
    (first != second).then(|| -second / (first - second))
}

fn of(known: &[(Signal, f64)], signal: Signal) -> Option<f64> {
    known.iter().find(|entry| entry.0 == signal).map(|entry| entry.1)
}

/// Follows the differences from the signals that are known, until nothing more is reached.
fn spread(known: &mut Vec<(Signal, f64), MOST_SIGNALS>, differences: &[BiasDifference]) {
    for _ in 0..MOST_SIGNALS {
        let before = known.len();
        for &BiasDifference { first, second, value } in differences {
            let reached = match (of(known, first), of(known, second)) {
                (Some(bias), None) => (second, bias - value),
                (None, Some(bias)) => (first, bias + value),
                _ => continue,
            };
            if known.push(reached).is_err() {
                return;
            }
        }
        if known.len() == before {
            return;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn signal(text: &str) -> Signal {
        text.parse().unwrap()
    }

    fn difference(first: &str, second: &str, value: f64) -> BiasDifference {
        BiasDifference { first: signal(first), second: signal(second), value }
    }

    fn of_gps(differences: &[BiasDifference]) -> Vec<(Signal, f64), MOST_SIGNALS> {
        absolute(Constellation::Gps, clock_references(Constellation::Gps), differences)
    }

    #[test]
    fn p1c1_alone_makes_c1_consistent_with_p1() {
        // P1 − C1 = 0.4 m: C1 − bias(C1) must be C1 + 0.4 m.
        let biases = of_gps(&[difference("1W", "1C", 0.4)]);
        assert_eq!(of(&biases, signal("1C")), Some(-0.4));
        assert_eq!((of(&biases, signal("1W")), of(&biases, signal("2W"))), (Some(0.0), Some(0.0)));
        assert_eq!(of(&biases, signal("5Q")), None);
    }

    #[test]
    fn p1p2_gives_what_single_frequency_users_subtract() {
        // RTKLIB (pntpos.c, prange): P1 − P1P2/(1 − γ), γ = (f1/f2)² = (77/60)².
        let gamma = 77.0 * 77.0 / 3_600.0;
        let biases = of_gps(&[difference("2W", "2C", -0.1), difference("1W", "2W", 2.0), difference("1W", "1C", 0.3)]);
        let b = |text| of(&biases, signal(text)).unwrap();
        assert!((b("1W") - 2.0 / (1.0 - gamma)).abs() < 1e-12);
        assert!((b("1W") - b("2W") - 2.0).abs() < 1e-12);
        assert!((gamma * b("1W") - b("2W")).abs() < 1e-12);
        assert!((b("1C") - (b("1W") - 0.3)).abs() < 1e-12 && (b("2C") - (b("2W") + 0.1)).abs() < 1e-12);
    }

    #[test]
    fn galileo_has_a_datum_for_each_kind_of_receiver() {
        let differences = [difference("1X", "5X", 1.0), difference("1C", "5Q", -2.0), difference("1C", "7Q", 0.5)];
        let biases = absolute(Constellation::Galileo, clock_references(Constellation::Galileo), &differences);
        let b = |text| of(&biases, signal(text)).unwrap();
        let (f1, f5) = (154.0 * 154.0, 115.0 * 115.0);
        assert!((f1 * b("1X") - f5 * b("5X")).abs() < 1e-9 && (f1 * b("1C") - f5 * b("5Q")).abs() < 1e-9);
        assert!((b("1X") - b("5X") - 1.0).abs() < 1e-12 && (b("1C") - b("7Q") - 0.5).abs() < 1e-12);
        assert!(absolute(Constellation::Galileo, clock_references(Constellation::Galileo), &[]).is_empty());
    }

    #[test]
    fn a_table_holds_as_many_as_fit_and_finds_stand_ins() {
        let key = |satellite: &str, text| BiasKey {
            satellite: satellite.parse().unwrap(),
            observable: Observable::Code,
            signal: signal(text),
        };
        let bias = |satellite, text, value| AbsoluteBias { key: key(satellite, text), value };
        let mut table = BiasTable::<2>::new();
        assert_eq!(table.insert(bias("G05", "2C", 1.0)), Ok(()));
        assert_eq!(table.insert(bias("G01", "1W", 2.0)), Ok(()));
        assert_eq!(table.insert(bias("G05", "2C", 3.0)), Ok(()));
        assert_eq!(table.insert(bias("G09", "1C", 4.0)), Err(bias("G09", "1C", 4.0)));
        assert_eq!(table.get(key("G05", "2L")), Some(3.0));
        assert_eq!(table.get(key("G01", "1P")), Some(2.0));
        assert_eq!(table.get(key("G01", "1C")), None);
        assert_eq!(table.get(BiasKey { observable: Observable::Phase, ..key("G05", "2C") }), None);
    }

    proptest! {
        /// Differences of any absolute biases give them back, up to what the clock takes up.
        #[test]
        fn differences_of_absolute_biases_come_back(
            values in prop::collection::vec(-10.0..10.0f64, 6), order in Just([0_usize, 1, 2, 3, 4]).prop_shuffle(),
        ) {
            let names = ["1W", "2W", "1C", "2C", "5Q", "5X"];
            // A chain 1W-2W-1C-2C-5Q-5X, its links in any order.
            let links: std::vec::Vec<BiasDifference> = order
                .iter()
                .map(|&i| difference(names[i], names[i + 1], values[i] - values[i + 1]))
                .collect();
            let biases = of_gps(&links);
            let (f1, f2) = (77.0 * 77.0, 3_600.0);
            let clock = (f1 * values[0] - f2 * values[1]) / (f1 - f2);
            for (name, value) in names.iter().zip(&values) {
                prop_assert!((of(&biases, signal(name)).unwrap() - (value - clock)).abs() < 1e-9);
            }
        }

        #[test]
        fn takes_anything(links in prop::collection::vec((b'1'..=b'9', b'A'..=b'Z', b'1'..=b'9', b'A'..=b'Z', any::<f64>()), 0..60)) {
            let links: std::vec::Vec<BiasDifference> = links
                .iter()
                .map(|&(a, b, c, d, value)| BiasDifference {
                    first: Signal::new(a, b).unwrap(),
                    second: Signal::new(c, d).unwrap(),
                    value,
                })
                .collect();
            for constellation in Constellation::ALL {
                let _ = absolute(constellation, clock_references(constellation), &links);
            }
        }
    }
}
