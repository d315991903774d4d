//! Global Pressure and Temperature: the average weather of a place and season, and the height of the geoid.
//!
//! Source: J. Böhm, R. Heinkelmann, H. Schuh, *Short note: A global model of pressure and temperature for geodetic
//! applications*, J. Geod. 81 (2007), and GPT.F of the IERS Conventions (2010): spherical harmonics of pressure and
//! temperature on the geoid, mean and amplitude about 28 January, carried to the height H above the geoid by
//! p = p₀ (1 − 2.26e-5 H)^5.225 and T = T₀ − 6.5 K/km H.
//!
//! The seasons' pressure is within 10 hPa (23 mm of zenith delay) of the weather's; an estimated zenith delay takes up
//! the difference. Heights are held below 20 km. Cost: 880 bytes of stack, some 1700 operations. Panic contract: none.

use super::gpt_coefficients::{PRESSURE_AMPLITUDE, PRESSURE_MEAN, TEMPERATURE_AMPLITUDE, TEMPERATURE_MEAN, UNDULATION};
use super::harmonics::Harmonics;
use super::mapping::year_angle;
use crate::gnss::geodesy::Geodetic;
use crate::gnss::time::GpsTime;

/// The highest height above the geoid that the model is evaluated at `[m]`.
const HIGHEST: f64 = 20_000.0;

/// The average weather at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GlobalWeather {
    /// Pressure `[hPa]`.
    pub pressure: f64,
    /// Temperature `[K]`.
    pub temperature: f64,
    /// Height of the geoid above the ellipsoid `[m]`, to degree 9.
    pub undulation: f64,
}

impl GlobalWeather {
    /// The weather of `time` at `receiver`.
    pub fn at(time: GpsTime, receiver: &Geodetic) -> Self {
        let harmonics = Harmonics::at(receiver);
        let season = libm::cos(year_angle(time));
        let undulation = harmonics.of(&UNDULATION);
        let height = (receiver.height - undulation).min(HIGHEST);
        let on_geoid = |mean, amplitude| harmonics.of(mean) + harmonics.of(amplitude) * season;
        Self {
            pressure: on_geoid(&PRESSURE_MEAN, &PRESSURE_AMPLITUDE) * libm::pow(1.0 - 2.26e-5 * height, 5.225),
            temperature: on_geoid(&TEMPERATURE_MEAN, &TEMPERATURE_AMPLITUDE) - 6.5e-3 * height + 273.15,
            undulation,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn agrees_with_the_test_case_of_the_iers_conventions() {
        // Header of GPT.F, IERS Conventions (2010): MJD 55055, 0.6708665767 rad, −1.393397187 rad, 812.546 m:
        // 918.0710638757363995 hPa, 19.31914181012882992 °C, −42.19185643717770517 m.
        let time = GpsTime::default().plus_seconds((55_055.0 - 44_244.0) * 86_400.0);
        let receiver = Geodetic { latitude: 0.670_866_576_7, longitude: -1.393_397_187, height: 812.546 };
        let weather = GlobalWeather::at(time, &receiver);
        assert!((weather.pressure - 918.071_063_875_736_4).abs() < 1e-9);
        assert!((weather.temperature - 273.15 - 19.319_141_810_128_83).abs() < 1e-9);
        assert!((weather.undulation + 42.191_856_437_177_705).abs() < 1e-10);
    }

    #[test]
    fn heights_beyond_the_air_are_held() {
        let at = |height| GlobalWeather::at(GpsTime::default(), &Geodetic { latitude: 0.5, longitude: 0.5, height });
        assert!(at(1e6).pressure > 0.0 && at(1e6) == at(1e7));
    }
}
