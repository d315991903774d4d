use super::*;
use proptest::prelude::*;
use std::io::Cursor;

/// Header lines of a version, file type and system.
fn header(version: &str, kind: &str, system: &str, rest: &[(&str, &str)]) -> String {
    let first = format!("{version:>9}           {kind:<20}{system}");
    let mut lines = vec![(first.as_str(), "RINEX VERSION / TYPE")];
    lines.extend_from_slice(rest);
    lines.push(("", "END OF HEADER"));
    lines.iter().map(|(content, label)| format!("{content:<60}{label:<20}\n")).collect()
}

/// A record of RINEX 3 with `lines` orbit lines: value number i is i (0.0i for the eccentricity), the square root of
/// the semi-major axis 5153.5, the time of ephemeris that of the date, 2020-06-25 02:00.
fn record(satellite: &str, lines: usize) -> String {
    let value = |i: usize| match i {
        8 => "0.080000000000D-01".to_owned(),
        10 => "5.153500000000D+03".to_owned(),
        11 => "3.528000000000D+05".to_owned(),
        20 => "5.170000000000D+02".to_owned(),
        i => format!("{:.12}D+00", i as f64),
    };
    let mut text = format!("{satellite} 2020 06 25 02 00 00");
    text.extend((0..3).map(|i| format!("{:>19}", value(i))));
    for line in 0..lines {
        text += "\n    ";
        text.extend((0..4).map(|i| format!("{:>19}", value(3 + 4 * line + i))));
    }
    text + "\n"
}

const GLONASS: &str = "\
R02 2020 06 25 02 15 00 2.340786159039D-05 0.000000000000D+00 3.546000000000D+05
    -7.312858886720D+03-1.848680496216D+00 1.862645149231D-09 0.000000000000D+00
     8.166229492188D+03-2.549054145813D+00 3.725290298462D-09-4.000000000000D+00
     2.308092382813D+04 3.109912872314D-01-0.000000000000D+00 0.000000000000D+00
";

fn read(text: &str) -> NavigationData {
    NavigationData::new("a.nav", Cursor::new(text.as_bytes().to_vec())).unwrap()
}

fn mixed(body: &str) -> NavigationData {
    read(&(header("3.04", "N: GNSS NAV DATA", "M", &[]) + body))
}

fn kepler(ephemeris: &Ephemeris) -> KeplerEphemeris {
    match ephemeris {
        Ephemeris::Kepler(kepler) => *kepler,
        Ephemeris::Glonass(_) => panic!("{ephemeris:?}"),
    }
}

fn dropped(data: &NavigationData) -> Vec<(Reason, u64, u64)> {
    data.reports[0].dropped.iter().map(|(reason, tally)| (*reason, tally.count, tally.first_line)).collect()
}

#[test]
fn every_field_goes_where_it_belongs() {
    let data = mixed(&record("G05", 7));
    let toe = GpsTime::from_week_tow(2111, 352_800.0);
    let e = kepler(&data.ephemerides[0]);
    assert_eq!((e.toc, e.toe, e.sqrt_a, e.e), (toe, toe, 5153.5, 0.008));
    assert_eq!([e.af0, e.af1, e.af2], [0.0, 1.0, 2.0]);
    assert_eq!((e.iode, [e.crs, e.delta_n, e.m0, e.cuc, e.cus]), (3, [4.0, 5.0, 6.0, 7.0, 9.0]));
    assert_eq!([e.cic, e.omega0, e.cis, e.i0, e.crc], [12.0, 13.0, 14.0, 15.0, 16.0]);
    assert_eq!([e.omega, e.omega_dot, e.idot], [17.0, 18.0, 19.0]);
    assert_eq!((e.accuracy, e.health, e.group_delay, e.fit_interval), (23.0, 24, [25.0, 0.0], 28.0));
    assert_eq!(data.reports[0].records, 1);
}

