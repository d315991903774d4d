//! Observation files of real receivers, against what other programs say of them.

use surefix::read::Reason;
use surefix::read::rinex::{ObservationEpoch, ObservationReader};
use surefix_core::gnss::time::GpsTime;
use surefix_tests::shared;

fn read(path: &str) -> Option<(Vec<ObservationEpoch>, ObservationReader)> {
    let mut reader = ObservationReader::open(&shared(&format!("data/{path}"))?).unwrap();
    let epochs = reader.by_ref().collect::<Result<_, _>>().unwrap();
    Some((epochs, reader))
}

/// Numbers of values: code, phase, Doppler, C/N0; and of phases with LLI bit 0 and bit 1.
fn counts(epochs: &[ObservationEpoch]) -> [usize; 6] {
    let count = |what: fn(&surefix_core::gnss::epoch::Observation) -> bool| {
        epochs.iter().flat_map(|epoch| &epoch.observations).filter(|o| what(o)).count()
    };
    [
        count(|o| o.code.is_some()),
        count(|o| o.phase.is_some()),
        count(|o| o.doppler.is_some()),
        count(|o| o.cn0.is_some()),
        count(|o| o.loss_of_lock),
        count(|o| o.half_cycle),
    ]
}

/// Epochs and [`counts`] of files, as counted in their columns by an awk script of a few lines that shares no code with
/// the reader (fields `substr($0, 4 + 16 * i, 14)` that are neither blank nor zero, of satellites G, R, E, C, J).
const EXPECTED: &[(&str, usize, [usize; 6])] = &[
    ("kinematic_galway_2018282/rover.obs.gz", 2072, [42204, 37395, 42203, 42204, 5588, 7313]),
    ("kinematic_ucr_car_2020194/base.obs.gz", 1810, [42563, 42167, 42563, 42563, 99, 126]),
    ("kinematic_ucr_car_2020194/rover.obs.gz", 1417, [32857, 29950, 32857, 32857, 566, 718]),
    ("kinematic_tokyo_2021265_1hz/3034265G.21O.gz", 360, [23040, 23040, 23040, 23040, 9, 0]),
    ("kinematic_tokyo_2021265_1hz/SEPT265G.21O.gz", 360, [26969, 23619, 0, 26969, 99, 0]),
    ("static_nagoya_2024176_1hz/base.obs.gz", 301, [44240, 42671, 44240, 44240, 8, 0]),
    ("static_nagoya_2024176_1hz/rover.obs.gz", 301, [45089, 44801, 45089, 45089, 10, 0]),
    ("static_saitama_2018242_1hz/base.obs.gz", 601, [62037, 61920, 0, 62037, 81, 0]),
    ("static_saitama_2018242_1hz/rover_1Hz.obs.gz", 601, [37322, 37322, 0, 37322, 1771, 0]),
    (
        "static_wtzr_wtzz_2020177/WTZR00DEU_R_20201770000_01D_30S_MO_120epoch.rnx.gz",
        120,
        [12511, 12500, 12511, 12511, 3, 0],
    ),
    (
        "static_wtzr_wtzz_2020177/WTZZ00DEU_R_20201770000_01D_30S_MO_120epoch.rnx.gz",
        120,
        [20450, 20450, 20604, 20604, 77, 0],
    ),
    ("kinematic_hk_tst_rover_only_2019118/TST2/2020_06_03_TST_03.obs.gz", 986, [47303, 40552, 47303, 47303, 174, 257]),
];

#[test]
fn nothing_recorded_is_lost() {
    for (path, epochs, values) in EXPECTED {
        let Some((read, reader)) = read(path) else { continue };
        assert_eq!(read.len(), *epochs, "{path}");
        assert_eq!(counts(&read), *values, "{path}");
        let unexpected: Vec<_> = reader
            .report()
            .dropped
            .keys()
            .filter(|reason| !matches!(reason, Reason::SatelliteUnsupported | Reason::Event))
            .collect();
        assert!(unexpected.is_empty(), "{}", reader.report());
    }
}

/// A day of compact RINEX and its first hour as another program expanded it: equal, to the last digit and flag.
#[test]
fn compact_rinex_is_expanded_to_the_last_digit() {
    let day = "ppp_esbc_2020177/ESBC00DNK_R_20201770000_01D_30S_MO.crx.gz";
    let hour = "ppp_esbc_2020177_1h/ESBC00DNK_R_20201770000_01D_30S_MO_120epoch.rnx.gz";
    let (Some((day, _)), Some((hour, _))) = (read(day), read(hour)) else { return };
    assert_eq!((day.len(), hour.len()), (2880, 120));
    for (expanded, plain) in day.iter().zip(&hour) {
        assert_eq!(expanded, plain);
    }
}

#[test]
fn headers_say_where_and_with_what() {
    let Some((_, reader)) = read("static_saitama_2018242_1hz/base.obs.gz") else { return };
    let header = reader.header();
    assert_eq!(header.version.to_string(), "3.02");
    assert_eq!((header.marker.as_str(), header.receiver.as_str()), ("BREF0001", "TRIMBLE NETR9"));
    assert_eq!(header.antenna, "TRM57971.00     NONE");
    assert_eq!(header.approximate_position, Some([-3_827_556.042_3, 3_524_863.496_2, 3_676_873.676_9]));
    assert_eq!((header.antenna_delta_hen, header.interval), ([1.488, 0.0, 0.0], Some(1.0)));
    assert_eq!((header.glonass_channels.len(), header.glonass_channels[&10]), (12, -7));
}

#[test]
fn epochs_have_their_time() {
    let Some((epochs, _)) = read("kinematic_ucr_car_2020194/rover.obs.gz") else { return };
    // 2020-07-12 01:36:23.994, a Sunday.
    assert_eq!(epochs[0].time, GpsTime::from_week_tow(2114, 5_783.994));
}
