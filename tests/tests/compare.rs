//! `surefix compare` on outputs of RTKLIB: what their README files say of them comes out.

use nalgebra::Vector3;
use surefix::compare::{Options, Truth, compare};
use surefix::read::solution::{self, Options as ReadOptions, Track};
use surefix_tests::shared;

/// Rover coordinate that the Nagoya data states, ECEF `[m]`.
const NAGOYA_ROVER: Vector3<f64> = Vector3::new(-3_817_681.380_7, 3_562_839.978_5, 3_650_158.376);

fn read(path: &std::path::Path) -> Track {
    solution::read(path, &ReadOptions::default()).unwrap()
}

#[test]
fn nagoya_instantaneous_is_all_fixed() {
    let Some(path) = shared("data/static_nagoya_2024176_1hz/rover_rtk.pos.gz") else { return };
    let report = compare(&read(&path), &Truth::Fixed(NAGOYA_ROVER), &Options::default());
    // README: 301 epochs, instantaneous ambiguity resolution, all fixed.
    assert_eq!((report.epochs, report.matched, report.fix_rate, report.wrong_fixes), (301, 301, 1.0, 0));
    assert_eq!((report.first_fix_s, report.gaps.count), (Some(0.0), 0));
    // Millimetres, as the last line of the README's static check says.
    let fixed = report.fixed.unwrap();
    assert!(fixed.rms_3d_m < 0.005, "{fixed:?}");
    // awk over the height and sdu columns: rms of (height − 104.8626 m) 1.395 mm, of its ratio to sdu 0.207.
    assert!((1e3 * fixed.rms_vertical_m - 1.395).abs() < 0.005, "{fixed:?}");
    let normalized = report.fixed_normalized.unwrap();
    assert!((normalized.rms.up - 0.207).abs() < 0.002, "{normalized:?}");
}

#[test]
fn nagoya_static_ends_at_the_stated_position() {
    let Some(path) = shared("data/static_nagoya_2024176_1hz/rtklib_expected/static_l1l2.pos.gz") else { return };
    let track = read(&path);
    // README: the difference to the stated position is (1.7, −0.6, 1.1) mm in ECEF, at the end of the run.
    let difference = track.points.last().unwrap().position - NAGOYA_ROVER;
    assert!((difference - Vector3::new(0.0017, -0.0006, 0.0011)).amax() < 0.2e-3, "{difference:?}");
    assert_eq!(compare(&track, &Truth::Fixed(NAGOYA_ROVER), &Options::default()).fix_rate, 1.0);
}

#[test]
fn galway_against_the_receivers_own_fixes() {
    // README of each: RTKLIB's fixed epochs; common fixed epochs with the receiver (quality 4); mean difference and its
    // standard deviation [mm] in these.
    let cases = [
        ("static_galway_2018277", 1123, 1073, [0.0, -2.0, -1.0], [6.0, 7.0, 13.0]),
        ("kinematic_galway_2018282", 658, 311, [2.0, 0.0, -1.0], [19.0, 19.0, 51.0]),
        ("kinematic_galway_walk_2018277", 58, 0, [-4.0, -6.0, -5.0], [15.0, 14.0, 18.0]),
    ];
    for (name, fixed, common, mean, sd) in cases {
        let Some(directory) = shared(&format!("data/{name}")) else { return };
        let solution = read(&directory.join("rtklib_expected/kinematic_l1_combined.pos.gz"));
        let only_fixed = ReadOptions { only_quality: Some("4".into()), ..ReadOptions::default() };
        let truth = solution::read(&directory.join("reference_navsol.csv.gz"), &only_fixed).unwrap();
        let report = compare(&solution, &Truth::Track(truth), &Options::default());
        let errors = report.fixed.unwrap();
        println!("{name}: {} {} {errors:?}", report.by_quality["fixed"], errors.count);
        assert_eq!(report.by_quality["fixed"], fixed, "{name}");
        assert!(common == 0 || errors.count == common, "{name}: {}", errors.count);
        for (i, (got_mean, got_sd)) in [
            (errors.mean_m.east, errors.sd_m.east),
            (errors.mean_m.north, errors.sd_m.north),
            (errors.mean_m.up, errors.sd_m.up),
        ]
        .into_iter()
        .enumerate()
        {
            assert!((1e3 * got_mean - mean[i]).abs() < 0.6 && (1e3 * got_sd - sd[i]).abs() < 0.6, "{name}: {errors:?}");
        }
    }
}

#[test]
fn the_cars_truth_is_read_in_the_solutions_week() {
    let Some(path) = shared("data/kinematic_ucr_car_2020194/groundtruth.csv.gz") else { return };
    // README: second of week 2114, once a second over 23 minutes 36 seconds.
    let truth = solution::read(&path, &ReadOptions { week: Some(2114), ..ReadOptions::default() }).unwrap();
    let span = truth.points.last().unwrap().time.since(truth.points[0].time);
    assert_eq!((truth.points[0].time.week(), truth.points[0].time.tow()), (2114, 5784.0));
    assert!((1400.0..1450.0).contains(&span), "{span}");
    // Against itself nothing is wrong.
    let report = compare(&truth, &Truth::Track(truth.clone()), &Options::default());
    assert_eq!(report.all.unwrap().rms_3d_m, 0.0);
}
