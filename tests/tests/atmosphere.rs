//! Ionosphere and troposphere against independent programs (vector file 07).

use serde_json::Value;
use surefix_core::gnss::atmosphere::{Klobuchar, StandardAtmosphere, niell};
use surefix_core::gnss::geodesy::{Geodetic, LookAngle};

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn numbers<const N: usize>(value: &Value, from: usize) -> [f64; N] {
    std::array::from_fn(|i| number(&value[from + i]))
}

#[test]
fn delays_agree_with_the_golden_vectors() {
    let Some(path) = surefix_tests::shared("vectors/gnss/07_klobuchar_saastamoinen_niell.json") else { return };
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut checked = 0;
    for case in file["cases"].as_array().unwrap() {
        let input = |name: &str| number(&case["in"][name]);
        let at = || Geodetic { latitude: input("lat"), longitude: 0.0, height: input("height") };
        let results: Vec<(&str, f64)> = match case["model"].as_str().unwrap() {
            "klobuchar" => {
                let coefficients = &case["in"]["alpha_beta"];
                let model = Klobuchar { alpha: numbers(coefficients, 0), beta: numbers(coefficients, 4) };
                let [latitude, longitude, height] = numbers(&case["in"]["lat_lon_h"], 0);
                let look = LookAngle { azimuth: input("az"), elevation: input("el") };
                vec![("delay_L1", model.delay_l1(&Geodetic { latitude, longitude, height }, look, input("tow")))]
            }
            "saast" => {
                let air = StandardAtmosphere::at_height(input("height"), input("humidity"));
                let zenith = air.zenith_delay(&at());
                let cosecant = 1.0 / input("el").sin();
                vec![
                    ("pressure_hPa", air.pressure),
                    ("temperature_K", air.temperature),
                    ("vapour_pressure_hPa", air.vapour_pressure),
                    ("slant_hydrostatic", zenith.hydrostatic * cosecant),
                    ("slant_total", zenith.total() * cosecant),
                ]
            }
            "niell" => vec![
                ("hydrostatic", niell::hydrostatic(input("doy"), &at(), input("el"))),
                ("wet", niell::wet(input("lat"), input("el"))),
            ],
            other => panic!("unknown model {other}"),
        };
        assert_eq!(results.len(), case["out"].as_object().unwrap().len(), "{}", case["id"]);
        for (name, value) in results {
            let (expected, tolerance) = (number(&case["out"][name]["expected"]), number(&case["out"][name]["tol"]));
            assert!((value - expected).abs() <= tolerance, "{} {name}: {value}, expected {expected}", case["id"]);
            checked += 1;
        }
    }
    assert_eq!(checked, 446);
}
