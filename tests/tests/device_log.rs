//! Real data through a device log: what an engine is told by the log is what it is told by the files.

use std::path::PathBuf;
use surefix::cli::files::Files;
use surefix::log::{LogInputs, LogWriter};
use surefix::process::stream::Input;
use surefix_tests::shared;

#[test]
fn a_log_tells_what_the_files_tell() {
    for (case, navigation) in [
        ("kinematic_ucr_car_2020194_10min", "rover.nav"),
        ("static_nagoya_2024176_1hz", "base.nav"),
        ("static_galway_2018277", "rover.nav"),
    ] {
        let Some(directory) = shared(&format!("data/{case}")) else { continue };
        let file = |name: &str| -> PathBuf {
            // Some of the data are kept compressed.
            let plain = directory.join(name);
            if plain.exists() { plain } else { directory.join(format!("{name}.gz")) }
        };
        let files = Files {
            rover: file("rover.obs"),
            base: file("base.obs"),
            navigation: vec![file(navigation)],
            base_xyz: None,
        };
        let mut open = files.open().unwrap();
        let told: Vec<Input> = open.stream().map(Result::unwrap).collect();
        assert!(told.len() > 300, "{case}: {}", told.len());

        let mut log = LogWriter::new(Vec::new());
        told.iter().for_each(|input| log.input(input).unwrap());
        let bytes = log.finish().unwrap();
        let mut log = LogInputs::new(case, &bytes[..]).unwrap();
        let back: Vec<Input> = log.by_ref().map(Result::unwrap).collect();
        assert!(log.damage().is_none(), "{case}: {:?}", log.damage());
        assert!(back == told, "{case}: the log differs from the files");
    }
}
