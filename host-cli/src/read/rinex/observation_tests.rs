use super::*;
use crate::read::FileKind;
use crate::read::rinex::samples::{COMPACT_1, COMPACT_3, RINEX_2, RINEX_3, read};
use flate2::Compression;
use flate2::write::GzEncoder;
use proptest::prelude::*;
use std::collections::BTreeMap;
use std::io::Write;

fn header(version: &str, system: char, rest: &[(&str, &str)]) -> String {
    let first = format!("{version:>9}           OBSERVATION DATA    {system}");
    let mut lines = vec![(first.as_str(), "RINEX VERSION / TYPE")];
    lines.extend_from_slice(rest);
    lines.push(("", "END OF HEADER"));
    lines.iter().map(|(content, label)| format!("{content:<60}{label:<20}\n")).collect()
}

/// A GPS file of RINEX 3 with one code, and whatever follows the header.
fn codes_only(body: &str) -> Vec<u8> {
    (header("3.04", 'G', &[("G    1 C1C", "SYS / # / OBS TYPES")]) + body).into_bytes()
}

fn find<'a>(epoch: &'a ObservationEpoch, satellite: &str, signal: &str) -> &'a Observation {
    let found =
        epoch.observations.iter().find(|o| o.satellite.to_string() == satellite && o.signal.to_string() == signal);
    found.unwrap_or_else(|| panic!("{satellite} {signal} is missing"))
}

fn dropped(report: &ReadReport) -> BTreeMap<Reason, u64> {
    report.dropped.iter().map(|(reason, tally)| (*reason, tally.count)).collect()
}

#[test]
fn rinex_3_is_read_to_the_last_digit() {
    let (epochs, report) = read(RINEX_3.as_bytes()).unwrap();
    assert_eq!(epochs.len(), 6);
    assert_eq!(dropped(&report), [(Reason::SatelliteUnsupported, 6), (Reason::Event, 1)].into());
    // 2020-06-25 is a Thursday of GPS week 2111; the third epoch is 60.0000002 s into it.
    let start = GpsTime::from_week_tow(2111, 345_600.0).nanoseconds();
    assert_eq!(epochs[2].time.nanoseconds() - start, 60_000_000_200);
    assert_eq!(epochs[2].clock_offset, Some(-0.000_123_056_789));
    assert_eq!(epochs[4].clock_offset, None);
    let g05 = find(&epochs[2], "G05", "1C");
    assert_eq!((g05.code, g05.phase), (Some(21_001_224.310), Some(105_006_190.729)));
    assert_eq!((g05.doppler, g05.cn0), (Some(-1_233.013), Some(44.75)));
    // G05 has no L5 in this epoch; channel numbers (X1) are no signal; C2L has no strength but a digit 5.
    assert!(!epochs[2].observations.iter().any(|o| o.satellite == g05.satellite && o.signal.band() == b'5'));
    assert_eq!(find(&epochs[2], "G05", "2L").cn0, Some(32.5));
    assert_eq!(find(&epochs[2], "C19", "2I").phase, Some(107_068_198.894));
}

#[test]
fn loss_of_lock_and_half_cycles_are_kept() {
    let (epochs, _) = read(RINEX_3.as_bytes()).unwrap();
    let flags = |epoch: usize, satellite, signal| {
        let o = find(&epochs[epoch], satellite, signal);
        (o.loss_of_lock, o.half_cycle)
    };
    assert_eq!(flags(0, "G05", "1C"), (false, false));
    assert_eq!(flags(1, "G05", "1C"), (true, false));
    assert_eq!(flags(3, "G05", "1C"), (false, true));
    assert_eq!(flags(4, "G05", "1C"), (true, true));
    // An indicator without a phase still says that lock was lost.
    assert_eq!((flags(1, "G30", "2W"), find(&epochs[1], "G30", "2W").phase), ((true, false), None));
    // After a power failure everything has lost lock.
    assert!(epochs[5].power_failure && epochs[5].observations.iter().all(|o| o.loss_of_lock));
    assert!(!epochs[4].power_failure);
}

