//! Single points of real receivers, from RINEX files: against another program's, against known coordinates, and with
//! faults put in. Run with `--nocapture` to see the statistics.

use nalgebra::Vector3;
use serde_json::Value;
use std::io::Read;
use surefix::read::rinex::{NavigationData, ObservationReader};
use surefix_core::gnss::SPEED_OF_LIGHT;
use surefix_core::gnss::atmosphere::{Klobuchar, Mapping};
use surefix_core::gnss::ephemeris::Ephemeris;
use surefix_core::gnss::epoch::EpochView;
use surefix_core::gnss::geodesy::{EARTH_ROTATION_RATE, Geodetic};
use surefix_core::gnss::orbit::store::{EphemerisStore, SelectionRule};
use surefix_core::gnss::satellite::Constellation;
use surefix_core::gnss::time::GpsTime;
use surefix_core::integrity::protection;
use surefix_core::integrity::stanford::Counts;
use surefix_core::spp::adjust::Unknowns;
use surefix_core::spp::position::Atmosphere;
use surefix_core::spp::rows::{self, Rows};
use surefix_core::spp::velocity::range_rate;
use surefix_core::spp::{Config, SinglePoint, SinglePointError, estimate, single_point};
use surefix_tests::shared;

/// Broadcast data of a case.
struct Broadcast {
    ephemerides: Box<EphemerisStore<4096>>,
    klobuchar: Option<Klobuchar>,
}

impl Broadcast {
    /// From navigation files below the reference data.
    fn read(paths: &[&str]) -> Option<Self> {
        let mut broadcast = Self { ephemerides: Box::new(EphemerisStore::new()), klobuchar: None };
        for path in paths {
            let data = NavigationData::open(&shared(&format!("data/{path}"))?).unwrap();
            for &ephemeris in &data.ephemerides {
                broadcast.ephemerides.insert(ephemeris);
            }
            broadcast.klobuchar = broadcast.klobuchar.or(data.klobuchar[Constellation::Gps.index()]);
        }
        Some(broadcast)
    }

    fn solve(&self, epoch: EpochView) -> Result<SinglePoint, SinglePointError> {
        let mut rows = Box::new(Rows::<64>::new());
        single_point(epoch, &self.ephemerides, self.klobuchar, &Config::DEFAULT, None, &mut rows)
    }
}

fn observations(path: &str) -> Option<ObservationReader> {
    Some(ObservationReader::open(&shared(&format!("data/{path}"))?).unwrap())
}

fn csv(path: &str) -> Option<Vec<Vec<f64>>> {
    let file = std::fs::File::open(shared(&format!("data/{path}"))?).unwrap();
    let mut text = String::new();
    match path.ends_with(".gz") {
        true => flate2::read::GzDecoder::new(file).read_to_string(&mut text),
        false => std::io::BufReader::new(file).read_to_string(&mut text),
    }
    .unwrap();
    let numbers = |line: &str| line.split(',').map(|field| field.trim().parse().ok()).collect();
    Some(text.lines().filter_map(numbers).collect())
}

/// Where a receiver was.
enum Truth {
    /// A fixed antenna, ECEF `[m]`, and its height above that point `[m]`.
    Static([f64; 3], f64),
    /// GPS second of week, ECEF `[m]`.
    Track(Vec<(f64, Vector3<f64>)>),
}

impl Truth {
    fn at(&self, time: GpsTime) -> Option<Vector3<f64>> {
        match self {
            Self::Static(point, height) => {
                let point = Vector3::from(*point);
                let here = Geodetic::from_ecef(&point);
                Some(point + here.enu_to_ecef(&Vector3::new(0.0, 0.0, *height)))
            }
            Self::Track(points) => {
                points.iter().find(|(tow, _)| (tow - time.tow()).abs() < 0.05).map(|&(_, position)| position)
            }
        }
    }
}

/// Errors of a run against the truth, and what the covariances say of them.
#[derive(Default)]
struct Statistics {
    epochs: u32,
    solved: u32,
    rejected: usize,
    horizontal: Vec<f64>,
    squares: Vector3<f64>,
    normalised: f64,
    speed_squares: Vec<f64>,
    speed_normalised: f64,
}

