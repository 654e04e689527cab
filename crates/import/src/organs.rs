//! Bodies of a segmented scan.

use std::collections::BTreeMap;

use viscera::mesh::tetrahedralize::{surface, tetrahedralize, tetrahedralize_to};
use viscera::mesh::winding::Solid;
use viscera::mesh::{SurfaceMesh, TetMesh, boundary_surface};
use viscera::scalar::{Vec3, vec3};
use viscera_volume::{LabelMap, Organ, OrganReport, Wall, summarize};

use crate::ImportError;
use crate::bodies::{Import, Inner, Options, Part, Touching};
use crate::hold::{Hold, Place, at_the_back};
use crate::name::name_of;
use crate::tissue::{self, Kind};

/// A label that is enclosed by another to this share of its faces is a part of it: a tumour in a liver.
const ENCLOSED: f64 = 0.8;

/// Organs are tied where this share of the smaller one's surface touches the other.
const TIED: f64 = 0.1;

/// A lattice has vertices inside of a wall everywhere where it is so many edges thick.
const RESOLVED: f64 = 1.3;

/// And need no other hold from this share on.
const HANGS: f64 = 0.3;

/// An edge is no longer than this share of the cube root of an organ's volume.
const COARSEST: f64 = 0.4;

/// A body in the making.
struct Plan {
    label: u16,
    name: String,
    kind: Kind,
    inner: Vec<(u16, String)>,
    organ: Organ,
    report: OrganReport,
}

/// Bodies of the labels that are asked for, or of all that are soft.
pub fn of_labels(
    file: &str,
    map: &LabelMap,
    options: &Options,
    down: Vec3<f64>,
    observe: &mut dyn FnMut(&str),
) -> Result<Import, ImportError> {
    let mut notes = Vec::new();
    let chosen = choose(file, map, options, &mut notes)?;
    let hosts = hosts(map, &chosen);
    let mut plans: Vec<Plan> = Vec::new();
    for (label, name) in chosen.iter().filter(|(label, _)| !hosts.contains_key(label)) {
        let inner: Vec<(u16, String)> =
            chosen.iter().filter(|(l, _)| hosts.get(l) == Some(label)).cloned().collect();
        let mut labels = vec![*label];
        labels.extend(inner.iter().map(|(label, _)| *label));
        let (organ, report) = Organ::new(map, &labels)
            .map_err(|error| ImportError::Organ { file: file.into(), error })?;
        let kind = tissue::kind_of(name);
        plans.push(Plan { label: *label, name: name.clone(), kind, inner, organ, report });
    }
    let volume: f64 = plans.iter().map(|plan| plan.report.volume).sum();
    let spacing = options.fineness.spacing(volume);
    let mut parts: Vec<Part> = Vec::new();
    for plan in &plans {
        observe(&plan.name);
        let mut part = build(file, map, plan, (spacing, options.hollow), down)?;
        // Names are of one body each.
        if parts.iter().any(|other| other.name == part.name) {
            part.name = format!("{}_{}", part.name, plan.label);
        }
        parts.push(part);
    }
    let touching = touching(&parts, libm::cbrt(map.to_world().voxel_volume()));
    for touching in touching.iter().filter(|touching| touching.share >= HANGS) {
        // A gallbladder hangs on its liver.
        parts[touching.from].holds.clear();
    }
    Ok(Import { file: file.into(), parts, touching, down, notes })
}

/// Labels and their names.
fn choose(
    file: &str,
    map: &LabelMap,
    options: &Options,
    notes: &mut Vec<String>,
) -> Result<Vec<(u16, String)>, ImportError> {
    let all: Vec<(u16, String, u64)> = summarize(map)
        .into_iter()
        .map(|label| {
            let name = label.name.unwrap_or_else(|| format!("label_{}", label.label));
            (label.label, name, label.voxels)
        })
        .collect();
    let known = || {
        let names: Vec<String> = all.iter().map(|(l, name, _)| format!("{l} {name}")).collect();
        names.join(", ")
    };
    if options.labels.is_empty() {
        let (mut chosen, mut left) = (Vec::new(), Vec::new());
        for (label, name, voxels) in &all {
            // Smaller ones have no shape that a scan could show.
            if tissue::kind_of(name).is_organ() && *voxels >= 64 {
                chosen.push((*label, name.clone()));
            } else {
                left.push(name.as_str());
            }
        }
        // Of unknown names all are taken.
        if chosen.is_empty()
            && all.iter().all(|(_, name, _)| tissue::kind_of(name) == Kind::Unknown)
        {
            chosen = all.iter().map(|(label, name, _)| (*label, name.clone())).collect();
            left.clear();
        }
        if chosen.is_empty() {
            return Err(ImportError::NoTissue { file: file.into(), labels: known() });
        }
        if !left.is_empty() {
            notes.push(format!("left out, choose by --labels: {}", left.join(", ")));
        }
        return Ok(chosen);
    }
    let mut chosen = Vec::new();
    for wanted in &options.labels {
        let is_wanted = |label: u16, name: &str| {
            wanted.parse() == Ok(label) || name_of(name) == name_of(wanted)
        };
        match all.iter().find(|(label, name, _)| is_wanted(*label, name)) {
            Some((label, name, _)) => {
                if !chosen.iter().any(|(known, _)| known == label) {
                    chosen.push((*label, name.clone()));
                }
            }
            None => {
                let (file, wanted) = (file.to_owned(), wanted.clone());
                let hint = format!("labels are {}", known());
                return Err(ImportError::UnknownLabel { file, wanted, hint });
            }
        }
    }
    Ok(chosen)
}

