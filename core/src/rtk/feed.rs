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
pub const CONFIG_SCHEMA: u16 = 1;

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
                let mut solution = self.push_rover(*epoch);
                if solution.quality < Quality::None {
                    solution.position -= above_marker(&solution.position, &self.rover_antenna);
                }
                return Some(solution);
            }
            Input::Event(Event::Reset) => self.restart(),
            Input::Config(_) | Input::Solution(_) | Input::Event(_) => {}
        }
        None
    }

    /// Where the base is, and how high the antennas stand.
    fn set_stations(&mut self, header: &Header) {
        self.rover_antenna = header.rover_antenna;
        self.base_position = header.base_position.map(|marker| {
            let marker = Vector3::from(marker);
            marker + above_marker(&marker, &header.base_antenna)
        });
    }
}

/// The vector from a marker to its antenna reference point, ECEF `[m]`, for an antenna `[up, east, north]` `[m]` of it.
fn above_marker(place: &Vector3<f64>, [up, east, north]: &[f64; 3]) -> Vector3<f64> {
    Geodetic::from_ecef(place).enu_to_ecef(&Vector3::new(*east, *north, *up))
}
