//! Bodies of a segmented scan.

use viscera::mesh::distance::SignedDistance;
use viscera::mesh::io::MeshNames;
use viscera::mesh::tetrahedralize::{
    TetrahedralizeError, surface, tetrahedralize, tetrahedralize_to,
};
use viscera::mesh::winding::Solid;
use viscera::mesh::{SurfaceMesh, TetMesh, boundary_surface};
use viscera::scalar::{Vec3, vec3};
use viscera_volume::{LabelMap, Organ, OrganReport, Wall};

use crate::ImportError;
use crate::bodies::{Import, Inner, Options, Part, Touching, told_edges, told_loss};
use crate::choose::{Choice, Chosen, FEWEST_VOXELS, choose};
use crate::filling::{Filled, KEPT, Missed, RESOLVED, Wanted, fill_to, first_spacing};
use crate::hold::{BACK, Hold, Place, at_the_back};
use crate::name::name_of;
use crate::size::{Fineness, MOST_OF_LABELS, finest, spacing_of, tets_of};
use crate::tissue::{self, Kind};
use crate::unit::{edge_below, length_text};

/// Organs are tied where this share of the smaller one's surface touches the other.
const TIED: f64 = 0.1;

/// And need no other hold from this share on.
const HANGS: f64 = 0.3;

/// A lattice finer than the scan shows no more of it: edges are at least this share of a voxel's,
const OF_A_VOXEL: f64 = 0.35;
/// and those of its surface this one.
const OF_A_VOXEL_SKIN: f64 = 0.5;

/// Edges of coarser surfaces that are tried, in voxels.
const COARSER: [f64; 6] = [4.0, 3.0, 2.0, 1.5, 1.0, 0.75];
/// One shows all where no larger share of the fine one's points is off by more than so many voxels, outside, where other organs are,
/// and inside.
const OFF: [(f64, f64, f64); 3] = [(0.05, 0.25, 0.25), (0.005, 0.4, 0.6), (0.0, 1.0, 1.5)];
/// So many are made to find one of the same volume.
const MOST_SURFACES: usize = 4;

/// A body in the making.
struct Plan {
    label: u16,
    name: String,
    kind: Kind,
    /// Labels in it that are regions of their own.
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
    let Choice { organs, mut warnings, mut notes } = choose(file, map, options)?;
    let mut plans: Vec<Plan> = Vec::new();
    for Chosen { label, name, inner, filled } in organs {
        let mut labels = vec![label];
        labels.extend(inner.iter().map(|(label, _)| *label).chain(filled));
        let (organ, report) = Organ::new(map, &labels)
            .map_err(|error| ImportError::Organ { file: file.into(), error })?;
        let kind = tissue::kind_of(&name);
        plans.push(Plan { label, name, kind, inner, organ, report });
    }
    let sizes = Sizes::of(file, &plans, options)?;
    let mut parts: Vec<Part> = Vec::new();
    let mut first_error = None;
    for (number, plan) in plans.iter().enumerate() {
        observe(&format!("{}, {} of {}", plan.name, number + 1, plans.len()));
        let mut part = match build(map, plan, (sizes, options), down) {
            Ok(part) => part,
            // One that has no shape is no reason to be without the others.
            Err(error) => {
                warnings.push(format!("`{}` is left out: {}", plan.name, reason(plan, &error)));
                first_error.get_or_insert((plan, error));
                continue;
            }
        };
        // Names are of one body each.
        if parts.iter().any(|other| other.name == part.name) {
            part.name = format!("{}_{}", part.name, plan.label);
        }
        let more = match plan.report.voxels as u64 >= FEWEST_VOXELS {
            true => format!(
                "more tetrahedra keep more of it, such as --labels {} --count {:.0}",
                plan.label,
                8.0 * sizes.most
            ),
            false => "its few voxels show no more of its shape".to_owned(),
        };
        // A wall around a cavity has another volume than the organ.
        let is_wall = options.hollow && plan.wall().is_some();
        warnings.extend(told_loss(&part, &more).filter(|_| !is_wall));
        parts.push(part);
    }
    if let Some((plan, error)) = first_error.filter(|_| parts.is_empty()) {
        let (file, organ, reason) = (file.to_owned(), plan.name.clone(), reason(plan, &error));
        return Err(ImportError::Organs { file, organ, reason });
    }
    notes.extend(sizes.told(&parts));
    let touching = touching(&parts, libm::cbrt(map.to_world().voxel_volume()));
    for touching in touching.iter().filter(|touching| touching.share >= HANGS) {
        // A gallbladder hangs on its liver.
        parts[touching.from].holds.clear();
    }
    let (file, thickness, balance) = (file.into(), None, None);
    Ok(Import { file, parts, touching, thickness, down, warnings, notes, balance })
}

