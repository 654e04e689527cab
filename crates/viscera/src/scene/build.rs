//! From the tables of a scene file to a scene: what one key alone cannot know is checked here.

use super::checks::{check_name, check_times, name_or_number, purpose};
use super::hand_tables::hand_over;
use super::keys::MotionKey;
use super::motion::{Force, ForceKey, Motion};
use super::selector::{Patch, Selector};
use super::tables::{
    BodyTable, ChangeTable, ForceTable, MaterialTable, MotionTable, PatchTable, SceneTable,
    ShapeName, SpringTable, TieTable, TimeSettings,
};
use super::tray::build_tools;
use super::{
    Ball, Body, BodyShape, Change, Fixing, Region, RegionLabel, Scene, SceneError, Spring, Tie,
    Written,
};
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes::LIVER_SPACING;
use crate::scalar::Vec3;
use crate::scalar::rigid::RigidTransform;
use crate::settings::{
    Choice, Node, Place, Placed, apply_override, parse_tree, read_table, suggest,
};
use crate::units::shorten;

impl Scene {
    /// Reads a scene. `name` stands in errors; each override is a key such as `solver.iterations` or
    /// `body.liver.material.young` and its value as one would write it in the file (quotes may be left out).
    pub fn parse(name: &str, text: &str, overrides: &[(&str, &str)]) -> Result<Self, SceneError> {
        let mut tree = parse_tree(name, text)?;
        for (key, value) in overrides {
            apply_override(&mut tree, key, value)?;
        }
        build_scene(name, tree)
    }
}

/// Beyond this a run of one frame per millisecond would take hours.
const MOST_FRAMES: f64 = 1e7;

/// Beyond this many lattice cells (some ten million tetrahedra) nothing here is real-time, and a
/// slip of the unit would eat the machine's memory.
const MOST_CELLS: f64 = 2e6;

/// A scene of a tree, which it keeps for changes to come.
pub(super) fn build_scene(name: &str, tree: Node) -> Result<Scene, SceneError> {
    let tables: SceneTable = read_table("", &tree)?;
    check_frame_count(name, &tables.time)?;
    let mut bodies: Vec<Body> = Vec::new();
    for table in &tables.body {
        check_name(&bodies, |body| &body.name, &table.value.name.value, "body", &table.place)?;
        bodies.push(build_body(table)?);
    }
    if bodies.is_empty() {
        // Only `body = []` gets here: without the key it is reported as missing.
        let place = Place::File { name: name.into(), line: 1, column: 1 };
        return Err(SceneError::NoBody { place });
    }

    let mut fixings: Vec<Fixing> = Vec::new();
    for (index, Placed { place, value }) in tables.fixing.iter().enumerate() {
        let name = name_or_number(&value.name, "fixing", index);
        check_name(&fixings, |fixing| &fixing.name, &name, "fixing", place)?;
        let patch =
            build_patch(&bodies, &value.patch, purpose("fixing", &value.name, index), place)?;
        fixings.push(Fixing { name, patch, stiffness: value.stiffness });
    }
    let mut tools = build_tools(&tables.tool, &tree)?;
    hand_over(&mut tools, &tables.hand)?;
    let title = if tables.title.is_empty() { name.to_owned() } else { tables.title };
    let (places, changes): (Vec<Place>, Vec<Change>) =
        build_changes(&tables.change)?.into_iter().unzip();
    let scene = Scene {
        name: name.to_owned(),
        title,
        description: tables.description,
        time: tables.time,
        world: tables.world,
        fixings,
        motions: build_motions(&bodies, &tables.motion)?,
        forces: build_forces(&bodies, &tables.force)?,
        springs: build_springs(&bodies, &tables.spring)?,
        ties: build_ties(&bodies, &tables.tie)?,
        contact: tables.contact,
        tools,
        bodies,
        changes,
        solver: tables.solver,
        output: tables.output,
        tree: Written(tree),
    };
    // Every change is tried now: an error in the middle of a run comes too late.
    let mut changed = scene.clone();
    for (change, place) in scene.changes.iter().zip(places) {
        changed.change(&change.settings).map_err(|error| SceneError::Change {
            place,
            time: change.time,
            error: Box::new(error),
        })?;
    }
    Ok(scene)
}

