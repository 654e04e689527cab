//! Bodies that bend, and the meshes they are filled with.

use std::fmt;

use anyhow::{Context as _, Result};
use viscera::mesh::TetMesh;
use viscera::mesh::distance::{Cuboid, Placed, rotation_about};
use viscera::mesh::refine::refine;
use viscera::mesh::shapes::{self, Block, Splitting};
use viscera::mesh::tetrahedralize::tetrahedralize;
use viscera::mesh::topology::BoundingBox;
use viscera::scalar::{Vec3, vec3};

use crate::delaunay::delaunay;
use crate::unstructured::{relaxed, shuffled};

/// Edge lengths of the bar [m]. Of 50 kPa it sinks by a third of its length.
pub const BAR: [f64; 3] = [0.08, 0.02, 0.02];

/// Edge lengths of the block [m].
pub const BLOCK: [f64; 3] = [0.06, 0.06, 0.03];

/// Edge lengths of the box around the angle [m]: a post and an arm, both as thick as the bar.
const ANGLE: [f64; 3] = [0.06, 0.02, 0.06];

/// Thickness of the tapered bar at its free end over that at the clamped one.
const TAPERED: f64 = 0.5;

/// Largest distance [m] from a plane of what lies in it.
pub(super) const NEAR: f64 = 1e-9;

/// By how much the stuffed bar is turned about its length against the lattice [rad]: faces cut it everywhere.
const TURNED: f64 = 0.35;

/// Share of the liver's longest axis along which it is held.
const HELD: f64 = 0.2;

/// Lattice spacing [m] of the procedural liver of some 180 vertices.
const LIVER_SPACING: f64 = 0.033;

/// What is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// Clamped at its low end along x.
    Bar,
    /// Held below.
    Block,
    /// A bar that thins to a half.
    Tapered,
    /// A post with an arm at its top, clamped below.
    Angle,
    /// A bar whose lower half is of the second material.
    Layers,
    /// A bar whose clamped half is of the second material.
    Halves,
    /// A bar as isosurface stuffing makes it: flat ends, edges along it cut off.
    Stuffed,
    /// The procedural liver, held where its longest axis begins.
    Liver,
}

/// How a body is filled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Filling {
    /// Boxes of five tetrahedra.
    Five,
    /// Boxes of six.
    Six,
    /// Boxes of six whose inner vertices are pushed about.
    Jittered,
    /// In no order, and of sound shapes; with a seed.
    Relaxed(u64),
    /// In no order, and of poor shapes.
    Shuffled(u64),
    /// Delaunay's, slivers and all.
    Delaunay(u64),
    /// By isosurface stuffing, where the shape is made by it.
    Lattice,
    /// The same, each tetrahedron split into eight.
    Split,
}

impl fmt::Display for Shape {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Bar => "bar",
            Self::Block => "block",
            Self::Tapered => "tapered bar",
            Self::Angle => "L-shaped bar",
            Self::Layers => "bar on a stiff layer",
            Self::Halves => "half-stiff bar",
            Self::Stuffed => "stuffed bar",
            Self::Liver => "liver",
        })
    }
}

impl fmt::Display for Filling {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Five => f.write_str("boxes of five"),
            Self::Six => f.write_str("boxes of six"),
            Self::Jittered => f.write_str("boxes of six, jittered"),
            Self::Relaxed(seed) => write!(f, "unstructured {seed}"),
            Self::Shuffled(seed) => write!(f, "unstructured {seed}, poor shapes"),
            Self::Delaunay(seed) => write!(f, "Delaunay {seed}, with slivers"),
            Self::Lattice => f.write_str("isosurface stuffing"),
            Self::Split => f.write_str("isosurface stuffing, split 1:8"),
        }
    }
}

/// A mesh that is held and pulled.
#[derive(Clone, Debug)]
pub struct Body {
    /// What it is filled with; region 1 is of the second material.
    pub mesh: TetMesh,
    /// What it is.
    pub shape: Shape,
    /// Whether a vertex is held, shape [vertex_count]. So is every point between held ones of a tetrahedron.
    pub held: Vec<bool>,
    /// The way that weight pulls.
    pub down: Vec3<f64>,
}

