//! Antenna phase centres: where a signal leaves the satellite and where it arrives, as ANTEX files describe it.
//!
//! Source: M. Rothacher, R. Schmid, *ANTEX: The Antenna Exchange Format, Version 1.4* (IGS, 2010). For each frequency an
//! offset (PCO) from a reference point, and variations (PCV) with direction:
//! * satellite: offset x, y, z in the body frame ([`super::attitude`]) from the centre of mass, variations over nadir;
//! * receiver: offset **north, east, up** from the antenna reference point, variations over zenith angle, and over azimuth
//!   where known.
//!
//! Signs: corrections `[m]` are *added* to the modelled range. That of the receiver is −(PCO + Δ)·e + PCV, e the unit
//! vector to the satellite and Δ the reference point's offset from the marker. Grids are borrowed; interpolation is linear
//! and holds the last value beyond the end. Cost: a few operations. Panic contract: none: a grid too short is zero there.

use super::attitude::Axes;
use super::geodesy::LookAngle;
use super::satellite::Constellation;
use super::signal::Signal;
use core::fmt;
use nalgebra::Vector3;

/// A carrier frequency as ANTEX names it: constellation and RINEX band digit (`G01`, `E05`).
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct AntennaBand {
    constellation: Constellation,
    band: u8,
}

impl AntennaBand {
    /// From constellation and RINEX band digit (`b'1'`…`b'9'`).
    pub const fn new(constellation: Constellation, band: u8) -> Option<Self> {
        if band >= b'1' && band <= b'9' { Some(Self { constellation, band }) } else { None }
    }

    /// Of a signal.
    pub const fn of(constellation: Constellation, signal: Signal) -> Self {
        Self { constellation, band: signal.band() }
    }

    /// Its constellation.
    pub const fn constellation(self) -> Constellation {
        self.constellation
    }

    /// RINEX band digit, `b'1'`…`b'9'`.
    pub const fn band(self) -> u8 {
        self.band
    }

    /// Carrier frequency `[Hz]`, of channel 0 for GLONASS; `None` for a band that the constellation has not.
    pub fn frequency(self) -> Option<f64> {
        Signal::new(self.band, b' ')?.frequency(self.constellation, Some(0))
    }
}

impl fmt::Display for AntennaBand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}0{}", self.constellation.letter(), self.band as char)
    }
}

impl fmt::Debug for AntennaBand {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

/// Phase centre variations on a grid.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Variations<'a> {
    /// First angle of the grid `[deg]`: zenith angle at a receiver, nadir angle at a satellite.
    pub first: f64,
    /// Step of the grid `[deg]`, above 0.
    pub step: f64,
    /// Variations over that angle alone `[m]`.
    pub mean: &'a [f64],
    /// Step in azimuth `[deg]`; 0 where variations do not depend on it.
    pub azimuth_step: f64,
    /// Variations `[m]`: for azimuth 0, step, … 360° one row each, as long as `mean`. Empty where not known.
    pub rows: &'a [f64],
}

impl Variations<'_> {
    /// Over zenith or nadir angle `[rad]` alone `[m]`.
    pub fn mean(&self, angle: f64) -> f64 {
        between(self.mean, self.position(angle))
    }

    /// Over zenith angle and azimuth `[rad]` `[m]`; where azimuths are not known as [`Variations::mean`].
    pub fn at(&self, angle: f64, azimuth: f64) -> f64 {
        let (columns, rows) = (self.mean.len(), self.rows.len().checked_div(self.mean.len()).unwrap_or(0));
        let known = rows >= 2 && self.azimuth_step > 0.0 && azimuth.is_finite();
        if !known {
            return self.mean(angle);
        }
        let degrees = azimuth.to_degrees();
        let place = (degrees - 360.0 * libm::floor(degrees / 360.0)) / self.azimuth_step;
        let below = (libm::floor(place) as usize).min(rows - 2);
        let row = |index: usize| {
            let start = index.saturating_mul(columns);
            self.rows.get(start..start.saturating_add(columns)).unwrap_or_default()
        };
        let angle = self.position(angle);
        let (low, high) = (between(row(below), angle), between(row(below + 1), angle));
        low + (high - low) * (place - below as f64).clamp(0.0, 1.0)
    }

    fn position(&self, angle: f64) -> f64 {
        (angle.to_degrees() - self.first) / self.step
    }
}

/// Linear interpolation at a `place` counted in steps, held at the ends; 0 in an empty list or at no place.
fn between(values: &[f64], place: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else { return 0.0 };
    if place.is_nan() {
        return 0.0;
    }
    let place = place.min(last as f64).max(0.0);
    let below = libm::floor(place) as usize;
    let low = values.get(below).copied().unwrap_or(0.0);
    let high = values.get(below.saturating_add(1)).copied().unwrap_or(low);
    low + (high - low) * (place - below as f64)
}