fn build_motions(
    bodies: &[Body],
    tables: &[Placed<MotionTable>],
) -> Result<Vec<Motion>, SceneError> {
    let mut motions: Vec<Motion> = Vec::new();
    for (index, Placed { place, value }) in tables.iter().enumerate() {
        let name = name_or_number(&value.name, "motion", index);
        check_name(&motions, |motion| &motion.name, &name, "motion", place)?;
        let purpose = purpose("motion", &value.name, index);
        motions.push(Motion {
            name,
            keys: motion_keys(value, &purpose, place)?,
            patch: build_patch(bodies, &value.patch, purpose, place)?,
            interpolation: value.interpolation,
            about: value.about,
            start: value.start,
            stiffness: value.stiffness,
            release: value.release,
        });
    }
    Ok(motions)
}

fn build_forces(bodies: &[Body], tables: &[Placed<ForceTable>]) -> Result<Vec<Force>, SceneError> {
    let mut forces: Vec<Force> = Vec::new();
    for (index, Placed { place, value }) in tables.iter().enumerate() {
        let name = name_or_number(&value.name, "force", index);
        check_name(&forces, |force| &force.name, &name, "force", place)?;
        let purpose = purpose("force", &value.name, index);
        forces.push(Force {
            name,
            keys: force_keys(value, &purpose)?,
            patch: build_patch(bodies, &value.patch, purpose, place)?,
            force: value.force,
            interpolation: value.interpolation,
        });
    }
    Ok(forces)
}

fn build_springs(
    bodies: &[Body],
    tables: &[Placed<SpringTable>],
) -> Result<Vec<Spring>, SceneError> {
    let mut springs: Vec<Spring> = Vec::new();
    for (index, Placed { place, value }) in tables.iter().enumerate() {
        let name = name_or_number(&value.name, "spring", index);
        check_name(&springs, |spring| &spring.name, &name, "spring", place)?;
        let end = |table: &PatchTable, which: &str, place: &Place| {
            let purpose = format!("{}, end `{which}`,", purpose("spring", &value.name, index));
            build_patch(bodies, table, purpose, place)
        };
        springs.push(Spring {
            name,
            from: end(&value.from.value, "from", &value.from.place)?,
            to: end(&value.to.value, "to", &value.to.place)?,
            stiffness: value.stiffness,
            rest_length: value.rest_length,
        });
    }
    Ok(springs)
}

fn build_ties(bodies: &[Body], tables: &[Placed<TieTable>]) -> Result<Vec<Tie>, SceneError> {
    let mut ties: Vec<Tie> = Vec::new();
    for (index, Placed { place, value }) in tables.iter().enumerate() {
        let name = name_or_number(&value.name, "tie", index);
        check_name(&ties, |tie| &tie.name, &name, "tie", place)?;
        let end = |table: &Placed<PatchTable>, which: &str| {
            let purpose = format!("{}, end `{which}`,", purpose("tie", &value.name, index));
            build_patch(bodies, &table.value, purpose, &table.place)
        };
        let (from, to) = (end(&value.from, "from")?, end(&value.to, "to")?);
        if from.body == to.body {
            return Err(SceneError::TieToItself {
                place: value.to.place.clone(),
                purpose: purpose("tie", &value.name, index),
                body: bodies[to.body].name.clone(),
            });
        }
        let TieTable { distance, stiffness, strength, .. } = *value;
        ties.push(Tie { name, from, to, distance, stiffness, strength, place: place.clone() });
    }
    Ok(ties)
}