impl Body {
    /// A shape with so many cells across.
    pub fn new(shape: Shape, filling: Filling, across: usize) -> Result<Self> {
        let down = vec3(0.0, 0.0, -1.0);
        let of = |mesh: TetMesh, is_held: &dyn Fn(Vec3<f64>) -> bool| {
            let held = mesh.vertices().iter().map(|&x| is_held(x)).collect();
            Self { mesh, shape, held, down }
        };
        let at_wall = |x: Vec3<f64>| x.x < NEAR;
        let body = match shape {
            // The rim of the end is cut off: with what lies half a spacing away all of the section is held.
            Shape::Stuffed => {
                let depth = 0.5 * stuffed_spacing(across) + NEAR;
                of(stuffed(across)?, &|x| x.x < depth)
            }
            Shape::Liver => Self::organ(&shapes::liver(LIVER_SPACING / across as f64, 1.0)?.tets)?,
            Shape::Block | Shape::Angle => of(filled(shape, filling, across)?, &|x| x.z < NEAR),
            _ => of(filled(shape, filling, across)?, &at_wall),
        };
        if filling == Filling::Split { body.split() } else { Ok(body) }
    }

    /// An organ of one material that is held where its longest axis begins and sags along its shortest, whatever its
    /// axes and regions are.
    pub fn organ(mesh: &TetMesh) -> Result<Self> {
        let regions = vec![0; mesh.tets().len()];
        let (mesh, _) = TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions)?;
        let extent = BoundingBox::around(mesh.vertices());
        let size = extent.size().to_array();
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| size[a].total_cmp(&size[b]));
        let [shortest, _, longest] = axes;
        let limit = extent.min[longest] + HELD * size[longest];
        let held = mesh.vertices().iter().map(|x| x[longest] < limit).collect();
        let mut down = Vec3::ZERO;
        down[shortest] = -1.0;
        Ok(Self { mesh, shape: Shape::Liver, held, down })
    }

    /// The same in eight times as many tetrahedra, held where it was.
    pub fn split(&self) -> Result<Self> {
        let (mesh, middles) =
            refine(&self.mesh).context("a body in eight times as many tetrahedra")?;
        let before = (0..).zip(&self.held).filter(|(_, held)| **held).map(|(v, _)| v);
        let mut held = vec![false; mesh.vertices().len()];
        for v in middles.patch(&before.collect::<Vec<u32>>()) {
            held[v as usize] = true;
        }
        Ok(Self { mesh, held, ..self.clone() })
    }

    /// Whether a point belongs to the face whose movement is read.
    pub(super) fn is_read(&self, x: Vec3<f64>) -> bool {
        match self.shape {
            Shape::Block => is_pressed(x),
            Shape::Angle => x.x > ANGLE[0] - NEAR,
            _ => x.x > BAR[0] - NEAR,
        }
    }
}

/// The quarter of the block's top in its middle.
fn is_pressed(x: Vec3<f64>) -> bool {
    let in_middle = |x: f64, edge: f64| (x - 0.5 * edge).abs() < 0.25 * edge + NEAR;
    x.z > BLOCK[2] - NEAR && in_middle(x.x, BLOCK[0]) && in_middle(x.y, BLOCK[1])
}

/// Shapes made of boxes. Blocks have an even number across.
fn filled(shape: Shape, filling: Filling, across: usize) -> Result<TetMesh> {
    let (size, boxes) = match shape {
        Shape::Block => (BLOCK, [2 * across, 2 * across, across]),
        Shape::Angle => (ANGLE, [3 * across, across, 3 * across]),
        _ => (BAR, [4 * across, across, across]),
    };
    if let Filling::Delaunay(seed) = filling {
        return shaped(shape, &delaunay(Vec3::from_f64(size), boxes, seed)?);
    }
    let block = Block {
        splitting: if filling == Filling::Five { Splitting::Five } else { Splitting::Six },
        jitter: if matches!(filling, Filling::Five | Filling::Six) { 0.0 } else { 0.6 },
        seed: 1,
        ..Block::new(Vec3::from_f64(size), boxes)
    };
    // What two materials meet in, and what is cut out of a box, stays where it is.
    let block = match shape {
        Shape::Layers | Shape::Halves | Shape::Angle => Block { jitter: 0.0, ..block },
        _ => block,
    };
    let mesh = shaped(shape, &block.mesh().context("a body that bends")?)?;
    match filling {
        Filling::Relaxed(seed) => relaxed(&mesh, seed),
        Filling::Shuffled(seed) => shuffled(&mesh, seed),
        _ => Ok(mesh),
    }
}

