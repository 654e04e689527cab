//! The files of the explicit method's kernels.

use crate::elements::text::kernel_text;

/// Which kernels: those that limit energy, or small steps; with contact; with recovered-gradient tetrahedra.
#[derive(Clone, Copy)]
pub struct Which {
    pub limits_energy: bool,
    pub touches: bool,
    pub is_recovered: bool,
}

/// Behind what they share with others: `common` laws, elements and sums, tables and forces of recovered-gradient tetrahedra,
/// what stands in the place of these, and tools.
pub fn texts(
    which: Which,
    common: &[&'static str],
    recovered: &[&'static str],
    [plain, tools]: [&'static str; 2],
) -> Vec<&'static str> {
    let mut own = common.to_vec();
    match (which.limits_energy, which.is_recovered) {
        (false, false) => own.extend([plain, kernel_text!("recovered_none.wgsl")]),
        (false, true) => own.extend([recovered, &[kernel_text!("recovered.wgsl")]].concat()),
        (true, false) => own.extend([plain, kernel_text!("energy_none.wgsl")]),
        // Without forces, the last of these.
        (true, true) => {
            own.extend(&recovered[..recovered.len().saturating_sub(1)]);
            own.push(kernel_text!("energy_recovered.wgsl"));
        }
    }
    if which.limits_energy {
        own.extend([tools, kernel_text!("energy.wgsl")]);
    } else if which.touches {
        let contact = kernel_text!("contact.wgsl");
        own.extend([tools, contact, kernel_text!("contact_small.wgsl"), kernel_text!("mod.wgsl")]);
    } else {
        own.extend([kernel_text!("contact_none.wgsl"), kernel_text!("mod.wgsl")]);
    }
    own
}
