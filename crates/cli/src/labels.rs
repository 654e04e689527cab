//! `viscera mesh labels`.

use anyhow::{Result, bail};
use std::path::Path;
use viscera::scalar::Vec3;
use viscera_import::{Found, ImportError, millilitres, open, rename, same_names};
use viscera_report::Table;
use viscera_resources::files;
use viscera_volume::{LabelMap, LabelSummary, summarize};

/// More names of labels that no voxel has are those of a list of all organs, and of no interest.
const MOST_EMPTY: usize = 20;

/// Prints the labels of a scan.
pub fn list(file: &Path, names: &[(u16, String)]) -> Result<()> {
    let name = file.display().to_string();
    let load = |name: &str| files::read(Path::new(name)).map_err(|error| error.to_string());
    let (mut map, mut report) = match open(&name, load) {
        Ok(Found::Labels(map, report)) => (map, report),
        Ok(_) => bail!("{name} is a mesh; look at it by `viscera mesh inspect`"),
        Err(ImportError::Mesh(_)) => bail!(
            "{name}: no label map that can be read; save it as NIfTI (.nii, .nii.gz) or NRRD (.nrrd, .seg.nrrd), for example \
             with 3D Slicer"
        ),
        Err(error) => return Err(error.into()),
    };
    rename(&name, &mut map, &mut report, names)?;
    let labels = summarize(&map);
    let mut text = format!("{name}: {report}\n{}", table(&labels));
    let empty = empty(&map, &labels);
    if !empty.is_empty() && empty.len() <= MOST_EMPTY {
        text.push_str(&format!("note: named, without voxels: {}\n", empty.join(", ")));
    }
    let named = labels.iter().filter_map(|label| Some((label.label, label.name.as_deref()?)));
    for warning in same_names(named) {
        text.push_str(&format!("warning: {warning}\n"));
    }
    files::print(&text)
}

/// Names of labels that no voxel has.
fn empty(map: &LabelMap, labels: &[LabelSummary]) -> Vec<String> {
    let is_empty = |label: &u16| !labels.iter().any(|known| known.label == *label);
    let names = map.names().iter().filter(|(label, _)| is_empty(label));
    names.map(|(label, name)| format!("{label} {name}")).collect()
}

fn table(labels: &[LabelSummary]) -> String {
    let mut table = Table::new([
        "label",
        "name",
        "voxels",
        "ml",
        "pieces",
        "from, mm",
        "to, mm",
        "cut by the image",
    ]);
    for label in labels {
        let place = |x: Vec3<f64>| format!("{:.0} {:.0} {:.0}", x.x, x.y, x.z);
        let [low, high] = label.world_bounds;
        let cuts: Vec<String> = label
            .touches_border
            .iter()
            .map(|face| format!("{} ({})", face.side, face.voxels))
            .collect();
        // As many digits as small ones need.
        let volume = match label.milliliters < 1.0 {
            true => millilitres(1e-6 * label.milliliters),
            false => format!("{:.1}", label.milliliters),
        };
        table.row([
            label.label.to_string(),
            label.name.clone().unwrap_or_else(|| format!("label_{}", label.label)),
            label.voxels.to_string(),
            volume,
            label.components.to_string(),
            place(low),
            place(high),
            cuts.join(", "),
        ]);
    }
    table.to_text()
}
