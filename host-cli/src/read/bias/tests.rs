use super::*;
use proptest::prelude::*;
use std::io::Cursor;

const SINEX: &str = "\
%=BIA 1.00 COD 2026:182:31588 IGS 2026:152:00000 2026:182:00000 A 00000351
+BIAS/DESCRIPTION
 TIME_SYSTEM                             G
 SATELLITE_CLOCK_REFERENCE_OBSERVABLES   G  C1W  C2W
 SATELLITE_CLOCK_REFERENCE_OBSERVABLES   E  C1X  C5X
-BIAS/DESCRIPTION
+BIAS/SOLUTION
*BIAS SVN_ PRN STATION__ OBS1 OBS2 BIAS_START____ BIAS_END______ UNIT __ESTIMATED_VALUE____ _STD_DEV___
 OSB  G080 G01           C1C       2026:152:00000 2026:182:00000 ns                 -6.2069      0.0046
 OSB  G080 G01           L1C       2026:152:00000 2026:182:00000 cyc                 0.5000      0.0046
 OSB  G080 G01           C2C       2026:152:00000 2026:153:00000 ns                  1.0000      0.0046
 OSB  G080 G01           C2C       2026:153:00000 2026:154:00000 ns                  2.0000      0.0046
 DSB  E101 E11           C1X  C5X  26:152:00000   0000:000:00000 ns                  3.0000      0.0046
 OSB  S120 S20           C1C       2026:152:00000 2026:182:00000 ns                 -6.2069      0.0046
 ISB       G01           C1C       2026:152:00000 2026:182:00000 ns                 -6.2069      0.0046
 OSB  G080 G01           C1?       2026:152:00000 2026:182:00000 ns                 -6.2069      0.0046
 OSB  G080 G01           C1W       2026:152:00000 2026:182:00000 ns                 -x.2069      0.0046
 OSB  G    G   ABMF      C1W       2026:152:00000 2026:182:00000 ns                  4.0000      0.0046
 DSB  R730 R01 ZAMB      C1P  C2P  2026:152:00000 2026:182:00000 ns                  5.0000      0.0046
-BIAS/SOLUTION
%=ENDBIA
";

const TABLE: &str = "\
CODE'S MONTHLY GNSS P1-C1 DCB SOLUTION, YEAR 2026, MONTH 06      01-JUL-26 08:42
--------------------------------------------------------------------------------

DIFFERENTIAL (P1-C1) CODE BIASES FOR SATELLITES AND RECEIVERS:

PRN / STATION NAME        VALUE (NS)  RMS (NS)
***   ****************    *****.***   *****.***
G01                           0.626       0.000
R02                           0.291       0.029
E03                           0.291       0.029
G04                           0.x91       0.029
R     ABMF 97103M001          0.529       0.006

";

fn read(text: impl AsRef<[u8]>) -> Result<(BiasData, ReadReport), ReadError> {
    let mut data = BiasData::default();
    let report = data.add_lines(Lines::new("a.bia", Cursor::new(text.as_ref().to_vec())))?;
    Ok((data, report))
}

/// Day of year 2026 (152 is 1 June).
fn day(day: u8) -> GpsTime {
    let june = surefix_core::gnss::time::Calendar::date(2026, 6, 1);
    GpsTime::from_calendar(&june).unwrap().plus_seconds((f64::from(day) - 152.0) * 86_400.0)
}

fn code(data: &BiasData, satellite: &str, signal: &str, time: GpsTime) -> Option<f64> {
    data.code_bias(satellite.parse().unwrap(), signal.parse().unwrap(), time)
}

#[test]
fn bias_sinex_arrives_with_its_validity() {
    let (data, report) = read(SINEX).unwrap();
    assert_eq!(report.records, 7);
    for reason in
        [Reason::SatelliteUnsupported, Reason::RecordUnsupported, Reason::RecordUnreadable, Reason::ValueUnreadable]
    {
        assert_eq!(report.count(reason), 1, "{report}");
    }
    let noon = day(152).plus_seconds(43_200.0);
    assert_eq!(code(&data, "G01", "1C", noon), Some(-6.2069 * METRES_PER_NS));
    assert_eq!(code(&data, "G01", "1W", noon), None);
    assert_eq!(code(&data, "G01", "1C", day(151)), None);
    assert_eq!(code(&data, "G01", "2L", noon), Some(METRES_PER_NS)); // by 2C
    assert_eq!(code(&data, "G01", "2L", noon.plus_seconds(86_400.0)), Some(2.0 * METRES_PER_NS));
    let phase = data.phase_bias("G01".parse().unwrap(), "1C".parse().unwrap(), noon).unwrap();
    assert!((phase - 0.5 * SPEED_OF_LIGHT / 1_575.42e6).abs() < 1e-12);
    let wanted = ["1C", "5Q"].map(|signal| ("G01".parse().unwrap(), signal.parse().unwrap()));
    assert_eq!(data.missing(wanted, noon), wanted[1..]);
    let list = data.at(noon);
    assert!(list.is_sorted_by_key(|bias| bias.key) && list.len() == 5);
}

#[test]
fn differences_become_absolute_against_the_file_s_clocks() {
    let (data, _) = read(SINEX).unwrap();
    let [first, second] = ["1X", "5X"].map(|signal| code(&data, "E11", signal, day(200)).unwrap());
    assert!((first - second - 3.0 * METRES_PER_NS).abs() < 1e-12);
    assert!((154.0 * 154.0 * first - 115.0 * 115.0 * second).abs() < 1e-9);
    assert_eq!(data.clock_references(Constellation::Galileo)[0], ["1X", "5X"].map(|signal| signal.parse().unwrap()));
    let [of_all, of_one] = data.receivers() else { panic!("two receivers") };
    assert_eq!((of_all.station.as_str(), of_all.satellite, of_all.value), ("ABMF", None, 4.0 * METRES_PER_NS));
    assert_eq!((of_one.satellite, of_one.second), ("R01".parse().ok(), "2P".parse().ok()));
}

#[test]
fn tables_of_code_make_c1_consistent_with_p1() {
    let (data, report) = read(TABLE).unwrap();
    assert_eq!(
        (report.records, report.count(Reason::RecordUnsupported), report.count(Reason::ValueUnreadable)),
        (3, 1, 1)
    );
    assert_eq!(code(&data, "G01", "1C", day(1)), Some(-0.626 * METRES_PER_NS));
    assert_eq!(code(&data, "G01", "1W", day(1)), Some(0.0));
    assert_eq!(code(&data, "R02", "1C", day(1)), Some(-0.291 * METRES_PER_NS));
    assert_eq!(data.receivers()[0].station, "ABMF 97103M001");
}

#[test]
fn other_files_are_refused() {
    assert!(matches!(read("hello\n"), Err(ReadError::Header { .. })));
    assert!(matches!(read(""), Err(ReadError::Empty { .. })));
    let cut = SINEX.replace("%=ENDBIA\n", "");
    assert_eq!(read(cut).unwrap().1.count(Reason::Truncated), 1);
}

proptest! {
    #[test]
    fn no_bytes_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..500),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
    ) {
        let _ = read(&bytes);
        for sample in [SINEX, TABLE] {
            let mut text = sample.as_bytes().to_vec();
            for (at, byte) in &edits {
                let at = at.index(text.len());
                text[at] = *byte;
            }
            if let Ok((data, _)) = read(&text) {
                prop_assert!(data.at(day(152)).iter().all(|bias| bias.value.is_finite()));
            }
        }
    }
}
