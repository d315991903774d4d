//! Group delays: broadcast clocks refer to a pair of signals (or to one), the measurement to another.
//!
//! For the code of one signal the satellite clock is dt_sat − [`Ephemeris::group_delay`]:
//!
//! | clock of | refers to | group delay |
//! |---|---|---|
//! | GPS, QZSS LNAV | L1/L2 ionosphere-free | L1: T_GD; L2: (f1/f2)² T_GD (IS-GPS-200N 20.3.3.3.3.2) |
//! | Galileo I/NAV, F/NAV | E1/E5b, E1/E5a ionosphere-free | E1: BGD of that pair; E5a, E5b: see below |
//! | BeiDou D1/D2 | B3I | B1I: T_GD1; B2I: T_GD2; B3I: 0 (BDS-SIS-ICD-B1I 3.0, 5.2.4.10) |
//! | GLONASS | G1 | 0 (Δτ_n is not used) |
//!
//! Galileo OS SIS ICD 2.1, 5.1.5: the code of E5x is late by ((f1/f5x)² − 1) BGD(E1, E5x) against that of E1. With the
//! BGD of the clock's own pair this is the ICD's (f1/f5x)² BGD; with both BGDs at hand it also gives E5a with an I/NAV
//! clock.
//!
//! Other signals (L5, B1C, B2a, …) need corrections that these messages do not carry. Panic contract: none.

use crate::gnss::ephemeris::{Ephemeris, KeplerEphemeris, NavigationMessage};
use crate::gnss::satellite::Constellation;
use crate::gnss::signal::Signal;

impl Ephemeris {
    /// Group delay of a signal's code against the broadcast clock `[s]`; `None` where the message does not tell.
    pub fn group_delay(&self, signal: Signal) -> Option<f64> {
        match self {
            Self::Glonass(_) => matches!(signal.band(), b'1' | b'2').then_some(0.0),
            Self::Kepler(kepler) => match kepler.satellite.constellation() {
                Constellation::Gps | Constellation::Qzss => lnav(kepler.group_delay[0], signal),
                Constellation::Galileo => galileo(kepler, signal),
                Constellation::BeiDou => beidou(kepler.group_delay, signal),
                Constellation::Glonass => None,
            },
        }
    }
}

fn lnav(t_gd: f64, signal: Signal) -> Option<f64> {
    match signal.band() {
        b'1' => Some(t_gd),
        b'2' => Some((77.0 / 60.0) * (77.0 / 60.0) * t_gd),
        _ => None,
    }
}

fn galileo(ephemeris: &KeplerEphemeris, signal: Signal) -> Option<f64> {
    let [bgd_e5a, bgd_e5b] = ephemeris.group_delay;
    let fnav = ephemeris.message == NavigationMessage::Fnav;
    let e1 = if fnav { bgd_e5a } else { bgd_e5b };
    // (f1/f5x)² − 1 with f in units of 10.23 MHz / 2: E1 308, E5a 230, E5b 236.
    let later_than_e1 = |f: f64, bgd: f64| (308.0 * 308.0 / (f * f) - 1.0) * bgd;
    match signal.band() {
        b'1' => Some(e1),
        b'5' => Some(e1 + later_than_e1(230.0, bgd_e5a)),
        b'7' if !fnav => Some(e1 + later_than_e1(236.0, bgd_e5b)),
        _ => None,
    }
}

fn beidou([t_gd1, t_gd2]: [f64; 2], signal: Signal) -> Option<f64> {
    match (signal.band(), signal.attribute()) {
        (b'2', _) => Some(t_gd1),
        (b'7', b'D' | b'P' | b'Z') => None, // B2b of BeiDou-3, not B2I
        (b'7', _) => Some(t_gd2),
        (b'6', _) => Some(0.0),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::super::kepler::tests::gps_g05;
    use super::*;

    fn delay_of(satellite: &str, message: NavigationMessage, group_delay: [f64; 2], signal: &str) -> Option<f64> {
        let satellite = satellite.parse().unwrap();
        Ephemeris::Kepler(KeplerEphemeris { satellite, message, group_delay, ..gps_g05() })
            .group_delay(signal.parse().unwrap())
    }

    #[test]
    fn each_signal_has_the_delay_of_its_interface_document() {
        use NavigationMessage::{D1D2, Fnav, Inav, Lnav};
        let [a, b] = [3e-9, 5e-9];
        for (satellite, message, signal, expected) in [
            ("G05", Lnav, "1C", Some(a)),
            ("G05", Lnav, "2W", Some(a * 77.0 * 77.0 / 3_600.0)), // γ of IS-GPS-200N 20.3.3.3.3.2
            ("G05", Lnav, "5Q", None),
            ("J02", Lnav, "1C", Some(a)),
            ("E01", Inav, "1C", Some(b)),
            ("E01", Fnav, "1C", Some(a)),
            ("E01", Inav, "7Q", Some(b * (1575.42 / 1207.14_f64).powi(2))), // Galileo OS SIS ICD 2.1, 5.1.5
            ("E01", Fnav, "5Q", Some(a * (1575.42 / 1176.45_f64).powi(2))),
            ("E01", Inav, "5Q", Some(b + a * ((1575.42 / 1176.45_f64).powi(2) - 1.0))),
            ("E01", Fnav, "7Q", None),
            ("C19", D1D2, "2I", Some(a)),
            ("C19", D1D2, "7I", Some(b)),
            ("C19", D1D2, "7D", None),
            ("C19", D1D2, "6I", Some(0.0)),
            ("C19", D1D2, "1P", None),
        ] {
            match (delay_of(satellite, message, [a, b], signal), expected) {
                (Some(delay), Some(expected)) => assert!((delay - expected).abs() < 1e-23, "{satellite} {signal}"),
                (delay, expected) => assert_eq!(delay, expected, "{satellite} {signal}"),
            }
        }
    }

    #[test]
    fn health_ignores_the_first_bit_of_qzss_only() {
        let healthy = |satellite: &str, health| {
            let satellite = satellite.parse().unwrap();
            Ephemeris::Kepler(KeplerEphemeris { satellite, health, ..gps_g05() }).healthy()
        };
        assert!(healthy("G05", 0) && !healthy("G05", 1) && healthy("J02", 1) && !healthy("J02", 2));
    }
}
