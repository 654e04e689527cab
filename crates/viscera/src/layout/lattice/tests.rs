use std::collections::{BTreeMap, BTreeSet};

use super::*;
use crate::mesh::shapes::{Block, Splitting};
use crate::mesh::topology::TET_EDGES;
use crate::scalar::{Mat3, vec3};

/// Weights are rounded to single precision, by half a unit of the last place; their sums are at most 1, and compared in pairs.
const ROUND_OFF: f64 = f32::EPSILON as f64;

/// Places `[m]`, tetrahedra, links.
#[derive(Clone)]
struct Part {
    places: Vec<Vec3<f64>>,
    tets: Vec<[u32; 4]>,
    links: Vec<[u32; 2]>,
}

impl Part {
    /// Cubes with an edge of 1 m and six tetrahedra each: the finest spacing is 2 m.
    fn cubes(cells: [usize; 3]) -> Self {
        let size = vec3(cells[0] as f64, cells[1] as f64, cells[2] as f64);
        Self::of(&Block { splitting: Splitting::Six, ..Block::new(size, cells) })
    }

    fn of(block: &Block) -> Self {
        let mesh = block.mesh().expect("a block");
        Self { places: mesh.vertices().to_vec(), tets: mesh.tets().to_vec(), links: Vec::new() }
    }

    /// Apart in the plane y = `height`, beyond x = `tip`: its vertices there are doubled.
    fn cut(mut self, height: f64, tip: f64) -> Self {
        let old_count = self.places.len();
        let mut double = vec![None; old_count];
        for v in 0..old_count {
            let x = self.places[v];
            if x.y == height && x.x > tip {
                double[v] = Some(self.places.len() as u32);
                self.places.push(x);
            }
        }
        for tet in &mut self.tets {
            let is_above = tet.iter().any(|&v| self.places[v as usize].y > height);
            for v in tet.iter_mut().filter(|_| is_above) {
                *v = double.get(*v as usize).copied().flatten().unwrap_or(*v);
            }
        }
        assert!(self.places.len() > old_count);
        self
    }

    /// Turned by 37 degrees about an axis along no edge, scaled, moved: no coordinate is a round number.
    fn turned(mut self) -> Self {
        let axis = vec3(2.0, -1.0, 3.0);
        let axis = axis * (1.0 / axis.length());
        let (sine, cosine) = libm::sincos(37.0_f64.to_radians());
        let turn = |x: Vec3<f64>| {
            x * cosine + axis.cross(x) * sine + axis * (axis.dot(x) * (1.0 - cosine))
        };
        self.places.iter_mut().for_each(|x| *x = turn(*x) * 0.01 + vec3(0.31, -5.7, 0.123));
        self
    }

    fn lattice(&self, most_coarse: usize) -> Lattice {
        Lattice::new(&self.places, &self.tets, &self.links, most_coarse)
    }

    /// The vertices that elements tie to each.
    fn neighbors(&self) -> Vec<BTreeSet<usize>> {
        let mut neighbors = vec![BTreeSet::new(); self.places.len()];
        let of_tets = self.tets.iter().flat_map(|tet| TET_EDGES.map(|edge| edge.map(|c| tet[c])));
        for [a, b] in of_tets.chain(self.links.iter().copied()) {
            neighbors[a as usize].insert(b as usize);
            neighbors[b as usize].insert(a as usize);
        }
        neighbors
    }

    /// Pairs of vertices that hang together where both are in a support, smaller vertices first.
    fn pairs(&self) -> BTreeSet<[usize; 2]> {
        let neighbors = self.neighbors();
        let with = |v: usize| neighbors[v].iter().map(move |&other| [v, other]);
        (0..neighbors.len()).flat_map(with).filter(|[a, b]| a < b).collect()
    }
}

fn jittered() -> Part {
    let block = Block::new(vec3(0.12, 0.07, 0.09), [12, 7, 9]);
    Part::of(&Block { jitter: 0.8, seed: 5, ..block })
}