#[test]
fn the_constellations_have_their_times_and_messages() {
    let data = mixed(&["E05", "C05", "J02"].map(|satellite| record(satellite, 7)).concat());
    let toe = GpsTime::from_week_tow(2111, 352_800.0);
    let [e05, j02, c05] = [0, 1, 2].map(|i| kepler(&data.ephemerides[i]));
    assert_eq!((e05.message, e05.toe, e05.group_delay), (NavigationMessage::Inav, toe, [25.0, 26.0]));
    assert_eq!((j02.message, j02.toe), (NavigationMessage::Lnav, toe));
    let bdt = toe.plus_seconds(14.0);
    assert_eq!((c05.message, c05.toe, c05.toc, c05.group_delay), (NavigationMessage::D1D2, bdt, bdt, [25.0, 26.0]));

    for (word, message) in
        [(517, NavigationMessage::Inav), (258, NavigationMessage::Fnav), (513, NavigationMessage::Inav)]
    {
        assert_eq!(galileo_message(word), message);
    }
    for (word, message) in [(2, NavigationMessage::Fnav), (1, NavigationMessage::Inav), (0, NavigationMessage::Inav)] {
        assert_eq!(galileo_message(word), message);
    }
}

#[test]
fn glonass_is_in_metres_and_gps_time() {
    let data = mixed(GLONASS);
    let Ephemeris::Glonass(e) = data.ephemerides[0] else { panic!() };
    assert_eq!(e.toe, GpsTime::from_week_tow(2111, 353_700.0 + 18.0));
    assert_eq!((e.channel, e.health, e.age), (-4, 0, 0.0));
    // 05:15 in Moscow is quarter of an hour 21.
    assert_eq!(e.iode, 21);
    assert_eq!(e.clock_bias, 2.340786159039e-5);
    // Kilometres in the file: the product with 1000 rounds in the last bit.
    assert!((e.position[0] - -7_312_858.886_72).abs() < 1e-8 && (e.velocity[1] - -2_549.054_145_813).abs() < 1e-12);
    assert!((e.acceleration[0] - 1.862_645_149_231e-6).abs() < 1e-20);
    // A channel as an unsigned byte.
    let Ephemeris::Glonass(e) = mixed(&GLONASS.replace("-4.000000000000D+00", " 2.520000000000D+02")).ephemerides[0]
    else {
        panic!()
    };
    assert_eq!(e.channel, -4);
}

#[test]
fn rinex_2_has_its_own_columns() {
    // As in the file brdc0060.10n of the CDDIS, with fewer values.
    let text = header(
        "2",
        "NAVIGATION DATA",
        " ",
        &[
            ("    0.7451E-08 -0.1490E-07 -0.5960E-07  0.1192E-06", "ION ALPHA"),
            ("    0.9011E+05 -0.6554E+05 -0.1311E+06  0.4588E+06", "ION BETA"),
            ("    15", "LEAP SECONDS"),
        ],
    ) + " 1 10  1  6  0  0  0.0-0.765500590205E-04-0.318323145621E-11 0.000000000000E+00\n"
        + "    0.700000000000E+02-0.512187500000E+02 0.593060417633E-08-0.185308241109E+01\n"
        + "   -0.259838998318E-05 0.384141004179E-02 0.521913170815E-05 0.515365295982E+04\n"
        + "    0.259200000000E+06 0.000000000000E+00 0.100000000000E+01 0.000000000000E+00\n"
        + &"    0.100000000000E+01 0.000000000000E+00 0.100000000000E+01 0.000000000000E+00\n".repeat(3)
        + "    0.259200000000E+06\n";
    let data = read(&text);
    let e = kepler(&data.ephemerides[0]);
    assert_eq!(e.satellite.to_string(), "G01");
    assert_eq!(e.toe, GpsTime::from_week_tow(1565, 259_200.0));
    assert_eq!((e.af0, e.iode, e.sqrt_a, e.fit_interval), (-0.765500590205e-4, 70, 5_153.652_959_82, 0.0));
    let klobuchar = data.klobuchar[Constellation::Gps.index()].unwrap();
    assert_eq!((klobuchar.alpha[1], klobuchar.beta[3]), (-0.1490e-7, 0.4588e6));
    assert_eq!(data.leap_seconds, Some(15));
}

