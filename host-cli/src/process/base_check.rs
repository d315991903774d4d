//! Is the base where its coordinate says? A typing error there moves every position by as much, unnoticed.

use super::stream::Input;
use surefix_core::gnss::geodesy::Geodetic;
use surefix_core::gnss::orbit::store::EphemerisStore;
use surefix_core::gnss::time::GpsTime;
use surefix_core::spp::rows::Rows;
use surefix_core::spp::{Config, single_point};

/// Farther from its own single point than this, a base coordinate is wrong `[m]`; single points are good to tens of
/// metres.
const LIMIT: f64 = 1_000.0;

/// The coordinate of the base contradicts the observations of the base.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error(
    "the base coordinate is {distance_km:.1} km from where the observations of the base put it ({latitude:.5}° \
     {longitude:.5}° {height:.0} m at GPS week {week} second {tow:.0}); correct it by --base-xyz X Y Z [m]",
    week = time.week(), tow = time.tow()
)]
pub struct BaseMisplaced {
    distance_km: f64,
    latitude: f64,
    longitude: f64,
    height: f64,
    time: GpsTime,
}

/// Watches the inputs of an engine until the first single point of the base.
pub struct BaseCheck {
    ephemerides: Box<EphemerisStore<512>>,
    rows: Box<Rows<64>>,
    coordinate: Option<[f64; 3]>,
    done: bool,
}

impl Default for BaseCheck {
    fn default() -> Self {
        Self {
            ephemerides: Box::new(EphemerisStore::new()),
            rows: Box::new(Rows::new()),
            coordinate: None,
            done: false,
        }
    }
}

impl BaseCheck {
    /// Takes note of an input; an error if it shows that the base is elsewhere.
    pub fn watch(&mut self, input: &Input) -> Result<(), BaseMisplaced> {
        match input {
            _ if self.done => {}
            Input::Header(header) => self.coordinate = header.base_position,
            Input::Ephemeris(ephemeris) => {
                self.ephemerides.insert(*ephemeris);
            }
            Input::Base(epoch) => {
                let point =
                    single_point(epoch.view(), &self.ephemerides, None, &Config::DEFAULT, None, &mut self.rows).ok();
                if let (Some(point), Some(coordinate)) = (point, self.coordinate) {
                    self.done = true;
                    let distance = (point.position - nalgebra::Vector3::from(coordinate)).norm();
                    if distance > LIMIT {
                        let place = Geodetic::from_ecef(&point.position);
                        return Err(BaseMisplaced {
                            distance_km: distance / 1000.0,
                            latitude: place.latitude.to_degrees(),
                            longitude: place.longitude.to_degrees(),
                            height: place.height,
                            time: epoch.time,
                        });
                    }
                }
            }
            _ => {}
        }
        Ok(())
    }
}
