//! Precise products of analysis centres as they are: counts against an independent count of their records, and what
//! interpolation between their nodes is worth.

use surefix::read::antex::Antex;
use surefix::read::clock::Clocks;
use surefix::read::sp3::Sp3;
use surefix::read::{FileKind, Reason, kind};
use surefix_core::gnss::attitude::Block;
use surefix_core::gnss::precise::{OrbitNode, clock, orbit};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::time::GpsTime;

/// An SP3 file, and what a script that splits its lines by columns counts in it.
struct Counts {
    file: &'static str,
    frame: &'static str,
    model: &'static str,
    satellites: usize,
    positions: usize,
    clocks: usize,
    clocks_absent: u64,
    manoeuvres: u64,
}

const SP3: [Counts; 5] = [
    Counts {
        file: "kinematic_tokyo_2021265_1hz/COD0MGXFIN_20212650000_01D_05M_ORB.SP3.gz",
        frame: "IGb14",
        model: "IGS14",
        satellites: 117,
        positions: 33_813,
        clocks: 33_696,
        clocks_absent: 117,
        manoeuvres: 0,
    },
    Counts {
        file: "ppp_esbc_2020177/GRG0MGXFIN_20201770000_01D_15M_ORB.SP3.gz",
        frame: "IGb14",
        model: "IGS14_2108",
        satellites: 75,
        positions: 7_200,
        clocks: 7_200,
        clocks_absent: 0,
        manoeuvres: 0,
    },
    Counts {
        file: "ppp_jfng_2019045_1h/COD0MGXFIN_20190450000_01D_05M_ORB.SP3.gz",
        frame: "IGS14",
        model: "IGS14",
        satellites: 92,
        positions: 26_587,
        clocks: 26_424,
        clocks_absent: 164,
        manoeuvres: 1,
    },
    Counts {
        file: "ppp_zim2_2026133_1h/IGS0OPSFIN_20261330000_01D_15M_ORB.SP3.gz",
        frame: "IGc20",
        model: "IGS20_2417",
        satellites: 32,
        positions: 3_072,
        clocks: 3_035,
        clocks_absent: 37,
        manoeuvres: 0,
    },
    Counts {
        file: "ppp_zimm_2015235/igs18586.sp3.gz",
        frame: "IGb08",
        model: "IGS08_1854",
        satellites: 31,
        positions: 2_976,
        clocks: 2_943,
        clocks_absent: 33,
        manoeuvres: 0,
    },
];

#[test]
fn orbit_files_are_read_to_the_last_record() {
    for expected in SP3 {
        let Some(path) = surefix_tests::shared(&format!("data/{}", expected.file)) else { return };
        let sp3 = Sp3::open(&path).unwrap();
        let (header, report) = (&sp3.headers[0], &sp3.reports[0]);
        assert_eq!((header.frame.as_str(), header.antenna_model.as_deref()), (expected.frame, Some(expected.model)));
        let satellites: Vec<_> = sp3.satellites().collect();
        assert_eq!(satellites.len(), expected.satellites, "{}", expected.file);
        assert_eq!(satellites.iter().map(|&s| sp3.orbit(s).len()).sum::<usize>(), expected.positions);
        assert_eq!(satellites.iter().map(|&s| sp3.clock(s).len()).sum::<usize>(), expected.clocks);
        assert_eq!(report.count(Reason::ClockAbsent), expected.clocks_absent, "{report}");
        assert_eq!(report.count(Reason::Manoeuvre), expected.manoeuvres, "{report}");
        assert_eq!(sp3.spacing(), Some(header.interval));
        assert_eq!(kind(&path).unwrap(), Some(FileKind::PreciseOrbit));
        let others = report.dropped.keys().filter(|reason| !matches!(reason, Reason::ClockAbsent | Reason::Manoeuvre));
        assert_eq!(others.count(), 0, "{report}");
    }
}

#[test]
fn clock_files_are_read_to_the_last_record() {
    for (file, satellites, records, frame) in [
        ("ppp_esbc_2020177/GRG0MGXFIN_20201770000_01D_30S_CLK.CLK.gz", 75, 215_999, "IGb14"),
        ("ppp_zim2_2026133_1h/IGS0OPSFIN_20261330000_90M_30S_CLK.CLK.gz", 32, 5_792, "IGc20"),
    ] {
        let Some(path) = surefix_tests::shared(&format!("data/{file}")) else { return };
        let clocks = Clocks::open(&path).unwrap();
        assert_eq!((clocks.satellites().count(), clocks.reports[0].records), (satellites, records), "{file}");
        assert!(clocks.reports[0].dropped.is_empty(), "{}", clocks.reports[0]);
        assert_eq!((clocks.spacing(), clocks.headers[0].frame.as_deref()), (Some(30.0), Some(frame)));
        assert_eq!(kind(&path).unwrap(), Some(FileKind::Clock));
    }
}

