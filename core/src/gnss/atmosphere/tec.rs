//! Ionospheric delay from maps of vertical electron content (IONEX), in a single layer.
//!
//! Source: S. Schaer, W. Gurtner, J. Feltens, *IONEX: The IONosphere Map EXchange Format Version 1* (1998). With the zenith
//! angle z = π/2 − ε at the receiver and sin z' = R/(R + H) sin z at the layer, the sight pierces it at the angle
//! ψ = z − z' around the Earth's centre in direction α, and the slant content is the vertical one times 1/cos z'.
//! Between two maps at T₁ and T₂ the content is interpolated linearly, each map turned with the Sun (equation (3) there):
//! E(φ, λ, t) = ((T₂ − t) E₁(φ, λ + ω(t − T₁)) + (t − T₁) E₂(φ, λ + ω(t − T₂))) / (T₂ − T₁), ω = 360° a day; a map is
//! bilinear between its nodes.
//!
//! Delay on code `[m]`: 40.3e16 / f² per TECU; the phase is *advanced* by as much. Times of maps are UT; taken for GPST they
//! are wrong by up to 20 s, which is 0.02 TECU. Cost: eight transcendental functions. Panic contract: none.

use crate::gnss::geodesy::{Geodetic, LookAngle};
use crate::gnss::time::GpsTime;
use core::f64::consts::{FRAC_PI_2, PI};

/// Code delay of 1 TECU (1e16 electrons/m²) at 1 Hz `[m Hz²]`.
const DELAY_PER_TECU: f64 = 40.3e16;
/// Seconds in a turn of the Sun.
const DAY: f64 = 86_400.0;

/// Delay `[m]` of a code of `frequency` `[Hz]` by `tec` `[TECU]`.
pub fn code_delay(tec: f64, frequency: f64) -> f64 {
    DELAY_PER_TECU / frequency / frequency * tec
}

/// A layer that holds all electrons.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SingleLayer {
    /// Radius of the Earth that maps refer to `[m]`: 6 371 000 by convention.
    pub base_radius: f64,
    /// Height of the layer above it `[m]`, 450 000 mostly.
    pub shell_height: f64,
    /// Whether the receiver's own height counts too, as in RTKLIB: 2 mm per 100 m at 11°. Not in the convention.
    pub with_receiver_height: bool,
}

/// Where a sight pierces the layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PiercePoint {
    /// Latitude `[rad]`.
    pub latitude: f64,
    /// Longitude `[rad]`, −π…π.
    pub longitude: f64,
    /// Slant over vertical content, 1/cos z'.
    pub slant_factor: f64,
}

impl SingleLayer {
    /// The pierce point of a sight. `None` below the horizon, or for a layer below the receiver.
    pub fn pierce(&self, receiver: &Geodetic, look: LookAngle) -> Option<PiercePoint> {
        let radius = self.base_radius + if self.with_receiver_height { receiver.height } else { 0.0 };
        let sin_layer = radius / (self.base_radius + self.shell_height) * libm::cos(look.elevation);
        if !(look.elevation > 0.0 && sin_layer < 1.0) {
            return None;
        }
        let angle = FRAC_PI_2 - look.elevation - libm::asin(sin_layer);
        let (sin_angle, cos_angle) = libm::sincos(angle);
        let (sin_latitude, cos_latitude) = libm::sincos(receiver.latitude);
        let (sin_azimuth, cos_azimuth) = libm::sincos(look.azimuth);
        let sin_pierced = sin_latitude * cos_angle + cos_latitude * sin_angle * cos_azimuth;
        let east = sin_angle * sin_azimuth;
        let meridian = cos_angle * cos_latitude - sin_angle * sin_latitude * cos_azimuth;
        Some(PiercePoint {
            latitude: libm::asin(sin_pierced.clamp(-1.0, 1.0)),
            longitude: libm::remainder(receiver.longitude + libm::atan2(east, meridian), 2.0 * PI),
            slant_factor: 1.0 / libm::sqrt(1.0 - sin_layer * sin_layer),
        })
    }
}

/// Equidistant nodes along a coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    /// The first node `[deg]`.
    pub first: f64,
    /// From a node to the next `[deg]`, negative where they descend.
    pub step: f64,
    /// Number of nodes.
    pub count: u16,
}

/// The content's vertical map at one time: borrowed nodes, row by row of equal latitude.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TecMap<'a> {
    /// When (GPST).
    pub time: GpsTime,
    /// The rows.
    pub latitudes: Axis,
    /// The columns.
    pub longitudes: Axis,
    /// TECU per unit of `values`, 0.1 mostly.
    pub unit: f64,
    /// One number a node; [`NO_VALUE`] where nothing is known.
    pub values: &'a [i32],
}

/// The value of nodes of which nothing is known.
pub const NO_VALUE: i32 = 9_999;