/// In the order of their times, with their places.
fn build_changes(tables: &[Placed<ChangeTable>]) -> Result<Vec<(Place, Change)>, SceneError> {
    let mut changes = Vec::new();
    for Placed { place, value } in tables {
        let mut settings = Vec::new();
        for text in &value.set {
            let Some((key, value)) = text.split_once('=') else {
                let setting = shorten(text);
                return Err(SceneError::ChangeText { place: place.clone(), setting });
            };
            settings.push((key.trim().to_owned(), value.trim().to_owned()));
        }
        changes.push((place.clone(), Change { time: value.time, settings }));
    }
    // Of two at one time the later one in the file comes later.
    changes.sort_by(|(_, a), (_, b)| a.time.total_cmp(&b.time));
    Ok(changes)
}

fn check_frame_count(name: &str, time: &TimeSettings) -> Result<(), SceneError> {
    let frames = time.duration / time.frame;
    if frames > MOST_FRAMES {
        return Err(SceneError::TooManyFrames { name: name.to_owned(), frames });
    }
    Ok(())
}

fn build_body(table: &Placed<BodyTable>) -> Result<Body, SceneError> {
    let (place, body) = (&table.place, &table.value);
    let name = body.name.value.clone();
    let owner = format!("body `{name}`");
    let material = build_material(&body.material, None, &owner, place)?;
    let mut regions: Vec<Region> = Vec::new();
    for Placed { place, value } in &body.region {
        let label = value.label.clone();
        let owner = format!("{owner}, region {label}");
        if regions.iter().any(|region| region.label == label) {
            let name = label.to_string();
            return Err(SceneError::NameTaken { place: place.clone(), kind: "region", name });
        }
        let material = build_material(&value.material, Some(&material), &owner, place)?;
        if value.sphere.is_some() && matches!(label, RegionLabel::Name(_)) {
            let problem =
                "a `sphere` gives a new label, which is a number, such as label = 1".into();
            return Err(SceneError::Shape { place: place.clone(), body: name, problem });
        }
        let ball =
            value.sphere.as_ref().map(|ball| Ball { center: ball.center, radius: ball.radius });
        regions.push(Region { label, ball, material });
    }
    let rotation = body.rotation_axis * body.rotation_angle;
    let shape = build_shape(body).map_err(|problem| SceneError::Shape {
        place: place.clone(),
        body: name.clone(),
        problem,
    })?;
    let placement = RigidTransform::about(Vec3::ZERO, rotation, body.position);
    let (refine, balanced) = (body.refine, body.balanced);
    Ok(Body { name, shape, refine, balanced, placement, material, regions })
}

/// Numbers that are written win over the preset's, those over the body's, those over defaults.
fn build_material(
    table: &MaterialTable,
    base: Option<&Material>,
    owner: &str,
    place: &Place,
) -> Result<Material, SceneError> {
    let preset = table.preset;
    let choose = |written: Option<f64>, of_preset: Option<f64>, of_base: Option<f64>| {
        written.or(of_preset).or(of_base)
    };
    let young = choose(table.young, preset.map(|it| it.young), base.map(Material::young));
    let poisson = choose(table.poisson, preset.map(|it| it.poisson), base.map(Material::poisson));
    let density = choose(table.density, preset.map(|it| it.density), base.map(Material::density));
    let viscosity = choose(table.viscosity, None, base.map(Material::viscosity));
    let model = table.model.or(base.map(Material::model));
    let Some(young) = young else {
        return Err(SceneError::NoMaterial { place: place.clone(), owner: owner.to_owned() });
    };
    Material::new(
        model.unwrap_or(MaterialModel::StableNeoHookean),
        young,
        poisson.unwrap_or(0.45),
        density.unwrap_or(1000.0),
    )
    .and_then(|material| material.with_viscosity(viscosity.unwrap_or(0.0)))
    .map_err(|error| SceneError::Material {
        place: place.clone(),
        owner: owner.to_owned(),
        error,
    })
}