#[test]
fn rinex_2_is_read_to_the_last_digit() {
    let (epochs, report) = read(RINEX_2.as_bytes()).unwrap();
    assert_eq!(epochs.len(), 5);
    assert_eq!(dropped(&report), [(Reason::Event, 1)].into());
    // 2005-04-02 is a Saturday of GPS week 1316.
    assert_eq!(epochs[1].time, GpsTime::from_week_tow(1316, 518_430.0));
    assert_eq!((epochs[0].clock_offset, epochs[1].clock_offset), (Some(0.000_15), None));
    // 13 GPS satellites with two signals, beyond the 12 of the first line, and GLONASS with one.
    assert_eq!(epochs[0].observations.len(), 27);
    let (l1, l2) = (find(&epochs[0], "G05", "1C"), find(&epochs[0], "G05", "2W"));
    assert_eq!((l1.doppler, l1.cn0), (Some(2_345.678), Some(44.125)));
    assert_eq!((l2.loss_of_lock, l2.cn0), (false, Some(32.5)));
    assert_eq!(find(&epochs[3], "G07", "1C").phase, None);
    // The header says that L1 of G30 counts half cycles.
    assert!(find(&epochs[0], "G30", "1C").half_cycle && !find(&epochs[0], "G30", "2W").half_cycle && !l1.half_cycle);
}

#[test]
fn an_event_changes_the_header_that_follows() {
    let mut reader = ObservationReader::new("sample", RINEX_3.as_bytes()).unwrap();
    assert_eq!(reader.header().antenna_delta_hen, [1.488, 0.0, 0.0]);
    assert_eq!(reader.header().glonass_channels, [(3, 5), (14, -7)].into());
    assert_eq!(
        (reader.header().receiver.as_str(), reader.header().antenna.as_str()),
        ("MODEL X", "ANTENNA Y       NONE")
    );
    while reader.next_epoch().unwrap().is_some() {}
    assert_eq!(reader.header().antenna_delta_hen, [1.5, 0.0, 0.0]);
}

#[test]
fn observation_types_may_change_within_the_file() {
    let file = codes_only(
        "> 2020 06 25 00 00  0.0000000  0  1\nG05  21000000.000\n\
         >                              4  1\n\
         G    2 C2W C1C                                              SYS / # / OBS TYPES \n\
         > 2020 06 25 00 00  1.0000000  0  1\nG05  22000000.000    21000000.500\n\
         > 2020 06 25 00 00  1.5000000  6  1\nG05         5.000\n\
         > 2020 06 25 00 00  2.0000000  0  1\nG05  22000001.000    21000001.500\n",
    );
    let (epochs, report) = read(&file).unwrap();
    assert_eq!(find(&epochs[1], "G05", "1C").code, Some(21_000_000.5));
    assert_eq!(epochs.len(), 3);
    assert_eq!(dropped(&report), [(Reason::Event, 1), (Reason::CycleSlipRecord, 1)].into());
}

#[test]
fn scale_factors_are_divided_out() {
    let types = ("G    2 C1C L1C", "SYS / # / OBS TYPES");
    let file = header("3.04", 'G', &[types, ("G  100  1 L1C", "SYS / SCALE FACTOR")])
        + "> 2020 06 25 00 00  0.0000000  0  1\nG05  21000000.000  1234567890.125\n";
    let (epochs, _) = read(file.as_bytes()).unwrap();
    let o = find(&epochs[0], "G05", "1C");
    assert_eq!((o.code, o.phase), (Some(21_000_000.0), Some(12_345_678.901_25)));
}

#[test]
fn epochs_of_other_time_scales_become_gps_time() {
    let types = ("C    1 C2I", "SYS / # / OBS TYPES");
    let body = "> 2020 06 25 00 00  0.0000000  0  1\nC19  21000000.000\n";
    for (scale, seconds) in [("GPS", 0.0), ("GAL", 0.0), ("BDT", 14.0), ("GLO", 18.0)] {
        let first = format!("  2020     6    25     0     0    0.0000000     {scale}");
        let file = header("3.04", 'M', &[types, (&first, "TIME OF FIRST OBS")]) + body;
        let (epochs, _) = read(file.as_bytes()).unwrap();
        assert_eq!(epochs[0].time, GpsTime::from_week_tow(2111, 345_600.0 + seconds), "{scale}");
    }
    // Without a time scale, that of the constellation of the file.
    let (epochs, _) = read((header("3.04", 'C', &[types]) + body).as_bytes()).unwrap();
    assert_eq!(epochs[0].time, GpsTime::from_week_tow(2111, 345_614.0));
}

#[test]
fn epochs_out_of_order_or_twice_are_dropped_and_counted() {
    let second = |s: u32| format!("> 2020 06 25 00 00 {s:2}.0000000  0  1\nG05  21000000.00{s}\n");
    let file = codes_only(&[2, 1, 2, 3, 3].map(second).concat());
    let (epochs, report) = read(&file).unwrap();
    let codes: Vec<_> = epochs.iter().map(|epoch| find(epoch, "G05", "1C").code.unwrap()).collect();
    assert_eq!(codes, [21_000_000.002, 21_000_000.003]);
    assert_eq!(dropped(&report), [(Reason::EpochOutOfOrder, 1), (Reason::EpochDuplicate, 2)].into());
    assert_eq!(report.dropped[&Reason::EpochOutOfOrder].first_line, 6);
}