/// The calibration of an antenna for one frequency.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration<'a> {
    /// The frequency that it was made for.
    pub band: AntennaBand,
    /// Offset of the mean phase centre `[m]`. Satellite: x, y, z of the body frame. Receiver: **north, east, up**.
    pub offset: [f64; 3],
    /// Variations about it.
    pub variations: Variations<'a>,
}

impl Calibration<'_> {
    /// Satellite: the phase centre from the centre of mass, ECEF `[m]`, to be added to the position of a precise orbit.
    pub fn satellite_offset(&self, axes: &Axes) -> Vector3<f64> {
        axes.to_ecef(&Vector3::from(self.offset))
    }

    /// Satellite: what to add to the modelled range from the *centre of mass* `[m]`: offset·direction + PCV. `direction`
    /// is the unit vector from receiver to satellite, ECEF; `nadir` the angle at the satellite `[rad]` ([`nadir_angle`]).
    pub fn satellite_correction(&self, axes: &Axes, direction: &Vector3<f64>, nadir: f64) -> f64 {
        self.satellite_offset(axes).dot(direction) + self.variations.mean(nadir)
    }

    /// Receiver: what to add to the modelled range from the *marker* `[m]`: −(PCO + Δ)·e + PCV, towards a satellite at
    /// `look`. `delta`: the antenna reference point from the marker, **east, north, up** `[m]`.
    pub fn receiver_correction(&self, delta: &Vector3<f64>, look: LookAngle) -> f64 {
        let [north, east, up] = self.offset;
        let zenith = core::f64::consts::FRAC_PI_2 - look.elevation;
        -(delta + Vector3::new(east, north, up)).dot(&look_direction(look)) + self.variations.at(zenith, look.azimuth)
    }
}

/// Unit vector east, north, up towards a place in the sky.
fn look_direction(look: LookAngle) -> Vector3<f64> {
    let ((sin_a, cos_a), (sin_e, cos_e)) = (libm::sincos(look.azimuth), libm::sincos(look.elevation));
    Vector3::new(cos_e * sin_a, cos_e * cos_a, sin_e)
}

/// The angle at the satellite between the Earth's centre and the receiver `[rad]`; ECEF of one time `[m]`. `direction` is
/// the unit vector from receiver to satellite. NaN where the satellite is in the Earth's centre.
pub fn nadir_angle(satellite: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    libm::atan2(satellite.cross(direction).norm(), satellite.dot(direction))
}

/// Which calibration stands for a frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Choice {
    /// Its place in the list.
    pub index: usize,
    /// The frequency that it was made for.
    pub band: AntennaBand,
    /// Whether that is the one asked for.
    pub exact: bool,
}

/// The calibration to use for `wanted` of a *receiver* antenna: its own; else that of the GPS frequency nearest to it
/// (most antennas of igs14.atx have GPS and GLONASS only); else the nearest of all. `None` if there is none at all.
pub fn choose_receiver(available: impl Iterator<Item = AntennaBand> + Clone, wanted: AntennaBand) -> Option<Choice> {
    own(available.clone(), wanted)
        .or_else(|| nearest(available.clone(), wanted, |band| band.constellation() == Constellation::Gps))
        .or_else(|| nearest(available, wanted, |_| true))
}

/// The calibration to use for `wanted` of a *satellite* antenna: its own, else the nearest frequency of the same
/// constellation.
pub fn choose_satellite(available: impl Iterator<Item = AntennaBand> + Clone, wanted: AntennaBand) -> Option<Choice> {
    let same = |band: AntennaBand| band.constellation() == wanted.constellation();
    own(available.clone(), wanted).or_else(|| nearest(available, wanted, same))
}

fn own(mut available: impl Iterator<Item = AntennaBand>, wanted: AntennaBand) -> Option<Choice> {
    available.position(|band| band == wanted).map(|index| Choice { index, band: wanted, exact: true })
}

