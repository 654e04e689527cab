//! Instruments on a tray: the tools of a file that has nothing else, to be taken into a running scene.

use super::build_instrument::build_instruments;
use super::instrument::{Course, Instrument, JawDrive};
use super::instrument_tables::ToolTable;
use super::keys::JawKey;
use super::write::{lengths, radians};
use super::{Interpolation, SceneError, Written};
use crate::scalar::Vec3;
use crate::scalar::rigid::{RigidTransform, rotation_vector};
use crate::settings::{
    Node, Placed, SettingError, Value, apply_override, parse_tree, read_table, settings_table,
    tables,
};

settings_table! {
    /// Instruments.
    struct TrayTable {
        /// Each as in a scene.
        tool: Vec<Placed<ToolTable>> = required, tables::<ToolTable>();
    }
}

/// Reads instruments: `[[tool]]` tables as a scene has them, and nothing else. `name` stands in errors.
pub fn read_tray(name: &str, text: &str) -> Result<Vec<Instrument>, SceneError> {
    let tree = parse_tree(name, text)?;
    let tray: TrayTable = read_table("", &tree)?;
    build_tools(&tray.tool, &tree)
}

/// The tools of a tree, each with what was written of it.
pub(super) fn build_tools(
    tables: &[Placed<ToolTable>],
    tree: &Node,
) -> Result<Vec<Instrument>, SceneError> {
    let mut tools = build_instruments(tables)?;
    if let Value::Table(entries) = &tree.value
        && let Some(Value::List(nodes)) = entries.get("tool").map(|node| &node.value)
    {
        for (tool, node) in tools.iter_mut().zip(nodes) {
            tool.table = Written(node.clone());
        }
    }
    Ok(tools)
}

impl Instrument {
    /// The instrument as it is taken by hand at a time [s]: under a name, at a pose to which it stands still, its jaws as
    /// they begin. What is written of it then says all of that to the bit.
    pub(crate) fn taken(
        mut self,
        name: String,
        pose: &RigidTransform,
        time: f64,
    ) -> Result<Self, SettingError> {
        let turn = rotation_vector(&pose.rotation);
        for key in ["keys", "path", "lock", "end", "rotation_axis", "rotation_angle"] {
            self.table.0.remove(key);
        }
        let mut write = |key: &str, text: String| apply_override(&mut self.table.0, key, &text);
        write("name", format!("\"{name}\""))?;
        write("position", lengths(pose.translation))?;
        write("rotation_vector", radians(turn))?;
        write("begin", format!("\"{time} s\""))?;
        write("friction", format!("{:?}", self.law.friction))?;
        write("stiffness", format!("{:?}", self.law.stiffness))?;
        write("thickness", format!("\"{} m\"", self.law.thickness))?;
        if let Some(jaws) = &mut self.jaws {
            let value = jaws.keys.first().map_or(0.0, |key| key.value);
            jaws.keys = vec![JawKey { time: 0.0, value }];
            jaws.locks.clear();
            match jaws.drive {
                JawDrive::Angle => {
                    write("jaw", format!("[{{ time = 0, angle = \"{value} rad\" }}]"))?
                }
                JawDrive::Force => {
                    write("closing_force", format!("[{{ time = 0, force = \"{value} N\" }}]"))?;
                }
            }
        }
        Ok(Self {
            name,
            placement: RigidTransform::about(Vec3::ZERO, turn, pose.translation),
            course: Course::Keys { keys: Vec::new(), interpolation: Interpolation::Linear },
            begin: time,
            end: None,
            hands: Vec::new(),
            ..self
        })
    }
}
