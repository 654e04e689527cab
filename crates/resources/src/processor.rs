//! The processor's name.

use sysinfo::{CpuRefreshKind, RefreshKind, System};

/// As the processor calls itself.
pub fn processor() -> String {
    let wanted = RefreshKind::nothing().with_cpu(CpuRefreshKind::nothing());
    let system = System::new_with_specifics(wanted).ok();
    let brand = system.as_ref().and_then(|s| s.cpus().first()).map(|cpu| cpu.brand().trim());
    brand.filter(|name| !name.is_empty()).unwrap_or("a processor without a name").to_owned()
}
