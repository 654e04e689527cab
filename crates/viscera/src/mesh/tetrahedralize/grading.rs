//! Larger tetrahedra deep inside of a shape: an octree over the cubes of the lattice.
//!
//! F. Labelle and J. R. Shewchuk, "Isosurface Stuffing", SIGGRAPH 2007, section 3. Eight cubes that lie deep enough become
//! one of twice their edge, and so on. Each cube is six pyramids around its centre, one on each face:
//!
//! ```text
//! two cubes of one size     the pyramids on both sides of the face are cut into four around the line between the centres;
//!                           where smaller cubes put a vertex into the middle of an edge, the one at that edge is cut in two
//! a cube beside four of     on its side eight: a fan around the face's centre, through its corners and the middles of its
//!     half its edge         edges; on theirs two for each, cut by the diagonal that ends in the face's centre
//! ```
//!
//! Cubes that touch, if only in a corner, differ by a factor of two at most, and all tetrahedra that a larger one has a part in have
//! all their corners inside, where the lattice left them. Their dihedral angles are those of undisturbed cubes, 45 to 120
//! degrees, and the bounds of the others stay what they are.

use super::super::lattice::{Corner, Lattice, Sign};

/// Cubes of one edge length, by their levels.
pub(in crate::mesh) struct Grading {
    /// Cubes of the lattice along each axis.
    cubes: [usize; 3],
    /// The lowest cube of the lattice that a larger one may begin with.
    origin: [usize; 3],
    /// The level of the cube that each cube of the lattice is part of: n for an edge of 2^(n-1); [`NEAR`] for those that have a
    /// vertex on the surface or outside.
    levels: Vec<u8>,
    coarsest: u8,
}

const NEAR: u8 = 0;
const FINEST: u8 = 1;

impl Grading {
    /// Of a lattice that was warped. Edges inside are at most `2^doublings` as long as at the surface.
    pub fn new(lattice: &Lattice, doublings: u32) -> Self {
        let cubes = lattice.cubes();
        let mut levels = vec![NEAR; cubes.iter().product()];
        let is_inside = |at: [usize; 3]| lattice.corner(at).sign == Sign::Inside;
        // The last cubes along each axis have no upper corners; they are outside.
        for_each(cubes.map(|n| n - 1), |[i, j, k]| {
            let [x, y, z] = [i, j, k].map(|n| 2 * n);
            let is_deep = is_inside([x + 1, y + 1, z + 1])
                && (0..8).all(|c| is_inside([x + 2 * (c & 1), y + (c & 2), z + (c & 4) / 2]));
            if is_deep {
                levels[i + cubes[0] * (j + cubes[1] * k)] = FINEST;
            }
        });
        // A level more than any lattice has room for is none.
        let coarsest = FINEST + doublings.min(u8::BITS) as u8;
        // Where cubes begin decides how many find room: of all eight ways the one that merges most.
        let tries = (0..8).map(|n| {
            let origin = [n & 1, n >> 1 & 1, n >> 2];
            let mut grading = Self { cubes, origin, levels: levels.clone(), coarsest };
            for level in FINEST + 1..=coarsest {
                grading.merge(lattice, level);
            }
            grading
        });
        let merged = |grading: &Self| grading.levels.iter().filter(|&&l| l > FINEST).count();
        let most = |best: Self, next: Self| if merged(&next) > merged(&best) { next } else { best };
        let uniform = Self { cubes, origin: [0; 3], levels: Vec::new(), coarsest: FINEST };
        tries.fold(uniform, most)
    }

    /// Makes cubes of a level of eight of the one below.
    fn merge(&mut self, lattice: &Lattice, level: u8) {
        let edge = edge_of(level);
        let mut large = Vec::new();
        self.for_each_block(edge, |low| {
            if self.has_room(lattice, low, level) {
                large.push(low);
            }
        });
        for low in large {
            for_each([edge; 3], |[i, j, k]| {
                let index = self.index([low[0] + i, low[1] + j, low[2] + k]);
                self.levels[index] = level;
            });
        }
    }

