//! Standard atmosphere and Saastamoinen's zenith delays.
//!
//! Sources: J. Saastamoinen, *Atmospheric correction for the troposphere and stratosphere in radio ranging of
//! satellites*, Geophys. Monogr. 15 (1972); gravity correction by Davis et al., Radio Sci. 20 (1985), equation (A11).
//! Pressure by height: International Standard Atmosphere, p = 1013.25 (1 − 2.2557e-5 h)^5.2568 hPa; temperature
//! 15 °C − 6.5 K/km; water vapour pressure e = 6.108 RH exp((17.15 T − 4684)/(T − 38.45)) hPa. The constant 273.16 (the
//! triple point) where 273.15 belongs is kept, as every program compared has it; it moves the wet delay by 0.1 mm.
//!
//! Heights are held in 0…10 km, where the standard atmosphere is meaningful: a wrong height neither makes the delay
//! jump to zero nor makes it absurd. Panic contract: never panics.

use crate::gnss::geodesy::Geodetic;

/// The height range of the model `[m]`.
const HEIGHTS: core::ops::RangeInclusive<f64> = 0.0..=10_000.0;

fn held(height: f64) -> f64 {
    height.clamp(*HEIGHTS.start(), *HEIGHTS.end())
}

/// Weather at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StandardAtmosphere {
    /// Total pressure `[hPa]`.
    pub pressure: f64,
    /// Temperature `[K]`.
    pub temperature: f64,
    /// Partial pressure of water vapour `[hPa]`.
    pub vapour_pressure: f64,
}

/// Delays in the direction of the zenith `[m]`.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ZenithDelay {
    /// By dry air, about 2.3 m at sea level.
    pub hydrostatic: f64,
    /// By water vapour, 0…0.4 m.
    pub wet: f64,
}

impl StandardAtmosphere {
    /// The weather at `height` `[m]` with relative `humidity` 0…1.
    pub fn at_height(height: f64, humidity: f64) -> Self {
        let height = held(height);
        let temperature = 15.0 - 6.5e-3 * height + 273.16;
        let pressure = 1013.25 * libm::pow(1.0 - 2.2557e-5 * height, 5.2568);
        Self { pressure, temperature, vapour_pressure: vapour_pressure(temperature, humidity) }
    }

    /// Zenith delays of this weather for a receiver at `receiver`.
    pub fn zenith_delay(&self, receiver: &Geodetic) -> ZenithDelay {
        ZenithDelay {
            hydrostatic: hydrostatic(self.pressure, receiver.latitude, held(receiver.height)),
            wet: wet(self.temperature, self.vapour_pressure),
        }
    }
}

/// Wet zenith delay `[m]` of a surface `temperature` `[K]` and `vapour_pressure` `[hPa]`.
pub fn wet(temperature: f64, vapour_pressure: f64) -> f64 {
    0.002277 * (1255.0 / temperature + 0.05) * vapour_pressure
}

/// Partial pressure of water vapour `[hPa]` at `temperature` `[K]` and relative `humidity` 0…1.
pub(super) fn vapour_pressure(temperature: f64, humidity: f64) -> f64 {
    6.108 * humidity * libm::exp((17.15 * temperature - 4684.0) / (temperature - 38.45))
}

/// Hydrostatic zenith delay `[m]` of a surface `pressure` `[hPa]` at `latitude` `[rad]` and `height` `[m]` (Davis et al.
/// 1985, equation (A11)): 0.0022768 p / (1 − 0.00266 cos 2φ − 0.00028 h/km).
pub fn hydrostatic(pressure: f64, latitude: f64, height: f64) -> f64 {
    let gravity = 1.0 - 0.00266 * libm::cos(2.0 * latitude) - 0.00028 * height / 1e3;
    0.0022768 * pressure / gravity
}

impl ZenithDelay {
    /// Sum of both `[m]`.
    pub fn total(self) -> f64 {
        self.hydrostatic + self.wet
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn at(latitude: f64, height: f64) -> Geodetic {
        Geodetic { latitude, longitude: 0.0, height }
    }

    #[test]
    fn sea_level_is_that_of_the_standard_atmosphere() {
        let air = StandardAtmosphere::at_height(0.0, 0.5);
        assert_eq!((air.pressure, air.temperature), (1013.25, 288.16));
        // Davis et al. 1985: 2.2768 mm/hPa at 45°.
        let zenith = air.zenith_delay(&at(core::f64::consts::FRAC_PI_4, 0.0));
        assert!((zenith.hydrostatic - 2.30697).abs() < 1e-4);
        assert!((0.05..0.15).contains(&zenith.wet));
    }

    #[test]
    fn agrees_with_rtklib_at_wettzell() {
        // RTKLIB demo5 2.5.1 tropmodel: 2.22212764858241 m at the zenith (lat 0.8577246076 rad, 666 m, humidity 0.7).
        let zenith = StandardAtmosphere::at_height(666.0, 0.7).zenith_delay(&at(0.8577246076000933, 666.0));
        assert!((zenith.total() - 2.22212764858241).abs() < 1e-9);
        assert!((zenith.hydrostatic - 2.1300918068043995).abs() < 1e-9);
    }

    #[test]
    fn heights_outside_the_model_are_held() {
        assert_eq!(StandardAtmosphere::at_height(-430.0, 0.7), StandardAtmosphere::at_height(0.0, 0.7));
        assert_eq!(StandardAtmosphere::at_height(1e7, 0.7), StandardAtmosphere::at_height(1e4, 0.7));
    }
}
