//! Cells of a file as tetrahedra and triangles.
//!
//! A cell with quadrilateral faces is a cone over those of its faces that do not contain its lowest vertex, with that
//! vertex as the tip; a quadrilateral is cut along the diagonal at its lowest vertex. Both cells at a face see the same four
//! numbers, so they cut it alike: Dompierre, Labbe, Vallet and Camarero, "How to subdivide pyramids, prisms and hexahedra
//! into tetrahedra", 1999. A second-order cell is taken by its corners: its edges become straight.

use super::parsed::CountedElements;

/// The shapes that cells have, whatever their order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Shape {
    Point,
    Line,
    Triangle,
    Quad,
    Tet,
    Pyramid,
    Wedge,
    Hexahedron,
}

/// Corners of the faces of a pyramid: base 0 1 2 3, tip 4.
const PYRAMID: [&[usize]; 5] = [&[0, 1, 2, 3], &[0, 1, 4], &[1, 2, 4], &[2, 3, 4], &[3, 0, 4]];
/// Of a wedge: triangles 0 1 2 and 3 4 5.
const WEDGE: [&[usize]; 5] = [&[0, 1, 2], &[3, 4, 5], &[0, 1, 4, 3], &[1, 2, 5, 4], &[2, 0, 3, 5]];
/// Of a hexahedron: squares 0 1 2 3 and 4 5 6 7.
const HEXAHEDRON: [&[usize]; 6] =
    [&[0, 1, 2, 3], &[4, 5, 6, 7], &[0, 1, 5, 4], &[1, 2, 6, 5], &[2, 3, 7, 6], &[3, 0, 4, 7]];

impl Shape {
    pub fn corner_count(self) -> usize {
        match self {
            Self::Point => 1,
            Self::Line => 2,
            Self::Triangle => 3,
            Self::Quad | Self::Tet => 4,
            Self::Pyramid => 5,
            Self::Wedge => 6,
            Self::Hexahedron => 8,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Point => "point",
            Self::Line => "line",
            Self::Triangle => "triangle",
            Self::Quad => "quadrilateral",
            Self::Tet => "tetrahedron",
            Self::Pyramid => "pyramid",
            Self::Wedge => "wedge",
            Self::Hexahedron => "hexahedron",
        }
    }
}

/// The cells of a file that are tissue or surface, and counts of all others.
#[derive(Default)]
pub(super) struct Cells {
    /// Shape `[tet_count]`, as are `regions` and `of_tets`.
    pub tets: Vec<[u32; 4]>,
    pub regions: Vec<u32>,
    /// The number in the file's order of the cell that a tetrahedron is of.
    pub of_tets: Vec<u32>,
    /// Shape `[triangle_count]`.
    pub triangles: Vec<[u32; 3]>,
    pub of_triangles: Vec<u32>,
    /// What a cell that became several was.
    pub split: Vec<CountedElements>,
    pub skipped: Vec<CountedElements>,
    /// A second-order cell: the range of its nodes in `nodes`, corners first.
    pub curved: Vec<Curved>,
    pub nodes: Vec<u32>,
    /// Names of arrays of whole numbers, one for each cell, that are not taken as regions.
    pub unused: Vec<String>,
}

/// A cell that has nodes between its corners.
#[derive(Clone, Copy)]
pub(super) struct Curved {
    pub first: usize,
    pub count: usize,
    pub corners: usize,
}

impl Cells {
    /// Adds a cell with all its nodes, of which there are at least as many as its shape has corners.
    pub fn add(&mut self, shape: Shape, nodes: &[u32], region: u32, cell: usize) {
        let count = shape.corner_count();
        let Some(corners) = nodes.get(..count) else { return };
        let is_wanted = !matches!(shape, Shape::Point | Shape::Line);
        if is_wanted && nodes.len() > count {
            self.curved.push(Curved {
                first: self.nodes.len(),
                count: nodes.len(),
                corners: count,
            });
            self.nodes.extend_from_slice(nodes);
        }
        match shape {
            Shape::Pyramid | Shape::Wedge | Shape::Hexahedron if !cfg!(feature = "formats") => {
                self.skip(shape.name());
            }
            Shape::Point | Shape::Line => self.skip(shape.name()),
            Shape::Triangle => self.add_triangle([corners[0], corners[1], corners[2]], cell),
            Shape::Quad => {
                let [a, b] = cut([corners[0], corners[1], corners[2], corners[3]]);
                self.add_triangle(a, cell);
                self.add_triangle(b, cell);
            }
            Shape::Tet => {
                self.add_tet([corners[0], corners[1], corners[2], corners[3]], region, cell);
            }
            Shape::Pyramid => self.split(shape, &PYRAMID, corners, region, cell),
            Shape::Wedge => self.split(shape, &WEDGE, corners, region, cell),
            Shape::Hexahedron => self.split(shape, &HEXAHEDRON, corners, region, cell),
        }
    }