impl Statistics {
    fn of(observations_path: &str, navigation: &[&str], truth: &Truth) -> Option<Self> {
        let broadcast = Broadcast::read(navigation)?;
        let mut reader = observations(observations_path)?;
        let mut s = Self::default();
        while let Some(epoch) = reader.next_epoch().unwrap() {
            let Some(expected) = truth.at(epoch.time) else { continue };
            s.epochs += 1;
            let Ok(point) = broadcast.solve(epoch.view()) else { continue };
            s.solved += 1;
            s.rejected += point.rejected.len();
            let here = Geodetic::from_ecef(&expected);
            let error = here.ecef_to_enu(&(point.position - expected));
            let covariance = here.covariance_to_enu(&point.covariance);
            s.horizontal.push(error.xy().norm());
            s.squares += error.component_mul(&error);
            s.normalised += (covariance.try_inverse().unwrap() * error).dot(&error) / 3.0;
            if let (Some(velocity), Truth::Static(..)) = (point.velocity, truth) {
                let v = velocity.velocity;
                s.speed_squares.push(v.norm_squared());
                s.speed_normalised += (velocity.covariance.try_inverse().unwrap() * v).dot(&v) / 3.0;
            }
        }
        s.horizontal.sort_by(f64::total_cmp);
        Some(s)
    }

    fn rms(&self) -> Vector3<f64> {
        (self.squares / f64::from(self.solved)).map(f64::sqrt)
    }

    /// Mean of eᵀ Σ⁻¹ e / 3: 1 if the covariance is right, less if it is cautious.
    fn normalised_error(&self) -> f64 {
        self.normalised / f64::from(self.solved)
    }

    fn speed_rms(&self) -> Option<f64> {
        let n = self.speed_squares.len() as f64;
        (n > 0.0).then(|| (self.speed_squares.iter().sum::<f64>() / n).sqrt())
    }
}

const WETTZELL: &str = "static_wtzr_wtzz_2020177/ESBC00DNK_R_20201770000_01D_MN.rnx.gz";
const WTZR: &str = "static_wtzr_wtzz_2020177/WTZR00DEU_R_20201770000_01D_30S_MO_120epoch.rnx.gz";
const WTZZ: &str = "static_wtzr_wtzz_2020177/WTZZ00DEU_R_20201770000_01D_30S_MO_120epoch.rnx.gz";
const NAGOYA: &str = "static_nagoya_2024176_1hz";
const CAR: &str = "kinematic_ucr_car_2020194";
const GEONET: &str = "static_geonet_2005092";
const SAITAMA: &str = "static_saitama_2018242_1hz";
const TOKYO: &str = "kinematic_tokyo_2021265_1hz";
const GALWAY: &str = "static_galway_2018277";
const HONG_KONG: &str = "kinematic_hk_tst_rover_only_2019118";