fn build_shape(body: &BodyTable) -> Result<BodyShape, String> {
    let shape = match (body.shape, &body.mesh) {
        (Some(_), Some(_)) => return Err("`mesh` and `shape` exclude each other; keep one".into()),
        (None, None) => {
            return Err("write a `shape` or a `mesh` file, for example shape = \"liver\"".into());
        }
        (Some(shape), None) => Some(shape),
        (None, Some(_)) => None,
    };
    refuse_foreign_keys(body, shape)?;
    let need = |value: Option<f64>, key: &str| {
        value.ok_or_else(|| format!("`{key}` is missing, for example {key} = \"50 mm\""))
    };
    let scale = body.scale.unwrap_or(1.0);
    let shape = match shape {
        None => BodyShape::File {
            mesh: body.mesh.clone().unwrap_or_default(),
            unit: scale
                * body.unit.ok_or(
                    "`unit` is missing: the length that 1 in the mesh stands for, such as \"1 mm\"",
                )?,
            surface: body.surface.clone(),
        },
        Some(ShapeName::Beam) => BodyShape::Beam {
            length: need(body.length, "length")?,
            width: need(body.width, "width")?,
            height: need(body.height, "height")?,
            cells_across: body.cells_across.unwrap_or(4),
            cut: body.cut.unwrap_or(0.0),
        },
        Some(ShapeName::Block) => BodyShape::Block {
            size: body.size.ok_or(
                "`size` is missing, for example size = [\"100 mm\", \"100 mm\", \"50 mm\"]",
            )?,
            cells: body.cells.ok_or("`cells` is missing, for example cells = [8, 8, 4]")?,
        },
        Some(ShapeName::Sphere) => {
            let radius = need(body.radius, "radius")?;
            BodyShape::Sphere { radius, spacing: body.spacing.unwrap_or(0.25 * radius) }
        }
        Some(ShapeName::Capsule) => {
            let (radius, length) = (need(body.radius, "radius")?, need(body.length, "length")?);
            BodyShape::Capsule { radius, length, spacing: body.spacing.unwrap_or(0.25 * radius) }
        }
        Some(ShapeName::Liver) => {
            BodyShape::Liver { spacing: body.spacing.unwrap_or(LIVER_SPACING * scale), scale }
        }
    };
    let cells = cell_count(&shape);
    if cells > MOST_CELLS {
        return Err(format!(
            "about {cells:.1e} lattice cells are too many (at most {MOST_CELLS:.0e}); make `spacing` \
             larger or `cells` fewer"
        ));
    }
    Ok(shape)
}

/// A key that the shape does not take would silently do nothing.
fn refuse_foreign_keys(body: &BodyTable, shape: Option<ShapeName>) -> Result<(), String> {
    let taken: &[&str] = match shape {
        None => &["unit", "surface", "scale"],
        Some(ShapeName::Beam) => &["length", "width", "height", "cells_across", "cut"],
        Some(ShapeName::Block) => &["size", "cells"],
        Some(ShapeName::Sphere) => &["radius", "spacing"],
        Some(ShapeName::Capsule) => &["radius", "length", "spacing"],
        Some(ShapeName::Liver) => &["spacing", "scale"],
    };
    let written = [
        ("unit", body.unit.is_some()),
        ("surface", body.surface.is_some()),
        ("length", body.length.is_some()),
        ("width", body.width.is_some()),
        ("height", body.height.is_some()),
        ("cells_across", body.cells_across.is_some()),
        ("cut", body.cut.is_some()),
        ("size", body.size.is_some()),
        ("cells", body.cells.is_some()),
        ("radius", body.radius.is_some()),
        ("spacing", body.spacing.is_some()),
        ("scale", body.scale.is_some()),
    ];
    match written.iter().find(|(key, is_written)| *is_written && !taken.contains(key)) {
        None => Ok(()),
        Some((key, _)) => {
            let name = |shape| ShapeName::ALL.iter().find(|(known, ..)| *known == shape);
            let what = match shape.and_then(name) {
                Some((_, name, _)) => format!("a {name}"),
                None => "a mesh file".to_owned(),
            };
            Err(format!("`{key}` means nothing for {what}, which takes {}", taken.join(", ")))
        }
    }
}