    /// A polygon as triangles around its first corner.
    pub fn add_polygon(&mut self, corners: &[u32], cell: usize) {
        match corners {
            &[a, b, c, d] => self.add(Shape::Quad, &[a, b, c, d], 0, cell),
            [first, rest @ ..] => {
                for pair in rest.windows(2) {
                    self.add_triangle([*first, pair[0], pair[1]], cell);
                }
            }
            [] => {}
        }
    }

    pub fn skip(&mut self, kind: &str) {
        CountedElements::count(&mut self.skipped, kind);
    }

    fn add_tet(&mut self, tet: [u32; 4], region: u32, cell: usize) {
        self.tets.push(tet);
        self.regions.push(region);
        self.of_tets.push(cell as u32);
    }

    fn add_triangle(&mut self, [a, b, c]: [u32; 3], cell: usize) {
        if a == b || b == c || c == a {
            self.skip("triangle without area");
            return;
        }
        self.triangles.push([a, b, c]);
        self.of_triangles.push(cell as u32);
    }

    fn split(
        &mut self,
        shape: Shape,
        faces: &[&[usize]],
        corners: &[u32],
        region: u32,
        cell: usize,
    ) {
        CountedElements::count(&mut self.split, shape.name());
        let tip = corners.iter().copied().min().unwrap_or_default();
        for face in faces {
            let mut at = [0; 4];
            for (place, &corner) in at.iter_mut().zip(*face) {
                *place = corners[corner];
            }
            match face.len() {
                _ if at[..face.len()].contains(&tip) => {}
                3 => self.add_tet([tip, at[0], at[1], at[2]], region, cell),
                _ => {
                    for [a, b, c] in cut(at) {
                        self.add_tet([tip, a, b, c], region, cell);
                    }
                }
            }
        }
    }
}

/// A quadrilateral cut along the diagonal at its lowest vertex.
fn cut([a, b, c, d]: [u32; 4]) -> [[u32; 3]; 2] {
    if a.min(c) <= b.min(d) { [[a, b, c], [a, c, d]] } else { [[b, c, d], [b, d, a]] }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mesh::{TetMesh, boundary_surface};
    use crate::scalar::vec3;

    /// A row of hexahedra with shuffled numbers: conforming, so that its boundary is that of the row.
    #[test]
    fn neighbours_cut_the_face_between_them_alike() {
        for turn in 0..12u32 {
            let number = |i: u32| (i * 5 + turn) % 12;
            let mut vertices = vec![vec3(0.0, 0.0, 0.0); 12];
            for i in 0..12 {
                let (layer, corner) = (i / 4, i % 4);
                let (x, y) = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)][corner as usize];
                vertices[number(i) as usize] = vec3(x, y, f64::from(layer));
            }
            let mut cells = Cells::default();
            for layer in 0..2 {
                let nodes: Vec<u32> = (0..8).map(|i| number(4 * layer + i)).collect();
                cells.add(Shape::Hexahedron, &nodes, layer, layer as usize);
            }
            let Cells { tets, regions, of_tets, .. } = cells;
            assert_eq!((tets.len(), of_tets[5], of_tets[6]), (12, 0, 1));
            let (mesh, _) = TetMesh::new(vertices, tets, regions).expect("a mesh");
            assert!((mesh.volume() - 2.0).abs() < 1e-15);
            // Five squares a cube, two triangles each.
            assert_eq!(boundary_surface(&mesh).surface.triangles.len(), 20);
        }
    }

    #[test]
    fn wedges_and_pyramids_keep_their_volume() {
        let square = [(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)];
        for turn in 0..6u32 {
            let at = |count: u32| move |i: u32| (i + turn) % count;
            let mut vertices = vec![vec3(0.0, 0.0, 0.0); 6];
            for i in 0..6 {
                let (x, y) = square[[0, 1, 3][i as usize % 3]];
                vertices[at(6)(i) as usize] = vec3(x, y, f64::from(i / 3));
            }
            let mut cells = Cells::default();
            cells.add(Shape::Wedge, &[0, 1, 2, 3, 4, 5].map(at(6)), 0, 0);
            assert_eq!(cells.tets.len(), 3);
            let (mesh, _) = TetMesh::new(vertices, cells.tets, vec![0; 3]).expect("a wedge");
            assert!((mesh.volume() - 0.5).abs() < 1e-15);

            let mut vertices = vec![vec3(0.0, 0.0, 0.0); 5];
            for i in 0..4 {
                let (x, y) = square[i as usize];
                vertices[at(5)(i) as usize] = vec3(x, y, 0.0);
            }
            vertices[at(5)(4) as usize] = vec3(0.5, 0.5, 1.0);
            let mut cells = Cells::default();
            cells.add(Shape::Pyramid, &[0, 1, 2, 3, 4].map(at(5)), 0, 0);
            assert_eq!(cells.tets.len(), 2);
            let (mesh, _) = TetMesh::new(vertices, cells.tets, vec![0; 2]).expect("a pyramid");
            assert!((mesh.volume() - 1.0 / 3.0).abs() < 1e-15);
        }
    }
}
