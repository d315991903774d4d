//! The ephemerides at hand, and which of them to use for a satellite at a time.
//!
//! Selection: the smallest |t − toe| within a [`SelectionRule`]; of two equally near ones, the later. Health plays no
//! part: exclude satellites by [`Ephemeris::healthy`] of what is selected, so that an unhealthy satellite is not used
//! with an older, healthy message.
//!
//! Cost: `select` is a binary search and a walk over one satellite's messages; `insert` moves at most N two-byte
//! indices, and looks at all N messages only when the store is full. About 290 N bytes. Panic contract: none.

use crate::gnss::ephemeris::{Ephemeris, NavigationMessage};
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::time::GpsTime;
use core::cmp::Ordering;
use heapless::Vec;

/// Which Galileo message to use; their clocks and group delays differ, so they must not be mixed within an epoch's
/// differences.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum GalileoMessage {
    /// I/NAV only: clock for E1/E5b.
    #[default]
    Inav,
    /// F/NAV only: clock for E1/E5a.
    Fnav,
    /// I/NAV, and F/NAV for satellites without a usable I/NAV message.
    InavElseFnav,
}

/// Which ephemerides may be used how far from their reference time.
///
/// Both limits are by [`Constellation::index`]: an ephemeris is usable at t if −`future` ≤ t − toe ≤ `past`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SelectionRule {
    /// Greatest age t − toe `[s]`.
    pub past: [f64; 5],
    /// Greatest lead toe − t `[s]`.
    pub future: [f64; 5],
    /// Galileo message.
    pub galileo: GalileoMessage,
}

impl SelectionRule {
    /// The default. GPS and QZSS: half the nominal fit interval of 4 h. Galileo: validity of 4 h after toe. BeiDou: 2 h
    /// (6 h, as RTKLIB has it, gives errors up to 160 m). GLONASS: 30 min, twice the half interval of tb.
    ///
    /// A toe ahead of t occurs in post-processing, and in real time for GPS, QZSS and GLONASS, which broadcast it ahead.
    pub const SAFE: Self = Self {
        past: [7_200.0, 14_400.0, 7_200.0, 7_200.0, 1_800.0],
        future: [7_200.0, 3_600.0, 7_200.0, 7_200.0, 1_800.0],
        galileo: GalileoMessage::Inav,
    };

    /// What RTKLIB demo5 2.5.1 does, for comparisons with it: toe of Galileo must be before t, be it by a nanosecond.
    pub const RTKLIB: Self = Self {
        past: [7_201.0, 14_400.0, 21_601.0, 7_201.0, 1_800.0],
        future: [7_201.0, -1e-9, 21_601.0, 7_201.0, 1_800.0],
        galileo: GalileoMessage::Inav,
    };

    /// Whether an ephemeris may be used at `time`, the Galileo message left aside.
    fn allows(&self, ephemeris: &Ephemeris, time: GpsTime) -> bool {
        let constellation = ephemeris.satellite().constellation().index();
        let age = time.since(ephemeris.toe());
        age <= self.past[constellation] && -age <= self.future[constellation]
    }

    /// The messages to look for, in order.
    const fn messages(&self, constellation: Constellation) -> &'static [NavigationMessage] {
        use NavigationMessage::{D1D2, Fnav, Inav, Lnav};
        match (constellation, self.galileo) {
            (Constellation::Gps | Constellation::Qzss | Constellation::Glonass, _) => &[Lnav],
            (Constellation::BeiDou, _) => &[D1D2],
            (Constellation::Galileo, GalileoMessage::Inav) => &[Inav],
            (Constellation::Galileo, GalileoMessage::Fnav) => &[Fnav],
            (Constellation::Galileo, GalileoMessage::InavElseFnav) => &[Inav, Fnav],
        }
    }
}

impl Default for SelectionRule {
    fn default() -> Self {
        Self::SAFE
    }
}

/// What became of an ephemeris given to [`EphemerisStore::insert`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Inserted {
    /// It is new.
    Added,
    /// It took the place of one of the same satellite, message and toe.
    Replaced,
    /// It is new, and for it an older one, of the satellite given, was dropped.
    Evicted(SatelliteId),
    /// The store is full and it is the least useful itself.
    Refused,
}