/// The sides of the slit are at y = 6, apart beyond x = 8.
fn slit() -> Part {
    Part::cubes([24, 12, 4]).cut(6.0, 8.0)
}

/// Two plates with a gap of half a metre, tied by one long spring at x = 0.
fn plates() -> Part {
    let mut part = Part::cubes([16, 6, 3]);
    let count = part.places.len() as u32;
    let other: Vec<_> = part.places.iter().map(|x| *x + vec3(0.0, 0.0, 3.5)).collect();
    part.places.extend(other);
    let other: Vec<_> = part.tets.iter().map(|tet| tet.map(|v| v + count)).collect();
    part.tets.extend(other);
    part.links.push([0, count]);
    part
}

/// A block with a chain of springs, so long that some supports have the ends of one and nothing else.
fn chain() -> Part {
    let mut part = Part::cubes([10, 6, 6]);
    for i in 1..9 {
        let last = part.places.len() as u32;
        part.places.push(vec3(10.0 + 1.5 * f64::from(i), 6.0, 6.0));
        part.links.push([last - 1, last]);
    }
    part
}

/// Convex, without cuts.
fn whole_parts() -> Vec<(&'static str, Part)> {
    // The finest spacing is twice the cells', so that every second layer of jittered vertices is around a plane.
    let block = Block { splitting: Splitting::Six, ..Block::new(vec3(1.4, 0.8, 0.6), [14, 8, 6]) };
    vec![
        ("bar", Part::cubes([20, 5, 5])),
        ("turned bar", Part::cubes([20, 5, 5]).turned()),
        ("jittered", jittered()),
        ("turned jittered", jittered().turned()),
        ("jittered about planes", Part::of(&Block { jitter: 0.8, seed: 3, ..block })),
    ]
}

fn all_parts() -> Vec<(&'static str, Part)> {
    let cut = [
        ("slit", slit()),
        ("turned slit", slit().turned()),
        ("plates", plates()),
        ("chain", chain()),
    ];
    whole_parts().into_iter().chain(cut).collect()
}

fn spacing_of(lattice: &Lattice, level: usize) -> f64 {
    lattice.spacing * f64::powi(2.0, level as i32)
}

/// Where a node lies `[m]`.
fn place_of(lattice: &Lattice, level: usize, node: u32) -> Vec3<f64> {
    let k = lattice.levels[level].points[node as usize].map(f64::from);
    lattice.axes.transpose() * (lattice.origin + Vec3::from_f64(k) * spacing_of(lattice, level))
}

fn nodes_of(level: &Level, vertex: usize) -> BTreeSet<u32> {
    level.of_vertices.of(vertex).iter().map(|&(node, _)| node).collect()
}

/// Pairs of copies of one lattice point.
fn copies(level: &Level) -> Vec<[u32; 2]> {
    let pairs = level.points.windows(2).enumerate();
    pairs.filter(|(_, p)| p[0] == p[1]).map(|(n, _)| [n as u32, n as u32 + 1]).collect()
}

#[test]
fn weights_add_up_to_one_and_carry_linear_functions() {
    let slope = Mat3::from_columns(vec3(1.0, -2.0, 0.3), vec3(0.7, 4.0, 1.0), vec3(-3.0, 0.1, 2.0));
    for (name, part) in all_parts() {
        let lattice = part.lattice(10);
        assert!(lattice.levels.len() >= 3, "{name}: {} levels", lattice.levels.len());
        for (l, level) in lattice.levels.iter().enumerate() {
            assert_eq!(level.of_vertices.offsets.len(), part.places.len() + 1);
            // Places of nodes and of vertices, as far as the farthest point of the lattice is away.
            let reach = lattice.origin.length() + part.places[0].length();
            let tolerance = 10.0 * ROUND_OFF * (reach + 3.0 * spacing_of(&lattice, l) + 30.0);
            for (v, x) in part.places.iter().enumerate() {
                let entries = level.of_vertices.of(v);
                assert!((1..=8).contains(&entries.len()));
                assert!(entries.iter().all(|&(_, w)| w > 0.0 && w <= 1.0));
                assert!(entries.windows(2).all(|pair| pair[0].0 < pair[1].0), "{name}: order");
                let sum: f64 = entries.iter().map(|&(_, w)| f64::from(w)).sum();
                assert!((sum - 1.0).abs() < ROUND_OFF, "{name} {l} {v}: {sum}");
                let carried = entries.iter().fold(Vec3::ZERO, |sum, &(node, w)| {
                    sum + slope * place_of(&lattice, l, node) * f64::from(w)
                });
                let error = (carried - slope * *x).length();
                assert!(error < tolerance, "{name} {l} {v}: {error}");
            }
        }
    }
}

