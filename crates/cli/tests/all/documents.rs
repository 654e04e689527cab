//! Documents that the program writes.

use std::path::Path;
use std::process::Command;

#[test]
fn scene_documentation_is_current() {
    let output = Command::new(env!("CARGO_BIN_EXE_viscera"))
        .args(["scene", "describe", "--markdown"])
        .output()
        .expect("viscera starts");
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/scene.md");
    let written = std::fs::read_to_string(&path).unwrap_or_default().replace("\r\n", "\n");
    let printed = String::from_utf8(output.stdout).expect("UTF-8");
    assert!(
        written == printed,
        "docs/scene.md is not what the program says; run\n\
         cargo run --release -- scene describe --markdown > docs/scene.md"
    );
}
