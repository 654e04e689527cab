//! Kernels read as text, without a device: every composition is valid, within the limits that WebGPU
//! gives everywhere, and agrees with the host about names, places and sizes.

use std::collections::BTreeSet;

use naga::valid::{Capabilities, GlobalUse, ModuleInfo, ValidationFlags, Validator};
use naga::{AddressSpace, Module, StorageAccess, TypeInner};
use viscera::elements::TetForm;
use viscera::solver::gpu::kernels::{self, Kernel, Swept, Variant, source};
use viscera::solver::gpu::{Slot, baseline, host_layouts};

fn variants() -> impl Iterator<Item = Variant> {
    TetForm::ALL.into_iter().flat_map(|form| Swept::ALL.map(|swept| Variant { form, swept }))
}

/// A kernel's text, parsed and validated with nothing beyond WebGPU's core.
fn parsed(kernel: &Kernel, variant: Variant) -> (Module, ModuleInfo) {
    let text = source(kernel, variant);
    let module = naga::front::wgsl::parse_str(&text)
        .unwrap_or_else(|error| panic!("{}: {}", kernel.entry, error.emit_to_string(&text)));
    let info = Validator::new(ValidationFlags::all(), Capabilities::empty()).validate(&module);
    let info =
        info.unwrap_or_else(|error| panic!("{}: {}", kernel.entry, error.emit_to_string(&text)));
    (module, info)
}

/// The place of an entry point in its module.
fn entry(kernel: &Kernel, module: &Module) -> usize {
    let found = module.entry_points.iter().position(|entry| entry.name == kernel.entry);
    found.unwrap_or_else(|| panic!("{} is no entry point", kernel.entry))
}

/// Whether a kernel is made in this variant: what it is bound to says how its sweeps go.
fn is_made(kernel: &Kernel, variant: Variant) -> bool {
    let copies = kernel.slots.contains(&Slot::Copies);
    let indices = kernel.slots.contains(&Slot::CornerIndices);
    match kernel.file {
        kernels::File::Sweep => {
            (copies, indices)
                == match variant.swept {
                    Swept::Vertices => (false, false),
                    Swept::Copies => (false, true),
                    Swept::Jacobi => (true, true),
                }
        }
        kernels::File::SweepElements => copies == (variant.swept == Swept::Jacobi),
        kernels::File::AndersonPush => copies == (variant.swept != Swept::Vertices),
        _ => true,
    }
}

/// Every kernel in the variants that its text tells apart.
fn all() -> impl Iterator<Item = (&'static Kernel, Variant)> {
    kernels::ALL.iter().flat_map(|kernel| {
        let mut texts = BTreeSet::new();
        let is_new = move |&v: &Variant| is_made(kernel, v) && texts.insert(source(kernel, v));
        variants().filter(is_new).map(move |v| (kernel, v))
    })
}

/// Whether `&&` and `||` stand beside each other without parentheses that tell them apart: WGSL forbids it, and browsers hold
/// to that where the parser of these tests does not.
fn mixes_and_with_or(text: &str) -> bool {
    let code = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<String>();
    // What was seen in each pair of parentheses that is open.
    let mut seen = vec![[false; 2]];
    let pairs = code.as_bytes().windows(2);
    pairs.into_iter().any(|pair| {
        match pair[0] {
            b'(' | b'[' => seen.push([false; 2]),
            b')' | b']' if seen.len() > 1 => {
                seen.pop();
            }
            b';' | b'{' | b'}' | b',' => {
                seen.iter_mut().next_back().into_iter().for_each(|s| *s = [false; 2])
            }
            _ => {}
        }
        let last = seen.last_mut();
        last.is_some_and(|last| {
            last[0] |= pair == b"&&";
            last[1] |= pair == b"||";
            *last == [true; 2]
        })
    })
}

#[test]
fn browsers_take_what_stands_between_and_and_or() {
    assert!(mixes_and_with_or("let a = b && c || d;") && mixes_and_with_or("if (b || c && d) {"));
    assert!(!mixes_and_with_or("let a = (b && c) || d; let e = b && c;"));
    for (kernel, variant) in all() {
        assert!(!mixes_and_with_or(&source(kernel, variant)), "{}: {variant:?}", kernel.entry);
    }
}