/// About how many lattice cells a shape is filled with.
fn cell_count(shape: &BodyShape) -> f64 {
    match *shape {
        BodyShape::File { .. } => 0.0,
        BodyShape::Beam { length, width, height, cells_across, .. } => {
            let cell = width.min(height) / f64::from(cells_across);
            [length, width, height].iter().map(|edge| (edge / cell).max(1.0)).product()
        }
        BodyShape::Block { cells, .. } => cells.iter().map(|&count| f64::from(count)).product(),
        BodyShape::Sphere { radius, spacing } => (2.0 * radius / spacing).powi(3),
        BodyShape::Capsule { radius, length, spacing } => {
            (2.0 * radius / spacing).powi(2) * (length + 2.0 * radius) / spacing
        }
        // The standard liver fits in a box of about 22 x 16 x 16 cm.
        BodyShape::Liver { spacing, scale } => 0.22 * 0.16 * 0.16 * (scale / spacing).powi(3),
    }
}

fn build_patch(
    bodies: &[Body],
    table: &PatchTable,
    purpose: String,
    place: &Place,
) -> Result<Patch, SceneError> {
    let wanted = &table.body.value;
    let Some(body) = bodies.iter().position(|body| body.name == *wanted) else {
        let names: Vec<_> = bodies.iter().map(|body| body.name.as_str()).collect();
        return Err(SceneError::UnknownBody {
            place: table.body.place.clone(),
            body: shorten(wanted),
            hint: suggest(wanted, &names),
        });
    };
    let place = place.clone();
    match table.selector() {
        Ok(Selector::Box { min, max }) => {
            let axes = ['x', 'y', 'z'];
            let inverted = (0..3).find(|&axis| min[axis] > max[axis]);
            if let Some(&axis) = inverted.and_then(|axis| axes.get(axis)) {
                return Err(SceneError::InvertedBox { place, purpose, axis });
            }
            Ok(Patch { body, selector: Selector::Box { min, max }, purpose, place })
        }
        Ok(selector) => Ok(Patch { body, selector, purpose, place }),
        Err(count) => Err(SceneError::SelectorCount { place, purpose, count }),
    }
}

fn motion_keys(
    motion: &MotionTable,
    purpose: &str,
    place: &Place,
) -> Result<Vec<MotionKey>, SceneError> {
    let (keys, start) = (&motion.keys, motion.start);
    check_times(keys.iter().map(|key| (&key.place, key.value.time)), purpose)?;
    let Some(first) = keys.first() else {
        return Err(SceneError::Keys {
            place: place.clone(),
            purpose: purpose.to_owned(),
            problem: "it needs a key, for example keys = [{ time = \"1 s\", translation = [0, 0, \
                      \"40 mm\"] }]"
                .to_owned(),
        });
    };
    if first.value.time < start {
        return Err(SceneError::Keys {
            place: first.place.clone(),
            purpose: purpose.to_owned(),
            problem: format!(
                "its first key at {} s is before its start at {start} s; move one of them",
                first.value.time
            ),
        });
    }
    let taken = MotionKey { time: start, translation: Vec3::ZERO, rotation: Vec3::ZERO };
    let before = (first.value.time > start).then_some(taken);
    let written = keys.iter().map(|key| MotionKey {
        time: key.value.time,
        translation: key.value.translation,
        rotation: key.value.rotation_axis * key.value.rotation_angle,
    });
    Ok(before.into_iter().chain(written).collect())
}

fn force_keys(table: &ForceTable, purpose: &str) -> Result<Vec<ForceKey>, SceneError> {
    let times = table.keys.iter().map(|key| (&key.place, key.value.time));
    check_times(times, purpose)?;
    let key = |key: &Placed<super::tables::ForceKeyTable>| ForceKey {
        time: key.value.time,
        factor: key.value.factor,
    };
    Ok(table.keys.iter().map(key).collect())
}