#[test]
fn ionosphere_and_leap_seconds_of_each_system_are_read() {
    let text = header(
        "3.02",
        "N: GNSS NAV DATA",
        "C",
        &[
            ("BDSA   6.5193D-09  1.1921D-07 -8.3447D-07  1.3709D-06", "IONOSPHERIC CORR"),
            ("BDSB   1.2493D+05 -6.7174D+05  6.2259D+06 -6.1604D+06", "IONOSPHERIC CORR"),
            ("GAL    2.8250e+01  7.8125e-03  1.0071e-02", "IONOSPHERIC CORR"),
            ("QZSA   2.8250e+01  7.8125e-03  1.0071e-02  0.0000e+00", "IONOSPHERIC CORR"),
            ("     4", "LEAP SECONDS"),
        ],
    );
    let data = read(&text);
    let beidou = data.klobuchar[Constellation::BeiDou.index()].unwrap();
    assert_eq!((beidou.alpha[0], beidou.beta[1]), (6.5193e-9, -6.7174e5));
    assert_eq!(data.galileo_ionosphere, Some([28.25, 0.007_812_5, 0.010_071]));
    assert_eq!(data.klobuchar[Constellation::Qzss.index()], None, "half of a model is none");
    // BeiDou counts leap seconds since 2006.
    assert_eq!(data.leap_seconds, Some(18));
}

#[test]
fn the_week_is_that_of_the_date() {
    // A clock of Saturday 23:59:44 with an ephemeris of Sunday 0 h, and the other way round.
    for (date, toe, expected) in [
        ("2020 06 27 23 59 44", "0.000000000000D+00", GpsTime::from_week_tow(2112, 0.0)),
        ("2020 06 28 00 00 00", "6.047840000000D+05", GpsTime::from_week_tow(2111, 604_784.0)),
    ] {
        let text = record("G05", 7).replace("2020 06 25 02 00 00", date).replace("3.528000000000D+05", toe);
        assert_eq!(kepler(&mixed(&text).ephemerides[0]).toe, expected);
    }
}

#[test]
fn messages_are_in_order_of_time_and_none_is_there_twice() {
    let later =
        record("G05", 7).replace("2020 06 25 02", "2020 06 25 04").replace("3.528000000000D+05", "3.600000000000D+05");
    let mut data = mixed(&[&later, GLONASS, &record("G05", 7), &later].map(String::from).concat());
    assert!(data.ephemerides.is_sorted_by_key(Ephemeris::toe));
    assert_eq!((data.ephemerides.len(), data.reports[0].records), (3, 3));
    assert_eq!(dropped(&data), [(Reason::MessageDuplicate, 1, 3 + 8 + 4 + 8)]);

    data.merge(mixed(&(record("G05", 7) + &record("G07", 7))));
    assert_eq!((data.ephemerides.len(), data.reports[1].records), (4, 1));
    assert_eq!(data.reports[1].count(Reason::MessageDuplicate), 1);
}

#[test]
fn what_cannot_be_used_is_dropped_and_counted() {
    for (body, reason) in [
        (record("S23", 3), Reason::MessageUnsupported),
        (record("I03", 7), Reason::MessageUnsupported),
        (record("X01", 7), Reason::MessageUnreadable),
        (record("G00", 7), Reason::MessageUnreadable),
        (record("G05", 7).replace("06 25", "13 25"), Reason::MessageUnreadable),
        (record("G05", 7).replacen("D+00", "D*00", 1), Reason::MessageUnreadable),
        (record("G05", 6), Reason::MessageUnreadable),
        (record("G05", 7).replace(" 5.153500000000D+03", &" ".repeat(19)), Reason::MessageUnreadable),
        (record("G05", 7).replace("5.1535", "9.1535"), Reason::MessageAbsurd),
        (record("G05", 7).replace("0.08000", "7.08000").replace("D-01", "D+01"), Reason::MessageAbsurd),
        (GLONASS.replace("-7.312858886720D+03", "-7.312858886720D+04"), Reason::MessageAbsurd),
        (GLONASS.replace("-4.000000000000D+00", "-9.000000000000D+00"), Reason::MessageAbsurd),
    ] {
        // A good one follows and is not touched.
        let data = mixed(&(body.clone() + &record("G07", 7)));
        assert_eq!(dropped(&data), [(reason, 1, 3)], "{body}");
        assert_eq!(data.ephemerides.len(), 1);
    }
}

