//! What the atmosphere adds to a range: the ionosphere by Klobuchar's broadcast model or maps of electrons ([`tec`]), the
//! troposphere by zenith delays and a mapping function.
//!
//! For single points: [`StandardAtmosphere`] and [`Mapping`]. For estimators of the zenith delay: [`Troposphere`], with
//! the weather of GPT or GPT3 and the mapping functions of Niell, GMF and VMF.
//!
//! All delays are in metres and positive: they are *added* to the modelled pseudorange. Angles are radians, heights
//! metres above the ellipsoid. (Klobuchar, the standard atmosphere and Niell mean heights above sea level; 50 m of
//! difference change the zenith delay by 15 mm, far below what these models promise. GPT and GPT3 have a geoid.)
//!
//! Cost: one Klobuchar delay takes six, one slant troposphere delay about ten transcendental functions.
//! Panic contract: nothing here panics; input that is not finite gives output that is not finite.

pub mod askne_nordius;
pub mod gmf;
mod gmf_coefficients;
pub mod gpt;
pub mod gpt3;
mod gpt_coefficients;
mod harmonics;
pub mod klobuchar;
pub mod mapping;
pub mod niell;
pub mod saastamoinen;
pub mod tec;
pub mod troposphere;

use super::geodesy::Geodetic;
pub use gpt::GlobalWeather;
pub use gpt3::{Gpt3Cell, Gpt3Grid, Gpt3Weather};
pub use klobuchar::Klobuchar;
pub use mapping::{MappingFunction, SiteMapping};
pub use saastamoinen::{StandardAtmosphere, ZenithDelay};
pub use troposphere::{SlantTroposphere, Troposphere, TroposphereModel, ZenithModel};

/// How a zenith delay is carried over to the elevation of a satellite.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Mapping {
    /// Niell 1996. The default: it stays within a few centimetres of ray tracing down to 5° of elevation.
    #[default]
    Niell,
    /// 1/sin(elevation), a flat atmosphere, as some programs use it for single points. 4 % (0.5 m) too long at 10°.
    Cosecant,
}

impl Mapping {
    /// Slant delay `[m]` of a zenith delay at `elevation` `[rad]`, for a receiver at `receiver` on day `day_of_year`
    /// (1 = 1 January, with fraction). `None` at or below the horizon.
    pub fn slant(self, zenith: ZenithDelay, day_of_year: f64, receiver: &Geodetic, elevation: f64) -> Option<f64> {
        if elevation.is_nan() || elevation <= 0.0 {
            return None;
        }
        Some(match self {
            Self::Niell => {
                let (site, sin) = (niell::site(day_of_year, receiver), libm::sin(elevation));
                zenith.hydrostatic * site.hydrostatic(sin) + zenith.wet * site.wet(sin)
            }
            Self::Cosecant => zenith.total() / libm::sin(elevation),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HERE: Geodetic = Geodetic { latitude: 0.8, longitude: 0.2, height: 100.0 };

    fn slant(mapping: Mapping, elevation: f64) -> Option<f64> {
        let zenith = StandardAtmosphere::at_height(HERE.height, 0.7).zenith_delay(&HERE);
        mapping.slant(zenith, 180.0, &HERE, elevation)
    }

    #[test]
    fn both_mappings_agree_at_the_zenith_and_refuse_the_ground() {
        let up = core::f64::consts::FRAC_PI_2;
        assert!((slant(Mapping::Niell, up).unwrap() - slant(Mapping::Cosecant, up).unwrap()).abs() < 1e-12);
        for elevation in [0.0, -0.1, f64::NAN] {
            assert_eq!(slant(Mapping::Niell, elevation), None);
        }
    }

    #[test]
    fn the_flat_atmosphere_is_too_long_near_the_horizon() {
        let elevation = 10f64.to_radians();
        let excess = slant(Mapping::Cosecant, elevation).unwrap() - slant(Mapping::Niell, elevation).unwrap();
        // 1/sin 10° = 5.76 against 5.55 by Niell's tables: 0.5 m of 14 m.
        assert!((0.4..0.6).contains(&excess));
    }
}
