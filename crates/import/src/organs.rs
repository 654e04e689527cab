//! Bodies of a segmented scan.

use std::collections::BTreeMap;

use viscera::mesh::distance::SignedDistance;
use viscera::mesh::tetrahedralize::{
    TetrahedralizeError, surface, tetrahedralize, tetrahedralize_to,
};
use viscera::mesh::winding::Solid;
use viscera::mesh::{SurfaceMesh, TetMesh, boundary_surface};
use viscera::scalar::{Vec3, vec3};
use viscera_volume::{LabelMap, Organ, OrganReport, Wall, summarize};

use crate::ImportError;
use crate::bodies::{Import, Inner, Options, Part, Touching, told_edges, told_loss};
use crate::filling::{Filled, KEPT, RESOLVED, Wanted, fill_to, first_spacing};
use crate::hold::{Hold, Place, at_the_back};
use crate::name::name_of;
use crate::size::{Fineness, MOST_OF_LABELS, finest, spacing_of, tets_of};
use crate::tissue::{self, Kind};

/// A label that is enclosed by another to this share of its faces is a part of it: a tumour in a liver.
const ENCLOSED: f64 = 0.8;

/// Organs are tied where this share of the smaller one's surface touches the other.
const TIED: f64 = 0.1;

/// And need no other hold from this share on.
const HANGS: f64 = 0.3;

/// A lattice finer than the scan shows no more of it: edges are at least this share of a voxel's.
const OF_A_VOXEL: f64 = 0.5;

/// A body in the making.
struct Plan {
    label: u16,
    name: String,
    kind: Kind,
    inner: Vec<(u16, String)>,
    organ: Organ,
    report: OrganReport,
}

impl Plan {
    /// How thick its wall is [m], where it is hollow and large enough for a cavity.
    fn wall(&self) -> Option<f64> {
        let size = libm::cbrt(self.report.volume);
        self.kind.wall().filter(|wall| 2.5 * wall < size)
    }
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
    let sizes = Sizes::of(file, &plans, options)?;
    let mut parts: Vec<Part> = Vec::new();
    let mut warnings = Vec::new();
    for (number, plan) in plans.iter().enumerate() {
        observe(&format!("{}, {} of {}", plan.name, number + 1, plans.len()));
        let mut part = build(file, map, plan, (sizes, options.hollow), down)?;
        // Names are of one body each.
        if parts.iter().any(|other| other.name == part.name) {
            part.name = format!("{}_{}", part.name, plan.label);
        }
        let more = format!("--labels {} --count {:.0}", plan.label, 8.0 * sizes.most);
        // A wall around a cavity has another volume than the organ.
        let is_wall = options.hollow && plan.wall().is_some();
        warnings.extend(told_loss(&part, &more).filter(|_| !is_wall));
        parts.push(part);
    }
    notes.extend(sizes.told(&parts));
    let touching = touching(&parts, libm::cbrt(map.to_world().voxel_volume()));
    for touching in touching.iter().filter(|touching| touching.share >= HANGS) {
        // A gallbladder hangs on its liver.
        parts[touching.from].holds.clear();
    }
    Ok(Import { file: file.into(), parts, touching, down, warnings, notes })
}

/// How fine organs are filled.
#[derive(Clone, Copy)]
struct Sizes {
    /// As it is asked for [m].
    spacing: f64,
    /// About so many tetrahedra are asked for, of all organs together.
    asked: f64,
    /// Thin organs may have so many, each for itself.
    most: f64,
}

impl Sizes {
    fn of(file: &str, plans: &[Plan], options: &Options) -> Result<Self, ImportError> {
        let volume: f64 = plans.iter().map(|plan| plan.report.volume).sum();
        let boxes = plans.iter().map(|plan| box_of(&plan.organ));
        let largest = boxes.fold(0.0, f64::max);
        let fineness = options.fineness.unwrap_or_default();
        let spacing = fineness.affordable(file, volume, largest, MOST_OF_LABELS)?;
        let least = Fineness::default().spacing(volume);
        let [asked, most] = [spacing, spacing.min(least)].map(|edge| tets_of(volume, edge));
        Ok(Self { spacing, asked, most })
    }