#[test]
fn every_kernel_is_bound_to_what_it_names_within_the_baseline() {
    let limits = baseline();
    let mut highest = [0; 4];
    for (kernel, variant) in all() {
        let (module, info) = parsed(kernel, variant);
        let at = entry(kernel, &module);
        let uses = info.get_entry_point(at);
        let (mut bound, mut groups, mut shared) = (BTreeSet::new(), BTreeSet::new(), 0);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).expect("a valid module");
        for (handle, variable) in module.global_variables.iter() {
            if uses[handle] == GlobalUse::empty() {
                continue;
            }
            if let Some(binding) = &variable.binding {
                groups.insert(binding.group);
                if binding.group == 0 {
                    bound.insert(binding.binding);
                }
            }
            if variable.space == AddressSpace::WorkGroup {
                shared += layouter[variable.ty].size;
            }
        }
        let named: BTreeSet<u32> = kernel.slots.iter().map(|&slot| slot as u32).collect();
        assert_eq!(bound, named, "{} is bound to other buffers than it uses", kernel.entry);
        let threads: u32 = module.entry_points[at].workgroup_size.iter().product();
        assert_eq!(threads, kernel.workgroup, "{}", kernel.entry);
        let counts = [bound.len() as u32, groups.len() as u32, threads, shared];
        for (highest, count) in highest.iter_mut().zip(counts) {
            *highest = count.max(*highest);
        }
    }
    println!("storage buffers, bind groups, threads, workgroup memory [bytes]: {highest:?}");
    let most = [
        limits.max_storage_buffers_per_shader_stage,
        limits.max_bind_groups,
        limits.max_compute_invocations_per_workgroup,
        limits.max_compute_workgroup_storage_size,
    ];
    assert_eq!(most, [8, 4, 256, 16 * 1024], "WebGPU's defaults");
    for (highest, most) in highest.into_iter().zip(most) {
        assert!(highest <= most, "{highest} where devices promise {most}");
    }
}

/// `CornerIndices` as WGSL writes it.
fn snake_case(slot: Slot) -> String {
    let mut name = String::new();
    for letter in format!("{slot:?}").chars() {
        if letter.is_uppercase() && !name.is_empty() {
            name.push('_');
        }
        name.extend(letter.to_lowercase());
    }
    name
}

#[test]
fn buffers_have_the_same_numbers_on_both_sides() {
    for (kernel, variant) in all() {
        let (module, _) = parsed(kernel, variant);
        for &slot in kernel.slots {
            let name = snake_case(slot);
            let variables = module.global_variables.iter().map(|(_, variable)| variable);
            let named = variables.into_iter().find(|v| v.name.as_deref() == Some(&name));
            let variable = named.unwrap_or_else(|| panic!("no kernel has `{name}`"));
            let number = variable.binding.as_ref().map(|b| (b.group, b.binding));
            assert_eq!(number, Some((0, slot as u32)), "{name}");
            let AddressSpace::Storage { access } = variable.space else {
                panic!("{name} is no storage");
            };
            assert_eq!(!access.contains(StorageAccess::STORE), slot.is_read_only(), "{name}");
        }
    }
}

#[test]
fn records_lie_alike_on_both_sides() {
    let variant = variants().next().expect("a variant");
    // Tools are in kernels of contact alone.
    let modules = [kernels::ANDERSON_PUSH, kernels::FIND_CONTACTS].map(|kernel| {
        let (module, _) = parsed(&kernel, variant);
        let mut layouter = naga::proc::Layouter::default();
        layouter.update(module.to_ctx()).expect("a valid module");
        (module, layouter)
    });
    let record = |name: &str| {
        let is_it = |ty: &naga::Type| ty.name.as_deref() == Some(name);
        let found = modules.iter().find_map(|(module, layouter)| {
            let (handle, ty) = module.types.iter().find(|(_, ty)| is_it(ty))?;
            Some((layouter[handle].size as usize, &ty.inner))
        });
        let (size, inner) = found.unwrap_or_else(|| panic!("no kernel has `{name}`"));
        let TypeInner::Struct { members, .. } = inner else { panic!("{name} is no record") };
        (size, members)
    };
    for (name, size, fields) in host_layouts() {
        let (found, members) = record(name);
        assert_eq!(found, size, "bytes of {name}");
        let there: Vec<(&str, usize)> = members
            .iter()
            .map(|member| (member.name.as_deref().unwrap_or("?"), member.offset as usize))
            .collect();
        assert_eq!(there, fields, "fields of {name}");
    }
}

/// Nothing is read back inside a step: the only place where memory is mapped is the one that answers
/// requests, and no step calls it.
#[test]
fn steps_map_no_memory() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("src/solver/gpu");
    let mut maps = Vec::new();
    let mut folders = vec![folder];
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("the sources").flatten() {
            let is_folder = entry.path().is_dir();
            if is_folder { folders.push(entry.path()) } else { files.push(entry) }
        }
    }
    for file in files {
        let text = std::fs::read_to_string(file.path()).expect("a source");
        let name = file.file_name().to_string_lossy().into_owned();
        maps.extend((0..text.matches("map_async").count()).map(|_| name.clone()));
    }
    // `Frames` and `Reading`, neither of which `step` reaches.
    maps.sort();
    assert_eq!(maps, ["reading.rs", "ring.rs"]);
}
