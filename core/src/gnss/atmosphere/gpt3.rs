//! GPT3: weather, mapping function coefficients and gradients by place and season, from a grid of 5° (or 1°).
//!
//! Source: D. Landskron, J. Böhm, *VMF3/GPT3: refined discrete and empirical troposphere mapping functions*, J. Geod. 92
//! (2018), and TU Wien's gpt3_5_fast: each quantity is mean + A₁ cos + B₁ sin of the year + A₂ cos + B₂ sin of half of it,
//! carried to the receiver's height for each of four cells around it, then interpolated bilinearly. Beyond 87.5° of
//! latitude the nearest cell holds.
//!
//! The grid stays where it is: [`Gpt3Grid`] fetches single cells, from flash or from memory.
//!
//! a_h and a_w go with the coefficients b and c of VMF3, which are not part of the grid; with those of VMF1
//! ([`super::MappingFunction::Vmf1`]) they are not quite consistent. Heights are ellipsoidal; a_h refers to sea level.
//! Cost: four cells of 512 bytes on the stack, eight transcendental functions a cell. Panic contract: none.

use super::askne_nordius::{self, GAS, GRAVITY, MOLAR_MASS};
use super::saastamoinen::{self, ZenithDelay};
use crate::gnss::geodesy::Geodetic;
use crate::gnss::time::GpsTime;
use core::array::from_fn;
use core::f64::consts::{FRAC_PI_2, PI, TAU};

/// Mean, and amplitudes of cosine and sine of the year and of half the year.
pub type Seasonal = [f64; 5];

/// A cell of the grid, around its centre.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gpt3Cell {
    /// Pressure `[Pa]`.
    pub pressure: Seasonal,
    /// Temperature `[K]`.
    pub temperature: Seasonal,
    /// Specific humidity `[kg/kg]`.
    pub humidity: Seasonal,
    /// Temperature lapse rate `[K/m]`.
    pub lapse_rate: Seasonal,
    /// Height of the geoid above the ellipsoid `[m]`.
    pub undulation: f64,
    /// Height of the grid's weather above the geoid `[m]`.
    pub height: f64,
    /// Mapping function coefficients a, hydrostatic and wet.
    pub mapping: [Seasonal; 2],
    /// Water vapour decrease factor.
    pub decrease: Seasonal,
    /// Weighted mean temperature `[K]`.
    pub mean_temperature: Seasonal,
    /// Gradients `[m]`: hydrostatic north and east, wet north and east.
    pub gradients: [Seasonal; 4],
}

/// A grid of cells in rows from north to south, columns from Greenwich eastwards; cell (0, 0) reaches from the pole and
/// the meridian of Greenwich one step south and east.
pub trait Gpt3Grid {
    /// Size of the cells `[deg]`: 5 or 1.
    fn step(&self) -> u8;
    /// A cell, `None` if the grid does not have it.
    fn cell(&self, row: u16, column: u16) -> Option<Gpt3Cell>;
}

/// Weather, mapping coefficients and gradients at a receiver.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gpt3Weather {
    /// Pressure `[hPa]`.
    pub pressure: f64,
    /// Temperature `[K]`.
    pub temperature: f64,
    /// Temperature lapse rate `[K/m]`, negative upwards.
    pub lapse_rate: f64,
    /// Weighted mean temperature `[K]`.
    pub mean_temperature: f64,
    /// Water vapour pressure `[hPa]`.
    pub vapour_pressure: f64,
    /// Hydrostatic mapping coefficient a at sea level.
    pub hydrostatic_a: f64,
    /// Wet mapping coefficient a.
    pub wet_a: f64,
    /// Water vapour decrease factor.
    pub decrease: f64,
    /// Height of the geoid above the ellipsoid `[m]`.
    pub undulation: f64,
    /// Hydrostatic gradients to north and east `[m]`.
    pub hydrostatic_gradients: [f64; 2],
    /// Wet gradients to north and east `[m]`.
    pub wet_gradients: [f64; 2],
}