#[test]
fn a_damaged_date_in_the_future_hides_nothing() {
    let at =
        |minute: u32, year: u32| format!("> {year} 06 25 00 {minute:02}  0.0000000  0  1\nG05  21000000.00{minute}\n");
    for damaged in 0..4 {
        let file = codes_only(&(0..5).map(|i| at(i, if i == damaged { 2028 } else { 2020 })).collect::<String>());
        let (epochs, report) = read(&file).unwrap();
        assert_eq!(epochs.len(), 4);
        assert_eq!(dropped(&report), [(Reason::EpochOutOfOrder, 1)].into());
        assert_eq!(report.dropped[&Reason::EpochOutOfOrder].first_line, 4 + 2 * u64::from(damaged));
    }
    // A gap is no damage.
    let (epochs, report) = read(&codes_only(&[at(0, 2020), at(0, 2021), at(1, 2021)].concat())).unwrap();
    assert_eq!((epochs.len(), report.dropped.len()), (3, 0));
}

#[test]
fn satellites_that_cannot_be_used_are_dropped_and_counted() {
    let file = codes_only(
        "> 2020 06 25 00 00  0.0000000  0  6\n\
         G05  21000000.000\nG05  22000000.000\nS23  38000000.000\nI02  38000000.000\nG99  21000000.000\nE05  21000000.000\n",
    );
    let (epochs, report) = read(&file).unwrap();
    assert_eq!(epochs[0].observations.len(), 1);
    assert_eq!(find(&epochs[0], "G05", "1C").code, Some(21_000_000.0));
    assert_eq!(
        dropped(&report),
        [(Reason::SatelliteDuplicate, 1), (Reason::SatelliteUnsupported, 2), (Reason::SatelliteUnreadable, 2)].into()
    );
}

#[test]
fn zero_is_no_value_and_absurd_ones_are_dropped_and_counted() {
    let types = [("G    4 C1C L1C D1C S1C", "SYS / # / OBS TYPES")];
    let record = |values: [&str; 4]| format!("{}\n", values.map(|value| format!("{value:>14}  ")).concat());
    let file = header("3.04", 'G', &types)
        + "> 2020 06 25 00 00  0.0000000  0  5\n"
        + &format!("G01{}", record(["0.000", "0.000", "0.000", "45.000"]))
        + &format!("G02{}", record(["1000.000", "-5.000", "-100.000", "145.000"]))
        + &format!("G03{}", record(["999999999.000", "5.000", "9999999.000", "-1.000"]))
        + &format!("G04{}", record(["2100000x.000", "5.0.0", "NaN", ""]))
        + "G05  21000000.12\n";
    let (epochs, report) = read(file.as_bytes()).unwrap();
    let o = find(&epochs[0], "G01", "1C");
    assert_eq!((o.code, o.phase, o.doppler, o.cn0), (None, None, None, Some(45.0)));
    let o = find(&epochs[0], "G02", "1C");
    assert_eq!((o.code, o.phase, o.doppler, o.cn0), (None, Some(-5.0), Some(-100.0), None));
    let o = find(&epochs[0], "G03", "1C");
    assert_eq!((o.code, o.phase, o.doppler, o.cn0), (None, Some(5.0), None, None));
    assert_eq!(epochs[0].observations.len(), 3);
    assert_eq!(dropped(&report), [(Reason::ValueAbsurd, 5), (Reason::ValueUnreadable, 4)].into());
}

#[test]
fn after_damaged_lines_reading_goes_on_at_the_next_epoch() {
    for sample in [RINEX_2, RINEX_3] {
        let (whole, _) = read(sample.as_bytes()).unwrap();
        // Damage the second epoch line.
        let year = if sample == RINEX_2 { " 05  4  2  0  0 30" } else { "> 2020 06 25 00 00 30" };
        let damaged = sample.replacen(year, &year.replace("  0", "  x").replace(" 06", " x6"), 1);
        assert_ne!(damaged, sample);
        let (epochs, report) = read(damaged.as_bytes()).unwrap();
        assert_eq!(epochs[0], whole[0]);
        assert_eq!(epochs[1..], whole[2..]);
        assert!(report.count(Reason::LineUnreadable) > 0);
    }
}