/// What a shape leaves of a box, moves and marks.
fn shaped(shape: Shape, mesh: &TetMesh) -> Result<TetMesh> {
    let middle = |&tet: &usize| mesh.corners(tet).iter().fold(Vec3::ZERO, |sum, x| sum + *x) * 0.25;
    let thickness = BAR[1];
    let is_kept = |tet: &usize| {
        let x = middle(tet);
        shape != Shape::Angle || x.x < thickness || x.z > ANGLE[2] - thickness
    };
    let kept: Vec<usize> = (0..mesh.tets().len()).filter(is_kept).collect();
    let region = |tet: &usize| {
        let x = middle(tet);
        u32::from(match shape {
            Shape::Layers => x.z < 0.5 * BAR[2],
            Shape::Halves => x.x < 0.5 * BAR[0],
            _ => false,
        })
    };
    let moved = |x: &Vec3<f64>| {
        let slimmer = 1.0 - (1.0 - TAPERED) * x.x / BAR[0];
        let middle = vec3(x.x, 0.5 * BAR[1], 0.5 * BAR[2]);
        if shape == Shape::Tapered { middle + (*x - middle) * slimmer } else { *x }
    };
    let vertices = mesh.vertices().iter().map(moved).collect();
    let regions = kept.iter().map(region).collect();
    let tets = kept.iter().map(|&tet| mesh.tets()[tet]).collect();
    Ok(TetMesh::new(vertices, tets, regions).context("a body that bends")?.0)
}

/// Spacing of the lattice [m], of which half is a whole number of times in the bar's half length. A cube has two vertices:
/// there are about as many as in boxes of this number across.
fn stuffed_spacing(across: usize) -> f64 {
    BAR[0] / (2 * across + 2) as f64
}

