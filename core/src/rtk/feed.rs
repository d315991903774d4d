//! Feeding the filter from a device log: one door for firmware and host, so that both do the same with every record.
//!
//! Coordinates: a log names the *markers* of base and rover and the heights of their antennas above them. Inside, the
//! filter works between antenna reference points; solutions given here are of the rover's marker.

use super::{RtkConfig, RtkFilter};
use crate::gnss::geodesy::Geodetic;
use crate::gnss::satellite::Constellation;
use crate::gnss::solution::{Quality, Solution};
use crate::log::{Event, Header, Input, Station};
use nalgebra::Vector3;

/// Schema number of an [`RtkConfig`] in a device log.
pub const CONFIG_SCHEMA: u16 = 3;

impl<const C: usize, const N: usize, const E: usize> RtkFilter<C, N, E> {
    /// Takes one record of a device log. A rover epoch is answered by a solution.
    pub fn feed(&mut self, input: &Input<'_>) -> Option<Solution> {
        match input {
            Input::Header(header) => self.set_stations(header),
            Input::Config(config) if config.schema == CONFIG_SCHEMA => {
                if let Some(config) = config.value::<RtkConfig>() {
                    self.configure(config);
                }
            }
            Input::Ionosphere(ionosphere) => {
                // The parameters of GPS are the reference; others serve where it sends none.
                if ionosphere.constellation == Constellation::Gps || self.ionosphere.is_none() {
                    self.push_ionosphere(ionosphere.klobuchar);
                }
            }
            Input::Ephemeris(ephemeris) => self.push_ephemeris(*ephemeris),
            Input::Epoch(Station::Base, epoch) => {
                self.push_base(*epoch);
            }
            Input::Epoch(Station::Rover, epoch) => {
                let solution = self.push_rover(*epoch);
                return Some(self.at_marker(solution));
            }
            Input::Event(Event::Reset) => self.start_afresh(),
            Input::Config(_) | Input::Solution(_) | Input::Event(_) => {}
        }
        None
    }

    /// Where the base is, and how high the antennas stand.
    fn set_stations(&mut self, header: &Header) {
        self.rover_antenna = header.rover_antenna;
        let base_position = header.base_position.map(|marker| {
            let marker = Vector3::from(marker);
            marker + above_marker(&marker, &header.base_antenna)
        });
        // A base that moves says itself where it is.
        if !self.config.moving_base && self.base_position != base_position {
            self.base_position = base_position;
            self.start_afresh();
        }
    }

    /// The solution of the rover's antenna reference point, brought down to the marker; a vector from a moving base is one
    /// between antennas.
    fn at_marker(&self, mut solution: Solution) -> Solution {
        if solution.quality < Quality::None && solution.base.is_none() {
            solution.position = self.marker(solution.position);
        }
        solution
    }

    /// Forgets all epochs, so that earlier ones may follow; what was told of stations and satellites stays.
    fn start_afresh(&mut self) {
        self.restart();
        self.latest = None;
        self.base.time = None;
        self.base.observations.clear();
        self.base.used = false;
        self.forget_base_motion();
    }
}