impl Gpt3Weather {
    /// Interpolates a grid for `time` at `receiver`. `None` if the grid lacks a cell that is needed or a coordinate is
    /// not finite.
    pub fn at(grid: &impl Gpt3Grid, time: GpsTime, receiver: &Geodetic) -> Option<Self> {
        let season = harmonics_of_year(time);
        let mut sum = [0.0; QUANTITIES];
        for (row, column, weight) in corners(grid.step(), receiver)? {
            if weight == 0.0 {
                continue;
            }
            let there = quantities(&grid.cell(row, column)?, &season, receiver.height);
            sum.iter_mut().zip(there).for_each(|(sum, value)| *sum += weight * value);
        }
        let [pressure, temperature, lapse_rate, mean_temperature, vapour_pressure, rest @ ..] = sum;
        let [hydrostatic_a, wet_a, decrease, undulation, north_h, east_h, north_w, east_w] = rest;
        Some(Self {
            pressure,
            temperature,
            lapse_rate,
            mean_temperature,
            vapour_pressure,
            hydrostatic_a,
            wet_a,
            decrease,
            undulation,
            hydrostatic_gradients: [north_h, east_h],
            wet_gradients: [north_w, east_w],
        })
    }

    /// Zenith delays of this weather: Saastamoinen's hydrostatic, Askne and Nordius' wet.
    pub fn zenith_delay(&self, receiver: &Geodetic) -> ZenithDelay {
        ZenithDelay {
            hydrostatic: saastamoinen::hydrostatic(self.pressure, receiver.latitude, receiver.height),
            wet: askne_nordius::wet(self.vapour_pressure, self.decrease, self.mean_temperature),
        }
    }
}

/// Quantities of [`Gpt3Weather`].
const QUANTITIES: usize = 13;

/// 1, cos, sin of the year, cos, sin of half of it.
fn harmonics_of_year(time: GpsTime) -> Seasonal {
    let angle = time.day_of_year() / 365.25 * TAU;
    let ((sin, cos), (sin_half, cos_half)) = (libm::sincos(angle), libm::sincos(2.0 * angle));
    [1.0, cos, sin, cos_half, sin_half]
}

/// A cell's values at a height `[m]` above the ellipsoid, in the order of the fields of [`Gpt3Weather`].
fn quantities(cell: &Gpt3Cell, season: &Seasonal, height: f64) -> [f64; QUANTITIES] {
    let now = |field: &Seasonal| -> f64 { field.iter().zip(season).map(|(a, b)| a * b).sum() };
    let (pressure, temperature, humidity) = (now(&cell.pressure), now(&cell.temperature), now(&cell.humidity));
    let (lapse_rate, decrease) = (now(&cell.lapse_rate), now(&cell.decrease));
    let above = height - cell.undulation - cell.height;

    // The pressure falls exponentially with the virtual temperature of the grid's height, the humidity with a power of it.
    let scale = GRAVITY * MOLAR_MASS / (GAS * temperature * (1.0 + 0.6077 * humidity));
    let at_height = pressure * libm::exp(-scale * above) / 100.0;
    let vapour = humidity * pressure / (0.622 + 0.378 * humidity) / 100.0;
    let vapour_at_height = vapour * libm::pow(100.0 * at_height / pressure, decrease + 1.0);

    let [hydrostatic, wet] = cell.mapping.each_ref().map(now);
    let [north_h, east_h, north_w, east_w] = cell.gradients.each_ref().map(now);
    [
        at_height,
        temperature + lapse_rate * above,
        lapse_rate,
        now(&cell.mean_temperature),
        vapour_at_height,
        hydrostatic,
        wet,
        decrease,
        cell.undulation,
        north_h,
        east_h,
        north_w,
        east_w,
    ]
}