#[test]
fn each_level_is_within_the_next_finer() {
    for (name, part) in all_parts() {
        let lattice = part.lattice(10);
        assert_eq!(lattice.levels[0].of_finer, Weights::default());
        for pair in lattice.levels.windows(2) {
            let (finer, coarser) = (&pair[0], &pair[1]);
            assert_eq!(coarser.of_finer.offsets.len(), finer.node_count() + 1);
            for node in 0..finer.node_count() {
                let sum: f32 = coarser.of_finer.of(node).iter().map(|&(_, w)| w).sum();
                assert_eq!(sum, 1.0, "{name}: parents of {node}");
            }
            for v in 0..part.places.len() {
                let mut composed = BTreeMap::new();
                for &(node, weight) in finer.of_vertices.of(v) {
                    for &(parent, share) in coarser.of_finer.of(node as usize) {
                        *composed.entry(parent).or_insert(0.0) +=
                            f64::from(weight) * f64::from(share);
                    }
                }
                let direct = coarser.of_vertices.of(v);
                assert_eq!(composed.len(), direct.len(), "{name}: {v}");
                for (&(node, weight), (other, sum)) in direct.iter().zip(composed) {
                    assert_eq!(node, other, "{name}: {v}");
                    assert!(
                        (f64::from(weight) - sum).abs() < ROUND_OFF,
                        "{name}: {v}: {weight} {sum}"
                    );
                }
            }
        }
    }
}

/// Copies of a point are the components of its support: whatever hangs together in the support is in one copy, and what
/// is in one copy hangs together within it.
#[test]
fn copies_are_the_components_of_supports() {
    for (name, part) in all_parts() {
        let pairs = part.pairs();
        for level in &part.lattice(10).levels {
            let mut members = vec![BTreeSet::new(); level.node_count()];
            let nodes: Vec<BTreeMap<[u32; 3], u32>> = (0..part.places.len())
                .map(|v| {
                    nodes_of(level, v).into_iter().map(|n| (level.points[n as usize], n)).collect()
                })
                .collect();
            for (v, nodes) in nodes.iter().enumerate() {
                assert_eq!(
                    nodes.len(),
                    level.of_vertices.of(v).len(),
                    "{name}: two copies of one point"
                );
                nodes.values().for_each(|&node| _ = members[node as usize].insert(v));
            }
            let mut ties = vec![Vec::new(); level.node_count()];
            for &[a, b] in &pairs {
                for (point, &node) in &nodes[a] {
                    if let Some(&other) = nodes[b].get(point) {
                        assert_eq!(node, other, "{name}: {a} and {b} hang together");
                        ties[node as usize].push([a, b]);
                    }
                }
            }
            let order = |node: usize| {
                (z_order(level.points[node].map(u64::from)), members[node].first().copied())
            };
            assert!(
                (0..members.len()).is_sorted_by_key(order),
                "{name}: by point, then first vertex"
            );
            for (members, ties) in members.iter().zip(&ties) {
                // Labels spread along ties until none changes.
                let mut labels: BTreeMap<usize, usize> = members.iter().map(|&v| (v, v)).collect();
                let mut changed = true;
                while changed {
                    changed = false;
                    for &[a, b] in ties {
                        let lower = labels[&a].min(labels[&b]);
                        changed |= labels.insert(a, lower) != Some(lower);
                        changed |= labels.insert(b, lower) != Some(lower);
                    }
                }
                let labels: BTreeSet<usize> = labels.into_values().collect();
                assert_eq!(labels.len(), 1, "{name}: a node has several components");
            }
        }
    }
}

