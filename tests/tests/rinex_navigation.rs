//! Navigation files are read as the golden vectors say: every ephemeris listed there, number by number.

use serde_json::Value;
use std::path::PathBuf;
use surefix::read::rinex::NavigationData;
use surefix_core::gnss::ephemeris::{Ephemeris, KeplerEphemeris, NavigationMessage};
use surefix_core::gnss::time::GpsTime;
use surefix_tests::shared;

/// The navigation file that the vectors mean.
fn file(name: &str) -> Option<PathBuf> {
    let path = match name {
        "static_nagoya_2024176_1hz base.nav" => "data/static_nagoya_2024176_1hz/base.nav.gz",
        "kinematic_ucr_car_2020194 COM3_200712.nav" => "data/kinematic_ucr_car_2020194/rover.nav.gz",
        "ESBC00DNK_R_20201770000_01D_MN.rnx" => "data/ppp_esbc_2020177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz",
        "SEPT2650.21P" => "data/kinematic_tokyo_2021265_1hz/SEPT2650.21P.gz",
        other => panic!("the vectors name a file that this test does not know: {other}"),
    };
    shared(path)
}

fn vectors(name: &str) -> Option<Value> {
    let text = std::fs::read_to_string(shared(&format!("vectors/gnss/{name}"))?).unwrap();
    Some(serde_json::from_str(&text).unwrap())
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn numbers<const N: usize>(value: &Value) -> [f64; N] {
    std::array::from_fn(|i| number(&value[i]))
}

fn time(week_tow: &Value) -> GpsTime {
    let [week, tow] = numbers(week_tow);
    GpsTime::from_week_tow(week as i32, tow)
}

fn kepler(data: &NavigationData) -> impl Iterator<Item = &KeplerEphemeris> {
    data.ephemerides.iter().filter_map(|ephemeris| match ephemeris {
        Ephemeris::Kepler(kepler) => Some(kepler),
        Ephemeris::Glonass(_) => None,
    })
}

#[test]
fn kepler_ephemerides_are_those_of_the_vectors() {
    let Some(vectors) = vectors("03_broadcast_kepler.json") else { return };
    for (id, expected) in vectors["ephemerides"].as_object().unwrap() {
        let Some(path) = file(expected["file"].as_str().unwrap()) else { continue };
        let data = NavigationData::open(&path).unwrap();
        let message = match expected["data_source"].as_u64() {
            Some(word) if word & 1 << 9 != 0 => Some(NavigationMessage::Inav),
            Some(_) => Some(NavigationMessage::Fnav),
            None => None,
        };
        let found: Vec<_> = kepler(&data)
            .filter(|e| e.satellite.to_string() == expected["sat"] && e.toe == time(&expected["toe_gpst"]))
            .filter(|e| message.is_none_or(|message| e.message == message))
            .filter(|e| f64::from(e.iode) == number(&expected["iode"]) && e.toc == time(&expected["toc_gpst"]))
            .filter(|e| e.health == number(&expected["health"]) as u16)
            .collect();
        assert!(!found.is_empty(), "{id} is missing");
        let same = |e: &&&KeplerEphemeris| {
            let values = [
                (e.delta_n, "deln"),
                (e.m0, "M0"),
                (e.e, "e"),
                (e.i0, "i0"),
                (e.omega0, "OMG0"),
                (e.omega, "omg"),
                (e.omega_dot, "OMGd"),
                (e.idot, "idot"),
                (e.cuc, "cuc"),
                (e.cus, "cus"),
                (e.crc, "crc"),
                (e.crs, "crs"),
                (e.cic, "cic"),
                (e.cis, "cis"),
                (e.af0, "f0"),
                (e.af1, "f1"),
                (e.af2, "f2"),
            ];
            let [delay_0, delay_1] = numbers(&expected["group_delay_fields"]);
            // The second field of GPS and QZSS is IODC there.
            let lnav = e.message == NavigationMessage::Lnav;
            values.into_iter().all(|(value, name)| value == number(&expected[name]))
                && (e.sqrt_a * e.sqrt_a - number(&expected["A"])).abs() < 1e-7
                && e.group_delay[0] == delay_0
                && (lnav || e.group_delay[1] == delay_1)
        };
        assert!(found.iter().any(|e| same(&e)), "{id}: none of {found:#?} is {expected:#}");
    }
}

#[test]
fn glonass_ephemerides_are_those_of_the_vectors() {
    let Some(vectors) = vectors("04_glonass.json") else { return };
    for case in vectors["cases"].as_array().unwrap() {
        let input = &case["in"];
        let Some(path) = file(input["file"].as_str().unwrap()) else { continue };
        let data = NavigationData::open(&path).unwrap();
        let near = |a: [f64; 3], b: [f64; 3], tolerance: f64| a.iter().zip(b).all(|(a, b)| (a - b).abs() <= tolerance);
        let found = data.ephemerides.iter().any(|ephemeris| match ephemeris {
            Ephemeris::Glonass(e) => {
                e.satellite.to_string() == input["sat"]
                    && e.toe == time(&input["toe_gpst"])
                    // Kilometres in the file: the product with 1000 rounds in the last bit.
                    && near(e.position, numbers(&input["pos"]), 1e-8)
                    && near(e.velocity, numbers(&input["vel"]), 1e-12)
                    && near(e.acceleration, numbers(&input["acc"]), 1e-20)
                    // The vectors name τn; RINEX and we have −τn.
                    && e.clock_bias == -number(&input["taun"])
                    && e.frequency_bias == number(&input["gamn"])
            }
            Ephemeris::Kepler(_) => false,
        });
        assert!(found, "{} is missing", case["id"]);
    }
}

#[test]
fn every_ephemeris_that_the_selection_vectors_choose_is_there() {
    let Some(vectors) = vectors("05_ephemeris_selection.json") else { return };
    for case in vectors["cases"].as_array().unwrap() {
        let Some(path) = file(case["in"]["file"].as_str().unwrap()) else { continue };
        let expected = &case["out"]["selected_toe_week_toe_tow_iode_health"]["expected"];
        if expected == "none" {
            continue;
        }
        let data = NavigationData::open(&path).unwrap();
        let found = kepler(&data).any(|e| {
            e.satellite.to_string() == case["in"]["sat"]
                && e.toe == time(expected)
                && f64::from(e.iode) == number(&expected[2])
                && f64::from(e.health) == number(&expected[3])
        });
        assert!(found, "{}: {expected} is missing", case["id"]);
    }
}
