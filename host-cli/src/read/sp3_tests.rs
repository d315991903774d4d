use super::*;
use proptest::prelude::*;
use std::io::Cursor;

/// The beginning of an SP3-d file of CODE (2020, day 177), with a satellite without clock, one without position, one of
/// NavIC, one with all flags, and a second epoch.
const COD: &str = "\
#dP2020  6 25  0  0  0.00000000     289 d+D   IGS14 FIT AIUB
## 2111 345600.00000000   300.00000000 59025 0.0000000000000
+    4   G05E12C19J02  0  0  0  0  0  0  0  0  0  0  0  0  0
++         5  5  5  5  0  0  0  0  0  0  0  0  0  0  0  0  0
%c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
%c cc cc ccc ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc
%f  1.2500000  1.025000000  0.00000000000  0.000000000000000
%i    0    0    0    0      0      0      0      0         0
/* PCV:IGS14_2108 OL/AL:FES2004  NONE     YN ORB:CoN CLK:CoN
*  2020  6 25  0  0  0.00000000
PG05  20403.407950  -4547.528917  16359.977229    -15.288617
PE12 -19696.316939     88.327642 -22105.040910 999999.999999
PC19      0.000000      0.000000      0.000000    350.123456
PI02 -33966.154303  15785.235812 -14897.665491 999999.999999
*  2020  6 25  0  5  0.00000000
PG05  20963.407950  -4347.528917  15759.977229    -15.288717              EP  MP
EOF
";

fn read(text: &str) -> Result<Sp3, ReadError> {
    Sp3::new("a.sp3", Cursor::new(text.as_bytes().to_vec()))
}

fn id(name: &str) -> SatelliteId {
    name.parse().unwrap()
}

#[test]
fn positions_clocks_and_header_are_read() {
    let sp3 = read(COD).unwrap();
    let midnight = GpsTime::from_week_tow(2111, 345_600.0);
    let node = OrbitNode { time: midnight, position: Vector3::new(20_403_407.95, -4_547_528.917, 16_359_977.229) };
    assert!((sp3.orbit(id("G05"))[0].position - node.position).amax() < 1e-8);
    assert_eq!(sp3.orbit(id("G05"))[0].time, midnight);
    assert!((sp3.clock(id("G05"))[0].bias + 15.288617e-6).abs() < 1e-20);
    let header = &sp3.headers[0];
    assert_eq!((header.version, header.interval), ('d', 300.0));
    assert_eq!([&header.frame, &header.orbit_type, &header.agency], ["IGS14", "FIT", "AIUB"]);
    assert_eq!(header.antenna_model.as_deref(), Some("IGS14_2108"));
}

#[test]
fn what_is_absent_or_not_to_be_interpolated_is_left_out_and_counted() {
    let sp3 = read(COD).unwrap();
    assert!(sp3.clock(id("E12")).is_empty() && sp3.orbit(id("E12")).len() == 1);
    assert!(sp3.orbit(id("C19")).is_empty() && sp3.clock(id("C19")).len() == 1);
    // The second node of G05 comes after a manoeuvre and a clock event.
    assert_eq!((sp3.orbit(id("G05")).len(), sp3.clock(id("G05")).len()), (1, 1));
    let report = &sp3.reports[0];
    for reason in [
        Reason::PositionAbsent,
        Reason::ClockAbsent,
        Reason::SatelliteUnsupported,
        Reason::Manoeuvre,
        Reason::ClockEvent,
    ] {
        assert_eq!(report.count(reason), 1, "{reason}");
    }
    assert_eq!((report.records, report.count(Reason::EndMissing)), (2, 0));
    let predicted = read(&COD.replace("EP  MP", " P   P")).unwrap();
    assert_eq!((predicted.predicted_positions, predicted.predicted_clocks), (1, 1));
    assert_eq!(predicted.orbit(id("G05")).len(), 2);
}

#[test]
fn other_time_scales_are_turned_into_gpst() {
    let at = |name: &str| read(&COD.replace("cc GPS", &format!("cc {name}"))).unwrap().span().unwrap().0;
    let midnight = GpsTime::from_week_tow(2111, 345_600.0);
    assert_eq!(at("TAI"), midnight.plus_seconds(-19.0));
    assert_eq!(at("UTC"), midnight.plus_seconds(18.0));
    assert_eq!(at("BDT"), midnight.plus_seconds(14.0));
    assert!(read(&COD.replace("cc GPS", "cc XYZ")).unwrap_err().to_string().contains("XYZ"));
}

#[test]
fn the_first_version_names_gps_satellites_by_number_alone() {
    let text = COD.replace("#dP", "#aP").replace("PG05", "P  5").replace("cc GPS ccc", "cc ccc ccc");
    assert_eq!(read(&text).unwrap().orbit(id("G05")).len(), 1);
}

#[test]
fn files_of_following_days_are_joined_with_their_common_epoch_once() {
    let mut sp3 = read(COD).unwrap();
    sp3.merge(read(&COD.replace("20403.4", "20403.5").replace("EP  MP", "")).unwrap());
    assert_eq!(sp3.orbit(id("G05")).len(), 2);
    assert!((sp3.orbit(id("G05"))[0].position.x - 20_403_407.95).abs() < 1e-8);
    // Two positions and two clocks at midnight.
    assert_eq!(sp3.reports[1].count(Reason::NodeDuplicate), 4);
    assert_eq!((sp3.headers.len(), sp3.spacing()), (2, Some(300.0)));
}

#[test]
fn a_cut_file_is_reported_and_another_one_refused() {
    let cut = read(&COD[..COD.len() - 60]).unwrap();
    assert_eq!((cut.reports[0].count(Reason::EndMissing), cut.reports[0].count(Reason::Truncated)), (1, 1));
    let damaged = read(&COD.replace("0  5  0.0000", "0 xx  0.0000")).unwrap();
    assert_eq!(damaged.reports[0].count(Reason::LineUnreadable), 2);
    let message = |text: &str| read(text).unwrap_err().to_string();
    assert!(message("").contains("empty"));
    assert!(message("hello").contains("a.sp3, line 1: is not an SP3 orbit file"));
    assert!(message(&COD[..300]).contains("no position"));
}

proptest! {
    #[test]
    fn no_bytes_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..500),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
        end in any::<prop::sample::Index>(),
    ) {
        let _ = Sp3::new("a.sp3", Cursor::new(bytes));
        let mut text = COD.as_bytes().to_vec();
        for (index, byte) in edits {
            let at = index.index(text.len());
            text[at] = byte;
        }
        text.truncate(end.index(COD.len()) + 1);
        if let Ok(sp3) = Sp3::new("a.sp3", Cursor::new(text)) {
            let finite = |satellite| sp3.orbit(satellite).iter().all(|node| node.position.amax().is_finite());
            prop_assert!(sp3.satellites().all(finite));
        }
    }
}