/// Wherever the planes of the lattice run: a vertex or two at the corner of a support may have a node of their own, which
/// separates nothing; all others of the support are together.
#[test]
fn what_is_whole_is_split_at_the_corners_of_supports_alone() {
    for (name, part) in whole_parts() {
        for level in part.lattice(0).levels {
            let mut sizes = vec![0; level.node_count()];
            level.of_vertices.entries.iter().for_each(|&(node, _)| sizes[node as usize] += 1);
            let mut copies = 0;
            for of_point in (0..sizes.len())
                .collect::<Vec<_>>()
                .chunk_by(|&a, &b| level.points[a] == level.points[b])
            {
                let mut sizes: Vec<usize> = of_point.iter().map(|&node| sizes[node]).collect();
                sizes.sort_unstable();
                sizes.pop();
                copies += sizes.len();
                assert!(sizes.iter().all(|&size| size <= 3), "{name}: {sizes:?}");
            }
            assert!(3 * copies <= level.node_count(), "{name}: {copies} of {}", level.node_count());
        }
    }
}

#[test]
fn a_bar_has_every_point_once() {
    let bar = Part::cubes([20, 5, 5]);
    let counts = |part: &Part, most| -> Vec<usize> {
        part.lattice(most).levels.iter().map(Level::node_count).collect()
    };
    // Spacings 2, 4, 8, 16, 32 m: 10, 5, 2.5, 1.25, 0.625 along the bar, a quarter of that across.
    assert_eq!(counts(&bar, 0), [11 * 4 * 4, 6 * 3 * 3, 4 * 2 * 2, 3 * 2 * 2, 2 * 2 * 2]);
    assert_eq!(counts(&bar, 32), [176, 54, 16]);
    assert_eq!(counts(&bar, 54), [176, 54]);
    assert_eq!(counts(&bar, 1000), [176]);
    let lattice = bar.lattice(0);
    assert!((lattice.spacing - 2.0).abs() < 1e-12);
    assert_eq!(lattice.origin, Vec3::ZERO);
    let all: BTreeSet<_> = lattice.levels[0].points.iter().collect();
    assert_eq!(all.len(), 176);
    // Round-off moves vertices off the planes of the lattice; it makes no nodes beside them.
    let mut odd = bar.clone();
    odd.places.iter_mut().for_each(|x| *x = *x * (0.1 / 3.0) + vec3(0.37, -1.1, 17.3));
    assert_eq!(counts(&odd, 0), counts(&bar, 0));
    // In its own planes a vertex has one node, beside one plane two.
    let of_first = lattice.levels[0].of_vertices.of(0);
    assert_eq!(of_first, [(0, 1.0)]);
    assert_eq!(lattice.levels[0].of_vertices.of(1).len(), 2);
}