    /// Calls `visit` with the lowest cube of each place for a cube of an edge length.
    fn for_each_block(&self, edge: usize, mut visit: impl FnMut([usize; 3])) {
        let count: [usize; 3] = std::array::from_fn(|a| (self.cubes[a] - self.origin[a]) / edge);
        for_each(count, |block| visit(std::array::from_fn(|a| self.origin[a] + block[a] * edge)));
    }

    /// Whether a cube of a level can begin here.
    fn has_room(&self, lattice: &Lattice, low: [usize; 3], level: u8) -> bool {
        let (edge, half) = (edge_of(level), edge_of(level - 1));
        // Cubes of the lattice are neighbours of the smallest blocks whatever they are; of others all around must be half as large.
        let margin = if level == FINEST + 1 { 0 } else { half };
        let is_within = (0..3).all(|a| low[a] >= half && low[a] + edge + half <= self.cubes[a]);
        let mut has_room = is_within && self.level(low) == level - 1;
        if has_room {
            for_each([edge + 2 * margin; 3], |[i, j, k]| {
                let at = [low[0] + i - margin, low[1] + j - margin, low[2] + k - margin];
                has_room &= self.level(at) >= level - 1;
            });
        }
        // Pyramids of neighbours reach from this one's faces to their centres.
        has_room
            && (0..6).all(|face| {
                let face = Face { low, edge, axis: face / 2, is_upper: face % 2 == 1 };
                let of_neighbors = |n: usize| face.beyond_at([1 + 2 * (n % 2), 1 + n / 2 * 2], 1);
                level > FINEST + 1
                    || (0..4).all(|n| lattice.corner(of_neighbors(n)).sign == Sign::Inside)
            })
    }

    fn index(&self, [i, j, k]: [usize; 3]) -> usize {
        i + self.cubes[0] * (j + self.cubes[1] * k)
    }

    fn level(&self, cube: [usize; 3]) -> u8 {
        self.levels[self.index(cube)]
    }

    /// Whether a cube of the lattice is one of the finest.
    pub fn is_fine(&self, cube: [usize; 3]) -> bool {
        self.level(cube) <= FINEST
    }

    /// Calls `visit` with each tetrahedron that has a part in a cube that is not one of the finest. All its corners are inside.
    pub fn for_each_tet(&self, lattice: &Lattice, mut visit: impl FnMut([Corner; 4])) {
        for level in FINEST + 1..=self.coarsest {
            let edge = edge_of(level);
            self.for_each_block(edge, |low| {
                if self.level(low) == level {
                    for face in 0..6 {
                        let face = Face { low, edge, axis: face / 2, is_upper: face % 2 == 1 };
                        self.fill(&face, level, &mut |tet| {
                            visit(tet.map(|at| lattice.corner(at)));
                        });
                    }
                }
            });
        }
    }

    /// Fills both pyramids on a face. Positions are doubled, as those of [`Corner`].
    fn fill(&self, face: &Face, level: u8, visit: &mut impl FnMut([[usize; 3]; 4])) {
        let beyond = self.level(face.cube_beyond());
        let (whole, half) = (2 * face.edge, face.edge);
        let center = face.center_of_cube(half);
        if beyond == level {
            // The other cube fills its lower faces.
            if face.is_upper {
                let other = face.shifted(center, whole);
                for side in 0..4 {
                    let [a, b] = [RING[side], RING[(side + 1) % 4]].map(|at| face.at(at, half));
                    if self.is_cut(face, side, level) {
                        let middle = face.at(between(RING[side], RING[(side + 1) % 4]), half);
                        visit([center, other, a, middle]);
                        visit([center, other, middle, b]);
                    } else {
                        visit([center, other, a, b]);
                    }
                }
            }
        } else if beyond < level {
            let middle = face.at([1, 1], half);
            for side in 0..4 {
                let [a, b] = [RING[side], RING[(side + 1) % 4]];
                let [start, cut, end] = [a, between(a, b), b].map(|at| face.at(at, half));
                visit([center, middle, start, cut]);
                visit([center, middle, cut, end]);
                // The smaller cube at the corner: its face goes from there over two middles of edges to the centre.
                let last = face.at(between(RING[(side + 3) % 4], a), half);
                let quarter = a.map(|at| if at == 0 { half / 2 } else { half + half / 2 });
                let small = face.beyond_at(quarter, half / 2);
                visit([small, middle, start, cut]);
                visit([small, middle, last, start]);
            }
        }
        // A larger cube fills both.
    }

