//! Unstructured meshes: inner vertices of a mesh pushed about, and its tetrahedra exchanged at random.
//!
//! Two tetrahedra with a common face give way to three around the edge between the corners opposite it, and three
//! around an edge to two (B. Joe, "Three-dimensional triangulations from local transformations", SIAM Journal on
//! Scientific and Statistical Computing 10, 1989). The boundary stays as it is, so that what is pinned does, and so do
//! the faces between regions.

use anyhow::{Context as _, Result};
use viscera::mesh::TetMesh;
use viscera::mesh::quality::shape_quality;
use viscera::mesh::topology::boundary_surface;
use viscera::scalar::Vec3;

use crate::load_cases::Random;

/// Of pushing every inner vertex and trying to exchange every tetrahedron. After eight the tetrahedra around inner
/// vertices are between 18 and 34, where all had 24; more rounds change less and less.
const ROUNDS: u32 = 20;

/// The farthest that a vertex is pushed at once, of the mean length of the edges around it.
const PUSH: f64 = 0.3;

/// Shape quality below which no tetrahedron is made: meshes with worse ones measure slivers, not irregularity. With 0.3
/// few exchanges are left, as the tetrahedra of boxes have 0.66 and halve where they are exchanged.
const LEAST_QUALITY: f64 = 0.2;

/// Volumes before and after an exchange are the same up to this, or the new tetrahedra do not fill the room of the old.
const SAME_VOLUME: f64 = 1e-9;

/// The same body, filled by other tetrahedra in no order. The same seed gives the same bits.
pub fn shuffled(mesh: &TetMesh, seed: u64) -> Result<TetMesh> {
    let mut filling = Filling::new(mesh);
    filling.rounds(&mut Random(seed));
    filling.finish()
}

/// As [`shuffled`], and then everything that makes the worst tetrahedra better, as meshes from a mesh generator are:
/// in no order, and of sound shapes.
pub fn relaxed(mesh: &TetMesh, seed: u64) -> Result<TetMesh> {
    let mut filling = Filling::new(mesh);
    let mut random = Random(seed);
    filling.rounds(&mut random);
    filling.improves = true;
    filling.rounds(&mut random);
    filling.finish()
}

struct Filling {
    /// Positions [m], shape [vertex_count].
    vertices: Vec<Vec3<f64>>,
    /// Positively wound, shape [tet_count].
    tets: Vec<[u32; 4]>,
    /// Regions of the tetrahedra, shape [tet_count].
    regions: Vec<u32>,
    /// Tetrahedra of each vertex, shape [vertex_count].
    around: Vec<Vec<u32>>,
    /// Vertices that may be pushed, shape [vertex_count].
    is_inner: Vec<bool>,
    /// Whether only what makes the worst better is done.
    improves: bool,
}

impl Filling {
    fn rounds(&mut self, random: &mut Random) {
        for _ in 0..ROUNDS {
            for vertex in 0..self.vertices.len() {
                self.push(vertex, random);
            }
            // Their number changes on the way.
            let mut tet = 0;
            while tet < self.tets.len() {
                self.exchange(tet, random);
                tet += 1;
            }
        }
    }

    fn finish(self) -> Result<TetMesh> {
        let (mesh, _) = TetMesh::new(self.vertices, self.tets, self.regions)
            .context("an unstructured mesh of the studies")?;
        Ok(mesh)
    }

    fn new(mesh: &TetMesh) -> Self {
        let mut is_inner = vec![true; mesh.vertices().len()];
        for v in boundary_surface(mesh).mesh_vertices {
            is_inner[v as usize] = false;
        }
        let mut around = vec![Vec::new(); mesh.vertices().len()];
        for (number, tet) in (0..).zip(mesh.tets()) {
            tet.iter().for_each(|&v| around[v as usize].push(number));
        }
        let (vertices, tets) = (mesh.vertices().to_vec(), mesh.tets().to_vec());
        let regions = mesh.regions().to_vec();
        for (is_inner, around) in is_inner.iter_mut().zip(&around) {
            let region = |tet: &u32| regions[*tet as usize];
            *is_inner &= around.iter().all(|tet| region(tet) == region(&around[0]));
        }
        Self { vertices, tets, regions, around, is_inner, improves: false }
    }

    fn corners(&self, tet: [u32; 4]) -> [Vec3<f64>; 4] {
        tet.map(|v| self.vertices[v as usize])
    }

    fn quality(&self, tet: [u32; 4]) -> f64 {
        shape_quality(self.corners(tet))
    }