/// Labels that lie in another, by label.
fn hosts(map: &LabelMap, chosen: &[(u16, String)]) -> BTreeMap<u16, u16> {
    let dims = map.dims();
    let steps = [1, dims[0], dims[0] * dims[1]];
    let labels = map.labels();
    let mut faces: BTreeMap<(u16, u16), usize> = BTreeMap::new();
    for place in 0..labels.len() {
        let own = labels[place];
        if own == 0 {
            continue;
        }
        for axis in 0..3 {
            let index = place / steps[axis] % dims[axis];
            let before = (index > 0).then(|| labels[place - steps[axis]]);
            let behind = (index + 1 < dims[axis]).then(|| labels[place + steps[axis]]);
            for other in [before, behind] {
                // Beyond the image there is nothing.
                let other = other.unwrap_or(0);
                if other != own {
                    *faces.entry((own, other)).or_default() += 1;
                }
            }
        }
    }
    let mut hosts = BTreeMap::new();
    for (label, _) in chosen {
        let of_label = faces.iter().filter(|((own, _), _)| own == label);
        let all: usize = of_label.clone().map(|(_, count)| count).sum();
        let most = of_label.filter(|((_, other), _)| *other != 0).max_by_key(|(_, count)| **count);
        let Some((&(_, host), &count)) = most else { continue };
        let is_chosen = chosen.iter().any(|(other, _)| *other == host);
        if is_chosen && count as f64 >= ENCLOSED * all as f64 && !hosts.contains_key(&host) {
            hosts.insert(*label, host);
        }
    }
    hosts
}

/// Fills an organ, and says how it was done.
fn build(
    file: &str,
    map: &LabelMap,
    plan: &Plan,
    (spacing, is_hollow): (f64, bool),
    down: Vec3<f64>,
) -> Result<Part, ImportError> {
    let Plan { organ, report, .. } = plan;
    let fail = |error| ImportError::Organs { file: file.into(), organ: plan.name.clone(), error };
    let voxel = libm::cbrt(map.to_world().voxel_volume());
    let size = libm::cbrt(report.volume);
    let mut notes = Vec::new();
    let skin = surface(organ, voxel.max(spacing / 8.0)).map_err(fail)?;
    let spacing = spacing.min(COARSEST * size);
    let mut wall_share = None;
    let wall = plan.kind.wall().filter(|wall| 2.5 * wall < size);
    let solid = wall.and_then(|_| Solid::new(&skin).ok());
    let made = match (wall, &solid) {
        (Some(thin), Some(skin)) if is_hollow => {
            let thickness = thin.max(RESOLVED * spacing);
            let text = format!("{:.1} mm", 1e3 * thickness);
            notes.push(match thickness > thin {
                true => format!(
                    "a wall of {text} around a cavity, as stiff along it as one of {:.1} mm: edges are too long for that",
                    1e3 * thin
                ),
                false => format!("a wall of {text} around a cavity"),
            });
            wall_share = Some(thin / thickness);
            tetrahedralize(&Wall { organ, skin, thickness }, spacing)
        }
        (Some(thickness), _) => {
            let text = 1e3 * thickness;
            notes.push(format!(
                "filled, as the scan shows it; --hollow leaves a wall of {text:.1} mm"
            ));
            tetrahedralize_to(|by| organ.offset(by), spacing, report.volume)
        }
        _ => tetrahedralize_to(|by| organ.offset(by), spacing, report.volume),
    };
    let (mesh, made) = made.map_err(fail)?;
    if report.crumbs[0] > 0 {
        let [pieces, voxels] = report.crumbs;
        notes.push(format!("left out {pieces} crumbs of {voxels} voxels"));
    }
    if made.components > 1 {
        notes.push(format!("{} unconnected parts, each with a hold", made.components));
    }
    let (mesh, inner) = with_inner(map, plan, mesh, &mut notes);
    let name = name_of(&plan.name);
    let mut holds = caps(map, &mesh, &name);
    if !holds.is_empty() {
        let faces: Vec<&str> = holds.iter().map(|hold| hold.reason.as_str()).collect();
        notes.push(format!("cut by the image: {}", faces.join(", ")));
    }
    holds.extend(at_the_back(&name, &mesh, down, "back"));
    let filled = wall.filter(|_| !is_hollow).map(|wall| (wall, report.volume));
    let mut tissue = tissue::of_filled(&plan.name, filled);
    if let Some(share) = wall_share {
        tissue.soften(share);
    }
    Ok(Part { name, mesh, skin: Some(skin), tissue, inner, holds, notes })
}