/// Up to `N` ephemerides of any satellites, N ≤ 65535. Two or three per satellite are enough for real time (the current
/// one, the next one, the other Galileo message).
#[derive(Clone, Debug)]
pub struct EphemerisStore<const N: usize> {
    /// In no order; never shrinks.
    ephemerides: Vec<Ephemeris, N>,
    /// Indices into `ephemerides`, sorted by [`Key`].
    order: Vec<u16, N>,
}

/// Satellite, message and toe: no two ephemerides in a store have the same.
type Key = (SatelliteId, u8, GpsTime);

fn key(ephemeris: &Ephemeris) -> Key {
    let message = match ephemeris {
        Ephemeris::Kepler(kepler) => kepler.message,
        Ephemeris::Glonass(_) => NavigationMessage::Lnav,
    };
    (ephemeris.satellite(), message as u8, ephemeris.toe())
}

impl<const N: usize> EphemerisStore<N> {
    const CAPACITY_IS_INDEXABLE: () = assert!(N <= u16::MAX as usize, "an EphemerisStore holds at most 65535");

    /// An empty store.
    pub const fn new() -> Self {
        let () = Self::CAPACITY_IS_INDEXABLE;
        Self { ephemerides: Vec::new(), order: Vec::new() }
    }

    /// Number of ephemerides held.
    pub fn len(&self) -> usize {
        self.order.len()
    }

    /// Whether none is held.
    pub fn is_empty(&self) -> bool {
        self.order.is_empty()
    }

    /// Forgets all.
    pub fn clear(&mut self) {
        self.ephemerides.clear();
        self.order.clear();
    }

    /// All, by satellite, message and toe.
    pub fn iter(&self) -> impl DoubleEndedIterator<Item = &Ephemeris> {
        self.order.iter().filter_map(|&slot| self.ephemerides.get(usize::from(slot)))
    }

    /// Adds an ephemeris. One of the same satellite, message and toe is replaced, for the satellite may have corrected
    /// itself. When full, the oldest (by toe) of those satellites and messages that are held several times makes room;
    /// if there are none, the oldest of all.
    pub fn insert(&mut self, ephemeris: Ephemeris) -> Inserted {
        let key_of = key(&ephemeris);
        match self.search(&key_of) {
            Ok(at) => {
                if let Some(held) = self.at_mut(at) {
                    *held = ephemeris;
                }
                Inserted::Replaced
            }
            Err(at) => match self.ephemerides.push(ephemeris) {
                Ok(()) => {
                    // `order` is as long as `ephemerides` was, so there is room in it.
                    let slot = (self.ephemerides.len() - 1) as u16;
                    let _ = self.order.insert(at, slot);
                    Inserted::Added
                }
                Err(_) => self.insert_into_full(ephemeris, at),
            },
        }
    }

    /// The ephemeris to use for a satellite at a time.
    pub fn select(&self, satellite: SatelliteId, time: GpsTime, rule: &SelectionRule) -> Option<&Ephemeris> {
        rule.messages(satellite.constellation()).iter().find_map(|&message| {
            let from = self.search(&(satellite, message as u8, GpsTime::from_nanoseconds(i64::MIN)));
            let from = from.unwrap_or_else(|at| at);
            self.order
                .get(from..)?
                .iter()
                .filter_map(|&slot| self.ephemerides.get(usize::from(slot)))
                .take_while(|e| (e.satellite(), key(e).1) == (satellite, message as u8))
                .filter(|e| rule.allows(e, time))
                // In order of toe: of equally near ones the later stays.
                .reduce(|best, e| if distance(e, time) <= distance(best, time) { e } else { best })
        })
    }

    /// Frequency channel of a GLONASS satellite, from the latest of its ephemerides.
    pub fn glonass_channel(&self, satellite: SatelliteId) -> Option<i8> {
        self.iter().rev().find_map(|ephemeris| match ephemeris {
            Ephemeris::Glonass(glonass) if glonass.satellite == satellite => Some(glonass.channel),
            _ => None,
        })
    }

    /// Where in `order` a key is, or belongs.
    fn search(&self, sought: &Key) -> Result<usize, usize> {
        self.order.binary_search_by(|&slot| match self.ephemerides.get(usize::from(slot)) {
            Some(held) => key(held).cmp(sought),
            None => Ordering::Greater,
        })
    }

    fn at(&self, place: usize) -> Option<&Ephemeris> {
        self.order.get(place).and_then(|&slot| self.ephemerides.get(usize::from(slot)))
    }

    fn at_mut(&mut self, place: usize) -> Option<&mut Ephemeris> {
        self.order.get(place).and_then(|&slot| self.ephemerides.get_mut(usize::from(slot)))
    }

