//! What became of a file, as text for people.

use viscera::mesh::TetMesh;
use viscera::mesh::quality::summarize_quality;
use viscera::mesh::verdict::{DEGREES, count_angles};
use viscera_report::Table;

use crate::{Import, millilitres};

impl Import {
    /// What was made: bodies with their sizes and shapes, and what was assumed.
    pub fn describe(&self) -> String {
        let mut table = Table::new([
            "body",
            "tets",
            "ml in scan",
            "ml in mesh",
            "angles, degrees",
            "below 10",
            "tissue",
            "held at",
        ]);
        for part in &self.parts {
            let quality = summarize_quality(&part.mesh);
            let (low, high) =
                (quality.min_dihedral.to_degrees(), quality.max_dihedral.to_degrees());
            let held: Vec<&str> =
                part.holds.iter().map(|hold| hold.reason.split(':').next().unwrap_or("")).collect();
            table.row([
                part.name.clone(),
                part.mesh.tets().len().to_string(),
                part.wanted.map_or_else(|| "-".to_owned(), millilitres),
                millilitres(part.mesh.volume()),
                format!("{low:.1} to {high:.1}"),
                format!("{:.3} %", 100.0 * share_below_ten(&part.mesh)),
                part.tissue.preset.unwrap_or("unknown").to_owned(),
                held.join(", "),
            ]);
        }
        let mut text = table.to_text();
        for touching in &self.touching {
            let (from, to) = (&self.parts[touching.from].name, &self.parts[touching.to].name);
            text.push_str(&format!(
                "tied: {from} to {to}, {:.0} % of its surface\n",
                100.0 * touching.share
            ));
        }
        for warning in &self.warnings {
            text.push_str(&format!("warning: {warning}\n"));
        }
        for note in &self.notes {
            text.push_str(&format!("note: {}\n", note.trim()));
        }
        for part in &self.parts {
            for note in &part.notes {
                text.push_str(&format!("note: {}: {note}\n", part.name));
            }
        }
        text
    }
}

/// The share of dihedral angles below 10 degrees.
fn share_below_ten(mesh: &TetMesh) -> f64 {
    let counts = count_angles(mesh);
    let below: usize = counts.iter().take(10 / DEGREES).sum();
    below as f64 / (6 * mesh.tets().len()).max(1) as f64
}