/// Why an organ is not filled.
fn reason(plan: &Plan, error: &TetrahedralizeError) -> String {
    let voxels = plan.report.voxels;
    match error {
        error if error.is_missed() && (voxels as u64) < FEWEST_VOXELS => {
            let are = if voxels == 1 { "voxel is" } else { "voxels are" };
            format!("{voxels} {are} too little for a shape; a scan with finer voxels may show it")
        }
        TetrahedralizeError::TooCoarse { spacing, suggestion, .. } => {
            let (long, short) = (length_text(*spacing), edge_below(*suggestion));
            let label = plan.label;
            format!("too thin for edges of {long}; --labels {label} --edge \"{short}\" fills it")
        }
        error => error.to_string(),
    }
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

/// Fills an organ, and says how it was done.
fn build(
    map: &LabelMap,
    plan: &Plan,
    (sizes, options): (Sizes, &Options),
    down: Vec3<f64>,
) -> Result<Part, TetrahedralizeError> {
    let Plan { organ, report, .. } = plan;
    let mut notes = Vec::new();
    let (skin, edge) = skin_of(organ, report.volume, sizes.spacing)?;
    let finest = sizes.finest(organ, report.volume);
    let first = first_spacing(report.volume, &skin, sizes.spacing, finest);
    let mut wall_share = None;
    let wall = plan.wall();
    let solid = wall.and_then(|_| Solid::new(&skin).ok());
    let wanted = Wanted { volume: report.volume, parts: report.pieces };
    let filled = || {
        fill_to(wanted, first, finest, |spacing| {
            let edges = options.spacing(spacing);
            let made = tetrahedralize_to(|by| organ.offset(by), edges, report.volume);
            made.map(|made| Filled::new(made, spacing))
        })
    };
    let made = match (wall, &solid) {
        (Some(thin), Some(skin)) if options.hollow => {
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
            let made = tetrahedralize(&Wall { organ, skin, thickness }, options.spacing(first));
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
    let Filled { mesh, report: made, spacing, .. } = made?;
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
    holds.extend(at_the_back(&name, &mesh, down, ("back", BACK)));
    let filled = wall.filter(|_| !options.hollow).map(|wall| (wall, report.volume));
    let mut tissue = tissue::of_filled(&plan.name, filled);
    if let Some(share) = wall_share {
        tissue.soften(share);
    }
    let regions = inner.iter().map(|inner| (inner.region, inner.name.clone())).collect();
    let names = MeshNames { regions, ..MeshNames::default() };
    let skin = coarser(organ, (skin, edge), spacing);
    let (skin, wanted) = (Some(skin), Some(report.volume));
    let is_balanced = true;
    Ok(Part { name, mesh, wanted, skin, tissue, inner, names, holds, is_balanced, notes })
}

/// The fine surface of an organ, and the length of its edges [m]: that of a voxel's, or half of it where a thin organ needs it for
/// its volume.
fn skin_of(
    organ: &Organ,
    volume: f64,
    spacing: f64,
) -> Result<(SurfaceMesh, f64), TetrahedralizeError> {
    let voxel = libm::cbrt(organ.voxel_size().iter().product());
    let [long, short] = [voxel.max(spacing / 8.0), OF_A_VOXEL_SKIN * voxel];
    let is_kept = |skin: &SurfaceMesh| (skin.enclosed_volume() / volume - 1.0).abs() <= KEPT;
    match surface(organ, long) {
        Ok(skin) if is_kept(&skin) => Ok((skin, long)),
        Ok(skin) => Ok(surface(organ, short).map_or((skin, long), |skin| (skin, short))),
        Err(_) => Ok((surface(organ, short)?, short)),
    }
}

/// The same surface with the longest edges that show all of it, no longer than those of its tetrahedra [m]: what meets other tissue
/// costs as much as it has points.
fn coarser(organ: &Organ, (skin, edge): (SurfaceMesh, f64), most: f64) -> SurfaceMesh {
    let voxel = libm::cbrt(organ.voxel_size().iter().product());
    let volume = skin.enclosed_volume();
    let shows = |coarse: &SurfaceMesh| {
        let Ok(solid) = Solid::new(coarse) else { return false };
        // Positive where it lies inside of the fine one.
        let off: Vec<f64> = skin.vertices.iter().map(|x| solid.distance(*x) / voxel).collect();
        let count = |is: &dyn Fn(f64) -> bool| off.iter().filter(|off| is(**off)).count();
        OFF.iter().all(|&(share, outside, inside)| {
            count(&|off| off < -outside || off > inside) as f64 <= share * off.len() as f64
        }) && (coarse.enclosed_volume() / volume - 1.0).abs() <= KEPT
    };
    let lengths = COARSER.iter().map(|length| length * voxel);
    let lengths = lengths.filter(|length| *length > edge && *length <= most);
    let coarse = lengths.filter_map(|edge| surface_to(organ, edge, volume)).find(shows);
    coarse.unwrap_or(skin)
}

/// The surface of an organ with edges of a length [m], so far out that it encloses a volume [m^3] where that is possible.
fn surface_to(organ: &Organ, edge: f64, volume: f64) -> Option<SurfaceMesh> {
    let mut out = 0.0;
    let mut skin = surface(organ, edge).ok()?;
    for _ in 1..MOST_SURFACES {
        let missing = volume - skin.enclosed_volume();
        if missing.abs() <= 0.5 * KEPT * volume {
            break;
        }
        out += missing / skin.area();
        skin = surface(&organ.offset(out), edge).ok()?;
    }
    Some(skin)
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