/// Coordinates are those that come with the data. Bounds on the rms (horizontal, vertical, `[m]`) are what broadcast
/// corrections on one frequency give under an open sky, 3–6 m after 1.5 times what was measured.
#[test]
fn under_an_open_sky_errors_are_metres_and_covariances_are_honest() {
    let car = || {
        let rows = csv(&format!("{CAR}/groundtruth.csv.gz"))?;
        Some(Truth::Track(rows.iter().map(|r| (r[1], Vector3::new(r[2], r[3], r[4]))).collect()))
    };
    let at = |x: f64, y: f64, z: f64| Some(Truth::Static([x, y, z], 0.0));
    let above = |x: f64, y: f64, z: f64, height: f64| Some(Truth::Static([x, y, z], height));
    let geodetic = |latitude: f64, longitude: f64, height: f64| {
        let place = Geodetic { latitude: latitude.to_radians(), longitude: longitude.to_radians(), height };
        Some(Truth::Static(place.to_ecef().into(), 0.0))
    };
    let file = |folder: &str, name: &str| format!("{folder}/{name}");
    let cases = [
        ("WTZR", WTZR.into(), WETTZELL.into(), above(4075580.3111, 931854.0543, 4801568.2808, 0.071), 2.4, 1.2),
        ("WTZZ", WTZZ.into(), WETTZELL.into(), above(4075579.1913, 931853.3696, 4801569.1897, 0.284), 2.4, 1.6),
        (
            "Nagoya",
            file(NAGOYA, "base.obs.gz"),
            file(NAGOYA, "base.nav.gz"),
            at(-3817681.1213, 3562839.4311, 3650159.1593),
            4.5,
            2.5,
        ),
        ("car", file(CAR, "rover.obs.gz"), file(CAR, "rover.nav.gz"), car(), 1.5, 5.0),
        (
            "car base",
            file(CAR, "base.obs.gz"),
            file(CAR, "rover.nav.gz"),
            at(-2430697.699, -4704189.201, 3544329.103),
            1.5,
            4.0,
        ),
        (
            "GEONET 3040",
            file(GEONET, "30400920.05o"),
            file(GEONET, "30400920.05n"),
            at(-3978241.958, 3382840.234, 3649900.853),
            1.5,
            2.5,
        ),
        (
            "Saitama",
            file(SAITAMA, "base.obs.gz"),
            file(SAITAMA, "base.nav.gz"),
            geodetic(35.89118801, 139.56999280, 47.5153),
            2.0,
            5.5,
        ),
        (
            "Tokyo base",
            file(TOKYO, "3034265G.21O.gz"),
            file(TOKYO, "SEPT2650.21P.gz"),
            at(-3959400.631, 3385704.533, 3667523.111),
            3.0,
            2.0,
        ),
        (
            "Galway",
            file(GALWAY, "rover.obs.gz"),
            file(GALWAY, "rover.nav.gz"),
            at(3774088.8987, -601662.8256, 5089318.0991),
            4.5,
            8.0,
        ),
    ];
    for (name, observations, navigation, truth, horizontal, vertical) in cases {
        let Some(truth) = truth else { continue };
        let Some(s) = Statistics::of(&observations, &[&navigation], &truth) else { continue };
        let rms = s.rms();
        println!(
            "{name:12} {}/{} rms E {:.2} N {:.2} U {:.2} m, normalised {:.2}, rejected {}, velocity rms {:.3?} m/s, \
             normalised {:.2}",
            s.solved,
            s.epochs,
            rms.x,
            rms.y,
            rms.z,
            s.normalised_error(),
            s.rejected,
            s.speed_rms(),
            s.speed_normalised / s.speed_squares.len().max(1) as f64,
        );
        assert!(s.epochs >= 120 && s.solved == s.epochs, "{name}: {} of {}", s.solved, s.epochs);
        assert!(rms.xy().norm() < horizontal && rms.z < vertical, "{name}: {rms}");
        assert!(s.normalised_error() < 1.2, "{name}: {}", s.normalised_error());
        assert!(s.rejected < s.solved as usize / 10, "{name}: {}", s.rejected);
        assert!(s.speed_rms().is_none_or(|rms| rms < 0.06), "{name}: {:?}", s.speed_rms());
    }
}

#[test]
fn between_high_buildings_most_positions_stay_usable() {
    let navigation = [format!("{HONG_KONG}/hksc1180.19n.gz"), format!("{HONG_KONG}/hksc1180.19b.gz")];
    let Some(track) = csv(&format!("{HONG_KONG}/groundTruth_TST.csv")) else { return };
    let here =
        |row: &Vec<f64>| Geodetic { latitude: row[2].to_radians(), longitude: row[3].to_radians(), height: row[4] };
    let truth = Truth::Track(track.iter().map(|row| (row[1], here(row).to_ecef())).collect());
    let observations = format!("{HONG_KONG}/COM3_190428_124409.obs.gz");
    let s = Statistics::of(&observations, &[&navigation[0], &navigation[1]], &truth).unwrap();
    let [median, most] = [0.5, 0.9].map(|part| s.horizontal[(part * s.horizontal.len() as f64) as usize]);
    println!(
        "Hong Kong {}/{} horizontal median {median:.1} m, 90 % {most:.1} m, rejected {}",
        s.solved, s.epochs, s.rejected
    );
    // Measured: 6.7 m and 30 m, most signals reflected.
    assert!(s.solved * 10 >= s.epochs * 9 && median < 10.0 && most < 45.0);
}