    /// That thin organs make more tetrahedra than were asked for.
    fn told(self, parts: &[Part]) -> Option<String> {
        let count: usize = parts.iter().map(|part| part.mesh.tets().len()).sum();
        (count as f64 > 1.3 * self.asked).then(|| {
            format!(
                "{count} tetrahedra in place of about {:.0}: thin organs need short edges; --labels takes fewer organs",
                self.asked
            )
        })
    }

    /// The shortest edges [m] of an organ.
    fn finest(self, organ: &Organ, volume: f64) -> f64 {
        let voxel = organ.voxel_size().into_iter().fold(f64::INFINITY, f64::min);
        let affordable = finest(volume, box_of(organ), MOST_OF_LABELS);
        spacing_of(volume, self.most).max(OF_A_VOXEL * voxel).max(affordable)
    }
}

/// The volume of the box around an organ [m^3].
fn box_of(organ: &Organ) -> f64 {
    let (low, high) = organ.bounds();
    let size = high - low;
    size.x * size.y * size.z
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
    (sizes, is_hollow): (Sizes, bool),
    down: Vec3<f64>,
) -> Result<Part, ImportError> {
    let Plan { organ, report, .. } = plan;
    let fail = |error| ImportError::Organs { file: file.into(), organ: plan.name.clone(), error };
    let mut notes = Vec::new();
    let skin = skin_of(organ, report.volume, sizes.spacing).map_err(fail)?;
    let finest = sizes.finest(organ, report.volume);
    let first = first_spacing(report.volume, &skin, sizes.spacing, finest);
    let mut wall_share = None;
    let wall = plan.wall();
    let solid = wall.and_then(|_| Solid::new(&skin).ok());
    let wanted = Wanted { volume: report.volume, parts: report.pieces };
    let filled = || {
        fill_to(wanted, first, finest, |spacing| {
            let made = tetrahedralize_to(|by| organ.offset(by), spacing, report.volume);
            made.map(|made| Filled::new(made, spacing))
        })
    };
    let made = match (wall, &solid) {
        (Some(thin), Some(skin)) if is_hollow => {
            let thickness = thin.max(RESOLVED * first);
            let text = format!("{:.1} mm", 1e3 * thickness);
            notes.push(match thickness > thin {
                true => format!(
                    "a wall of {text} around a cavity, as stiff along it as one of {:.1} mm: edges are too long for that",
                    1e3 * thin
                ),
                false => format!("a wall of {text} around a cavity"),
            });
            wall_share = Some(thin / thickness);
            let made = tetrahedralize(&Wall { organ, skin, thickness }, first);
            made.map(|made| Filled::new(made, first))
        }
        (Some(thickness), _) => {
            let text = 1e3 * thickness;
            notes.push(format!(
                "filled, as the scan shows it; --hollow leaves a wall of {text:.1} mm"
            ));
            filled()
        }
        _ => filled(),
    };
    let Filled { mesh, report: made, spacing, .. } = made.map_err(fail)?;
    notes.extend(told_edges(spacing, sizes.spacing));
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
    let (skin, wanted) = (Some(skin), Some(report.volume));
    Ok(Part { name, mesh, wanted, skin, tissue, inner, holds, notes })
}

/// The fine surface of an organ: with edges as long as a voxel's, or half as long where a thin organ needs it for its volume.
fn skin_of(organ: &Organ, volume: f64, spacing: f64) -> Result<SurfaceMesh, TetrahedralizeError> {
    let voxel = libm::cbrt(organ.voxel_size().iter().product());
    let coarse = surface(organ, voxel.max(spacing / 8.0));
    let is_kept = |skin: &SurfaceMesh| (skin.enclosed_volume() / volume - 1.0).abs() <= KEPT;
    match coarse {
        Ok(skin) if is_kept(&skin) => Ok(skin),
        Ok(skin) => Ok(surface(organ, OF_A_VOXEL * voxel).unwrap_or(skin)),
        Err(_) => surface(organ, OF_A_VOXEL * voxel),
    }
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
            if shape.distance(middle) < 0.0 {
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
