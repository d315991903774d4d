use super::*;
use proptest::prelude::*;
use std::io::Cursor;

fn line(content: &str, label: &str) -> String {
    format!("{content:<60}{label:<20}\n")
}

/// Two maps, an hour apart, of 2 rows at 10° and 0° and 3 columns at 0°, 10° and 20°; the second with a missing value.
fn sample() -> String {
    let mut text = line("     1.0            IONOSPHERE MAPS     GNSS", "IONEX VERSION / TYPE");
    text += &line("  6371.0", "BASE RADIUS");
    text += &line("   450.0 450.0   0.0", "HGT1 / HGT2 / DHGT");
    text += &line("    10.0   0.0 -10.0", "LAT1 / LAT2 / DLAT");
    text += &line("     0.0  20.0  10.0", "LON1 / LON2 / DLON");
    text += &line("    -1", "EXPONENT");
    text += &line("", "END OF HEADER");
    for (kind, hour, values) in [
        ("TEC", 23, ["  100  110  120", "  200  210  220"]),
        ("TEC", 24, ["  100 9999  120", "  300  310  320"]),
        ("RMS", 23, ["   10   10   10", "   20   20   20"]),
        ("RMS", 24, ["   10   10   10", "   20   20   20"]),
    ] {
        text += &line("     1", &format!("START OF {kind} MAP"));
        text += &line(&format!("  2019    12     1{hour:>6}     0     0"), "EPOCH OF CURRENT MAP");
        for (latitude, values) in ["  10.0", "   0.0"].iter().zip(values) {
            text += &line(&format!("  {latitude}   0.0  20.0  10.0 450.0"), "LAT/LON1/LON2/DLON/H");
            text += values;
            text += "\n";
        }
        text += &line("     1", &format!("END OF {kind} MAP"));
    }
    text + &line("", "END OF FILE")
}

fn read(text: impl AsRef<[u8]>) -> Result<(Ionex, ReadReport), ReadError> {
    Ionex::read(Lines::new("a.inx", Cursor::new(text.as_ref().to_vec())))
}

#[test]
fn maps_and_their_errors_arrive() {
    let (ionex, report) = read(sample()).unwrap();
    assert_eq!((report.records, report.observations), (2, 11));
    assert!(report.dropped.is_empty(), "{report}");
    let start = GpsTime::from_calendar(&Calendar { hour: 23, ..Calendar::date(2019, 12, 1) }).unwrap();
    assert_eq!(ionex.times().collect::<Vec<_>>(), [start, start.plus_seconds(3_600.0)]);
    let maps = ionex.maps_at(start.plus_seconds(60.0)).unwrap();
    assert!((maps.before.at(0.0, 10.0).unwrap() - 21.0).abs() < 1e-12);
    assert_eq!(maps.after.at(10.0, 10.0), None);
    assert!((ionex.rms_at(start).unwrap().before.at(5.0, 0.0).unwrap() - 1.5).abs() < 1e-12);
    assert!(ionex.maps_at(start.plus_seconds(3_600.0)).is_some());
    assert_eq!(ionex.maps_at(start.plus_seconds(-1.0)), None);
    assert_eq!(ionex.maps_at(start.plus_seconds(3_601.0)), None);
}

#[test]
fn what_is_missing_is_counted_and_what_is_no_ionex_refused() {
    let text = sample();
    let cut: String = text.lines().take(12).map(|line| format!("{line}\n")).collect();
    let (ionex, report) = read(cut).unwrap();
    assert_eq!((ionex.maps.len(), report.count(Reason::Truncated)), (1, 1));
    assert!(matches!(read("x"), Err(ReadError::Header { .. })));
    assert!(matches!(read(""), Err(ReadError::Empty { .. })));
    let layers = text.replace("   450.0 450.0   0.0", "   100.0 450.0  50.0");
    assert!(read(layers).unwrap_err().to_string().contains("several layers"));
}

proptest! {
    #[test]
    fn no_bytes_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..500),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
    ) {
        let _ = read(&bytes);
        let mut text = sample().into_bytes();
        for (at, byte) in edits {
            let at = at.index(text.len());
            text[at] = byte;
        }
        if let Ok((ionex, _)) = read(&text) {
            for time in ionex.times() {
                let _ = ionex.maps_at(time).map(|maps| maps.before.at(5.0, 5.0));
            }
        }
    }
}