#[test]
fn antenna_files_are_read_to_the_last_antenna() {
    // 7 of the antennas of igs14.atx are those of NavIC.
    for (file, satellites, receivers, navic, model) in [
        ("common/igs14.atx.gz", 319, 382, 7, "IGS14_2134"),
        ("common/igs05.atx.gz", 107, 216, 0, "IGS05_1627"),
        ("ppp_zim2_2026133_1h/igs20_zim2_gps_trim.atx.gz", 14, 2, 0, "IGS20_2423"),
    ] {
        let Some(path) = surefix_tests::shared(&format!("data/{file}")) else { return };
        let antex = Antex::open(&path).unwrap();
        assert_eq!((antex.satellites.len(), antex.receivers.len()), (satellites, receivers), "{}", antex.report);
        assert_eq!(antex.report.count(Reason::SatelliteUnsupported), navic);
        assert_eq!(antex.report.dropped.len(), usize::from(navic > 0), "{}", antex.report);
        assert_eq!((antex.model.as_deref(), antex.absolute), (Some(model), true));
        assert_eq!(kind(&path).unwrap(), Some(FileKind::Antenna));
    }
}

#[test]
fn satellites_in_service_have_a_known_block() {
    let Some(path) = surefix_tests::shared("data/common/igs14.atx.gz") else { return };
    let antex = Antex::open(&path).unwrap();
    let time = GpsTime::from_week_tow(2111, 388_800.0);
    let block = |name: &str| antex.satellite(name.parse().unwrap(), time).map(|antenna| antenna.block);
    for (name, expected) in [
        ("G01", Block::GpsIIF),
        ("G05", Block::GpsIIR),
        ("G04", Block::GpsIII),
        ("E12", Block::GalileoIov),
        ("E01", Block::GalileoFoc),
        ("R05", Block::GlonassM),
        ("C01", Block::Geostationary),
        ("C06", Block::BeiDou2),
        ("C19", Block::BeiDou3CastMeo),
        ("C25", Block::BeiDou3Secm),
        ("J01", Block::QzssI),
        ("J02", Block::QzssII),
        ("J07", Block::Geostationary),
    ] {
        assert_eq!(block(name), Some(expected), "{name}");
    }
}

/// Each second node left out and predicted from those around it: at twice the spacing of 5 minutes the error is 1.5 mm
/// rms and 3.2 mm at most (the table `leave_one_out` of vectors/gnss/06_sp3_clk.json, from a part of these nodes). The
/// bands are 10 % for the rms, and 4 mm for the maximum over four times as many nodes.
#[test]
fn orbits_at_ten_minutes_predict_the_nodes_between_to_millimetres() {
    let file = "data/ppp_esbc_2020177/COD0MGXFIN_20201770000_01D_05M_ORB.SP3.gz";
    let Some(path) = surefix_tests::shared(file) else { return };
    let sp3 = Sp3::open(&path).unwrap();
    for (constellation, published) in [
        (Constellation::Gps, 0.001_528),
        (Constellation::Galileo, 0.001_464),
        (Constellation::Glonass, 0.001_557),
        (Constellation::BeiDou, 0.001_336),
        (Constellation::Qzss, 0.001_262),
    ] {
        let (mut sum, mut count, mut worst) = (0.0_f64, 0.0, 0.0_f64);
        for satellite in sp3.satellites().filter(|satellite| satellite.constellation() == constellation) {
            let nodes = sp3.orbit(satellite);
            let kept: Vec<OrbitNode> = nodes.iter().step_by(2).copied().collect();
            // (Not at the ends, where windows are one-sided.)
            for node in nodes.iter().skip(1).step_by(2).filter(|node| {
                let margin = 3_600.0;
                node.time.since(nodes[0].time) > margin && nodes[nodes.len() - 1].time.since(node.time) > margin
            }) {
                let error = (orbit(&kept, node.time).unwrap().position - node.position).norm();
                (sum, count, worst) = (sum + error * error, count + 1.0, worst.max(error));
            }
        }
        let rms = (sum / count).sqrt();
        println!("{constellation:?}: {count} nodes, rms {:.3} mm, worst {:.3} mm", rms * 1e3, worst * 1e3);
        assert!((rms - published).abs() < 0.1 * published, "{constellation:?} {rms}");
        assert!(worst < 0.004, "{constellation:?} {worst}");
    }
}

/// Clocks at 5 minutes, predicted from every tenth of 30 s: the file of vectors has 1e-10 s rms for GPS.
#[test]
fn clocks_at_thirty_seconds_are_worth_reading() {
    let file = "data/ppp_esbc_2020177/GRG0MGXFIN_20201770000_01D_30S_CLK.CLK.gz";
    let Some(path) = surefix_tests::shared(file) else { return };
    let clocks = Clocks::open(&path).unwrap();
    for (constellation, most) in [(Constellation::Gps, 2e-10), (Constellation::Galileo, 2e-10)] {
        let (mut sum, mut count) = (0.0_f64, 0.0_f64);
        for satellite in clocks.satellites().filter(|satellite| satellite.constellation() == constellation) {
            let nodes = clocks.clock(satellite);
            let sparse: Vec<_> = nodes.iter().filter(|node| node.time.tow() % 300.0 == 0.0).copied().collect();
            for node in nodes {
                if let Ok(value) = clock(&sparse, node.time, 300.0) {
                    sum += (value.bias - node.bias).powi(2);
                    count += f64::from(u8::from(value.distance > 0.0));
                }
            }
        }
        let rms: f64 = (sum / count).sqrt();
        println!("{constellation:?}: {count} clocks, rms {rms:.2e} s");
        assert!(rms < most, "{constellation:?} {rms:e}");
    }
}