#[test]
fn the_sides_of_a_slit_move_apart() {
    let part = slit();
    let lattice = part.lattice(0);
    let first_double = Part::cubes([24, 12, 4]).places.len();
    let mut split_levels = 0;
    for (l, level) in lattice.levels.iter().enumerate() {
        let spacing = spacing_of(&lattice, l);
        // A node that moves a vertex here has nothing at x = 8, the tip, in its support.
        let is_far = |v: &usize| part.places[*v].x >= 8.0 + 2.0 * spacing;
        let all = (0..part.places.len()).filter(is_far);
        let (upper, lower): (Vec<usize>, Vec<usize>) =
            all.partition(|&v| part.places[v].y > 6.0 || v >= first_double);
        let nodes = |side: &[usize]| -> BTreeSet<u32> {
            side.iter().flat_map(|&v| nodes_of(level, v)).collect()
        };
        assert!(nodes(&upper).is_disjoint(&nodes(&lower)), "level {l}");
        // 1 above, 0 below: the function that moves the sides apart is one of the level's.
        let above = nodes(&upper);
        for v in upper.iter().chain(&lower) {
            let value: f64 = (level.of_vertices.of(*v).iter())
                .filter(|(node, _)| above.contains(node))
                .map(|&(_, w)| f64::from(w))
                .sum();
            let expected = f64::from(u8::from(upper.contains(v)));
            assert!((value - expected).abs() < ROUND_OFF);
        }
        let split = copies(level);
        split_levels += usize::from(!split.is_empty());
        for node in split.as_flattened() {
            let place = place_of(&lattice, l, *node);
            assert!(place.x > 8.0 + spacing - 1e-9, "level {l}: a copy before the tip of the slit");
            assert!((place.y - 6.0).abs() < spacing, "level {l}: a copy beside the slit");
        }
        let whole = Part::cubes([24, 12, 4]).lattice(0);
        assert_eq!(level.node_count(), whole.levels[l].node_count() + split.len(), "level {l}");
    }
    // Every second vertex from x = 10 to 24 and from z = 0 to 4, at y = 6.
    assert_eq!(copies(&lattice.levels[0]).len(), 8 * 3);
    assert!(split_levels >= 2, "{split_levels}");
}

#[test]
fn a_link_joins_what_no_tetrahedron_does() {
    let tied = plates();
    let free = Part { links: Vec::new(), ..tied.clone() };
    let [tied, free] = [&tied, &free].map(|part| part.lattice(0));
    let is_whole = |level: &Level, point: [u32; 3]| {
        level.points.iter().filter(|&&other| other == point).count() == 1
    };
    // The spring runs from z = 0 to z = 3.5 above the origin. Spaced 4 m or 8 m, the point at the origin reaches both of
    // its ends.
    for (l, point) in [(1, [0, 0, 0]), (2, [0, 0, 0])] {
        assert!(!is_whole(&free.levels[l], point), "level {l}");
        assert!(is_whole(&tied.levels[l], point), "level {l}");
    }
    // Away from the spring it changes nothing.
    for (l, point) in [[2, 0, 1], [4, 0, 0], [2, 0, 0]].into_iter().enumerate() {
        assert!(!is_whole(&tied.levels[l], point), "level {l}");
    }
}

#[test]
fn small_parts_have_no_levels() {
    let corners = [[0.0; 3], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0; 3]];
    let places = corners.map(Vec3::from_f64);
    let tets = [[0, 1, 2, 3], [1, 2, 3, 4]];
    let none = Lattice::default();
    assert_eq!(Lattice::new(&places[..4], &tets[..1], &[], 0), none);
    assert_eq!(Lattice::new(&places, &tets, &[], 0), none);
    assert_eq!(Lattice::new(&places[..1], &[], &[], 0), none);
    assert_eq!(Lattice::new(&[], &[], &[], 0), none);
    // A chain of springs alone has no cells.
    let chain: Vec<Vec3<f64>> = (0..100).map(|i| vec3(f64::from(i), 0.0, 0.0)).collect();
    let links: Vec<[u32; 2]> = (1..100).map(|i| [i - 1, i]).collect();
    assert_eq!(Lattice::new(&chain, &[], &links, 0), none);
    // Nor has a block that a spring ties to what is more cells away than their numbers have bits.
    let tied = |distance: f64| {
        let mut part = Part::cubes([3, 2, 2]);
        part.links.push([0, part.places.len() as u32]);
        part.places.push(vec3(distance, 0.0, 0.0));
        part
    };
    assert_eq!(tied(4e6).lattice(0).levels[0].node_count(), 12 + 1);
    assert_eq!(tied(5e6).lattice(0), none);
    assert!(cell_order(&[], &[]).is_empty());
    assert_eq!(cell_order(&places[..1], &[]), [0]);
    for part in [tied(4e6), tied(5e6), Part { tets: Vec::new(), ..tied(9.0) }] {
        let order = cell_order(&part.places, &part.tets);
        assert_eq!((order[0], order.len()), (0, part.places.len()));
        assert_eq!(order.iter().max(), order.last(), "the far vertex stands last");
    }
    // 12 nodes for 24 vertices are too many, 12 for 36 are not.
    assert_eq!(Part::cubes([3, 2, 1]).lattice(0), none);
    assert_eq!(Part::cubes([3, 2, 2]).lattice(0).levels[0].node_count(), 12);
}