    /// Makes room for an ephemeris that belongs at `place`, or refuses it.
    fn insert_into_full(&mut self, ephemeris: Ephemeris, place: usize) -> Inserted {
        let stream = |e: &Ephemeris| (key(e).0, key(e).1);
        let new = stream(&ephemeris);
        // Whether it shares satellite and message with a neighbour in the order, the new one included.
        let is_one_of_several = |at: usize, e: &Ephemeris| {
            let like = |other: Option<&Ephemeris>| other.is_some_and(|other| stream(other) == stream(e));
            stream(e) == new || like(self.at(at + 1)) || at.checked_sub(1).is_some_and(|before| like(self.at(before)))
        };
        // The worth of an ephemeris: several before single, then by age; ties by place, for determinism.
        let worst = (0..self.len())
            .filter_map(|at| self.at(at).map(|e| ((!is_one_of_several(at, e), e.toe(), at), e.satellite())))
            .min_by_key(|&(worth, _)| worth);
        let new_is_one_of_several =
            [Some(place), place.checked_sub(1)].into_iter().flatten().any(|at| self.at(at).map(stream) == Some(new));
        match worst {
            Some(((single, toe, at), dropped)) if (single, toe) < (!new_is_one_of_several, ephemeris.toe()) => {
                let slot = self.order.remove(at);
                if let Some(held) = self.ephemerides.get_mut(usize::from(slot)) {
                    *held = ephemeris;
                }
                let _ = self.order.insert(if at < place { place - 1 } else { place }, slot);
                Inserted::Evicted(dropped)
            }
            _ => Inserted::Refused,
        }
    }
}

impl<const N: usize> Default for EphemerisStore<N> {
    fn default() -> Self {
        Self::new()
    }
}

/// |t − toe| `[s]`.
fn distance(ephemeris: &Ephemeris, time: GpsTime) -> f64 {
    libm::fabs(time.since(ephemeris.toe()))
}

#[cfg(test)]
mod tests {
    use super::super::kepler::tests::gps_g05;
    use super::*;
    use proptest::prelude::*;

    fn of(satellite: &str, message: NavigationMessage, hour: i32) -> Ephemeris {
        let toe = GpsTime::from_week_tow(2111, f64::from(hour) * 3_600.0);
        Ephemeris::Kepler(crate::gnss::ephemeris::KeplerEphemeris {
            satellite: satellite.parse().unwrap(),
            message,
            toe,
            ..gps_g05()
        })
    }

    fn hour_selected<const N: usize>(
        store: &EphemerisStore<N>,
        satellite: &str,
        tow: f64,
        rule: SelectionRule,
    ) -> Option<f64> {
        let time = GpsTime::from_week_tow(2111, tow);
        store.select(satellite.parse().unwrap(), time, &rule).map(|e| e.toe().tow() / 3_600.0)
    }

    #[test]
    fn the_nearest_is_selected_and_the_later_of_two_equally_near() {
        let mut store = EphemerisStore::<8>::new();
        for hour in [4, 0, 2] {
            assert_eq!(store.insert(of("G05", NavigationMessage::Lnav, hour)), Inserted::Added);
        }
        store.insert(of("G06", NavigationMessage::Lnav, 1));
        let select = |tow| hour_selected(&store, "G05", tow, SelectionRule::SAFE);
        assert_eq!((select(3_599.0), select(3_600.0), select(3_601.0)), (Some(0.0), Some(2.0), Some(2.0)));
        assert_eq!((select(21_600.0), select(21_601.0)), (Some(4.0), None));
        assert_eq!(hour_selected(&store, "G07", 0.0, SelectionRule::SAFE), None);
    }

    #[test]
    fn the_galileo_message_is_chosen_explicitly() {
        let mut store = EphemerisStore::<8>::new();
        store.insert(of("E01", NavigationMessage::Inav, 0));
        store.insert(of("E01", NavigationMessage::Fnav, 1));
        store.insert(of("E02", NavigationMessage::Fnav, 1));
        let select = |satellite: &str, galileo| {
            hour_selected(&store, satellite, 3_600.0, SelectionRule { galileo, ..SelectionRule::SAFE })
        };
        assert_eq!(select("E01", GalileoMessage::Inav), Some(0.0));
        assert_eq!(select("E01", GalileoMessage::Fnav), Some(1.0));
        assert_eq!(select("E01", GalileoMessage::InavElseFnav), Some(0.0));
        assert_eq!(select("E02", GalileoMessage::Inav), None);
        assert_eq!(select("E02", GalileoMessage::InavElseFnav), Some(1.0));
    }

