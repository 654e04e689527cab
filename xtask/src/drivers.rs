//! Graphics drivers for the tests of the GPU backend: where a machine has none, software ones.

use std::path::{Path, PathBuf};
use std::process::Command;

/// Where Vulkan's loader looks for drivers on Linux.
const DRIVER_FOLDERS: [&str; 3] =
    ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d", "/usr/local/share/vulkan/icd.d"];

/// What gives a Debian system a software driver.
const PACKAGES: [&str; 2] = ["mesa-vulkan-drivers", "libvulkan1"];

/// The second software driver, stricter and without anything beyond the baseline; it comes with the
/// browser.
const SECOND: &str = "/usr/lib/chromium/vk_swiftshader_icd.json";
const SECOND_PACKAGE: &str = "chromium";

/// A driver for the tests is there, or is put there; otherwise what to do.
pub fn ensure() -> Result<(), String> {
    if !cfg!(target_os = "linux") || has_driver() {
        return Ok(());
    }
    install(&PACKAGES)?;
    if has_driver() {
        Ok(())
    } else {
        Err(format!("no Vulkan driver is installed. {}", advice(&PACKAGES)))
    }
}

/// The second driver's file; nothing where it may be missing and is.
pub fn second(required: bool) -> Result<Option<PathBuf>, String> {
    let file = Path::new(SECOND);
    if !cfg!(target_os = "linux") {
        return Ok(None);
    }
    if required && !file.exists() {
        install(&[SECOND_PACKAGE])?;
        if !file.exists() {
            return Err(format!("{SECOND} is not there. {}", advice(&[SECOND_PACKAGE])));
        }
    }
    Ok(file.exists().then(|| file.to_owned()))
}

fn has_driver() -> bool {
    DRIVER_FOLDERS.iter().any(|folder| {
        let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
        entries.into_iter().any(|entry| entry.path().extension().is_some_and(|e| e == "json"))
    })
}

/// Installs packages where that needs no password.
fn install(packages: &[&str]) -> Result<(), String> {
    if !may_install() {
        return Err(advice(packages));
    }
    println!("\n== drivers: apt-get install {}", packages.join(" "));
    let run = |arguments: &[&str]| {
        let mut command = Command::new("apt-get");
        command.args(arguments).env("DEBIAN_FRONTEND", "noninteractive");
        command.status().is_ok_and(|status| status.success())
    };
    let install = [&["install", "-y", "--no-install-recommends"], packages].concat();
    if run(&["update"]) && run(&install) {
        return Ok(());
    }
    Err(format!("apt-get failed. {}", advice(packages)))
}

fn may_install() -> bool {
    let id = Command::new("id").arg("-u").output();
    let is_root = id.is_ok_and(|output| output.stdout.trim_ascii() == b"0");
    is_root && Path::new("/usr/bin/apt-get").exists()
}

fn advice(packages: &[&str]) -> String {
    format!(
        "Install it: `apt-get install {}` on Debian and Ubuntu, the package of the same driver elsewhere.",
        packages.join(" ")
    )
}
