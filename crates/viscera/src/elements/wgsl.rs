//! The twins of these functions for graphics processors: plain WGSL without bindings and entry points, to be put
//! before a kernel. Every text needs [`KINEMATICS`] and [`GREEN_STRAIN`]; what else one needs is said. What
//! chooses a law or a kind by its number is made from their lists.

use super::text::kernel_text;
use std::fmt::Write;
use std::sync::LazyLock;

use super::TetForm;
use super::law::{ALL_LAWS, Law, with_law};
use super::list::{ARE_ANCHORED, KIND_SIZES, KIND_WGSL};
use crate::material::MaterialModel;
use crate::settings::Choice;

/// Linear tetrahedra, the 6 x 6 solve, and the records that all share; twin of [`super`].
pub const KINEMATICS: &str = kernel_text!("mod.wgsl");
/// Twin of [`super::green_strain`].
pub const GREEN_STRAIN: &str = kernel_text!("green_strain.wgsl");
/// Twin of [`super::neo_hookean`].
pub const NEO_HOOKEAN: &str = kernel_text!("neo_hookean.wgsl");
/// Twin of [`super::neo_hookean_pair`]; needs [`NEO_HOOKEAN`].
const NEO_HOOKEAN_PAIR: &str = kernel_text!("neo_hookean_pair.wgsl");
/// Twin of [`super::singular_values`].
const SINGULAR_VALUES: &str = kernel_text!("singular_values.wgsl");
/// Twin of [`super::neo_hookean_stretch`]; needs [`SINGULAR_VALUES`].
const NEO_HOOKEAN_STRETCH: &str = kernel_text!("neo_hookean_stretch.wgsl");
/// Twin of [`super::recovered`]; needs [`NEO_HOOKEAN`].
pub const RECOVERED: &str = kernel_text!("recovered.wgsl");
/// Twin of [`super::kinds`], without the kinds.
const KINDS_SHARED: &str = kernel_text!("kinds.wgsl");

/// A function that calls one of several by a number; `of` is the body of each.
fn switch<'a>(
    head: &str,
    number: &str,
    names: impl Iterator<Item = &'a str>,
    of: impl Fn(usize, &str) -> String,
) -> String {
    let mut text = format!("fn {head} {{\n    switch {number} {{\n");
    let names: Vec<&str> = names.collect();
    for (i, name) in names.iter().enumerate() {
        let case = if i + 1 == names.len() { "default".to_owned() } else { format!("case {i}u") };
        let _ = writeln!(text, "        {case}: {{ return {}; }}", of(i, name));
    }
    text + "    }\n}\n"
}

/// All laws, and what chooses one: `law_energy_density`, `law_piola` and so on. The text of the law of
/// Saint Venant and Kirchhoff is [`GREEN_STRAIN`].
pub static LAW_TEXT: LazyLock<String> = LazyLock::new(|| {
    let mut text = String::new();
    for law in ALL_LAWS {
        let of_law = with_law!(law, L => L::WGSL);
        if of_law != GREEN_STRAIN {
            text += of_law;
        }
    }
    let moduli = ("lame_lambda: f32, lame_mu: f32", "lame_lambda, lame_mu");
    for (function, given, passed, returned) in [
        ("energy_density", moduli.0, moduli.1, "f32"),
        ("piola", moduli.0, moduli.1, "mat3x3f"),
        ("curvature", &format!("g: vec3f, {}", moduli.0), &format!("g, {}", moduli.1), "f32"),
        ("energy_change", &format!("d: mat3x3f, {}", moduli.0), &format!("d, {}", moduli.1), "f32"),
        ("gradient_map", "", "", "mat3x3f"),
    ] {
        let head = format!("law_{function}(law: u32, f: mat3x3f, {given}) -> {returned}");
        let names = MaterialModel::ALL.iter().map(|(_, name, _)| *name);
        text += &switch(&head, "law", names, |_, name| format!("{name}_{function}(f, {passed})"));
    }
    text
});

/// All kinds of elements that are no tetrahedra, and what chooses one: `element_energy` and so on.
pub static KIND_TEXT: LazyLock<String> = LazyLock::new(|| {
    let mut text = KINDS_SHARED.to_owned();
    for [_, of_kind] in KIND_WGSL {
        text += of_kind;
    }
    let names = || KIND_WGSL.iter().map(|[name, _]| *name);
    let of_kind = |i: usize| {
        let [corners, multipliers] = KIND_SIZES[i].map(|count| format!("{count}u"));
        [corners, multipliers, ARE_ANCHORED[i].to_string()]
    };
    let numbers = [("corners", "u32"), ("multipliers", "u32"), ("is_anchored", "bool")];
    for (k, (function, returned)) in numbers.into_iter().enumerate() {
        let head = format!("element_{function}(kind: u32) -> {returned}");
        text += &switch(&head, "kind", names(), |i, _| of_kind(i)[k].clone());
    }
    let at = "e: ElementMoment, x: array<vec3f, 4>";
    for (function, given, passed, returned) in [
        ("energy", at, "e, x", "f32"),
        ("energy_change", &format!("{at}, d: array<vec3f, 4>"), "e, x, d", "f32"),
        ("forces", at, "e, x", "array<vec3f, 4>"),
        ("curvature", "e: ElementMoment", "e", "f32"),
    ] {
        let head = format!("element_{function}(kind: u32, {given}) -> {returned}");
        text += &switch(&head, "kind", names(), |_, name| format!("{name}_{function}({passed})"));
    }
    // Kinds without multipliers have none of these functions.
    for (function, given, passed, returned, without) in [
        (
            "solve",
            ", w: array<f32, 4>, l: vec4f, squared: f32",
            "e, x, w, l, squared",
            "ElementCorrection",
            "ElementCorrection()",
        ),
        (
            "loads",
            ", l: vec4f, squared: f32",
            "e, x, l, squared",
            "array<CornerLoad, 4>",
            "loads_of_forces($_forces(e, x), $_curvature(e), squared)",
        ),
        ("constitutive", ", squared: f32", "e, x, squared", "vec4f", "vec4f()"),
    ] {
        let head = format!("element_{function}(kind: u32, {at}{given}) -> {returned}");
        text += &switch(&head, "kind", names(), |i, name| {
            let has_block = KIND_SIZES[i][1] > 0;
            if has_block {
                format!("{name}_{function}({passed})")
            } else {
                without.replace('$', name)
            }
        });
    }
    text
});

/// The texts that make a constraint formulation of tetrahedra: `form_solve`, `form_corner_loads` and
/// `form_constitutive`.
pub fn form_texts(form: TetForm) -> Vec<&'static str> {
    match form {
        TetForm::GreenStrain => vec![kernel_text!("forms_green_strain.wgsl")],
        TetForm::NeoHookeanPair => {
            vec![NEO_HOOKEAN, NEO_HOOKEAN_PAIR, kernel_text!("forms_neo_hookean_pair.wgsl")]
        }
        TetForm::NeoHookeanStretch => vec![
            SINGULAR_VALUES,
            NEO_HOOKEAN_STRETCH,
            kernel_text!("forms_neo_hookean_stretch.wgsl"),
        ],
    }
}

/// Every function of every file, once.
pub fn everything() -> String {
    let files = [KINEMATICS, GREEN_STRAIN, &LAW_TEXT, NEO_HOOKEAN_PAIR, SINGULAR_VALUES];
    files.concat() + NEO_HOOKEAN_STRETCH + RECOVERED + &KIND_TEXT
}