#[test]
fn an_epoch_that_lacks_satellites_keeps_the_others() {
    for (sample, lines, second) in [(RINEX_2, 2, " 05  4  2  0  0 30"), (RINEX_3, 1, "> 2020 06 25 00 00 30")] {
        let (whole, _) = read(sample.as_bytes()).unwrap();
        let mut kept: Vec<&str> = sample.lines().collect();
        // The last satellite of the first epoch, before the second epoch line.
        let second = kept.iter().position(|line| line.starts_with(second)).unwrap();
        kept.drain(second - lines..second);
        let (epochs, report) = read(kept.join("\n").as_bytes()).unwrap();
        assert_eq!(report.count(Reason::SatelliteMissing), 1);
        assert_eq!(epochs.len(), whole.len());
        assert!(whole[0].observations.starts_with(&epochs[0].observations));
        assert_eq!(epochs[1..], whole[1..]);
    }
}

#[test]
fn carriage_returns_and_bytes_that_are_not_utf_8_do_not_matter() {
    for sample in [RINEX_2, RINEX_3, COMPACT_1, COMPACT_3] {
        let (plain, report) = read(sample.as_bytes()).unwrap();
        let windows = sample.replace('\n', "\r\n").replace("someone", "M\u{fffd}nch").into_bytes();
        let latin: Vec<u8> =
            String::from_utf8_lossy(&windows).chars().map(|c| if c.is_ascii() { c as u8 } else { 0xfc }).collect();
        assert!(std::str::from_utf8(&latin).is_err());
        let (epochs, its_report) = read(&latin).unwrap();
        assert_eq!((epochs, its_report), (plain, report));
    }
    let name = "M\u{fc}nchen".chars().map(|c| c as u8).collect::<Vec<u8>>();
    let mut file = codes_only("");
    let at = file.iter().position(|&byte| byte == b'\n').unwrap() + 1;
    file.splice(at..at, [&name[..], &[b' '; 53], b"MARKER NAME\n"].concat());
    assert_eq!(ObservationReader::new("sample", std::io::Cursor::new(file)).unwrap().header().marker, "M\u{fc}nchen");
}

/// Code, phase, Doppler and C/N0 by epoch, satellite and signal.
fn values(epochs: &[ObservationEpoch]) -> BTreeMap<(GpsTime, SatelliteId, String), [Option<f64>; 3]> {
    let of_epoch = |epoch: &ObservationEpoch| {
        let time = epoch.time;
        epoch
            .observations
            .clone()
            .into_iter()
            .map(move |o| ((time, o.satellite, o.signal.to_string()), [o.code, o.phase, o.doppler]))
    };
    epochs.iter().flat_map(of_epoch).collect()
}

#[test]
fn a_file_cut_off_anywhere_keeps_what_is_complete_and_nothing_else() {
    for sample in [RINEX_2, RINEX_3, COMPACT_1, COMPACT_3] {
        let (whole, _) = read(sample.as_bytes()).unwrap();
        let whole_values = values(&whole);
        let header_end = sample.find("END OF HEADER").unwrap() + "END OF HEADER".len();
        for end in header_end..sample.len() {
            let (epochs, report) = read(&sample.as_bytes()[..end]).unwrap();
            let complete = epochs.len().saturating_sub(1);
            assert_eq!(epochs[..complete], whole[..complete], "cut at {end}");
            for (key, values) in values(&epochs) {
                let expected = whole_values.get(&key).unwrap_or_else(|| panic!("{key:?} was made up, cut at {end}"));
                for (value, expected) in values.iter().zip(expected) {
                    assert!(value.is_none() || value == expected, "{key:?}: {value:?} of {expected:?}, cut at {end}");
                }
            }
            // If satellites are missing, it says so.
            let last_is_short =
                epochs.last().is_some_and(|last| last.observations.len() < whole[complete].observations.len());
            assert!(!last_is_short || !report.dropped.is_empty(), "silent loss, cut at {end}");
        }
    }
}

#[test]
fn a_damaged_gzip_stream_counts_as_the_end() {
    let directory = tempfile::tempdir().unwrap();
    let path = directory.path().join("sample.rnx.gz");
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(RINEX_3.as_bytes()).unwrap();
    let gzipped = encoder.finish().unwrap();
    std::fs::write(&path, &gzipped).unwrap();
    let epochs: Vec<_> = ObservationReader::open(&path).unwrap().collect::<Result<_, _>>().unwrap();
    assert_eq!(epochs, read(RINEX_3.as_bytes()).unwrap().0);

    std::fs::write(&path, &gzipped[..gzipped.len() - 200]).unwrap();
    let mut reader = ObservationReader::open(&path).unwrap();
    let kept: Vec<_> = reader.by_ref().collect::<Result<_, _>>().unwrap();
    assert!(!kept.is_empty() && kept.len() < epochs.len());
    assert_eq!(reader.report().count(Reason::CompressionDamaged), 1);
}

