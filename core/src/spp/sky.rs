//! Simulated satellites with exact measurements, for tests of this room.

use super::adjust::{Model, Unknowns};
use super::position::{Atmosphere, PositionModel};
use super::rows::Row;
use super::velocity::VelocityModel;
use crate::gnss::SPEED_OF_LIGHT;
use crate::gnss::atmosphere::{Klobuchar, Mapping};
use crate::gnss::geodesy::Geodetic;
use crate::gnss::orbit::SatelliteState;
use crate::gnss::satellite::{Constellation, SatelliteId};
use crate::gnss::time::GpsTime;
use nalgebra::Vector3;

/// Near Wettzell, moving.
pub const RECEIVER: Vector3<f64> = Vector3::new(4_075_580.0, 931_853.0, 4_801_568.0);
pub const VELOCITY: Vector3<f64> = Vector3::new(12.0, -7.0, 3.0);
/// Receiver clock offsets by constellation `[m]` and their drift `[m/s]`.
pub const CLOCKS: [f64; 5] = [90_000.0, 90_006.0, 89_980.0, 90_002.0, 90_050.0];
pub const DRIFT: f64 = 31.0;
pub const ATMOSPHERE: Atmosphere = Atmosphere {
    time: GpsTime::from_nanoseconds(1_277_078_400_000_000_000),
    klobuchar: Some(Klobuchar {
        alpha: [4.6566e-9, 1.4901e-8, -5.9605e-8, -1.1921e-7],
        beta: [81_920.0, 98_304.0, -65_536.0, -524_290.0],
    }),
    mapping: Mapping::Niell,
};

/// Rows of as many satellites of each constellation as told, spread over the sky above 15°, with exact code and Doppler.
pub fn sky(numbers: &[u8; 5]) -> Vec<Row> {
    let here = Geodetic::from_ecef(&RECEIVER);
    let mut rows = Vec::new();
    for (constellation, &count) in Constellation::ALL.into_iter().zip(numbers) {
        for number in 1..=count {
            // Golden-angle spiral: never two satellites in a line.
            let turn = 2.399963 * rows.len() as f64;
            let elevation = 0.26 + 1.2 * ((rows.len() * 7) % 11) as f64 / 11.0;
            let (sin, cos) = elevation.sin_cos();
            let direction = here.enu_to_ecef(&Vector3::new(cos * turn.sin(), cos * turn.cos(), sin));
            let mut row = Row {
                satellite: SatelliteId::new(constellation, number).unwrap(),
                state: SatelliteState {
                    time: ATMOSPHERE.time,
                    position: RECEIVER + direction * 2.2e7,
                    velocity: Vector3::new(1500.0 * turn.cos(), -2000.0 * turn.sin(), 1800.0),
                    clock: 1e-5 * turn.sin(),
                    clock_drift: 1e-11,
                    relativity: 0.0,
                },
                code: 0.0,
                code_variance: 1.0,
                frequency: 1_575.42e6,
                doppler: Some(0.0),
                doppler_variance: 0.01,
                cn0: Some(45.0),
                accuracy: 2.0,
            };
            let position = PositionModel { atmosphere: ATMOSPHERE };
            let at = position.point(&Unknowns { vector: RECEIVER, biases: CLOCKS });
            row.code = -position.equation(&row, &at).unwrap().residual;
            let rate = VelocityModel { position: RECEIVER };
            let at = Unknowns { vector: VELOCITY, biases: [DRIFT, 0.0, 0.0, 0.0, 0.0] };
            let residual = rate.equation(&row, &at).unwrap().residual;
            row.doppler = Some(residual * row.frequency / SPEED_OF_LIGHT);
            rows.push(row);
        }
    }
    rows
}