fn nearest(
    available: impl Iterator<Item = AntennaBand>,
    wanted: AntennaBand,
    eligible: impl Fn(AntennaBand) -> bool,
) -> Option<Choice> {
    let target = wanted.frequency()?;
    let distance = |band: AntennaBand| band.frequency().map(|hz| libm::fabs(hz - target));
    available
        .enumerate()
        .filter(|&(_, band)| eligible(band))
        .filter_map(|(index, band)| Some((distance(band)?, Choice { index, band, exact: false })))
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, choice)| choice)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn band(text: &str) -> AntennaBand {
        let letter = text.chars().next().and_then(Constellation::from_letter).unwrap();
        AntennaBand::new(letter, text.as_bytes()[2]).unwrap()
    }

    const MEAN: [f64; 3] = [0.0, 0.002, 0.001];
    /// Azimuth 0, 180 and 360°.
    const ROWS: [f64; 9] = [0.0, 0.001, 0.003, 0.0, 0.003, -0.001, 0.0, 0.001, 0.003];

    fn variations() -> Variations<'static> {
        Variations { first: 0.0, step: 5.0, mean: &MEAN, azimuth_step: 180.0, rows: &ROWS }
    }

    #[test]
    fn variations_are_interpolated_and_held() {
        let v = variations();
        let near = |a: f64, b: f64| assert!((a - b).abs() < 1e-15, "{a} {b}");
        near(v.mean(2.5_f64.to_radians()), 0.001);
        near(v.mean(40.0_f64.to_radians()), 0.001);
        near(v.mean(-1.0), 0.0);
        near(v.at(5.0_f64.to_radians(), 0.0), 0.001);
        near(v.at(5.0_f64.to_radians(), 90.0_f64.to_radians()), 0.002);
        near(v.at(5.0_f64.to_radians(), -90.0_f64.to_radians()), 0.002);
        near(v.at(10.0_f64.to_radians(), 180.0_f64.to_radians()), -0.001);
        assert_eq!(Variations { rows: &[], ..v }.at(0.05, 1.0), v.mean(0.05));
    }

    #[test]
    fn a_high_phase_centre_shortens_the_range_at_both_ends() {
        let flat = Variations { first: 0.0, step: 5.0, mean: &[], azimuth_step: 0.0, rows: &[] };
        let receiver = Calibration { band: band("G01"), offset: [0.0, 0.0, 0.1], variations: flat };
        let zenith = LookAngle { azimuth: 1.0, elevation: core::f64::consts::FRAC_PI_2 };
        assert!((receiver.receiver_correction(&Vector3::new(0.0, 0.0, 1.5), zenith) + 1.6).abs() < 1e-15);
        // North, east, up: a satellite in the north sees the first.
        let tilted = Calibration { offset: [0.003, 0.0, 0.0], ..receiver };
        let north = LookAngle { azimuth: 0.0, elevation: 0.0 };
        assert!((tilted.receiver_correction(&Vector3::zeros(), north) + 0.003).abs() < 1e-15);
        // z points to the Earth: 2 m of it bring the antenna 2 m nearer to a receiver below.
        let up = Vector3::x();
        let axes = Axes { x: Vector3::z(), y: Vector3::new(0.0, -1.0, 0.0), z: -up };
        let satellite = Calibration { offset: [0.3, 0.0, 2.0], ..receiver };
        assert!((satellite.satellite_correction(&axes, &up, 0.0) + 2.0).abs() < 1e-15);
        assert_eq!(satellite.satellite_offset(&axes), Vector3::new(-2.0, 0.0, 0.3));
    }

    #[test]
    fn nadir_angles_end_at_the_limb() {
        // A GPS satellite on the horizon: sin ν = 6378/26560, 13.9°.
        let receiver = Vector3::new(6_378e3, 0.0, 0.0);
        let satellite = Vector3::new(6_378e3, (26_560e3_f64.powi(2) - 6_378e3_f64.powi(2)).sqrt(), 0.0);
        let direction = (satellite - receiver).normalize();
        assert!((nadir_angle(&satellite, &direction) - (6_378.0 / 26_560.0_f64).asin()).abs() < 1e-12);
    }

    #[test]
    fn missing_frequencies_are_replaced_by_the_nearest_and_it_is_said() {
        let igs14 = ["G01", "G02", "R01", "R02"].map(band);
        let choice = |text| choose_receiver(igs14.into_iter(), band(text)).unwrap();
        assert_eq!(choice("R02"), Choice { index: 3, band: band("R02"), exact: true });
        assert_eq!(choice("E01"), Choice { index: 0, band: band("G01"), exact: false });
        assert_eq!(choice("E05"), Choice { index: 1, band: band("G02"), exact: false });
        assert_eq!(choice("C02").band, band("G01"));
        assert_eq!(choose_receiver([band("R01")].into_iter(), band("E01")).unwrap().band, band("R01"));
        assert_eq!(choose_receiver([].into_iter(), band("E01")), None);
        assert_eq!(choose_satellite(igs14.into_iter(), band("E01")), None);
        assert_eq!(choose_satellite(igs14.into_iter(), band("G05")).unwrap().band, band("G02"));
        // (E03 is no band of Galileo.)
        assert_eq!(choose_receiver(igs14.into_iter(), band("E03")), None);
    }

    proptest! {
        #[test]
        fn any_grid_is_interpolated(
            mean in prop::collection::vec(-1.0..1.0_f64, 0..6), rows in prop::collection::vec(-1.0..1.0_f64, 0..20),
            first: f64, step: f64, azimuth_step: f64, angle: f64, azimuth: f64
        ) {
            let v = Variations { first, step, mean: &mean, azimuth_step, rows: &rows };
            prop_assert!(v.mean(angle).abs() <= 1.0 && v.at(angle, azimuth).abs() <= 1.0);
        }
    }
}
