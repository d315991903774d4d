//! Single points against RTKLIB and an independent least squares (vector file 13).

use nalgebra::Vector3;
use serde_json::Value;
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::atmosphere::{Klobuchar, Mapping};
use surefix_core::gnss::geodesy::{Geodetic, line_of_sight, look_angle, sagnac_first_order};
use surefix_core::gnss::orbit::SatelliteState;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::time::GpsTime;
use surefix_core::spp::adjust::{Unknowns, equations};
use surefix_core::spp::position::{Atmosphere, PositionModel};
use surefix_core::spp::rows::Row;
use surefix_core::spp::{Config, SinglePoint, estimate};

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("an array").iter().map(number).collect()
}

fn satellite(value: &Value) -> SatelliteId {
    value.as_str().and_then(|name| name.parse().ok()).expect("a satellite")
}

/// The rows of a case: satellite states, codes and variances as listed.
///
/// The file's programs have the first-order Sagnac term; the full rotation differs from it by up to 0.11 mm, the same
/// size as the tolerances. The difference, a function of the listed states, is put on the codes.
fn rows(case: &Value, time: GpsTime) -> Vec<Row> {
    let receiver = Vector3::from_column_slice(&numbers(&case["out"]["position_ecef"]["expected"]));
    let beyond_first_order = |satellite: &Vector3<f64>| {
        let first_order = (satellite - receiver).norm() + sagnac_first_order(&receiver, satellite);
        line_of_sight(&receiver, satellite).range - first_order
    };
    let position = |s: &Value| Vector3::from_column_slice(&numbers(&s["satellite_ecef"]));
    let row = |s: &Value| Row {
        satellite: satellite(&s["sat"]),
        state: SatelliteState {
            time,
            position: position(s),
            velocity: Vector3::from_column_slice(&numbers(&s["satellite_velocity_ecef"])),
            clock: number(&s["satellite_clock"]),
            clock_drift: number(&s["satellite_clock_drift"]),
            relativity: 0.0,
        },
        code: number(&s["code_corrected"]) + beyond_first_order(&position(s)),
        code_variance: number(&s["variance"]),
        frequency: number(&s["f_hz"]),
        doppler: None,
        doppler_variance: 1.0,
        cn0: None,
        accuracy: 0.0,
    };
    case["in"]["satellites"].as_array().unwrap().iter().map(row).collect()
}

/// Every output of a case that is an estimator's, by its name in the file.
fn outputs(point: &SinglePoint, rows: &[Row], atmosphere: &Atmosphere) -> Vec<(String, Vec<f64>)> {
    let clock = |constellation: Constellation| point.clocks[constellation.index()];
    let gps = clock(Constellation::Gps).expect("GPS in every case");
    let mut all = vec![
        ("position_ecef".into(), point.position.as_slice().to_vec()),
        ("receiver_clock_s".into(), vec![gps / SPEED_OF_LIGHT]),
        (
            "dop_gdop_pdop_hdop_vdop".into(),
            vec![point.dop.geometric, point.dop.position, point.dop.horizontal, point.dop.vertical],
        ),
    ];
    for constellation in Constellation::ALL.into_iter().filter(|&c| c != Constellation::Gps) {
        if let Some(other) = clock(constellation) {
            let name = format!("clock_offset_{}_minus_GPS_s", constellation.letter());
            all.push((name, vec![(other - gps) / SPEED_OF_LIGHT]));
        }
    }
    let biases = std::array::from_fn(|group| point.clocks[group].unwrap_or(0.0));
    let unknowns = Unknowns { vector: point.position, biases };
    let model = PositionModel { atmosphere: *atmosphere };
    let residuals = equations(&model, rows, &point.rejected, &unknowns).map(|(_, e)| e.residual).collect();
    let receiver = Geodetic::from_ecef(&point.position);
    let looks: Vec<_> = rows.iter().map(|row| look_angle(&point.position, &row.state.position)).collect();
    let delays: Vec<_> =
        rows.iter().zip(&looks).map(|(row, &look)| atmosphere.delays(&receiver, look, row.frequency)).collect();
    all.push(("residuals_m".into(), residuals));
    let degrees = looks.iter().flat_map(|look| [look.azimuth.to_degrees(), look.elevation.to_degrees()]);
    all.push(("az_el_deg".into(), degrees.collect()));
    all.push(("slant_iono_m".into(), delays.iter().map(|d| d.ionosphere.unwrap()).collect()));
    all.push(("slant_tropo_m".into(), delays.iter().map(|d| d.troposphere).collect()));
    all
}

fn flat(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(items) => items.iter().flat_map(flat).collect(),
        other => vec![number(other)],
    }
}

#[test]
fn the_estimator_agrees_with_the_golden_vectors() {
    let Some(path) = surefix_tests::shared("vectors/gnss/13_single_point.json") else { return };
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let cases = file["cases"].as_array().unwrap();
    for case in cases {
        let input = &case["in"];
        let k = numbers(&input["klobuchar"]);
        let week = input["gps_week"].as_i64().unwrap() as i32;
        let atmosphere = Atmosphere {
            time: GpsTime::from_week_tow(week, number(&input["tow"])),
            klobuchar: Some(Klobuchar { alpha: [k[0], k[1], k[2], k[3]], beta: [k[4], k[5], k[6], k[7]] }),
            mapping: Mapping::Cosecant,
        };
        let rows = rows(case, atmosphere.time);
        let point = estimate(&rows, &atmosphere, Unknowns::default(), &Config::DEFAULT).unwrap();
        assert!(point.rejected.is_empty() && point.used.len() == rows.len(), "{}: {:?}", case["id"], point.rejected);
        for (name, values) in outputs(&point, &rows, &atmosphere) {
            let (expected, tolerance) = (flat(&case["out"][&name]["expected"]), number(&case["out"][&name]["tol"]));
            assert_eq!(values.len(), expected.len(), "{} {name}", case["id"]);
            for (value, expected) in values.iter().zip(expected) {
                assert!((value - expected).abs() <= tolerance, "{} {name}: {value}, expected {expected}", case["id"]);
            }
        }
    }
    assert_eq!(cases.len(), 19);
}
