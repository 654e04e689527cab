//! Writing the scene.

use std::fmt::Write;

use viscera::mesh::io::{ply, vtu};
use viscera::mesh::topology::BoundingBox;
use viscera::mesh::verdict::count_angles;
use viscera::scalar::Vec3;

use crate::bodies::{Import, Part};
use crate::hold::{Place, rounded};
use crate::name::{name_of, stem_of};
use crate::quality::angles_plot;
use crate::tissue::Tissue;
use crate::unit::millilitres;

/// Files of a scene: names, relative to the scene file, and bytes. The scene file itself comes first.
#[derive(Clone, Debug)]
pub struct Written {
    /// Names and bytes.
    pub files: Vec<(String, Vec<u8>)>,
}

impl Import {
    /// The scene file, which has the name of the file that it was made of, the meshes that it names, and a picture of their
    /// dihedral angles.
    pub fn scene(&self, title: &str) -> Written {
        let name = name_of(stem_of(&self.file));
        let mut files = vec![(format!("{name}.toml"), self.text(title).into_bytes())];
        for part in &self.parts {
            // Patches are of the mesh, and its places are finite.
            let grid = vtu::write_mesh(&part.mesh, &part.names);
            files.push((format!("{}.vtu", part.name), grid.unwrap_or_default()));
            if let Some(skin) = &part.skin {
                files.push((format!("{}_skin.ply", part.name), ply::write(skin)));
            }
        }
        let angles = |part: &Part| (part.name.clone(), count_angles(&part.mesh));
        let bodies: Vec<(String, Vec<usize>)> = self.parts.iter().map(angles).collect();
        // A scene is none the worse without it.
        files.extend(
            angles_plot(&bodies).ok().map(|svg| (format!("{name}_angles.svg"), svg.into_bytes())),
        );
        Written { files }
    }

    fn text(&self, title: &str) -> String {
        let mut text = String::new();
        let file = self.file.rsplit(['/', '\\']).next().unwrap_or(&self.file);
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "# Made from {file}. Lines that begin with # are comments; `viscera scene describe` lists all keys."
        );
        for note in self.warnings.iter().chain(&self.notes) {
            let _ = writeln!(text, "# {}", note.trim());
        }
        let _ = writeln!(text, "title = {:?}", plain(title));
        text.push_str("\n# 1 in place of 0.95 leaves all motion to the tissue's own viscosity.\n");
        text.push_str("[time]\nduration = \"3 s\"\nvelocity_factor = 0.95\n");
        let _ = writeln!(text, "\n[world]\ngravity = {}", self.gravity());
        if let Some(thickness) = self.thickness {
            let _ = writeln!(text, "\n[contact]\nthickness = \"{:.1} mm\"", 1e3 * thickness);
        }
        for part in &self.parts {
            body(&mut text, part);
        }
        for part in &self.parts {
            for hold in &part.holds {
                let _ = writeln!(text, "\n# `{}` is held at {}.", part.name, hold.reason);
                let _ =
                    writeln!(text, "[[fixing]]\nname = {:?}\nbody = {:?}", hold.name, part.name);
                let _ = writeln!(text, "{}", selector(&hold.place));
            }
            patches(&mut text, part);
        }
        for touching in &self.touching {
            let (from, to) = (&self.parts[touching.from], &self.parts[touching.to]);
            let _ = writeln!(
                text,
                "\n# {:.0} % of the surface of `{}` lies on `{}`: they are tied there. Without a tie they slide on each other.",
                100.0 * touching.share,
                from.name,
                to.name
            );
            let _ = writeln!(text, "[[tie]]\nname = \"{}_on_{}\"", from.name, to.name);
            let _ = writeln!(text, "from = {}\nto = {}", whole(from), whole(to));
            let _ = writeln!(text, "distance = \"{:.2} mm\"", 1e3 * touching.distance);
        }
        text.push_str("\n[output]\nevery = 6\n");
        if self.parts.len() > 1 {
            text.push_str("# \"displacement\" shows how far tissue goes.\ncolors = \"bodies\"\n");
        }
        if self.down.y < 0.0 {
            // From the front, where a surgeon stands.
            text.push_str("view_from = [0.35, 1, 0.3]\n");
        }
        text
    }

    fn gravity(&self) -> String {
        let along = self.down.to_array().map(|value| 9.81 * value + 0.0);
        let texts = along.map(|value| match value == 0.0 {
            true => "0".to_owned(),
            false => format!("\"{value:.2} m/s^2\""),
        });
        format!("[{}]", texts.join(", "))
    }
}