#[test]
fn a_blank_field_that_is_not_needed_is_zero() {
    let text = record("G05", 7).replace("25.000000000000D+00", &" ".repeat(19));
    assert_eq!(kepler(&mixed(&text).ephemerides[0]).group_delay, [0.0, 0.0]);
}

#[test]
fn a_file_cut_off_anywhere_keeps_what_is_complete() {
    let head = header("3.04", "N: GNSS NAV DATA", "M", &[]);
    let text = head.clone() + &record("G05", 7) + GLONASS + &record("E05", 7);
    let whole = read(&text);
    for end in head.len()..text.len() {
        let data = read(&text[..end]);
        for ephemeris in &data.ephemerides {
            // Transmission time and fit interval come last; without them the message is the same.
            let Ephemeris::Kepler(cut) = ephemeris else {
                assert!(whole.ephemerides.contains(ephemeris), "cut at {end}");
                continue;
            };
            let same = |e: &Ephemeris| matches!(e, Ephemeris::Kepler(e) if KeplerEphemeris { fit_interval: cut.fit_interval, ..*e } == *cut);
            assert!(whole.ephemerides.iter().any(same), "cut at {end}: {cut:?}");
        }
    }
    let cut = read(&text[..text.len() - 200]);
    assert_eq!(cut.ephemerides.len(), 2);
    assert_eq!(cut.reports[0].count(Reason::Truncated), 1);
}

#[test]
fn carriage_returns_do_not_matter() {
    let text = header("3.04", "N: GNSS NAV DATA", "M", &[]) + &record("G05", 7) + GLONASS;
    assert_eq!(read(&text), read(&text.replace('\n', "\r\n")));
}

#[test]
fn what_is_no_navigation_file_is_refused_with_a_remedy() {
    let error = |text: &str| NavigationData::new("a.nav", Cursor::new(text.as_bytes().to_vec())).unwrap_err();
    assert_eq!(
        error(&header("3.04", "OBSERVATION DATA", "M", &[])).to_string(),
        "a.nav: this is an observation file, where a navigation file is needed; give it as ROVER or BASE"
    );
    assert!(matches!(error(""), ReadError::Empty { .. }));
    assert!(matches!(error(&header("4.00", "N", "M", &[])), ReadError::Version { .. }));
    assert!(matches!(error("hello\n"), ReadError::NotRinex { .. }));
    let first = header("3.04", "N", "M", &[]).lines().next().unwrap().to_owned();
    assert!(matches!(error(&first), ReadError::Header { line: 1, .. }));
    let missing = NavigationData::open("no/such/file.nav".as_ref()).unwrap_err();
    assert!(matches!(missing, ReadError::Open { .. }));
}

proptest! {
    #[test]
    fn no_bytes_panic(bytes in proptest::collection::vec(any::<u8>(), 0..2000), edits in proptest::collection::vec((0..2000_usize, any::<u8>()), 0..20)) {
        let _ = NavigationData::new("a.nav", Cursor::new(bytes.clone()));
        for (version, kind) in [("3.04", "N: GNSS NAV DATA"), ("2.11", "NAVIGATION DATA"), ("2.11", "GLONASS NAV DATA")] {
            let head = header(version, kind, "M", &[]);
            let _ = NavigationData::new("a.nav", Cursor::new([head.as_bytes(), &bytes].concat()));
            let mut text = (head + &record("G05", 7) + GLONASS + &record("C05", 7)).into_bytes();
            for &(at, byte) in &edits {
                if let Some(old) = text.get_mut(at) {
                    *old = byte;
                }
            }
            let _ = NavigationData::new("a.nav", Cursor::new(text));
        }
    }
}