impl TecMap<'_> {
    /// Vertical content `[TECU]` at latitude and longitude `[deg]`, of any turn. Up to a step beyond the first and last
    /// row their values hold (maps end at ±87.5°). `None` outside of the map or next to a node without a value.
    pub fn at(&self, latitude: f64, longitude: f64) -> Option<f64> {
        let row = (latitude - self.latitudes.first) / self.latitudes.step;
        let last = f64::from(self.latitudes.count) - 1.0;
        if !(-1.0..=last + 1.0).contains(&row) {
            return None;
        }
        let turn = libm::fabs(360.0 / self.longitudes.step);
        let along = libm::fmod((longitude - self.longitudes.first) / self.longitudes.step, turn);
        let column = if along < 0.0 { along + turn } else { along };
        let ([row, below], row_share) = between(row.min(last).max(0.0));
        let ([column, right], column_share) = between(column);
        let mut sum = 0.0;
        for (row, share) in [(row, 1.0 - row_share), (below, row_share)] {
            for (column, weight) in [(column, share * (1.0 - column_share)), (right, share * column_share)] {
                if weight != 0.0 {
                    sum += weight * self.node(row, column, turn)?;
                }
            }
        }
        Some(sum)
    }

    /// Content of a node `[TECU]`; columns repeat after `turn` nodes.
    fn node(&self, row: usize, column: usize, turn: f64) -> Option<f64> {
        let columns = usize::from(self.longitudes.count);
        let column = if column < columns { column } else { column.checked_sub(libm::round(turn) as usize)? };
        if row >= usize::from(self.latitudes.count) || column >= columns {
            return None;
        }
        let value = self.values.get(row * columns + column).copied()?;
        (value != NO_VALUE).then_some(f64::from(value) * self.unit)
    }
}

/// The nodes around a place among them, and the share of the second.
fn between(place: f64) -> ([usize; 2], f64) {
    let first = libm::floor(place);
    ([first as usize, (first as usize).saturating_add(1)], place - first)
}

/// Two maps that follow each other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TecMaps<'a> {
    /// The earlier map.
    pub before: TecMap<'a>,
    /// The later map; the same one again where only one is at hand.
    pub after: TecMap<'a>,
    /// Whether the maps are turned with the Sun; without, the error is up to several TECU.
    pub turned: bool,
}