/// Errors of single points between high buildings against the engine's code-only protection levels, both sets where they
/// have a truth, as a Stanford diagram counts them.
///
/// Without regard to the residuals PE > PL in 99 (horizontal) and 91 (vertical) of the 485 epochs of TST: most signals are
/// reflected, which no model of σ has. What is left with it, 3 and 5, is far above the risk of 2e-7 still: where reflections
/// agree with each other, one epoch cannot tell.
#[test]
fn between_high_buildings_protection_levels_are_counted() {
    let factors = protection::Config::DEFAULT.factors().unwrap();
    let tst2 = ["hksc155c.20n", "hksc155d.20n", "hksc155c.20b", "hksc155d.20b", "hksc155c.20g", "hksc155c.20l.gz"];
    for (name, observation, navigation, track, most) in [
        ("TST", "COM3_190428_124409.obs.gz", vec!["hksc1180.19n.gz", "hksc1180.19b.gz"], "groundTruth_TST.csv", [3, 5]),
        ("TST2", "2020_06_03_TST_03.obs.gz", tst2.to_vec(), "groundTruth_TST.csv", [0, 0]),
    ] {
        let folder = if name == "TST" { HONG_KONG.to_owned() } else { format!("{HONG_KONG}/{name}") };
        let file = |file: &str| format!("{folder}/{file}");
        let Some(track) = csv(&file(track)) else { return };
        let here =
            |row: &Vec<f64>| Geodetic { latitude: row[2].to_radians(), longitude: row[3].to_radians(), height: row[4] };
        let truth = Truth::Track(track.iter().map(|row| (row[1], here(row).to_ecef())).collect());
        let navigation: Vec<String> = navigation.into_iter().map(file).collect();
        let broadcast = Broadcast::read(&navigation.iter().map(String::as_str).collect::<Vec<_>>()).unwrap();
        let mut reader = observations(&file(observation)).unwrap();
        let (mut plain, mut counts) = ([Counts::default(); 2], [Counts::default(); 2]);
        while let Some(epoch) = reader.next_epoch().unwrap() {
            let Some(expected) = truth.at(epoch.time) else { continue };
            let Ok(point) = broadcast.solve(epoch.view()) else { continue };
            let local = Geodetic::from_ecef(&expected);
            let error = local.ecef_to_enu(&(point.position - expected));
            for (counts, inflation) in [(&mut plain, 1.0), (&mut counts, point.inflation())] {
                let levels = factors.levels(&local.covariance_to_enu(&point.covariance), inflation).unwrap();
                // Alert limits of a street and of a height above ground.
                counts[0].add(error.xy().norm(), levels.horizontal, 40.0);
                counts[1].add(error.z.abs(), levels.vertical, 50.0);
            }
        }
        println!("{name}, as configured: {plain:?}\n{name}, widened by residuals: {counts:?}");
        assert!(counts.iter().zip(most).all(|(counts, most)| counts.beyond() <= most), "{name}: {counts:?}");
    }
}

#[test]
fn a_fault_of_100_m_is_excluded_and_harmless() {
    let (Some(broadcast), Some(mut reader)) = (Broadcast::read(&[WETTZELL]), observations(WTZR)) else { return };
    let mut turn = 0;
    while let Some(mut epoch) = reader.next_epoch().unwrap() {
        let clean = broadcast.solve(epoch.view()).unwrap();
        let used: Vec<_> = clean.used.iter().collect();
        let victim = used[turn % used.len()];
        let fault = if turn % 2 == 0 { 100.0 } else { -100.0 };
        turn += 1;
        for observation in epoch.observations.iter_mut().filter(|o| o.satellite == victim) {
            observation.code = observation.code.map(|code| code + fault);
        }
        let point = broadcast.solve(epoch.view()).unwrap();
        assert!(point.rejected.contains(victim) && point.rejected.len() == 1, "{victim}: {:?}", point.rejected);
        // What leaving out one of 20 satellites does.
        assert!((point.position - clean.position).norm() < 2.0, "{victim}: {}", point.position - clean.position);
    }
    assert_eq!(turn, 120);
}

fn number(value: &Value) -> f64 {
    value.as_f64().expect("a number")
}

fn vector(value: &Value) -> Vector3<f64> {
    Vector3::from_iterator(value.as_array().expect("an array").iter().map(number))
}

/// What to add to our code to get RTKLIB's. It takes BGD E5a/E1, of the satellite's first message in the file, off E1
/// code, though it uses the I/NAV clock, to which BGD E5b/E1 belongs (Galileo OS SIS ICD 2.1, table 67).
fn rtklib_galileo(broadcast: &Broadcast, config: &Config, row: &rows::Row, time: GpsTime) -> f64 {
    let store = &broadcast.ephemerides;
    let first = store.iter().find(|e| e.satellite() == row.satellite);
    match (store.select(row.satellite, time, &config.ephemerides), first) {
        (Some(Ephemeris::Kepler(used)), Some(Ephemeris::Kepler(first)))
            if row.satellite.constellation() == Constellation::Galileo =>
        {
            SPEED_OF_LIGHT * (used.group_delay[1] - first.group_delay[0])
        }
        _ => 0.0,
    }
}

