//! The troposphere of a receiver for an estimator: built once per epoch (or per hour on a static receiver), then a
//! cheap slant delay for each satellite.
//!
//! The slant delay is T = T_h m_h(ε) + Z_w m_w(ε) + m_g(ε) (G_n cos α + G_e sin α): the a priori part T_h m_h is
//! modelled, the wet zenith delay Z_w and the gradients G are estimated, with the partial derivatives given here.
//!
//! Cost: building up to some 3000 operations (GPT and GMF), a slant two sines, a cosine and eight divisions. Panic
//! contract: none.

use super::gpt::GlobalWeather;
use super::mapping::{MappingFunction, SiteMapping, gradients};
use super::saastamoinen::{self, StandardAtmosphere, ZenithDelay, vapour_pressure};
use crate::gnss::geodesy::{Geodetic, LookAngle};
use crate::gnss::time::GpsTime;

/// Where the a priori zenith delay comes from.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(rename_all = "snake_case"))]
pub enum ZenithModel {
    /// GPT's pressure and temperature with Davis' and Saastamoinen's formulae. The default.
    #[default]
    Gpt,
    /// The standard atmosphere by height alone.
    Standard,
    /// As given, for instance of GPT3 ([`super::Gpt3Weather::zenith_delay`]) or of a site file.
    Given(ZenithDelay),
}

/// The models of a [`Troposphere`].
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct TroposphereModel {
    /// A priori zenith delay.
    pub zenith: ZenithModel,
    /// Mapping functions.
    pub mapping: MappingFunction,
    /// Relative humidity 0…1 for the a priori wet zenith delay, where the model has none of its own.
    pub humidity: f64,
}

impl Default for TroposphereModel {
    /// GPT and GMF, half humid.
    fn default() -> Self {
        Self { zenith: ZenithModel::default(), mapping: MappingFunction::default(), humidity: 0.5 }
    }
}

/// The troposphere over a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Troposphere {
    /// A priori zenith delays `[m]`.
    pub zenith: ZenithDelay,
    /// Mapping functions.
    pub mapping: SiteMapping,
}

/// The troposphere towards a satellite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SlantTroposphere {
    /// Hydrostatic delay T_h m_h `[m]`, added to the modelled range.
    pub hydrostatic: f64,
    /// Wet mapping function m_w: the partial derivative by the wet zenith delay.
    pub wet_mapping: f64,
    /// Partial derivatives by the gradients to north and east.
    pub gradients: [f64; 2],
}

impl Troposphere {
    /// Over a receiver at `receiver` around `time`.
    pub fn new(time: GpsTime, receiver: &Geodetic, model: &TroposphereModel) -> Self {
        let zenith = match model.zenith {
            ZenithModel::Standard => {
                StandardAtmosphere::at_height(receiver.height, model.humidity).zenith_delay(receiver)
            }
            ZenithModel::Given(zenith) => zenith,
            ZenithModel::Gpt => {
                let GlobalWeather { pressure, temperature, .. } = GlobalWeather::at(time, receiver);
                let vapour_pressure = vapour_pressure(temperature, model.humidity);
                ZenithDelay {
                    hydrostatic: saastamoinen::hydrostatic(pressure, receiver.latitude, receiver.height),
                    wet: saastamoinen::wet(temperature, vapour_pressure),
                }
            }
        };
        Self { zenith, mapping: model.mapping.at(time, receiver) }
    }

    /// Towards a satellite; `None` at or below the horizon.
    pub fn slant(&self, look: LookAngle) -> Option<SlantTroposphere> {
        if look.elevation.is_nan() || look.elevation <= 0.0 {
            return None;
        }
        let sin = libm::sin(look.elevation);
        Some(SlantTroposphere {
            hydrostatic: self.zenith.hydrostatic * self.mapping.hydrostatic(sin),
            wet_mapping: self.mapping.wet(sin),
            gradients: gradients(look),
        })
    }
}

impl SlantTroposphere {
    /// The whole delay `[m]` for a wet zenith delay `[m]` and gradients to north and east `[m]`.
    pub fn delay(&self, wet_zenith: f64, [north, east]: [f64; 2]) -> f64 {
        let [by_north, by_east] = self.gradients;
        self.hydrostatic + self.wet_mapping * wet_zenith + by_north * north + by_east * east
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const WETTZELL: Geodetic = Geodetic { latitude: 0.8577246076000933, longitude: 0.2247809543643497, height: 666.0 };

    #[test]
    fn the_a_priori_delay_at_wettzell_is_that_of_its_pressure() {
        // GPT.F of the IERS Conventions: 943.6065264974255 hPa on MJD 59025. Davis' formula by hand:
        // 0.0022768 · 943.60653 / (1 − 0.00266 cos 98.2873° − 0.00028 · 0.666) = 2.14798 m.
        let time = GpsTime::default().plus_seconds((59_025.0 - 44_244.0) * 86_400.0);
        let troposphere = Troposphere::new(time, &WETTZELL, &TroposphereModel::default());
        assert!((troposphere.zenith.hydrostatic - 2.14798).abs() < 1e-5);
        assert!((0.05..0.15).contains(&troposphere.zenith.wet));
    }

    #[test]
    fn models_of_the_zenith_agree_within_the_weather() {
        let zenith = |zenith| {
            let model = TroposphereModel { zenith, ..TroposphereModel::default() };
            Troposphere::new(GpsTime::from_week_tow(2100, 0.0), &WETTZELL, &model).zenith
        };
        let (gpt, standard) = (zenith(ZenithModel::Gpt), zenith(ZenithModel::Standard));
        assert!((gpt.hydrostatic - standard.hydrostatic).abs() < 0.03);
        assert_eq!(zenith(ZenithModel::Given(standard)), standard);
    }

    proptest! {
        #[test]
        fn the_delay_is_linear_in_what_is_estimated(
            elevation in 0.05..1.57f64, azimuth in 0.0..6.2f64, wet in 0.0..0.4f64, north in -2e-3..2e-3f64, east in -2e-3..2e-3f64,
        ) {
            let troposphere = Troposphere::new(GpsTime::from_week_tow(2100, 0.0), &WETTZELL, &TroposphereModel::default());
            let slant = troposphere.slant(LookAngle { azimuth, elevation }).unwrap();
            let delay = |wet, gradients| slant.delay(wet, gradients);
            let sum = slant.hydrostatic + (delay(wet, [0.0; 2]) - slant.hydrostatic)
                + (delay(0.0, [north, east]) - slant.hydrostatic);
            prop_assert!((delay(wet, [north, east]) - sum).abs() < 1e-12 * sum.abs());
            prop_assert!(slant.hydrostatic >= troposphere.zenith.hydrostatic && slant.wet_mapping >= 1.0 - 1e-12);
        }

        #[test]
        fn takes_anything(ns: i64, latitude: f64, longitude: f64, height: f64, elevation: f64, azimuth: f64) {
            let receiver = Geodetic { latitude, longitude, height };
            let troposphere = Troposphere::new(GpsTime::from_nanoseconds(ns), &receiver, &TroposphereModel::default());
            prop_assert_eq!(troposphere.slant(LookAngle { elevation, azimuth }).is_none(), elevation.is_nan() || elevation <= 0.0);
        }
    }
}