impl TecMaps<'_> {
    /// Vertical content `[TECU]` at `time` over a pierce point. `None` outside of the maps in space or time.
    pub fn vertical(&self, time: GpsTime, pierced: &PiercePoint) -> Option<f64> {
        let span = self.after.time.since(self.before.time);
        let since = time.since(self.before.time);
        if since < 0.0 || since > span {
            return None;
        }
        let share = if span > 0.0 { since / span } else { 0.0 };
        let (latitude, longitude) = (pierced.latitude * (180.0 / PI), pierced.longitude * (180.0 / PI));
        let of = |map: &TecMap| {
            let turn = if self.turned { time.since(map.time) / DAY * 360.0 } else { 0.0 };
            map.at(latitude, longitude + turn)
        };
        let before = if share < 1.0 { of(&self.before)? } else { 0.0 };
        let after = if share > 0.0 { of(&self.after)? } else { 0.0 };
        Some((1.0 - share) * before + share * after)
    }

    /// Slant content `[TECU]` at `time` in the direction `look` from `receiver`; see [`code_delay`] for its delay.
    pub fn slant(&self, layer: &SingleLayer, time: GpsTime, receiver: &Geodetic, look: LookAngle) -> Option<f64> {
        let pierced = layer.pierce(receiver, look)?;
        Some(self.vertical(time, &pierced)? * pierced.slant_factor)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const LAYER: SingleLayer = SingleLayer { base_radius: 6_371e3, shell_height: 450e3, with_receiver_height: false };

    /// 3 rows at 10, 0, −10°, 4 columns each 90° from −180°: value `10 row + column`, in tenths.
    fn map(values: &[i32], seconds: f64) -> TecMap<'_> {
        TecMap {
            time: GpsTime::from_week_tow(2000, seconds),
            latitudes: Axis { first: 10.0, step: -10.0, count: 3 },
            longitudes: Axis { first: -180.0, step: 90.0, count: 4 },
            unit: 0.1,
            values,
        }
    }

    const VALUES: [i32; 12] = [0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, NO_VALUE];

    #[test]
    fn a_map_is_bilinear_closed_in_longitude_and_held_at_its_edges() {
        let at = |latitude, longitude| map(&VALUES, 0.0).at(latitude, longitude);
        let near = |value: Option<f64>, expected: f64| assert!((value.unwrap() - expected).abs() < 1e-12);
        near(at(0.0, -90.0), 1.1);
        near(at(5.0, -45.0), 0.65);
        near(at(0.0, 135.0), 1.15); // between 90° and 180° = −180°
        near(at(0.0, 180.0 + 360.0), 1.0);
        near(at(15.0, 0.0), 0.2);
        assert_eq!(at(-5.0, 90.0), None);
        assert_eq!(at(25.0, 0.0), None);
        assert_eq!(at(f64::NAN, 0.0), None);
    }

    /// Bug: within a step of its first row, a map without rows panicked, as its last row lies before its first.
    #[test]
    fn a_map_without_rows_or_columns_has_no_value() {
        let whole = map(&VALUES, 0.0);
        for (rows, columns) in [(0, 4), (3, 0), (0, 0)] {
            let latitudes = Axis { count: rows, ..whole.latitudes };
            let longitudes = Axis { count: columns, ..whole.longitudes };
            assert_eq!(TecMap { latitudes, longitudes, ..whole }.at(12.0, 0.0), None);
        }
    }

    #[test]
    fn maps_are_interpolated_and_turned_with_the_sun() {
        let (early, late) = ([10; 12], [20; 12]);
        let mut maps = TecMaps { before: map(&early, 0.0), after: map(&late, 7_200.0), turned: true };
        let under = PiercePoint { latitude: 0.0, longitude: 0.0, slant_factor: 1.0 };
        let at = |maps: &TecMaps, seconds| maps.vertical(GpsTime::from_week_tow(2000, seconds), &under);
        assert!((at(&maps, 1_800.0).unwrap() - 1.25).abs() < 1e-12);
        assert_eq!((at(&maps, -1.0), at(&maps, 7_201.0)), (None, None));
        // Six hours later the Sun stands over where 90° further east it stood.
        maps.after = map(&VALUES, 43_200.0);
        maps.before = map(&VALUES, 0.0);
        assert!((at(&maps, 21_600.0).unwrap() - (1.3 + 1.1) / 2.0).abs() < 1e-12);
    }

    #[test]
    fn the_zenith_is_pierced_above_the_receiver() {
        let receiver = Geodetic { latitude: 0.8, longitude: 3.1, height: 500.0 };
        let pierced = LAYER.pierce(&receiver, LookAngle { azimuth: 1.0, elevation: FRAC_PI_2 }).unwrap();
        assert!((pierced.latitude - 0.8).abs() < 1e-12 && (pierced.longitude - 3.1).abs() < 1e-12);
        assert!((pierced.slant_factor - 1.0).abs() < 1e-12);
        // 40.3e16/(1575.42e6)²: 0.1624 m per TECU.
        assert!((code_delay(1.0, 1_575.42e6) - 0.162_372).abs() < 1e-6);
        assert_eq!(LAYER.pierce(&receiver, LookAngle { azimuth: 1.0, elevation: -0.1 }), None);
    }

    proptest! {
        #[test]
        fn the_pierce_point_is_in_the_direction_of_the_sight(
            latitude in -1.5..1.5f64, longitude in -3.1..3.1f64, azimuth in 0.0..6.2f64, elevation in 0.05..1.5f64,
        ) {
            let receiver = Geodetic { latitude, longitude, height: 0.0 };
            let pierced = LAYER.pierce(&receiver, LookAngle { azimuth, elevation }).unwrap();
            let unit = |latitude: f64, longitude: f64| {
                nalgebra::Vector3::new(latitude.cos() * longitude.cos(), latitude.cos() * longitude.sin(), latitude.sin())
            };
            // Sight from the sphere's surface, in its spherical horizon system.
            let here = unit(latitude, longitude);
            let sight = unit(pierced.latitude, pierced.longitude) * 6_821e3 - here * 6_371e3;
            let look = receiver.look(&sight);
            prop_assert!((look.elevation - elevation).abs() < 1e-9);
            prop_assert!((libm::remainder(look.azimuth - azimuth, 2.0 * PI)).abs() < 1e-8);
            let cos_layer = sight.normalize().dot(&unit(pierced.latitude, pierced.longitude));
            prop_assert!((pierced.slant_factor * cos_layer - 1.0).abs() < 1e-9);
        }

        #[test]
        fn takes_anything(
            latitude: f64, longitude: f64, first: f64, step: f64, count: u16, values in prop::collection::vec(any::<i32>(), 0..20), ns: i64,
        ) {
            let axis = Axis { first, step, count };
            let any_map = TecMap { time: GpsTime::from_nanoseconds(ns), latitudes: axis, longitudes: axis, unit: 0.1, values: &values };
            let _ = any_map.at(latitude, longitude);
            let receiver = Geodetic { latitude, longitude, height: step };
            let maps = TecMaps { before: any_map, after: map(&VALUES, 0.0), turned: true };
            let _ = maps.slant(&LAYER, GpsTime::default(), &receiver, LookAngle { azimuth: longitude, elevation: latitude });
        }
    }
}