fn body(text: &mut String, part: &Part) {
    let (count, volume) = (part.mesh.tets().len(), millilitres(part.mesh.volume()));
    let _ = writeln!(text, "\n# {}: {count} tetrahedra, {volume} ml.", part.name);
    for note in &part.notes {
        let _ = writeln!(text, "# {note}");
    }
    let _ = writeln!(
        text,
        "[[body]]\nname = {:?}\nmesh = \"{}.vtu\"\nunit = \"1 m\"",
        part.name, part.name
    );
    if part.skin.is_some() {
        let _ = writeln!(text, "surface = \"{}_skin.ply\"", part.name);
    }
    if part.is_balanced {
        text.push_str("# As scanned or drawn it is at rest under gravity; without this line it sags from there.\n");
        text.push_str("balanced = true\n");
    }
    material(text, "body.material", &part.tissue);
    for inner in &part.inner {
        let _ = writeln!(text, "\n# {}", inner.name);
        let _ = writeln!(text, "[[body.region]]\nlabel = {}", inner.region);
        let _ = writeln!(text, "{}", keys(&inner.tissue));
    }
}

/// What the mesh has names for, with a fixing that is not in force yet.
fn patches(text: &mut String, part: &Part) {
    const SHOWN: usize = 12;
    let Some(first) = part.names.patches.first() else { return };
    let _ = writeln!(text, "\n# The mesh of `{}` has named patches:", part.name);
    for patch in part.names.patches.iter().take(SHOWN) {
        let _ = writeln!(text, "#   {}, {} vertices", quoted(&patch.name), patch.vertices.len());
    }
    if let Some(more) = part.names.patches.len().checked_sub(SHOWN + 1) {
        let file = format!("{}.vtu", part.name);
        let _ = writeln!(text, "#   and {} more: viscera mesh inspect {file} --json", more + 1);
    }
    let _ = writeln!(
        text,
        "# To hold one of them, take the marks off the next lines; motions and forces take `patch` in the same way.\n\
         # [[fixing]]\n# body = {:?}\n# patch = {}",
        part.name,
        quoted(&first.name)
    );
}

/// A name of a file as TOML has text; readers have taken out what would end the line.
fn quoted(name: &str) -> String {
    format!("\"{}\"", name.replace('\\', "\\\\").replace('"', "\\\""))
}

fn material(text: &mut String, table: &str, tissue: &Tissue) {
    text.push('\n');
    if !tissue.note.is_empty() {
        let _ = writeln!(text, "# {}", tissue.note);
    }
    let _ = writeln!(text, "[{table}]\n{}", keys(tissue));
}

fn keys(tissue: &Tissue) -> String {
    // Nearer to 0.5 costs more iterations and shows in volume only.
    let rest = "poisson = 0.45\nviscosity = \"10 ms\"";
    match tissue.preset {
        Some(preset) => match tissue.young {
            Some(young) => {
                format!("preset = {preset:?}\nyoung = \"{:.2} kPa\"\n{rest}", young / 1e3)
            }
            None => format!("preset = {preset:?}\n{rest}"),
        },
        None => format!("young = \"8 kPa\"\ndensity = \"1050 kg/m^3\"\n{rest}"),
    }
}

fn selector(place: &Place) -> String {
    match place {
        Place::Beyond { point, normal } => {
            let normal = normal.to_array().map(|value| format!("{:.6}", value + 0.0));
            let normal = normal.join(", ");
            format!("half_space = {{ point = [{}], normal = [{normal}] }}", lengths(*point))
        }
        Place::Within(bounds) => {
            // A tenth of a millimetre more, for rounding here and in files of single precision.
            let more = Vec3::splat(1e-4);
            let (min, max) = (lengths(bounds.min - more), lengths(bounds.max + more));
            format!("box = {{ min = [{min}], max = [{max}] }}")
        }
    }
}

/// A selection of all of a body.
fn whole(part: &Part) -> String {
    let place = Place::Within(BoundingBox::around(part.mesh.vertices()));
    format!("{{ body = {:?}, {} }}", part.name, selector(&place))
}

fn lengths(x: Vec3<f64>) -> String {
    let texts = rounded(x).to_array().map(|value| format!("\"{:.2} mm\"", 1e3 * value + 0.0));
    texts.join(", ")
}

/// Without what ends a line or a text.
fn plain(title: &str) -> String {
    title.chars().filter(|c| !c.is_control() && *c != '"' && *c != '\\').collect()
}