/// The vector from a marker to its antenna reference point, ECEF `[m]`, for an antenna `[up, east, north]` `[m]` of it.
pub(super) fn above_marker(place: &Vector3<f64>, [up, east, north]: &[f64; 3]) -> Vector3<f64> {
    Geodetic::from_ecef(place).enu_to_ecef(&Vector3::new(*east, *north, *up))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::gnss::atmosphere::Klobuchar;
    use crate::gnss::epoch::{Epoch, Observation};
    use crate::gnss::solution::Reason;
    use crate::gnss::time::GpsTime;
    use crate::log::{InputReader, Ionosphere, MAX_FRAME, write_config};
    use crate::rtk::config::BandPlan;

    type Filter = RtkFilter<8, 17, 4>;

    /// The marker of WTZR of the real-data tests, EPN coordinate at 2020.0 `[m]`.
    const MARKER: [f64; 3] = [4_075_580.311_1, 931_854.054_3, 4_801_568.280_8];

    fn epoch(seconds: f64) -> Epoch<8> {
        let mut epoch = Epoch::new(GpsTime::from_week_tow(2100, seconds));
        let mut observation = Observation::new("G01".parse().unwrap(), "1C".parse().unwrap());
        observation.code = Some(2.1e7);
        epoch.observations.push(observation).unwrap();
        epoch
    }

    #[test]
    fn the_base_antenna_stands_above_its_marker() {
        let mut filter = Filter::new(RtkConfig::default(), None);
        let header = Header { base_position: Some(MARKER), base_antenna: [1.5, 0.2, -0.3], ..Header::default() };
        filter.feed(&Input::Header(header));
        let marker = Geodetic::from_ecef(&MARKER.into());
        let antenna = filter.base_position.unwrap();
        let up = Geodetic::from_ecef(&antenna).height - marker.height;
        let enu = marker.ecef_to_enu(&(antenna - Vector3::from(MARKER)));
        assert!((up - 1.5).abs() < 1e-7, "{up}"); // the horizontal offset adds its square over twice the Earth's radius
        assert!((enu - Vector3::new(0.2, -0.3, 1.5)).norm() < 1e-8, "{enu}");
    }

    #[test]
    fn solutions_are_of_the_marker() {
        let mut filter = Filter::new(RtkConfig::default(), None);
        filter.feed(&Input::Header(Header { rover_antenna: [2.0, 0.0, 0.0], ..Header::default() }));
        let mut solution = Solution::none(GpsTime::from_nanoseconds(0), Reason::NoBase);
        assert_eq!(filter.at_marker(solution), solution);
        solution.quality = Quality::Code;
        solution.position = MARKER.into();
        let height = |position: &Vector3<f64>| Geodetic::from_ecef(position).height;
        let down = height(&solution.position) - height(&filter.at_marker(solution).position);
        assert!((down - 2.0).abs() < 1e-8, "{down}");
    }

    #[test]
    fn there_is_no_base_before_its_coordinate_nor_after_a_reset() {
        let mut filter = Filter::new(RtkConfig::default(), None);
        let base = |filter: &mut Filter, seconds| filter.feed(&Input::Epoch(Station::Base, epoch(seconds).view()));
        let reason = |filter: &mut Filter, seconds| {
            filter.feed(&Input::Epoch(Station::Rover, epoch(seconds).view())).unwrap().reason
        };
        base(&mut filter, 2.0);
        assert_eq!(reason(&mut filter, 2.0), Reason::NoBase);
        filter.feed(&Input::Header(Header { base_position: Some(MARKER), ..Header::default() }));
        base(&mut filter, 1.0);
        assert_eq!(reason(&mut filter, 1.0), Reason::PositionFailed); // one satellite
        assert_eq!(reason(&mut filter, 1.0), Reason::OutOfOrder);
        filter.feed(&Input::Event(Event::Reset));
        assert_eq!(reason(&mut filter, 1.0), Reason::NoBase);
    }

    #[test]
    fn a_config_comes_through_a_log() {
        let config = RtkConfig { bands: BandPlan::L1L2L5, max_age: 7.5, ..RtkConfig::default() };
        assert_ne!(config, RtkConfig::default());
        let mut filter = Filter::new(RtkConfig::default(), None);
        let mut frame = [0; MAX_FRAME];
        for (schema, expected) in [(CONFIG_SCHEMA + 1, RtkConfig::default()), (CONFIG_SCHEMA, config)] {
            let length = write_config(schema, &config, &mut frame).unwrap();
            let mut reader = InputReader::<8>::new();
            for &byte in &frame[..length] {
                assert_eq!(reader.push(byte, |input| assert!(filter.feed(&input).is_none())), None);
            }
            assert_eq!((reader.counts().good, filter.config()), (1, &expected));
        }
    }

    #[test]
    fn the_ionosphere_of_gps_is_preferred() {
        let mut filter = Filter::new(RtkConfig::default(), None);
        let mut told = |constellation, alpha| {
            let klobuchar = Klobuchar { alpha: [alpha; 4], beta: [0.0; 4] };
            filter.feed(&Input::Ionosphere(Ionosphere { constellation, klobuchar }));
            filter.ionosphere.unwrap().alpha[0]
        };
        assert_eq!(told(Constellation::BeiDou, 1.0), 1.0);
        assert_eq!(told(Constellation::Gps, 2.0), 2.0);
        assert_eq!(told(Constellation::Qzss, 3.0), 2.0);
        assert_eq!(told(Constellation::Gps, 4.0), 4.0);
    }
}