    fn volume(&self, tet: [u32; 4]) -> f64 {
        viscera::mesh::tet_volume(self.corners(tet))
    }

    /// The worst around a vertex.
    fn worst_around(&self, vertex: usize) -> f64 {
        let qualities = self.around[vertex].iter().map(|&t| self.quality(self.tets[t as usize]));
        qualities.fold(f64::INFINITY, f64::min)
    }

    /// Pushes an inner vertex where that leaves sound tetrahedra, or better ones than were there.
    fn push(&mut self, vertex: usize, random: &mut Random) {
        let way = random.vector(1.0);
        if !self.is_inner[vertex] {
            return;
        }
        let place = self.vertices[vertex];
        let (mut sum, mut count) = (0.0, 0.0);
        for &other in self.around[vertex].iter().flat_map(|&t| &self.tets[t as usize]) {
            sum += (self.vertices[other as usize] - place).length();
            count += f64::from(u8::from(other as usize != vertex));
        }
        let before = self.worst_around(vertex);
        self.vertices[vertex] = place + way * (PUSH * sum / count);
        let least = if self.improves { before } else { before.min(LEAST_QUALITY) };
        if self.worst_around(vertex) < least {
            self.vertices[vertex] = place;
        }
    }

    /// Tetrahedra that have all of these vertices.
    fn with(&self, vertices: &[u32]) -> Vec<u32> {
        let has_all = |&&t: &&u32| vertices.iter().all(|v| self.tets[t as usize].contains(v));
        self.around[vertices[0] as usize].iter().filter(has_all).copied().collect()
    }

    /// Exchanges a tetrahedron with its neighbour across a face, or with the others around an edge, one as often as the
    /// other, where that leaves sound ones.
    fn exchange(&mut self, tet: usize, random: &mut Random) {
        let [turn, kind] = [random.bits() as usize % 4, random.bits() as usize % 2];
        let mut tet = self.tets[tet];
        tet.rotate_left(turn);
        let [apex, a, b, c] = tet;
        let (shared, count): (&[u32], _) = if kind == 0 { (&[a, b, c], 2) } else { (&[a, b], 3) };
        let old = self.with(shared);
        let region = |tet: u32| self.regions[tet as usize];
        if old.len() != count || old.iter().any(|&tet| region(tet) != region(old[0])) {
            return;
        }
        let corners = old.iter().flat_map(|&t| self.tets[t as usize]);
        let mut others: Vec<u32> =
            corners.filter(|v| *v != apex && !tet[1..=shared.len()].contains(v)).collect();
        others.sort_unstable();
        others.dedup();
        let new = match (shared, &others[..]) {
            (&[a, b, c], &[far]) => {
                [[a, b], [b, c], [c, a]].map(|[v, w]| [apex, far, v, w]).to_vec()
            }
            (&[a, b], &[v, w]) => vec![[apex, v, w, a], [apex, v, w, b]],
            // The edge lies on the boundary.
            _ => return,
        };
        self.replace(&old, new);
    }

    /// Puts tetrahedra in the place of others, if they are sound and fill the same room.
    fn replace(&mut self, old: &[u32], mut new: Vec<[u32; 4]>) {
        for tet in &mut new {
            if self.volume(*tet) < 0.0 {
                tet.swap(2, 3);
            }
        }
        let before: f64 = old.iter().map(|&t| self.volume(self.tets[t as usize])).sum();
        let after: f64 = new.iter().map(|tet| self.volume(*tet)).sum();
        let qualities = old.iter().map(|&t| self.quality(self.tets[t as usize]));
        let least = match self.improves {
            true => qualities.fold(f64::INFINITY, f64::min),
            false => LEAST_QUALITY,
        };
        let is_sound = new.iter().all(|tet| self.quality(*tet) >= least);
        if !is_sound || (after - before).abs() > SAME_VOLUME * before {
            return;
        }
        for &t in old {
            for v in self.tets[t as usize] {
                self.around[v as usize].retain(|other| *other != t);
            }
        }
        // Three for two: the third is appended. Two for three: the last of all moves to the free place.
        let mut places = old.to_vec();
        if new.len() > old.len() {
            places.push(self.tets.len() as u32);
            self.tets.push([0; 4]);
            self.regions.push(self.regions[old[0] as usize]);
        }
        for (&place, tet) in places.iter().zip(&new) {
            self.tets[place as usize] = *tet;
            tet.iter().for_each(|&v| self.around[v as usize].push(place));
        }
        if let Some(&free) = places.get(new.len()) {
            self.close(free);
        }
    }

