use super::*;
use proptest::prelude::*;
use std::io::Cursor;
use surefix_core::gnss::geodesy::LookAngle;

/// A line with its label.
fn labelled(content: &str, label: &str) -> String {
    format!("{content:<60}{label:<20}\n")
}

/// An antenna with grid lines and frequencies, each a name, an offset `[mm]` and rows.
fn antenna(name: &str, lines: &[(&str, &str)], frequencies: &[(&str, &str, &[&str])]) -> String {
    let mut text = labelled("", "START OF ANTENNA") + &labelled(name, "TYPE / SERIAL NO");
    text.extend(lines.iter().map(|(content, label)| labelled(content, label)));
    for (frequency, offset, rows) in frequencies {
        text += &labelled(&format!("   {frequency}"), "START OF FREQUENCY");
        text += &labelled(offset, "NORTH / EAST / UP");
        text.extend(rows.iter().map(|row| format!("{row}\n")));
        text += &labelled(&format!("   {frequency}"), "END OF FREQUENCY");
    }
    text + &labelled("", "END OF ANTENNA")
}

fn satellite(type_and_name: &str, until: Option<&str>) -> String {
    let mut lines = vec![
        ("     0.0", "DAZI"),
        ("     0.0  10.0   5.0", "ZEN1 / ZEN2 / DZEN"),
        ("     1", "# OF FREQUENCIES"),
        ("  2011     7    16     0     0    0.0000000", "VALID FROM"),
        ("IGS14_2134", "SINEX CODE"),
    ];
    lines.extend(until.map(|until| (until, "VALID UNTIL")));
    antenna(type_and_name, &lines, &[("G01", "    394.00      0.00   1501.80", &["   NOAZI    6.10    4.40    2.80"])])
}

fn sample() -> String {
    let grid = [("    90.0", "DAZI"), ("     0.0  90.0  45.0", "ZEN1 / ZEN2 / DZEN"), ("IGS14_2134", "SINEX CODE")];
    let rows = [
        "   NOAZI    0.00    1.00   -2.00",
        "     0.0    0.00    1.00   -2.00",
        "    90.0    0.00    3.00   -2.00",
        "   180.0    0.00    1.00   -2.00",
        "   270.0    0.00    1.00   -2.00",
        "   360.0    0.00    1.00   -2.00",
    ];
    let offset = "      0.45      0.14    161.70";
    labelled("     1.4            M", "ANTEX VERSION / SYST")
        + &labelled("A", "PCV TYPE / REFANT")
        + &labelled("", "END OF HEADER")
        + &satellite(
            "BLOCK IIA           G01                 G032      1992-079A",
            Some("  2014     1     1     0     0    0.0000000"),
        )
        + &satellite("BLOCK IIF           G01                 G063      2011-036A", None)
            .replace("2011     7", "2014     6")
        + &satellite("IRNSS-1GEO          I03                 I003      2014-061A", None)
        + &antenna("LEIAR25.R3      LEIT", &grid, &[("G01", offset, &rows), ("I05", offset, &rows)])
        + &antenna("LEIAR25.R3      NONE", &grid, &[("G01", offset, &rows)])
}

fn read(text: &str) -> Result<Antex, ReadError> {
    Antex::new("a.atx", Cursor::new(text.as_bytes().to_vec()))
}

