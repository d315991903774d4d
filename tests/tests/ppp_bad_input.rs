//! Bad input of `surefix ppp` as a user meets it: refused with a message that names the file and the remedy, or left out with a
//! warning that says what it costs. Never is anything taken as zero in silence.

use flate2::read::GzDecoder;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use surefix::process::ppp::files::FileList;
use surefix::process::ppp::run::{Done, Job, JobError};
use surefix_core::gnss::solution::Quality;
use surefix_tests::shared;

/// The first hour of ESBC.
const CASE: &str = "data/ppp_esbc_2020177_1h";
const OBSERVATIONS: &str = "ESBC00DNK_R_20201770000_01D_30S_MO_120epoch.rnx.gz";
const ORBITS: [&str; 2] = ["GRG0MGXFIN_20201760000_01D_15M_ORB.SP3.gz", "GRG0MGXFIN_20201770000_01D_15M_ORB.SP3.gz"];
const CLOCKS: &str = "GRG0MGXFIN_20201770000_65M_30S_CLK.CLK.gz";

fn read(path: &Path) -> String {
    let mut text = String::new();
    GzDecoder::new(fs::File::open(path).unwrap()).read_to_string(&mut text).unwrap();
    text
}

/// A spoiled copy of a file, in a temporary directory.
struct Spoiled {
    _directory: tempfile::TempDir,
    path: PathBuf,
}

fn spoil(path: &Path, change: impl Fn(String) -> String) -> Spoiled {
    let directory = tempfile::tempdir().unwrap();
    let name = path.file_stem().unwrap();
    let spoiled = directory.path().join(name);
    fs::write(&spoiled, change(read(path))).unwrap();
    Spoiled { _directory: directory, path: spoiled }
}

fn run(files: &[PathBuf]) -> Result<Done, JobError> {
    Job::default().run(&FileList::sort(files)?, |_| (), None)
}

/// Observations cut to `epochs` epochs, so that debug builds stay fast.
fn beginning(directory: &Path, epochs: usize, change: impl Fn(String) -> String) -> Spoiled {
    spoil(&directory.join(OBSERVATIONS), |text| {
        let mut parts = text.split("\n>");
        let header = change(parts.next().unwrap().to_owned());
        let body: Vec<&str> = parts.take(epochs).collect();
        format!("{header}\n>{}\n", body.join("\n>").trim_end())
    })
}

fn warns(done: &Done, parts: &[&str]) {
    let all = done.opened.warnings.join("\n");
    for part in parts {
        assert!(all.contains(part), "{part:?} is not in: {all}");
    }
}

fn last(done: &Done) -> Quality {
    done.run.solutions.last().unwrap().solution.quality
}

#[test]
fn without_orbits_or_observations_the_message_says_which_file_to_give() {
    let Some(directory) = shared(CASE) else { return };
    let observations = directory.join(OBSERVATIONS);
    let error = run(std::slice::from_ref(&observations)).err().unwrap().to_string();
    assert!(error.contains("none of the files has orbits") && error.contains("SP3"), "{error}");
    let error = run(&[directory.join(ORBITS[1])]).err().unwrap().to_string();
    assert!(error.contains("none of the files has observations"), "{error}");
    let error = run(&[observations, directory.join("README.md")]).err().unwrap().to_string();
    assert!(error.contains("README.md") && error.contains("leave it out"), "{error}");
}

/// Orbits without clock file, antennas, biases, tides: all is said, and it runs. (The clocks of the SP3 file are those of 15 minutes.)
#[test]
fn what_is_missing_is_said_with_its_cost() {
    let Some(directory) = shared(CASE) else { return };
    let short = beginning(&directory, 20, |header| header);
    let files = [short.path.clone(), directory.join(ORBITS[0]), directory.join(ORBITS[1])];
    let done = run(&files).unwrap();
    warns(
        &done,
        &[
            "no clock file",
            "every 900 s",
            "no ANTEX file",
            "heights are off",
            "code biases",
            "pole tide",
            "ocean loading",
        ],
    );
    assert_eq!(last(&done), Quality::Float);
}

/// Code biases of half a year before are not used, and that is said.
#[test]
fn biases_of_another_time_are_warned_of() {
    let Some(directory) = shared(CASE) else { return };
    let Some(biases) = shared("data/common/CAS0MGXRAP_20193350000_01D_01D_DCB.BSX.gz") else { return };
    let short = beginning(&directory, 2, |header| header);
    let files = [short.path.clone(), directory.join(ORBITS[0]), directory.join(ORBITS[1]), biases];
    warns(&run(&files).unwrap(), &["the code biases are of 2019-12-01", "none is used"]);
}