#[test]
fn numbers_of_vertices_do_not_matter() {
    for part in [slit(), jittered().turned(), plates()] {
        let count = part.places.len();
        // A permutation, as the factor has no divisor in common with the count.
        let factor = (count / 3..).find(|f| (2..=*f).all(|d| f % d + count % d > 0)).expect("one");
        let new: Vec<usize> = (0..count).map(|v| (v * factor + 7) % count).collect();
        let mut places = vec![Vec3::ZERO; count];
        (0..count).for_each(|v| places[new[v]] = part.places[v]);
        let number = |v: u32| new[v as usize] as u32;
        let tets = part.tets.iter().map(|tet| tet.map(number)).collect();
        let links = part.links.iter().map(|link| link.map(number)).collect();
        let permuted = Part { places, tets, links };
        let (a, b) = (part.lattice(10), permuted.lattice(10));
        assert_eq!(
            (a.spacing, a.axes, a.origin, a.levels.len()),
            (b.spacing, b.axes, b.origin, b.levels.len())
        );
        for (a, b) in a.levels.iter().zip(&b.levels) {
            assert_eq!(a.points, b.points);
            let mut renamed = BTreeMap::new();
            for v in 0..count {
                let sorted = |level: &Level, v: usize| {
                    let entries = level.of_vertices.of(v).iter();
                    let mut all: Vec<_> =
                        entries.map(|&(n, w)| (level.points[n as usize], w.to_bits(), n)).collect();
                    all.sort_unstable();
                    all
                };
                for (old, new) in sorted(a, v).into_iter().zip(sorted(b, new[v])) {
                    assert_eq!((old.0, old.1), (new.0, new.1));
                    // One node of the one for each node of the other.
                    assert_eq!(*renamed.entry(old.2).or_insert(new.2), new.2);
                }
                assert_eq!(sorted(a, v).len(), sorted(b, new[v]).len());
            }
            let names: BTreeSet<u32> = renamed.values().copied().collect();
            assert_eq!((renamed.len(), names.len()), (a.node_count(), b.node_count()));
        }
    }
}

#[test]
fn vertices_stand_cell_by_cell() {
    for part in [Part::cubes([20, 5, 5]), jittered().turned()] {
        let keys = cell_order(&part.places, &part.tets);
        let lattice = part.lattice(0);
        let mut order: Vec<usize> = (0..keys.len()).collect();
        order.sort_unstable_by_key(|&v| keys[v]);
        // Blocks of cells, cells, and halves and quarters of cells: each stands in one row.
        for size in [4.0, 2.0, 1.0, 0.5, 0.25] {
            let cell = |v: usize| {
                let x = lattice.along_axes(part.places[v]);
                x.to_array().map(|x| (x / (size * lattice.spacing) + 1e-9).floor() as u64)
            };
            let mut cells: Vec<[u64; 3]> = order.iter().map(|&v| cell(v)).collect();
            cells.dedup();
            let rows = cells.len();
            assert!(cells.is_sorted_by_key(|&cell| z_order(cell)));
            assert_eq!(cells.into_iter().collect::<BTreeSet<_>>().len(), rows, "cells of {size}");
        }
    }
}