    /// Moves the last tetrahedron to a place that is free.
    fn close(&mut self, free: u32) {
        let last = self.tets.len() as u32 - 1;
        let (Some(tet), Some(region)) = (self.tets.pop(), self.regions.pop()) else { return };
        if free == last {
            return;
        }
        self.tets[free as usize] = tet;
        self.regions[free as usize] = region;
        for v in tet {
            for number in &mut self.around[v as usize] {
                if *number == last {
                    *number = free;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::mesh::topology::vertex_tets;
    use viscera::scalar::vec3;

    /// As the studies mesh a bar of boxes, where an inner vertex has 24 tetrahedra around it.
    fn boxes() -> TetMesh {
        use viscera::mesh::shapes::{Block, Splitting};
        let block = Block {
            splitting: Splitting::Six,
            jitter: 0.6,
            ..Block::new(vec3(0.2, 0.05, 0.05), [20, 5, 5])
        };
        block.mesh().expect("a mesh")
    }

    #[test]
    fn no_order_is_left_and_the_body_stays() {
        let (before, after) = (boxes(), shuffled(&boxes(), 1).expect("a mesh"));
        assert!((after.volume() / before.volume() - 1.0).abs() < 1e-9);
        let outside = |mesh: &TetMesh| {
            let of = boundary_surface(mesh).mesh_vertices;
            of.into_iter().map(|v| (v, mesh.vertices()[v as usize])).collect::<Vec<_>>()
        };
        assert_eq!(outside(&before), outside(&after));
        let worst = (0..after.tets().len()).map(|t| shape_quality(after.corners(t)));
        assert!(worst.fold(f64::INFINITY, f64::min) > 0.9 * LEAST_QUALITY);

        let around = vertex_tets(&after);
        let is_outside: Vec<u32> = boundary_surface(&after).mesh_vertices;
        let inner = (0..after.vertices().len()).filter(|&v| !is_outside.contains(&(v as u32)));
        let mut counts: Vec<usize> = inner.map(|v| around.around(v).len()).collect();
        counts.sort_unstable();
        let [low, high] = [counts[counts.len() / 10], counts[counts.len() * 9 / 10]];
        println!(
            "{} tets, a tenth has up to {low} of them around it, another {high} or more",
            after.tets().len()
        );
        assert!(low <= 22 && high >= 28, "{counts:?}");
    }

    /// What lies on either side of a plane stays there, to the bit of its faces.
    #[test]
    fn regions_keep_their_faces() {
        let mesh = boxes();
        let is_low = |x: Vec3<f64>| x.z < 0.02;
        let regions = |mesh: &TetMesh| -> Vec<u32> {
            let middle = |tet| mesh.corners(tet).iter().fold(Vec3::ZERO, |sum, x| sum + *x) * 0.25;
            (0..mesh.tets().len()).map(|tet| u32::from(is_low(middle(tet)))).collect()
        };
        let (vertices, tets) = (mesh.vertices().to_vec(), mesh.tets().to_vec());
        let mesh = TetMesh::new(vertices, tets, regions(&mesh)).expect("the same mesh").0;
        let after = shuffled(&mesh, 2).expect("a mesh");
        let volume = |mesh: &TetMesh, region: u32| -> f64 {
            let of = (0..mesh.tets().len()).filter(|&tet| mesh.regions()[tet] == region);
            of.map(|tet| viscera::mesh::tet_volume(mesh.corners(tet))).sum()
        };
        assert_ne!(mesh.tets().len(), after.tets().len());
        for region in [0, 1] {
            let [before, after] = [&mesh, &after].map(|mesh| volume(mesh, region));
            assert!((after / before - 1.0).abs() < 1e-9, "{before} {after}");
        }
        let outside = |mesh: &TetMesh, region: u32| {
            let tets = mesh.tets().iter().zip(mesh.regions());
            let tets: Vec<_> = tets.filter(|(_, of)| **of == region).map(|(tet, _)| *tet).collect();
            let (regions, vertices) = (vec![0; tets.len()], mesh.vertices().to_vec());
            let part = TetMesh::new(vertices, tets, regions).expect("a part").0;
            let mut places = boundary_surface(&part).surface.vertices;
            places.sort_unstable_by(|a, b| {
                a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
            });
            places
        };
        assert_eq!(outside(&mesh, 1), outside(&after, 1));
    }

    #[test]
    fn the_seed_decides() {
        let of = |seed| shuffled(&boxes(), seed).expect("a mesh");
        assert_eq!(of(3), of(3));
        assert_ne!(of(3), of(4));
    }
}
