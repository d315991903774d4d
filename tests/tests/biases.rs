//! Biases of real products: what is read, and that the clocks' pairs of signals have none.

use std::path::PathBuf;
use surefix::read::bias::BiasData;
use surefix_core::gnss::satellite::{Constellation, SatelliteId};
use surefix_core::gnss::signal::Signal;
use surefix_core::gnss::time::{Calendar, GpsTime};

/// A nanosecond of light `[m]`.
const NS: f64 = 0.299_792_458;

fn file(name: &str) -> Option<PathBuf> {
    surefix_tests::shared(&format!("data/{name}"))
}

fn read(name: &str) -> Option<BiasData> {
    let (data, report) = BiasData::open(&file(name)?).unwrap();
    assert!(report.records > 0 && report.dropped.is_empty(), "{report}");
    Some(data)
}

fn date(year: i32, month: u8, day: u8) -> GpsTime {
    GpsTime::from_calendar(&Calendar { hour: 12, ..Calendar::date(year, month, day) }).unwrap()
}

fn signal(name: &str) -> Signal {
    name.parse().unwrap()
}

fn satellites(constellation: Constellation) -> impl Iterator<Item = SatelliteId> {
    (1..64).filter_map(move |number| SatelliteId::new(constellation, number))
}

/// Ionosphere-free biases `[m]` of a pair, for every satellite that has both.
fn ionosphere_free(data: &BiasData, constellation: Constellation, pair: [&str; 2], time: GpsTime) -> Vec<f64> {
    let [first, second] = pair.map(signal);
    let hz = |signal: Signal| signal.frequency(constellation, Some(0)).unwrap();
    let (f1, f2) = (hz(first).powi(2), hz(second).powi(2));
    let of = |satellite| {
        let (b1, b2) = (data.code_bias(satellite, first, time)?, data.code_bias(satellite, second, time)?);
        Some((f1 * b1 - f2 * b2) / (f1 - f2))
    };
    satellites(constellation).filter_map(of).collect()
}

/// Twice what rounding to four decimals of a nanosecond makes of an ionosphere-free combination, 0.00005 ns × (2.55 + 1.55)
/// for GPS and less for the others; the largest in these files is 0.0003 ns (by an independent reading in Python).
const ROUNDING: f64 = 4.1e-4 * NS;

/// CODE's satellite clocks refer to pairs of signals, whose absolute biases cancel in the ionosphere-free combination.
#[test]
fn the_clock_s_signals_have_no_ionosphere_free_bias_in_codes_products() {
    use Constellation::{BeiDou, Galileo, Glonass, Gps};
    const TOKYO: &str = "kinematic_tokyo_2021265_1hz/COD0MGXFIN_20212650000_01D_01D_OSB.BIA.gz";
    const ZIMMERWALD: &str = "ppp_zim2_2026133_1h/COD0OPSFIN_20261330000_01D_01D_OSB.BIA.gz";
    for (name, time, constellation, pair, count) in [
        ("common/CODE.BIA", date(2026, 6, 10), Gps, ["1W", "2W"], 32),
        ("common/CODE.BIA", date(2026, 6, 10), Glonass, ["1P", "2P"], 21),
        (TOKYO, date(2021, 9, 22), Gps, ["1W", "2W"], 32),
        (TOKYO, date(2021, 9, 22), Galileo, ["1C", "5Q"], 24),
        (TOKYO, date(2021, 9, 22), BeiDou, ["2I", "6I"], 37),
        (ZIMMERWALD, date(2026, 5, 13), Gps, ["1W", "2W"], 32),
    ] {
        let Some(data) = read(name) else { return };
        let biases = ionosphere_free(&data, constellation, pair, time);
        let worst = biases.iter().fold(0.0, |worst: f64, bias| worst.max(bias.abs()));
        assert!(
            biases.len() == count && worst < ROUNDING,
            "{name}, {constellation:?}: {} up to {worst} m",
            biases.len()
        );
    }
}