/// Gives the tetrahedra of what lies in an organ a region of their own.
fn with_inner(
    map: &LabelMap,
    plan: &Plan,
    mesh: TetMesh,
    notes: &mut Vec<String>,
) -> (TetMesh, Vec<Inner>) {
    if plan.inner.is_empty() {
        return (mesh, Vec::new());
    }
    let mut regions = mesh.regions().to_vec();
    let mut inner = Vec::new();
    for (label, name) in &plan.inner {
        let Ok((shape, _)) = Organ::new(map, &[*label]) else { continue };
        let mut count = 0;
        for (tet, region) in regions.iter_mut().enumerate() {
            let corners = mesh.corners(tet);
            let middle = (corners[0] + corners[1] + corners[2] + corners[3]) * 0.25;
            if viscera::mesh::distance::SignedDistance::distance(&shape, middle) < 0.0 {
                *region = u32::from(*label);
                count += 1;
            }
        }
        if count == 0 {
            notes.push(format!("`{name}` in it is smaller than a tetrahedron: left out"));
            continue;
        }
        notes.push(format!("`{name}` in it is {count} of its tetrahedra"));
        inner.push(Inner {
            region: u32::from(*label),
            name: name_of(name),
            tissue: tissue::of_name(name),
        });
    }
    let (vertices, tets) = (mesh.vertices().to_vec(), mesh.tets().to_vec());
    let labelled = TetMesh::new(vertices, tets, regions).map(|(mesh, _)| mesh);
    (labelled.unwrap_or(mesh), inner)
}

/// Faces of the image that have vertices of a body on them.
fn caps(map: &LabelMap, mesh: &TetMesh, body: &str) -> Vec<Hold> {
    let to_world = map.to_world();
    let inverse = to_world.matrix.inverse().transpose();
    let mut holds = Vec::new();
    for axis in 0..3 {
        for is_end in [false, true] {
            let mut voxel = [0.0; 3];
            voxel[axis] = if is_end { map.dims()[axis] as f64 - 0.5 } else { -0.5 };
            let on_face = to_world.to_world(vec3(voxel[0], voxel[1], voxel[2]));
            let outward = inverse.columns[axis] * if is_end { 1.0 } else { -1.0 };
            let normal = outward * (1.0 / outward.length());
            // A tenth of a millimetre inside, for files in single precision.
            let point = on_face - normal * 1e-4;
            let count = mesh.vertices().iter().filter(|x| (**x - point).dot(normal) > 0.0).count();
            if count >= 3 {
                let side = to_world.side_at_end(axis);
                let side = if is_end { side } else { side.opposite() };
                let name = format!("{body}_{side}");
                let reason = format!("its {side} end");
                holds.push(Hold { name, place: Place::Beyond { point, normal }, reason });
            }
        }
    }
    holds
}

/// Bodies that touch, by their surfaces.
fn touching(parts: &[Part], voxel: f64) -> Vec<Touching> {
    let surface = |part: &Part| -> SurfaceMesh { boundary_surface(&part.mesh).surface };
    let surfaces: Vec<SurfaceMesh> = parts.iter().map(surface).collect();
    let solids: Vec<Option<Solid>> = surfaces.iter().map(|s| Solid::new(s).ok()).collect();
    let distance = (1.5 * voxel).clamp(1e-3, 5e-3);
    let mut touching = Vec::new();
    for a in 0..parts.len() {
        for b in a + 1..parts.len() {
            let is_smaller = parts[a].mesh.volume() <= parts[b].mesh.volume();
            let (from, to) = if is_smaller { (a, b) } else { (b, a) };
            let Some(solid) = &solids[to] else { continue };
            let near = surfaces[from].vertices.iter().filter(|x| solid.nearest(**x) <= distance);
            let share = near.count() as f64 / surfaces[from].vertices.len().max(1) as f64;
            if share >= TIED {
                touching.push(Touching { from, to, share, distance });
            }
        }
    }
    touching
}
