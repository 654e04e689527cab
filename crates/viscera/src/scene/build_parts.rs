//! The shapes of a tool from its table: sizes, those of instruments where nothing is written, and how they lie together.

use super::instrument::{Part, ToolKind};
use super::instrument_tables::ToolTable;
use super::solid::{RidgedJaw, Solid, SolidSource, Tube};
use crate::contact::Shape;
use crate::scalar::rigid::RigidTransform;
use crate::scalar::{Vec3, vec3};
use std::f64::consts::{FRAC_PI_2, FRAC_PI_3, PI};

/// What tissue meets of a tool.
#[derive(Default)]
pub(super) struct Built {
    pub parts: Vec<Part>,
    pub solids: Vec<Solid>,
}

/// Radius of the shafts of instruments that pass a port of 5 mm [m].
const SLIM: f64 = 2.5e-3;
/// The same of one of 10 mm.
const WIDE: f64 = 5e-3;
/// Length of shafts [m].
const SHAFT: f64 = 0.3;
/// A hook's tip [m].
const TIP: f64 = 0.01;
/// Width, thickness and length of an atraumatic grasper's jaws [m].
const JAW: [f64; 3] = [5e-3, 3e-3, 20e-3];
/// Height and spacing of their ridges [m].
const RIDGES: [f64; 2] = [5e-4, 2e-3];
/// Width, thickness and length of a fan retractor's fingers [m].
const FINGER: [f64; 3] = [4e-3, 3e-3, 60e-3];
const FINGERS: u32 = 5;
/// Of a suction tip's bore [m].
const BORE: f64 = 1.5e-3;
/// So many times its radius a bore is deep.
const BORE_DEPTH: f64 = 8.0;

pub(super) fn build_parts(table: &ToolTable) -> Result<Built, String> {
    let need = |value: Option<f64>, key: &str| {
        value.ok_or_else(|| format!("`{key}` is missing, for example {key} = \"5 mm\""))
    };
    let need_size = |size: Option<[f64; 3]>, key: &str| {
        size.ok_or_else(|| {
            format!("`{key}` is missing, for example {key} = [\"10 mm\", \"2 mm\", \"20 mm\"]")
        })
    };
    let alone = |shape: Shape| Ok(of_parts(vec![fixed(shape, RigidTransform::IDENTITY)]));
    if table.unit.is_some() && table.mesh.is_none() && table.jaw_mesh.is_none() {
        return Err("`unit` is that of a mesh file, and none is named; leave it out".to_owned());
    }
    match table.kind {
        ToolKind::HalfSpace => alone(Shape::HalfSpace),
        ToolKind::Sphere => alone(Shape::Sphere { radius: need(table.radius, "radius")? }),
        ToolKind::Capsule => alone(Shape::Capsule {
            length: need(table.length, "length")?,
            radius: need(table.radius, "radius")?,
        }),
        ToolKind::Probe => alone(shaft(table, SLIM)),
        ToolKind::Box => alone(rounded_box(need_size(table.size, "size")?, table.rounding, 0.25)),
        ToolKind::Blade => {
            let size = need_size(table.size, "size")?;
            let middle = at(vec3(0.0, 0.0, 0.5 * size[2]));
            Ok(of_parts(vec![fixed(rounded_box(size, table.rounding, 0.5), middle)]))
        }
        ToolKind::Hook => {
            let radius = table.radius.unwrap_or(SLIM);
            let tip = Shape::Capsule { length: table.tip_length.unwrap_or(TIP), radius };
            let bend = vec3(-table.tip_angle.unwrap_or(FRAC_PI_2), 0.0, 0.0);
            let bent = RigidTransform::about(Vec3::ZERO, bend, Vec3::ZERO);
            let shaft = fixed(shaft(table, SLIM), RigidTransform::IDENTITY);
            Ok(of_parts(vec![shaft, fixed(tip, bent)]))
        }
        ToolKind::Grasper => match &table.jaw_mesh {
            Some(mesh) if table.jaw_size.is_none() && table.rounding.is_none() => {
                Ok(mesh_jaws(mesh, unit(table)?, table.jaw_gap.unwrap_or(0.0)))
            }
            Some(_) => {
                Err("`jaw_mesh` says how large jaws are; leave out `jaw_size` and `rounding`"
                    .into())
            }
            None => Ok(box_jaws(need_size(table.jaw_size, "jaw_size")?, table)),
        },
        ToolKind::Mesh => {
            let mesh = table.mesh.clone().ok_or_else(|| {
                "`mesh` is missing, for example mesh = \"hook.obj\" and unit = \"1 mm\"".to_owned()
            })?;
            let source = SolidSource::File { mesh, unit: unit(table)? };
            let solid = Solid { source, place: RigidTransform::IDENTITY, opens: 0.0 };
            Ok(Built { solids: vec![solid], ..Built::default() })
        }
        ToolKind::AtraumaticGrasper => ridged_jaws(table),
        ToolKind::FanRetractor => Ok(fan(table)),
        ToolKind::SuctionTip => {
            let radius = table.radius.unwrap_or(SLIM);
            let tube = Tube {
                radius,
                inner: table.inner_radius.unwrap_or(BORE / SLIM * radius),
                depth: BORE_DEPTH * radius,
                length: table.length.unwrap_or(SHAFT),
            };
            if let Some(words) = tube.complaint() {
                return Err(words.to_owned());
            }
            let source = SolidSource::Tube(tube);
            let solid = Solid { source, place: RigidTransform::IDENTITY, opens: 0.0 };
            Ok(Built { solids: vec![solid], ..Built::default() })
        }
    }
}