/// Range rate of a receiver at rest as RTKLIB's `resdop` has it: with the Sagnac term's sign opposite to that of its
/// range. Our rate, whose test is the derivative of the range, differs by up to 9 mm/s.
fn rtklib_rate(receiver: &Vector3<f64>, row: &rows::Row) -> f64 {
    let (s, v) = (&row.state.position, &row.state.velocity);
    let sagnac = EARTH_ROTATION_RATE / SPEED_OF_LIGHT * (v.y * receiver.x - v.x * receiver.y);
    (s - receiver).normalize().dot(v) + sagnac
}

/// Rows made from the files are those that RTKLIB made, and so is the point with its variances.
#[test]
fn from_files_to_the_golden_points() {
    let Some(path) = shared("vectors/gnss/13_single_point.json") else { return };
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut velocities = 0;
    for case in file["cases"].as_array().unwrap() {
        let (input, output, id) = (&case["in"], &case["out"], case["id"].as_str().unwrap());
        let (observation_path, navigation_path) = match id.split('_').next() {
            Some("wtzr") => (WTZR.to_owned(), WETTZELL.to_owned()),
            Some("nagoya") => (format!("{NAGOYA}/base.obs.gz"), format!("{NAGOYA}/base.nav.gz")),
            _ => (format!("{CAR}/rover.obs.gz"), format!("{CAR}/rover.nav.gz")),
        };
        let (Some(broadcast), Some(mut reader)) =
            (Broadcast::read(&[&navigation_path]), observations(&observation_path))
        else {
            return;
        };
        let time = GpsTime::from_week_tow(input["gps_week"].as_i64().unwrap() as i32, number(&input["tow"]));
        let mut epochs = std::iter::from_fn(|| reader.next_epoch().unwrap());
        let Some(epoch) = epochs.find(|epoch| epoch.time.since(time).abs() < 0.01) else {
            continue; // the drive was cut after 24 minutes
        };
        let config = Config { ephemerides: SelectionRule::RTKLIB, mapping: Mapping::Cosecant, ..Config::DEFAULT };
        let mut rows = Box::new(Rows::<64>::new());
        rows::prepare(epoch.view(), &broadcast.ephemerides, &config, &mut rows);

        let listed = input["satellites"].as_array().unwrap();
        rows.retain(|row| listed.iter().any(|s| s["sat"] == row.satellite.to_string()));
        assert_eq!(rows.len(), listed.len(), "{id}");
        for row in rows.iter_mut() {
            let expected = listed.iter().find(|s| s["sat"] == row.satellite.to_string()).unwrap();
            row.code += rtklib_galileo(&broadcast, &config, row, epoch.time);
            let off = (row.state.position - vector(&expected["satellite_ecef"])).norm();
            let clock = row.state.clock - number(&expected["satellite_clock"]);
            let code = row.code - number(&expected["code_corrected"]);
            assert!(off < 2e-3 && clock.abs() < 3e-12 && code.abs() < 1e-4, "{id} {row:?}: {off} {clock} {code}");
            row.code_variance = number(&expected["variance"]);
            row.doppler_variance = 1.0;
        }
        let k: Vec<f64> = input["klobuchar"].as_array().unwrap().iter().map(number).collect();
        let klobuchar = Klobuchar { alpha: [k[0], k[1], k[2], k[3]], beta: [k[4], k[5], k[6], k[7]] };
        let atmosphere = Atmosphere { time: epoch.time, klobuchar: Some(klobuchar), mapping: Mapping::Cosecant };
        let point = estimate(&rows, &atmosphere, Unknowns::default(), &config).unwrap();
        let off = (point.position - vector(&output["position_ecef"]["expected"])).norm();
        assert!(off < 2e-3, "{id}: {off}");
        if let Some(expected) = output.get("velocity_ecef").filter(|_| point.velocity.is_some()) {
            for row in rows.iter_mut() {
                let (rate, _) =
                    range_rate(&point.position, &Vector3::zeros(), &row.state.position, &row.state.velocity);
                let wavelength = SPEED_OF_LIGHT / row.frequency;
                row.doppler = row.doppler.map(|d| d + (rtklib_rate(&point.position, row) - rate) / wavelength);
            }
            let point = estimate(&rows, &atmosphere, Unknowns::default(), &config).unwrap();
            let off = point.velocity.unwrap().velocity - vector(&expected["expected"]);
            assert!(off.amax() <= number(&expected["tol"]), "{id}: {off}");
            velocities += 1;
        }
    }
    assert_eq!(velocities, 17);
}