/// Row, column and weight of the four cells around a receiver; `None` where a coordinate is not finite.
fn corners(step: u8, receiver: &Geodetic) -> Option<[(u16, u16, f64); 4]> {
    let step = f64::from(step.clamp(1, 90));
    let (rows, columns) = (libm::floor(180.0 / step), libm::floor(360.0 / step));
    let from_pole = (FRAC_PI_2 - receiver.latitude) * (180.0 / PI);
    let east = libm::fmod(receiver.longitude * (180.0 / PI), 360.0);
    if !(0.0..=180.0).contains(&from_pole) || east.is_nan() {
        return None;
    }
    // Cell centres are at whole numbers of these.
    let row = from_pole / step - 0.5;
    let column = (if east < 0.0 { east + 360.0 } else { east }) / step - 0.5;
    let (north, west) = (libm::floor(row), libm::floor(column));
    // Beyond the outermost centres the nearest cell holds: also in longitude, as in TU Wien's program.
    let polar = from_pole <= step / 2.0 || from_pole >= 180.0 - step / 2.0;
    let (south_share, east_share) =
        if polar { (libm::round(row - north), libm::round(column - west)) } else { (row - north, column - west) };
    let row_of = |row: f64| row.min(rows - 1.0).max(0.0) as u16;
    let column_of = |column: f64| libm::fmod(column + columns, columns) as u16;
    Some(from_fn(|corner| {
        let (south, east) = (corner & 1 == 1, corner & 2 == 2);
        let share = |share: f64, there: bool| if there { share } else { 1.0 - share };
        let (row, column) = (north + f64::from(u8::from(south)), west + f64::from(u8::from(east)));
        (row_of(row), column_of(column), share(south_share, south) * share(east_share, east))
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// A grid whose undulation is `row + column / 100` and whose other values are plausible.
    struct Ramp;

    impl Gpt3Grid for Ramp {
        fn step(&self) -> u8 {
            5
        }

        fn cell(&self, row: u16, column: u16) -> Option<Gpt3Cell> {
            let mean = |value: f64| [value, 0.0, 0.0, 0.0, 0.0];
            (row < 36 && column < 72).then(|| Gpt3Cell {
                pressure: mean(101_325.0),
                temperature: mean(288.15),
                humidity: mean(0.008),
                lapse_rate: mean(-6.5e-3),
                undulation: f64::from(row) + f64::from(column) / 100.0,
                height: 0.0,
                mapping: [mean(1.2e-3), mean(5.5e-4)],
                decrease: mean(2.8),
                mean_temperature: mean(275.0),
                gradients: [mean(0.0); 4],
            })
        }
    }

    fn undulation(latitude: f64, longitude: f64) -> f64 {
        let receiver = Geodetic { latitude: latitude.to_radians(), longitude: longitude.to_radians(), height: 0.0 };
        Gpt3Weather::at(&Ramp, GpsTime::default(), &receiver).unwrap().undulation
    }

    #[test]
    fn centres_are_hit_and_between_them_it_is_linear() {
        for (latitude, longitude, value) in [
            (87.5, 2.5, 0.0),
            (82.5, 7.5, 1.01),
            (85.0, 5.0, 0.505),
            (-87.5, -2.5, 35.71),
            (0.0, 0.0, 17.5 + 71.0 / 200.0), // across Greenwich
            (90.0, 1.0, 0.0),                // at the pole the nearest
            (89.0, 6.0, 0.01),
            (-90.0, 357.6, 35.71),
        ] {
            assert!((undulation(latitude, longitude) - value).abs() < 1e-9, "{latitude} {longitude}");
        }
    }

    #[test]
    fn sea_level_weather_is_that_of_the_cell() {
        let receiver = Geodetic { latitude: 0.0, longitude: 1.0, height: 0.0 };
        let weather = Gpt3Weather::at(&Ramp, GpsTime::default(), &receiver).unwrap();
        let zenith = weather.zenith_delay(&receiver);
        assert!((2.25..2.35).contains(&zenith.hydrostatic) && (0.05..0.25).contains(&zenith.wet));
    }

    proptest! {
        #[test]
        fn weights_sum_to_one_and_cells_exist(latitude in -90.0..=90.0f64, longitude in -1e3..1e3f64, step in 1..=30u8) {
            let receiver =
                Geodetic { latitude: latitude.to_radians(), longitude: longitude.to_radians(), height: 0.0 };
            let corners = corners(step, &receiver).unwrap();
            prop_assert!((corners.iter().map(|corner| corner.2).sum::<f64>() - 1.0).abs() < 1e-12);
            for (row, column, _) in corners {
                prop_assert!(row < 180 / u16::from(step) && column < 360 / u16::from(step));
            }
        }

        #[test]
        fn takes_anything(ns: i64, latitude: f64, longitude: f64, height: f64) {
            let receiver = Geodetic { latitude, longitude, height };
            let _ = Gpt3Weather::at(&Ramp, GpsTime::from_nanoseconds(ns), &receiver);
        }
    }
}