/// Width, thickness and length of jaws [m], where the table or the kind says it.
pub(super) fn jaw_size(table: &ToolTable) -> Option<[f64; 3]> {
    let is_atraumatic = table.kind == ToolKind::AtraumaticGrasper;
    table.jaw_size.or(is_atraumatic.then_some(JAW))
}

fn of_parts(parts: Vec<Part>) -> Built {
    Built { parts, ..Built::default() }
}

fn fixed(shape: Shape, place: RigidTransform) -> Part {
    Part { shape, place, opens: 0.0 }
}

fn at(place: Vec3<f64>) -> RigidTransform {
    RigidTransform::about(Vec3::ZERO, Vec3::ZERO, place)
}

fn unit(table: &ToolTable) -> Result<f64, String> {
    table.unit.ok_or_else(|| {
        "`unit` is missing, for example unit = \"1 mm\" where 1 in the mesh file is a millimetre".to_owned()
    })
}

fn shaft(table: &ToolTable, radius: f64) -> Shape {
    Shape::Capsule { length: table.length.unwrap_or(SHAFT), radius: table.radius.unwrap_or(radius) }
}

/// A box of a size [m]; its edges are rounded by a share of the smallest, where nothing else is written.
fn rounded_box(size: [f64; 3], rounding: Option<f64>, share: f64) -> Shape {
    let smallest = size.into_iter().fold(f64::INFINITY, f64::min);
    let radius = rounding.unwrap_or(share * smallest);
    Shape::RoundedBox { half: Vec3::from_f64(size) * 0.5, radius }
}

fn box_jaws(size: [f64; 3], table: &ToolTable) -> Built {
    let away = 0.5 * (table.jaw_gap.unwrap_or(0.0) + size[1]);
    let jaw = |opens: f64| Part {
        shape: rounded_box(size, table.rounding, 0.25),
        place: at(vec3(0.0, opens * away, -0.5 * size[2])),
        opens,
    };
    of_parts(vec![jaw(1.0), jaw(-1.0)])
}

/// The other jaw: the upper one turned by half a turn about the shaft.
fn lower() -> RigidTransform {
    RigidTransform::about(Vec3::ZERO, vec3(0.0, 0.0, PI), Vec3::ZERO)
}

fn mesh_jaws(mesh: &str, unit: f64, gap: f64) -> Built {
    let away = at(vec3(0.0, 0.5 * gap, 0.0));
    let jaw = |opens: f64| Solid {
        source: SolidSource::File { mesh: mesh.to_owned(), unit },
        place: if opens > 0.0 { away } else { lower().after(&away) },
        opens,
    };
    Built { solids: vec![jaw(1.0), jaw(-1.0)], ..Built::default() }
}

fn ridged_jaws(table: &ToolTable) -> Result<Built, String> {
    let size = table.jaw_size.unwrap_or(JAW);
    let jaw = RidgedJaw {
        size,
        away: 0.5 * table.jaw_gap.unwrap_or(0.0),
        rounding: table.rounding.unwrap_or(0.15 * size[0].min(size[1])),
        height: table.ridge_height.unwrap_or(RIDGES[0]),
        spacing: table.ridge_spacing.unwrap_or(RIDGES[1]),
        is_other: false,
    };
    if let Some(words) = jaw.complaint() {
        return Err(words.to_owned());
    }
    let solid = |opens: f64| Solid {
        source: SolidSource::Jaw(RidgedJaw { is_other: opens < 0.0, ..jaw }),
        place: if opens > 0.0 { RigidTransform::IDENTITY } else { lower() },
        opens,
    };
    // Its round end begins at the hinge.
    let radius = table.radius.unwrap_or(SLIM);
    let shaft = fixed(shaft(table, SLIM), at(vec3(0.0, 0.0, radius)));
    Ok(Built { parts: vec![shaft], solids: vec![solid(1.0), solid(-1.0)] })
}

fn fan(table: &ToolTable) -> Built {
    let size = table.size.unwrap_or(FINGER);
    let count = table.fingers.unwrap_or(FINGERS);
    let spread = table.spread.unwrap_or(FRAC_PI_3);
    let shape = rounded_box(size, table.rounding, 0.5);
    let hinge = vec3(0.0, 0.0, size[2]);
    let finger = |number: u32| {
        let angle = spread * (f64::from(number) / f64::from(count - 1) - 0.5);
        let turned = RigidTransform::about(Vec3::ZERO, vec3(0.0, angle, 0.0), hinge);
        fixed(shape.clone(), turned.after(&at(vec3(0.0, 0.0, -0.5 * size[2]))))
    };
    let mut parts: Vec<Part> = (0..count).map(finger).collect();
    parts.push(fixed(shaft(table, WIDE), at(hinge)));
    of_parts(parts)
}
