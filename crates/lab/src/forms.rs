//! Forms that the bar and the block of the load cases come in.

use anyhow::{Context as _, Result};
use std::fmt;
use viscera::material::Material;
use viscera::mesh::TetMesh;
use viscera::mesh::distance::rotation_about;
use viscera::mesh::shapes::{Block, Splitting};
use viscera::scalar::{Mat3, Vec3, vec3};

use crate::load_cases::{BAR, BLOCK, GRAVITY, LoadCase, NEAR, Size};
use crate::unstructured::shuffled;

/// What a bar or a block is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Form {
    /// Boxes along the axes, split alike, inner vertices displaced: no two tetrahedra are alike. The others have boxes
    /// as well, but with vertices where they belong, unless they say otherwise.
    Usual,
    /// The usual vertices pushed about, with tetrahedra in no order.
    Unstructured,
    /// Along the axes: what the others are compared with.
    Aligned,
    /// Inner vertices displaced as far as they may.
    Jittered,
    /// The whole scene turned by 37 degrees about a skew axis.
    Turned,
    /// A bar eight times as long as it is thick.
    Slender,
    /// Two bars side by side that share no vertex. Where they hang, each is held at another end.
    Touching,
    /// A bar cut across by 60 % of its height.
    Cut,
    /// A ball a hundred times as stiff in the middle.
    Inclusion,
}

impl fmt::Display for Form {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Usual => "structured",
            Self::Unstructured => "unstructured",
            Self::Aligned => "aligned",
            Self::Jittered => "jittered",
            Self::Turned => "turned by 37 degrees",
            Self::Slender => "1:8 slender",
            Self::Touching => "two touching",
            Self::Cut => "cut by 60 %",
            Self::Inclusion => "stiff inclusion",
        })
    }
}

/// Young's modulus of an inclusion over that around it.
const STIFFER: f64 = 100.0;

/// Of what the displacement of inner vertices may be: in the usual form, and where it is as strong as it may be.
const JITTER: [f64; 2] = [0.6, 0.9];

/// Thickness of a slender bar over that of the usual one, a quarter of whose length that is.
const SLENDER: f64 = 0.5;

impl Form {
    /// A bar from the origin along x.
    pub fn bar(self, size: Size) -> Result<TetMesh> {
        if self == Self::Slender {
            let edges = vec3(BAR[0], SLENDER * BAR[1], SLENDER * BAR[2]);
            let cells = [[8, 1, 1], [16, 2, 2], [32, 4, 4], [80, 10, 10], [176, 22, 22]];
            return self.boxes(edges, cells, size);
        }
        let cells = [[4, 2, 2], [10, 3, 3], [20, 5, 5], [52, 13, 13], [112, 28, 28]];
        let bar = self.boxes(Vec3::from_f64(BAR), cells, size)?;
        if self == Self::Touching { side_by_side(&bar) } else { Ok(bar) }
    }

    /// A block from the origin.
    pub fn block(self, size: Size) -> Result<TetMesh> {
        let cells = [[4, 4, 2], [6, 6, 3], [10, 10, 5], [26, 26, 13], [56, 56, 28]];
        self.boxes(Vec3::from_f64(BLOCK), cells, size)
    }

    fn boxes(self, edges: Vec3<f64>, cells: [[usize; 3]; 5], size: Size) -> Result<TetMesh> {
        let block = Block {
            splitting: Splitting::Six,
            jitter: match self {
                Self::Usual | Self::Unstructured => JITTER[0],
                Self::Jittered => JITTER[1],
                _ => 0.0,
            },
            seed: 1,
            cut: if self == Self::Cut { 0.6 } else { 0.0 },
            ..Block::new(edges, cells[size as usize])
        };
        let mesh = block.mesh().context("a block of the studies")?;
        if self == Self::Unstructured { shuffled(&mesh, 1) } else { Ok(mesh) }
    }

    /// What a form changes beside the mesh of a bar or a block.
    pub(crate) fn finish(self, load_case: &mut LoadCase) -> Result<()> {
        match self {
            Self::Turned => {
                load_case.turned = rotation_about(vec3(1.0, 2.0, 3.0), 37.0_f64.to_radians());
                load_case.gravity = load_case.turned * load_case.gravity;
                load_case.mesh = moved(&load_case.mesh, load_case.turned, Vec3::ZERO)?;
            }
            Self::Touching if load_case.gravity == GRAVITY => {
                // The second half of the vertices is that of the second bar.
                let half = load_case.mesh.vertices().len() as u32 / 2;
                let other_end = load_case.select(|x| x.x > BAR[0] - NEAR);
                load_case.fixed.retain(|&v| v < half);
                load_case.fixed.extend(other_end.into_iter().filter(|&v| v >= half));
            }
            Self::Inclusion => include_ball(load_case)?,
            _ => {}
        }
        Ok(())
    }
}

/// Turned about the origin, then moved by an offset [m].
fn moved(mesh: &TetMesh, turn: Mat3<f64>, offset: Vec3<f64>) -> Result<TetMesh> {
    let vertices = mesh.vertices().iter().map(|&x| turn * x + offset).collect();
    Ok(TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec())?.0)
}

/// The bar, and beside it along y, touching it, another one.
fn side_by_side(bar: &TetMesh) -> Result<TetMesh> {
    let other = moved(bar, Mat3::IDENTITY, vec3(0.0, BAR[1], 0.0))?;
    let shift = bar.vertices().len() as u32;
    let tets = bar.tets().iter().copied();
    let tets = tets.chain(other.tets().iter().map(|tet| tet.map(|v| v + shift)));
    let vertices = [bar.vertices(), other.vertices()].concat();
    let regions = [bar.regions(), other.regions()].concat();
    Ok(TetMesh::new(vertices, tets.collect(), regions)?.0)
}

/// Tetrahedra with their middle in a ball three tenths of the height across to either side become region 1, stiffer.
fn include_ball(load_case: &mut LoadCase) -> Result<()> {
    let mesh = &load_case.mesh;
    let extent = viscera::mesh::topology::BoundingBox::around(mesh.vertices());
    let (center, radius) = (extent.center(), 0.3 * extent.size().z);
    let is_in_ball = |tet: usize| {
        let middle = mesh.corners(tet).into_iter().fold(Vec3::ZERO, |sum, x| sum + x) * 0.25;
        u32::from((middle - center).length() < radius)
    };
    let regions = (0..mesh.tets().len()).map(is_in_ball).collect();
    load_case.mesh = TetMesh::new(mesh.vertices().to_vec(), mesh.tets().to_vec(), regions)?.0;
    let soft = load_case.tissue;
    let young = STIFFER * soft.young();
    load_case.inclusion = Some(Material::new(soft.model(), young, soft.poisson(), soft.density())?);
    Ok(())
}