/// Bands that no constellation has (or a receiver with one band) leave no position, and that is said.
#[test]
fn bands_that_are_not_there_are_warned_of() {
    let Some(directory) = shared(CASE) else { return };
    let short = beginning(&directory, 2, |header| header);
    let list = FileList::sort(&[short.path.clone(), directory.join(ORBITS[0]), directory.join(ORBITS[1])]).unwrap();
    let mut job = Job::default();
    job.settings.engine.bands.bands = [*b"19"; 5];
    let done = job.run(&list, |_| (), None).unwrap();
    warns(&done, &["no constellation has two bands of those wanted", "--bands"]);
    assert_eq!(last(&done), Quality::None);
}

/// Broadcast messages alone: a position to metres, and that is said.
#[test]
fn broadcast_messages_alone_give_metres_and_say_so() {
    let Some(directory) = shared(CASE) else { return };
    let short = beginning(&directory, 20, |header| header);
    let navigation = directory.join("ESBC00DNK_R_20201770000_01D_MN.rnx.gz");
    let done = run(&[short.path.clone(), navigation]).unwrap();
    warns(&done, &["no SP3 file", "good to a metre"]);
    let position = done.run.solutions.last().unwrap().solution.position;
    let truth = nalgebra::Vector3::new(3_582_104.767, 532_590.182, 5_232_755.147);
    assert!((position - truth).norm() < 5.0, "{}", position - truth);
}

#[test]
fn a_header_coordinate_that_is_absurd_or_zero_is_not_used() {
    let Some(directory) = shared(CASE) else { return };
    for coordinate in ["        0.0000        0.0000        0.0000", "  9999999.0000  9999999.0000  9999999.0000"] {
        let short = beginning(&directory, 10, |header| {
            let place = |line: &str| {
                if line.contains("APPROX POSITION XYZ") {
                    format!("{coordinate:60}APPROX POSITION XYZ")
                } else {
                    line.to_owned()
                }
            };
            header.lines().map(place).collect::<Vec<_>>().join("\n")
        });
        let done =
            run(&[short.path.clone(), directory.join(ORBITS[0]), directory.join(ORBITS[1]), directory.join(CLOCKS)])
                .unwrap();
        warns(&done, &["approximate position"]);
        let position = done.run.solutions.last().unwrap().solution.position;
        let truth = nalgebra::Vector3::new(3_582_104.767, 532_590.182, 5_232_755.147);
        assert!((position - truth).norm() < 2.0, "{}", position - truth);
    }
}

/// Half of an SP3 file: what is there is used, what is not is counted, and nothing is made up behind its end.
#[test]
fn a_truncated_sp3_file_is_used_as_far_as_it_goes() {
    let Some(directory) = shared(CASE) else { return };
    let cut = spoil(&directory.join(ORBITS[1]), |text| text[..text.len() / 300].to_owned());
    let short = beginning(&directory, 10, |header| header);
    let outcome = run(&[short.path.clone(), cut.path.clone(), directory.join(CLOCKS)]);
    match outcome {
        Ok(done) => {
            assert!(done.run.solutions.iter().all(|solution| !solution.without_products.is_empty()));
            assert_eq!(last(&done), Quality::None);
        }
        Err(error) => assert!(error.to_string().contains("SP3"), "{error}"),
    }
}

/// A satellite that the clock file does not have: named, with what becomes of it.
#[test]
fn satellites_missing_in_the_clocks_are_named() {
    let Some(directory) = shared(CASE) else { return };
    let without = spoil(&directory.join(CLOCKS), |text| {
        text.lines().filter(|line| !line.starts_with("AS G02")).collect::<Vec<_>>().join("\n")
    });
    let short = beginning(&directory, 4, |header| header);
    let done =
        run(&[short.path.clone(), directory.join(ORBITS[0]), directory.join(ORBITS[1]), without.path.clone()]).unwrap();
    warns(&done, &["not in the clock files", "G02"]);
}

/// Antennas of another frame than the orbits, and an antenna that is not there.
#[test]
fn antennas_of_another_frame_and_unknown_ones_are_warned_of() {
    let (Some(directory), Some(antennas)) = (shared(CASE), shared("data/ppp_zim2_2026133_1h")) else { return };
    let short = beginning(&directory, 4, |header| header);
    let files = [
        short.path.clone(),
        directory.join(ORBITS[0]),
        directory.join(ORBITS[1]),
        directory.join(CLOCKS),
        antennas.join("igs20_zim2_gps_trim.atx.gz"),
    ];
    let done = run(&files).unwrap();
    warns(&done, &["ASH701945E_M", "is not there", "heights are off", "do not belong together"]);
}