    /// Whether smaller cubes put a vertex into the middle of a face's edge: those across the edge.
    fn is_cut(&self, face: &Face, side: usize, level: u8) -> bool {
        face.cubes_across(side).into_iter().any(|cube| self.level(cube) < level)
    }
}

/// A face of a cube.
struct Face {
    /// The cube's lowest cube of the lattice, and its edge in those.
    low: [usize; 3],
    edge: usize,
    /// The axis that the face is across, and whether it is the upper of both.
    axis: usize,
    is_upper: bool,
}

/// Corners of a face around it, in halves of its edge along the two other axes.
const RING: [[usize; 2]; 4] = [[0, 0], [2, 0], [2, 2], [0, 2]];

fn between(a: [usize; 2], b: [usize; 2]) -> [usize; 2] {
    [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2]
}

impl Face {
    fn others(&self) -> [usize; 2] {
        [(self.axis + 1) % 3, (self.axis + 2) % 3]
    }

    /// A point of the face, doubled, in steps of `half` along the two other axes.
    fn at(&self, steps: [usize; 2], half: usize) -> [usize; 3] {
        self.in_plane(steps.map(|n| n * half))
    }

    fn in_plane(&self, offsets: [usize; 2]) -> [usize; 3] {
        let mut at = self.low.map(|n| 2 * n);
        for (axis, offset) in self.others().into_iter().zip(offsets) {
            at[axis] += offset;
        }
        if self.is_upper {
            at[self.axis] += 2 * self.edge;
        }
        at
    }

    /// A point at a distance from the face on its other side, doubled.
    fn beyond_at(&self, offsets: [usize; 2], distance: usize) -> [usize; 3] {
        self.shifted(self.in_plane(offsets), distance)
    }

    /// Outwards by a distance.
    fn shifted(&self, mut at: [usize; 3], distance: usize) -> [usize; 3] {
        let along = &mut at[self.axis];
        *along = if self.is_upper { *along + distance } else { *along - distance };
        at
    }

    fn center_of_cube(&self, half: usize) -> [usize; 3] {
        self.low.map(|n| 2 * n + half)
    }

    /// A cube of the lattice on the other side.
    fn cube_beyond(&self) -> [usize; 3] {
        let mut cube = self.low;
        let along = &mut cube[self.axis];
        *along = if self.is_upper { *along + self.edge } else { *along - 1 };
        cube
    }

    /// Cubes of the lattice across an edge of the face, on both its sides.
    fn cubes_across(&self, side: usize) -> [[usize; 3]; 2] {
        let [u, v] = self.others();
        [self.low, self.cube_beyond()].map(|mut cube| {
            match side {
                0 => cube[v] -= 1,
                1 => cube[u] += self.edge,
                2 => cube[v] += self.edge,
                _ => cube[u] -= 1,
            }
            cube
        })
    }
}

/// In cubes of the lattice.
fn edge_of(level: u8) -> usize {
    1 << (level - FINEST)
}

fn for_each(counts: [usize; 3], mut visit: impl FnMut([usize; 3])) {
    for k in 0..counts[2] {
        for j in 0..counts[1] {
            for i in 0..counts[0] {
                visit([i, j, k]);
            }
        }
    }
}