#[test]
fn satellites_are_found_by_number_and_time() {
    let antex = read(&sample()).unwrap();
    let g01 = "G01".parse().unwrap();
    let at = |year| GpsTime::from_calendar(&surefix_core::gnss::time::Calendar::date(year, 1, 1)).unwrap();
    let found = antex.satellite(g01, at(2020)).unwrap();
    assert_eq!(
        (found.block, found.antenna_type.as_str(), found.spacecraft.as_str()),
        (Block::GpsIIF, "BLOCK IIF", "G063")
    );
    assert_eq!(antex.satellite(g01, at(2012)).unwrap().block, Block::GpsIIA);
    assert!(antex.satellite(g01, at(2010)).is_none());
    assert!(antex.satellite(g01, at(2014).plus_seconds(30.0 * 86_400.0)).is_none());
    assert!(antex.satellite("G02".parse().unwrap(), at(2020)).is_none());
    let calibration = found.calibrations[0].view();
    assert!((calibration.offset[2] - 1.5018).abs() < 1e-12);
    assert!((calibration.variations.mean(2.5_f64.to_radians()) - 0.00525).abs() < 1e-12);
    assert_eq!((antex.model.as_deref(), antex.absolute), (Some("IGS14_2134"), true));
    assert_eq!((antex.report.records, antex.report.count(Reason::SatelliteUnsupported)), (4, 1));
}

#[test]
fn receivers_are_found_by_name_and_a_missing_radome_is_said() {
    let antex = read(&sample()).unwrap();
    let found = antex.receiver("LEIAR25.R3      LEIT").unwrap();
    assert_eq!((found.antenna.radome.as_str(), found.radome_known), ("LEIT", true));
    assert_eq!(found.antenna.calibrations.len(), 1);
    let bare = antex.receiver("LEIAR25.R3").unwrap();
    assert_eq!((bare.antenna.radome.as_str(), bare.radome_known), ("NONE", true));
    let other = antex.receiver("LEIAR25.R3      SCIT").unwrap();
    assert_eq!((other.antenna.radome.as_str(), other.radome_known), ("NONE", false));
    assert!(antex.receiver("UNKNOWN         NONE").is_none());
    // In the east at 45°: the row of 90°.
    let variations = found.antenna.calibrations[0].view().variations;
    let look = LookAngle { azimuth: 90.0_f64.to_radians(), elevation: 45.0_f64.to_radians() };
    let zenith = 90.0_f64.to_radians() - look.elevation;
    assert!((variations.at(zenith, look.azimuth) - 0.003).abs() < 1e-12);
    assert!((variations.mean(zenith) - 0.001).abs() < 1e-12);
}

#[test]
fn damaged_antennas_are_counted_and_other_files_refused() {
    let text = sample();
    let short = read(&text.replacen("    1.00   -2.00\n", "    1.00\n", 1)).unwrap();
    assert_eq!((short.report.count(Reason::AntennaUnreadable), short.receivers.len()), (1, 1));
    let cut = read(&text[..text.len() - 200]).unwrap();
    assert_eq!((cut.report.count(Reason::Truncated), cut.receivers.len()), (1, 1));
    let message = |text: &str| read(text).unwrap_err().to_string();
    assert!(message("").contains("empty"));
    assert!(message("hello").contains("a.atx, line 1: is not an ANTEX antenna file"));
    assert!(message(&text[..150]).contains("END OF HEADER"));
    assert!(message(&text[..3 * 81]).contains("no antenna"));
}

#[test]
fn the_time_before_gps_is_before_all() {
    let text = sample().replace("2011     7    16", "1978     2    22");
    assert_eq!(read(&text).unwrap().satellites[0].from, Some(GpsTime::default()));
}

proptest! {
    #[test]
    fn no_bytes_panic(
        bytes in prop::collection::vec(any::<u8>(), 0..500),
        edits in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..20),
        end in any::<prop::sample::Index>(),
    ) {
        let _ = Antex::new("a.atx", Cursor::new(bytes));
        let mut text = sample().into_bytes();
        for (index, byte) in edits {
            let at = index.index(text.len());
            text[at] = byte;
        }
        text.truncate(end.index(text.len()) + 1);
        if let Ok(antex) = Antex::new("a.atx", Cursor::new(text)) {
            for calibration in antex.receivers.iter().flat_map(|antenna| &antenna.calibrations) {
                prop_assert!(calibration.view().variations.at(0.5, 1.0).is_finite());
            }
        }
    }
}