    #[test]
    fn rtklibs_rule_takes_galileo_of_the_past_only_and_old_beidou() {
        let mut store = EphemerisStore::<8>::new();
        store.insert(of("E01", NavigationMessage::Inav, 1));
        store.insert(of("C19", NavigationMessage::D1D2, 0));
        for (satellite, tow, safe, rtklib) in [
            ("E01", 3_599.0, Some(1.0), None),
            ("E01", 3_600.0, Some(1.0), None),
            ("E01", 3_601.0, Some(1.0), Some(1.0)),
            ("C19", 7_200.0, Some(0.0), Some(0.0)),
            ("C19", 21_600.0, None, Some(0.0)),
        ] {
            assert_eq!(hour_selected(&store, satellite, tow, SelectionRule::SAFE), safe, "{satellite} {tow}");
            assert_eq!(hour_selected(&store, satellite, tow, SelectionRule::RTKLIB), rtklib, "{satellite} {tow}");
        }
    }

    #[test]
    fn a_full_store_drops_the_oldest_of_those_held_several_times() {
        let mut store = EphemerisStore::<4>::new();
        for (satellite, hour) in [("G01", 0), ("G02", 2), ("G02", 3), ("G03", 1)] {
            assert_eq!(store.insert(of(satellite, NavigationMessage::Lnav, hour)), Inserted::Added);
        }
        let g = |name: &str| name.parse().unwrap();
        // G02 is there twice: its older one goes, although G01 and G03 are older still.
        assert_eq!(store.insert(of("G04", NavigationMessage::Lnav, 4)), Inserted::Evicted(g("G02")));
        // All single now: the newcomer makes G03 one of two, so G03's older one goes.
        assert_eq!(store.insert(of("G03", NavigationMessage::Lnav, 3)), Inserted::Evicted(g("G03")));
        // All single: the oldest of all goes; what is older than all is refused.
        assert_eq!(store.insert(of("G05", NavigationMessage::Lnav, 5)), Inserted::Evicted(g("G01")));
        assert_eq!(store.insert(of("G06", NavigationMessage::Lnav, 0)), Inserted::Refused);
        assert_eq!(store.insert(of("G05", NavigationMessage::Lnav, 0)), Inserted::Refused);
        assert_eq!(store.insert(of("G05", NavigationMessage::Lnav, 5)), Inserted::Replaced);
        let held: Vec<String, 4> = store.iter().map(|e| e.satellite().to_string()).collect();
        assert_eq!(held, ["G02", "G03", "G04", "G05"]);
    }

    proptest! {
        /// Against the plain rule over all that was inserted; order and satellites as they come.
        #[test]
        fn selection_is_the_plain_rule(
            inserted in prop::collection::vec((1_u8..5, 0_i32..24), 0..40),
            number in 1_u8..5,
            tow in 0.0..90_000.0_f64,
        ) {
            let name = |number: u8| format!("G{number:02}");
            let mut store = EphemerisStore::<64>::new();
            for &(number, hour) in &inserted {
                store.insert(of(&name(number), NavigationMessage::Lnav, hour));
            }
            let plain = inserted
                .iter()
                .filter(|&&(n, _)| n == number)
                .map(|&(_, hour)| f64::from(hour))
                .filter(|hour| (tow - hour * 3_600.0).abs() <= 7_200.0)
                .min_by(|a, b| (tow - a * 3_600.0).abs().total_cmp(&(tow - b * 3_600.0).abs()));
            prop_assert_eq!(hour_selected(&store, &name(number), tow, SelectionRule::SAFE), plain);
            prop_assert!(store.iter().map(key).is_sorted());
        }

        /// A small store stays sorted, full and free of duplicates whatever is thrown at it.
        #[test]
        fn a_small_store_stays_consistent(inserted in prop::collection::vec((1_u8..5, 0_i32..24), 5..60)) {
            let mut store = EphemerisStore::<5>::new();
            for &(number, hour) in &inserted {
                let before = store.len();
                let outcome = store.insert(of(&format!("G{number:02}"), NavigationMessage::Lnav, hour));
                prop_assert_eq!(store.len(), before + usize::from(outcome == Inserted::Added));
                prop_assert!(store.iter().map(key).is_sorted_by(|a, b| a < b));
            }
        }
    }
}
