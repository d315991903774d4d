//! Klobuchar's ionosphere model with the eight coefficients that GPS broadcasts (QZSS and BeiDou broadcast sets of the
//! same form).
//!
//! Source: IS-GPS-200N 20.3.3.5.2.5 and figure 20-4; J. A. Klobuchar, *Ionospheric time-delay algorithm for
//! single-frequency GPS users*, IEEE Trans. Aerosp. Electron. Syst. 23 (1987). The delay is a half cosine over local
//! time, peaking at 14:00, on a floor of 5 ns at night, seen through a thin shell at 350 km. It removes about half of
//! the delay (rms); what remains is of the same order as the correction.
//!
//! Symbols as in the interface document: ψ earth-centred angle, φ_i, λ_i latitude and longitude of the pierce point,
//! φ_m geomagnetic latitude, F obliquity factor, all in semicircles where it says so. Panic contract: never panics.

use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::geodesy::{Geodetic, LookAngle};
use core::f64::consts::PI;

/// GPS L1, to which the coefficients refer `[Hz]`.
const F_L1: f64 = 1_575.42e6;
/// Delay at night `[s]`.
const NIGHT: f64 = 5e-9;
/// Local time of the maximum, 14:00 `[s]`.
const PEAK: f64 = 50_400.0;
/// Seconds in a day.
const DAY: f64 = 86_400.0;

/// Broadcast coefficients of the model.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Klobuchar {
    /// Cubic of the amplitude in geomagnetic latitude: α₀…α₃ `[s, s/semicircle, s/semicircle², s/semicircle³]`.
    pub alpha: [f64; 4],
    /// Cubic of the period in geomagnetic latitude: β₀…β₃ `[s, s/semicircle, s/semicircle², s/semicircle³]`.
    pub beta: [f64; 4],
}

impl Klobuchar {
    /// Slant delay of code on GPS L1 `[m]` for a receiver at `receiver` and a satellite seen at `look`, at GPS second of
    /// week (or of day) `tow` `[s]`.
    pub fn delay_l1(&self, receiver: &Geodetic, look: LookAngle, tow: f64) -> f64 {
        let LookAngle { azimuth, elevation } = look;
        let elevation = elevation / PI; // semicircles from here on
        let psi = 0.0137 / (elevation + 0.11) - 0.022;
        let phi_i = (receiver.latitude / PI + psi * libm::cos(azimuth)).clamp(-0.416, 0.416);
        let lambda_i = receiver.longitude / PI + psi * libm::sin(azimuth) / libm::cos(phi_i * PI);
        let phi_m = phi_i + 0.064 * libm::cos((lambda_i - 1.617) * PI);

        let local = 43_200.0 * lambda_i + tow;
        let local = local - libm::floor(local / DAY) * DAY;

        let cubic = |c: &[f64; 4]| c[0] + phi_m * (c[1] + phi_m * (c[2] + phi_m * c[3]));
        let amplitude = cubic(&self.alpha).max(0.0);
        let period = cubic(&self.beta).max(72_000.0);

        let away = 0.53 - elevation;
        let obliquity = 1.0 + 16.0 * away * away * away;
        let x = 2.0 * PI * (local - PEAK) / period;
        // The interface document truncates the cosine after the fourth power, and switches at 1.57, not at π/2.
        let day = if libm::fabs(x) < 1.57 { amplitude * (1.0 + x * x * (-0.5 + x * x / 24.0)) } else { 0.0 };
        SPEED_OF_LIGHT * obliquity * (NIGHT + day)
    }

    /// Slant delay of code `[m]` at carrier `frequency` `[Hz]`: the L1 delay times (f_L1/f)². Arguments as
    /// [`Klobuchar::delay_l1`].
    pub fn delay(&self, frequency: f64, receiver: &Geodetic, look: LookAngle, tow: f64) -> f64 {
        let ratio = F_L1 / frequency;
        ratio * ratio * self.delay_l1(receiver, look, tow)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Coefficients broadcast on 2020-06-25 (RINEX header of that day's IGS navigation file).
    const QUIET: Klobuchar = Klobuchar {
        alpha: [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7],
        beta: [81_920.0, 98_304.0, -65_536.0, -524_290.0],
    };

    fn at(latitude: f64, longitude: f64) -> Geodetic {
        Geodetic { latitude, longitude, height: 0.0 }
    }

    #[test]
    fn agrees_with_four_programs() {
        // RTKLIB demo5 2.5.1, raPPPid, sidereon 3.0.4 and a numpy version agree within 1e-14 m on this value
        // (Wettzell, az 0.5, el 0.2 rad, tow 388800 s).
        let look = LookAngle { azimuth: 0.5, elevation: 0.2 };
        let delay = QUIET.delay_l1(&at(0.8577246076000933, 0.2247809543643497), look, 388_800.0);
        assert!((delay - 3.9312400620192194).abs() < 1e-9, "{delay}");
    }

    #[test]
    fn scales_with_the_inverse_square_of_the_frequency() {
        let look = LookAngle { azimuth: 0.5, elevation: 1.0 };
        let delay = |frequency| QUIET.delay(frequency, &at(0.8, 0.2), look, 50_000.0);
        let ratio = delay(1_227.60e6) / delay(F_L1);
        assert!((ratio - (77.0 / 60.0) * (77.0 / 60.0)).abs() < 1e-12); // IS-GPS-200N 20.3.3.3.3.3: γ = (77/60)²
    }

    proptest! {
        #[test]
        fn never_below_the_night_floor(
            latitude in -1.57..1.57f64, longitude in -3.2..3.2f64, azimuth in 0.0..6.3f64, elevation in 0.0..1.57f64,
            tow in 0.0..604_800.0f64,
        ) {
            let delay = QUIET.delay_l1(&at(latitude, longitude), LookAngle { azimuth, elevation }, tow);
            prop_assert!((0.99 * SPEED_OF_LIGHT * NIGHT..100.0).contains(&delay));
        }

        #[test]
        fn takes_anything(frequency: f64, latitude: f64, longitude: f64, azimuth: f64, elevation: f64, tow: f64) {
            let _ = QUIET.delay(frequency, &at(latitude, longitude), LookAngle { azimuth, elevation }, tow);
        }
    }
}
