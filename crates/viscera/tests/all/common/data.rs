//! Where real meshes are found, for the tests of all packages.

use std::path::PathBuf;

/// The folder that VISCERA_DATA names, or none, said, where a test is to be skipped. With
/// VISCERA_REQUIRE=1 a test without its data fails instead.
pub fn data_folder() -> Option<PathBuf> {
    let folder = std::env::var_os("VISCERA_DATA").map(PathBuf::from);
    if folder.is_none() {
        let required = std::env::var_os("VISCERA_REQUIRE").is_some_and(|value| value == "1");
        assert!(!required, "VISCERA_REQUIRE=1 needs VISCERA_DATA, the folder of real meshes");
        println!("skipped: VISCERA_DATA is not set");
    }
    folder
}