fn open_error(bytes: &[u8]) -> ReadError {
    ObservationReader::new("a.obs", std::io::Cursor::new(bytes.to_vec())).err().expect("must not open")
}

#[test]
fn what_is_no_observation_file_is_refused_with_a_remedy() {
    let missing = ObservationReader::open("no/such/file.obs".as_ref()).err().unwrap();
    assert!(matches!(missing, ReadError::Open { .. }));
    assert!(missing.to_string().contains("no/such/file.obs") && missing.to_string().contains("check the path"));

    assert!(matches!(open_error(b""), ReadError::Empty { .. }));

    let navigation = format!("{:<60}RINEX VERSION / TYPE\n", "     3.04           N: GNSS NAV DATA    M: MIXED");
    let error = open_error(navigation.as_bytes());
    assert!(matches!(error, ReadError::WrongKind { found: FileKind::Navigation, expected: FileKind::Observation, .. }));
    assert_eq!(
        error.to_string(),
        "a.obs: this is a navigation file, where an observation file is needed; give it as NAV"
    );

    for (bytes, words) in [
        (&b"\xb5\x62\x01\x07"[..], "u-blox"),
        (b"\xd3\x00\x13>\xd0", "RTCM"),
        (b"#dP2020  6 25", "SP3"),
        (b"PK\x03\x04", "zip"),
        (b"\x1f\x9d\x90", "gzip -d"),
        (b"hello\nworld\n", "RINEX VERSION / TYPE"),
        (b"\n\n", "RINEX VERSION / TYPE"),
        (&[0xff; 100_000], "RINEX VERSION / TYPE"),
    ] {
        let error = open_error(bytes);
        assert!(matches!(error, ReadError::NotRinex { .. }) && error.to_string().contains(words), "{error}");
    }
}

#[test]
fn headers_that_cannot_be_used_are_refused_with_their_line() {
    let future = header("5.00", 'G', &[]);
    assert!(matches!(open_error(future.as_bytes()), ReadError::Version { version, .. } if version == "RINEX 5.00"));
    let compact = format!("{:<60}CRINEX VERS   / TYPE\n", "2.0                 COMPACT RINEX FORMAT");
    assert!(matches!(open_error(compact.as_bytes()), ReadError::Version { version, .. } if version == "CRINEX 2.0"));

    let cut = RINEX_3.lines().take(5).collect::<Vec<_>>().join("\n");
    assert!(matches!(open_error(cut.as_bytes()), ReadError::Header { line: 5, .. }));
    let cut = COMPACT_3.lines().take(2).collect::<Vec<_>>().join("\n");
    assert!(matches!(open_error(cut.as_bytes()), ReadError::Header { line: 2, .. }));

    let no_types = header("3.04", 'M', &[("S    1 C1C", "SYS / # / OBS TYPES")]);
    let error = open_error(no_types.as_bytes());
    assert!(matches!(error, ReadError::Header { line: 3, .. }), "{error}");
    assert!(error.to_string().contains("no observation types"), "{error}");
}

/// Bytes with some replaced, removed or put in.
fn mutated(sample: &'static str) -> impl Strategy<Value = Vec<u8>> {
    let edits = proptest::collection::vec((0..sample.len(), any::<u8>(), 0..3_usize), 1..20);
    edits.prop_map(move |edits| {
        let mut bytes = sample.as_bytes().to_vec();
        for (at, byte, kind) in edits {
            let at = at.min(bytes.len() - 1);
            match kind {
                0 => bytes[at] = byte,
                1 => drop(bytes.remove(at)),
                _ => bytes.insert(at, byte),
            }
        }
        bytes
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(512))]

    #[test]
    fn garbage_never_panics(bytes in proptest::collection::vec(any::<u8>(), 0..2000)) {
        let _ = read(&bytes);
        for sample in [RINEX_2, RINEX_3, COMPACT_1, COMPACT_3] {
            let header_end = sample.find("END OF HEADER").unwrap() + "END OF HEADER\n".len();
            let _ = read(&[&sample.as_bytes()[..header_end], &bytes].concat());
        }
    }

    #[test]
    fn mutated_files_never_panic_and_epochs_stay_in_order(
        bytes in prop_oneof![mutated(RINEX_2), mutated(RINEX_3), mutated(COMPACT_1), mutated(COMPACT_3)]
    ) {
        if let Ok((epochs, report)) = read(&bytes) {
            prop_assert!(epochs.is_sorted_by(|a, b| a.time < b.time));
            prop_assert_eq!(report.records, epochs.len() as u64);
        }
    }
}
