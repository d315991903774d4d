//! Tells the linker where the memory map is and which scripts make an image of it.

fn main() {
    let repository = concat!(env!("CARGO_MANIFEST_DIR"), "/..");
    println!("cargo:rustc-link-search={repository}");
    println!("cargo:rustc-link-arg-bins=-Tlink.x");
    println!("cargo:rustc-link-arg-bins=-Tdefmt.x");
    println!("cargo:rerun-if-changed={repository}/memory.x");
    println!("cargo:rerun-if-changed=build.rs");
}