/// In products whose clocks are made from phases they cancel on average over the satellites only, so that they must be
/// taken out of the pair's observations too. Worst satellites by an independent reading (Python) of the files.
#[test]
fn clocks_made_from_phases_leave_biases_to_single_satellites() {
    use Constellation::{Galileo, Gps};
    const WUHAN: &str = "ppp_jfng_2019045_1h/COD0R03FIN_20190450000_01D_01D_OSB.BIA.gz";
    for (name, time, constellation, pair, worst_ns) in [
        (WUHAN, date(2019, 2, 14), Gps, ["1W", "2W"], 0.5050),
        (WUHAN, date(2019, 2, 14), Galileo, ["1C", "5Q"], 0.4414),
        ("common/CODE.BIA", date(2026, 6, 10), Galileo, ["1C", "5Q"], 0.8061),
        ("common/CODE.BIA", date(2026, 6, 10), Galileo, ["1X", "5X"], 0.4956),
    ] {
        let Some(data) = read(name) else { return };
        let biases = ionosphere_free(&data, constellation, pair, time);
        let mean = biases.iter().sum::<f64>() / biases.len() as f64;
        let worst = biases.iter().fold(0.0, |worst: f64, bias| worst.max(bias.abs()));
        assert!(mean.abs() < ROUNDING, "{name}, {constellation:?}: mean {mean} m");
        assert!((worst - worst_ns * NS).abs() < 1e-4 * NS, "{name}, {constellation:?}: {worst} m");
    }
}

/// The comment in CODE.BIA: P1-C1 DCB = Bias_C1W − Bias_C1C; G01: −5.2579 + 6.2069 = 0.949 ns.
#[test]
fn codes_absolute_biases_give_its_p1_c1_correction() {
    let Some(data) = read("common/CODE.BIA") else { return };
    let bias = |name| data.code_bias("G01".parse().unwrap(), signal(name), date(2026, 6, 10)).unwrap();
    assert!((bias("1W") - bias("1C") - 0.949 * NS).abs() < 1e-9);
}

/// Daily differences of the Chinese Academy of Sciences, of all constellations, become absolute biases.
#[test]
fn differences_of_cas_reach_the_signals_in_use() {
    let name = "common/CAS0MGXRAP_20193350000_01D_01D_DCB.BSX.gz";
    let Some(data) = read(name) else { return };
    let noon = date(2019, 12, 1);
    // As many satellites as the file has records of: 32 C1W C2W, 24 C1X C5X and C1C C5Q, 40 C2I C6I, 20 C1P C2P.
    use Constellation::{BeiDou, Galileo, Glonass, Gps};
    for (constellation, pair, count) in [
        (Gps, ["1W", "2W"], 32),
        (Galileo, ["1C", "5Q"], 24),
        (Galileo, ["1X", "5X"], 24),
        (BeiDou, ["2I", "6I"], 40),
        (Glonass, ["1P", "2P"], 20),
    ] {
        let biases = ionosphere_free(&data, constellation, pair, noon);
        assert!(biases.len() >= count, "{constellation:?}: {}", biases.len());
        assert!(biases.iter().all(|bias| bias.abs() < 1e-9), "{constellation:?}");
    }
    let gps = satellites(Gps).filter(|&satellite| data.code_bias(satellite, signal("1W"), noon).is_some());
    let wanted: Vec<_> = gps.map(|satellite| (satellite, signal("1C"))).collect();
    assert_eq!((wanted.len(), data.missing(wanted, noon).len()), (32, 0));
}

/// CODE's tables: P1C1 of G01, 1.419 ns in the file of July 2010, is added to C1.
#[test]
fn codes_tables_are_added_to_c1() {
    let Some(mut data) = read("common/P1C1_ALL.DCB") else { return };
    let g01 = |data: &BiasData, name| data.code_bias("G01".parse().unwrap(), signal(name), date(2010, 7, 1));
    assert!((g01(&data, "1C").unwrap() + 1.419 * NS).abs() < 1e-12);
    assert_eq!(g01(&data, "1W"), Some(0.0));
    // With P1P2 (2.042 ns) and P2C2 (−0.365 ns) the datum is the ionosphere-free pair.
    for name in ["common/P1P2_ALL.DCB", "common/P2C2.DCB"] {
        let Some(path) = file(name) else { return };
        let report = data.add(&path).unwrap();
        assert!(report.dropped.is_empty(), "{report}");
    }
    let of = |name| g01(&data, name).unwrap();
    assert!((of("1W") - of("2W") - 2.042 * NS).abs() < 1e-12 && (of("1W") - of("1C") - 1.419 * NS).abs() < 1e-12);
    assert!((of("2W") - of("2C") + 0.365 * NS).abs() < 1e-12);
}