/// The bar by isosurface stuffing. Ends lie in planes of the lattice and are flat; all other faces are cut anywhere,
/// as the bar is turned about its length.
fn stuffed(across: usize) -> Result<TetMesh> {
    let half_size = Vec3::from_f64(BAR) * 0.5;
    let bar = Placed {
        shape: Cuboid { center: Vec3::ZERO, half_size, rounding: 0.0 },
        rotation: rotation_about(vec3(1.0, 0.0, 0.0), TURNED),
        scale: 1.0,
        translation: Vec3::ZERO,
    };
    let spacing = stuffed_spacing(across);
    let (mesh, _) = tetrahedralize(&bar, spacing).context("a stuffed bar")?;
    let place = |x: &Vec3<f64>| bar.rotation.transpose() * *x + half_size;
    let vertices = mesh.vertices().iter().map(place).collect();
    let (tets, regions) = (mesh.tets().to_vec(), mesh.regions().to_vec());
    Ok(TetMesh::new(vertices, tets, regions).context("a stuffed bar")?.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::mesh::quality::shape_quality;
    use viscera::mesh::tet_volume;

    fn volume(mesh: &TetMesh, region: u32) -> f64 {
        let of = (0..mesh.tets().len()).filter(|&tet| mesh.regions()[tet] == region);
        of.map(|tet| tet_volume(mesh.corners(tet))).sum()
    }

    /// Whatever fills them: tapers as a truncated pyramid, an angle of five cubes, halves of two materials.
    #[test]
    fn bodies_have_their_volumes() {
        let bar = BAR.iter().product::<f64>();
        let cube = BAR[1].powi(3);
        let tapered = bar * (1.0 + TAPERED + TAPERED * TAPERED) / 3.0;
        for filling in [Filling::Five, Filling::Relaxed(1), Filling::Delaunay(1)] {
            for (shape, volumes) in [
                (Shape::Bar, [bar, 0.0]),
                (Shape::Tapered, [tapered, 0.0]),
                (Shape::Angle, [5.0 * cube, 0.0]),
                (Shape::Layers, [0.5 * bar; 2]),
                (Shape::Halves, [0.5 * bar; 2]),
            ] {
                // Points of Delaunay's lie where they like: nothing ends where a shape does.
                let is_anywhere = matches!(filling, Filling::Delaunay(_));
                if is_anywhere && !matches!(shape, Shape::Bar | Shape::Tapered) {
                    continue;
                }
                let mesh = Body::new(shape, filling, 2).expect("a body").mesh;
                for (region, expected) in (0..).zip(volumes) {
                    let error = (volume(&mesh, region) - expected).abs() / bar;
                    assert!(error < 1e-9, "{shape}, {filling}, region {region}: {error:e}");
                }
            }
        }
    }

    /// Ends of the stuffed bar are whole and flat but for edges that are cut off, and so is what lies between.
    #[test]
    fn the_stuffed_bar_is_a_bar() {
        let body = Body::new(Shape::Stuffed, Filling::Lattice, 4).expect("a body");
        let filled = volume(&body.mesh, 0) / BAR.iter().product::<f64>();
        let boundary = viscera::mesh::boundary_surface(&body.mesh);
        let end = |is_end: &dyn Fn(Vec3<f64>) -> bool| -> f64 {
            let corners =
                |triangle: &[u32; 3]| triangle.map(|v| boundary.surface.vertices[v as usize]);
            let triangles = boundary.surface.triangles.iter().map(corners);
            let at_end = triangles.filter(|triangle| triangle.iter().all(|x| is_end(*x)));
            at_end.map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length()).sum()
        };
        let areas = [end(&|x| x.x < NEAR), end(&|x| body.is_read(x))];
        println!("{filled} of the bar, ends {areas:?}, {} vertices", body.mesh.vertices().len());
        // Along each edge of the bar a corner is cut off, as far as an edge of the lattice to either side at most.
        let edge = stuffed_spacing(4);
        let section = BAR[1] * BAR[2];
        assert!((1.0 - 2.0 * edge * edge / section..1.0).contains(&filled), "{filled}");
        for area in areas {
            let least = (1.0 - 2.0 * edge / BAR[1]) * (1.0 - 2.0 * edge / BAR[2]);
            assert!((least..1.0).contains(&(area / section)), "{area}");
        }
        let held = body.held.iter().filter(|held| **held).count();
        assert!(held > 20 && held < body.held.len() / 4, "{held}");
    }

    #[test]
    fn slivers_are_kept() {
        let mesh = Body::new(Shape::Bar, Filling::Delaunay(1), 4).expect("a body").mesh;
        let shapes = || (0..mesh.tets().len()).map(|tet| shape_quality(mesh.corners(tet)));
        let worst = shapes().fold(1.0, f64::min);
        let poor = shapes().filter(|shape| *shape < 0.1).count();
        println!("{} tetrahedra, {poor} below 0.1, the worst {worst}", mesh.tets().len());
        assert!(worst < 0.05 && poor > 5, "{worst}, {poor}");
    }

    /// What is split is held where it was: at points between held ones.
    #[test]
    fn a_split_organ_is_held_where_it_was() {
        let body =
            Body::organ(&shapes::liver(LIVER_SPACING, 1.0).expect("a liver").tets).expect("a body");
        let fine = body.split().expect("a body");
        assert_eq!(fine.held.len(), fine.mesh.vertices().len());
        let held_volume = |body: &Body| -> f64 {
            let held = |tet: &[u32; 4]| tet.iter().all(|&v| body.held[v as usize]);
            let tets = body.mesh.tets().iter().enumerate().filter(|(_, tet)| held(tet));
            tets.map(|(tet, _)| tet_volume(body.mesh.corners(tet))).sum()
        };
        let [coarse, fine] = [&body, &fine].map(held_volume);
        assert!(coarse > 0.0 && (fine / coarse - 1.0).abs() < 1e-12, "{coarse} {fine}");
    }
}
