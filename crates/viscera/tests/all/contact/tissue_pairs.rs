//! Tissue that meets tissue and is held at every vertex: its forces are sums that can be written down.

use viscera::contact::TissueContact;
use viscera::material::Material;
use viscera::mesh::TetMesh;
use viscera::model::ModelBuilder;
use viscera::scalar::rigid::rotation_matrix;
use viscera::scalar::{Vec3, vec3};
use viscera::solver::Pin;
use viscera::state::State;

use super::tissue::{Bodies, block_at, rubbing};
use super::{METHODS, method};
use crate::common::SNH;

/// Thickness of contact [m].
const THICKNESS: f64 = 1e-3;

/// A regular tetrahedron whose first face has this middle [m] and this outward normal, an edge of it along `along`.
fn facet(middle: Vec3<f64>, normal: Vec3<f64>, along: Vec3<f64>, edge: f64) -> TetMesh {
    let radius = edge / 3f64.sqrt();
    let across = normal.cross(along);
    let corner = |angle: f64| {
        let [cosine, sine] = [libm::cos(angle), libm::sin(angle)];
        middle + (across * cosine + along * sine) * radius
    };
    let third = std::f64::consts::TAU / 3.0;
    let apex = middle - normal * (edge * (2.0f64 / 3.0).sqrt());
    let vertices = vec![corner(0.0), corner(third), corner(-third), apex];
    TetMesh::new(vertices, vec![[0, 1, 2, 3]], vec![0]).expect("a mesh").0
}

/// Middles [m] and outward normals of the faces of a tetrahedron.
fn faces(mesh: &TetMesh) -> Vec<(Vec3<f64>, Vec3<f64>)> {
    let all = viscera::mesh::topology::boundary_faces(mesh.tets());
    let corners = all.into_iter().map(|(_, face)| face.map(|v| mesh.vertices()[v as usize]));
    let face = |[a, b, c]: [Vec3<f64>; 3]| {
        let normal = (b - a).cross(c - a);
        ((a + b + c) * (1.0 / 3.0), normal * (1.0 / normal.length()))
    };
    corners.map(face).collect()
}

/// Bodies of these moduli [Pa], every vertex of which is held; far from each other at rest, so that contact knows nothing of
/// how they stand there.
struct Held {
    bodies: Bodies<f64>,
    /// How far each is from where it has to be [m].
    away: Vec<Vec3<f64>>,
}

impl Held {
    fn new(meshes: Vec<TetMesh>, young: &[f64], contact: &TissueContact, name: &str) -> Self {
        let away: Vec<Vec3<f64>> =
            (0..meshes.len()).map(|body| vec3(0.0, 0.0, 0.3) * body as f64).collect();
        let apart = meshes.iter().zip(&away).map(|(mesh, away)| {
            let vertices = mesh.vertices().iter().map(|x| *x + *away).collect();
            TetMesh::new(vertices, mesh.tets().to_vec(), mesh.regions().to_vec()).expect("same").0
        });
        let apart: Vec<TetMesh> = apart.collect();
        let mut builder = ModelBuilder::new();
        for (mesh, young) in apart.iter().zip(young) {
            let tissue = Material::new(SNH, *young, 0.3, 1000.0).expect("a tissue");
            builder.add_body(mesh, &tissue).expect("a body");
        }
        let (settings, substeps) = method(name);
        let bodies = Bodies::built(builder, apart, contact, (&settings, substeps));
        let mut held = Self { bodies, away };
        held.put(&vec![Vec3::ZERO; held.away.len()]);
        held
    }

    fn body(&self, v: u32) -> usize {
        let bodies = &self.bodies.model.bodies;
        bodies.iter().position(|body| body.vertices.contains(&(v as usize))).expect("a body")
    }

    /// Puts the bodies where they are `ways` [m] from where they were made, without a way there.
    fn put(&mut self, ways: &[Vec3<f64>]) {
        self.lead(ways);
        let Bodies { model, state, inputs, .. } = &mut self.bodies;
        *state = State::at_rest(model);
        for pin in &inputs.pins {
            state.positions[pin.vertex as usize] = pin.target;
        }
    }

    /// Leads the bodies there in the steps to come.
    fn lead(&mut self, ways: &[Vec3<f64>]) {
        self.lead_by(|body, x| x + ways[body]);
    }

    /// Leads vertices of a body made at a place [m] to another.
    fn lead_by(&mut self, act: impl Fn(usize, Vec3<f64>) -> Vec3<f64>) {
        let place = |v: u32| {
            let body = self.body(v);
            act(body, self.bodies.rest(v) - self.away[body])
        };
        let all = 0..self.bodies.model.vertex_count() as u32;
        let pins = all.map(|vertex| Pin { vertex, target: place(vertex) }).collect();
        self.bodies.inputs.pins = pins;
    }

    /// The force [N] that others exert on a body which has stood still for some steps, and the sum of all moments on bodies
    /// [N m].
    fn force(&mut self, body: usize) -> (Vec3<f64>, Vec3<f64>) {
        // Forces of inertia are gone then.
        (0..3).for_each(|_| self.bodies.step());
        self.felt(body)
    }

    fn felt(&mut self, body: usize) -> (Vec3<f64>, Vec3<f64>) {
        let mut sums = (Vec3::ZERO, Vec3::ZERO);
        for v in 0..self.bodies.model.vertex_count() as u32 {
            let force = -self.bodies.reaction(|vertex| vertex == v);
            if self.body(v) == body {
                sums.0 += force;
            }
            sums.1 += self.bodies.place(v).cross(force);
        }
        sums
    }
}

/// `f = nu sum_s A_s/2 s(-n_s.nu) p(d_s)`, `p(d) = k (dh - d) + 9 k (dh/2 - d)`, each where above zero; `1/k = 1/k_1 + 1/k_2`,
/// `k_i = kf E_i/L_i`: of the four faces of a small tetrahedron over a wide one, turned any way.
#[test]
fn the_force_of_a_pair_is_that_of_its_law_and_acts_on_both() {
    let (edges, young) = ([0.04, 0.005], [1e4, 3e4]);
    let contact = rubbing(0.0);
    let [own, other] = [0, 1].map(|i| contact.law.stiffness * young[i] / edges[i]);
    let k = own * other / (own + other);
    let up = vec3(0.0, 0.0, 1.0);
    let wide = facet(Vec3::ZERO, up, vec3(1.0, 0.0, 0.0), edges[0]);
    for name in METHODS {
        let mut partly = 0;
        for (tilt, height) in [
            (0.0, 0.7e-3),
            (0.0, 0.2e-3),
            (0.0, -0.2e-3),
            (0.9, 0.6e-3),
            (1.05, 0.4e-3),
            (1.2, 0.6e-3),
            (1.45, 0.4e-3),
        ] {
            let turn = rotation_matrix(vec3(0.6, 0.8, 0.0) * tilt);
            // Away from the wide one's own sample in the middle of its face.
            let middle = vec3(6e-3, 7e-3, height);
            let small = facet(middle, turn * -up, turn * vec3(1.0, 0.0, 0.0), edges[1]);
            partly += faces(&small)
                .iter()
                .filter(|(middle, normal)| {
                    middle.z < THICKNESS && (-0.68..-0.22).contains(&normal.z)
                })
                .count();
            let expected = expected(&small, k, edges[1]);
            let mut held = Held::new(vec![wide.clone(), small], &young, &contact, name);
            let (on_small, moments) = held.force(1);
            let on_wide = held.felt(0).0;
            // Rounding of places as far apart as bodies are at rest, times the stiffness of the tetrahedra.
            let rounding = 1e-9;
            let off = (on_small - up * expected).length();
            assert!(off < rounding, "{name}, {tilt}, {height}: {on_small:?} of {expected}");
            assert!((on_small + on_wide).length() < rounding, "{name}: {on_small:?} {on_wide:?}");
            assert!(moments.length() < 1e-2 * rounding, "{name}: {moments:?}");
        }
        assert!(partly > 2, "{partly}");
    }
}

/// The wide flat face of a block of two triangles, and a small tetrahedron at a height [m] over a place of it.
fn on_a_plane(name: &str, friction: f64) -> Held {
    let block = block_at([0.04, 0.04, 0.01], [1; 3], vec3(0.0, 0.0, -0.01));
    let along = vec3(0.6, 0.8, 0.0);
    let small = facet(Vec3::ZERO, vec3(0.0, 0.0, -1.0), along, 0.005);
    Held::new(vec![block, small], &[1e4, 1e4], &rubbing(friction), name)
}

/// Where the small one slides across the border of two triangles in one plane, the plane's normal is that of its force.
#[test]
fn a_flat_face_of_several_triangles_is_one_plane() {
    for name in METHODS {
        let mut held = on_a_plane(name, 0.0);
        let place = |i: i32| vec3(-1.32e-3 + 1e-4 * f64::from(i), 1.3e-3, 0.6e-3);
        held.put(&[Vec3::ZERO, place(-12)]);
        let (first, _) = held.force(1);
        let mut triangles = std::collections::BTreeSet::new();
        for i in -12..=12 {
            held.lead(&[Vec3::ZERO, place(i)]);
            let (force, _) = held.force(1);
            assert!(force.x.abs().max(force.y.abs()) < 1e-9 * force.z, "{name}, {i}: {force:?}");
            assert!((force.z / first.z - 1.0).abs() < 1e-6, "{name}: {force:?} {first:?}");
            triangles.insert(held.bodies.state.contact.pairs[0].triangle);
        }
        assert_eq!(triangles.len(), 2, "{name}");
    }
}

/// Friction is a spring that gives way (a Jenkins element): `f = -K u`, `|K u| <= mu N`, `K = N/(dh - d)`; what has given way
/// stays so, however the normal force grows again. All of it in two directions, and over the border of two triangles.
#[test]
fn what_rubs_sticks_gives_way_and_turns_back() {
    let friction = 0.3;
    // Ways [m] along the plane and heights [m]; whether it stands still after a way.
    let stops = [
        (0.00e-3, 0.6e-3, true),
        (0.05e-3, 0.6e-3, true),
        (0.10e-3, 0.6e-3, true),
        (0.22e-3, 0.6e-3, true),
        (0.18e-3, 0.6e-3, true),
        (0.06e-3, 0.6e-3, true),
        (-0.2e-3, 0.6e-3, true),
        // Its normal force falls to a half, and it turns back in the next step.
        (-0.2e-3, 0.8e-3, false),
        (-0.17e-3, 0.8e-3, true),
        (-0.17e-3, 0.6e-3, true),
        (-0.11e-3, 0.6e-3, true),
    ];
    for name in METHODS {
        for direction in [vec3(0.6, 0.8, 0.0), vec3(0.8, -0.6, 0.0)] {
            let mut held = on_a_plane(name, friction);
            let place = |way: f64, height: f64| direction * way + vec3(-1.3e-3, 1.32e-3, height);
            held.put(&[Vec3::ZERO, place(0.0, 0.6e-3)]);
            let mut triangles = std::collections::BTreeSet::new();
            let (mut slip, mut before) = (0.0f64, 0.0);
            for (way, height, stands) in stops {
                held.lead(&[Vec3::ZERO, place(way, height)]);
                let most = friction * (THICKNESS - height);
                slip = (slip + way - before).clamp(-most, most);
                before = way;
                triangles.extend(held.bodies.state.contact.pairs.first().map(|pair| pair.triangle));
                if !stands {
                    held.bodies.step();
                    continue;
                }
                let (force, _) = held.force(1);
                let expected = direction * (-slip * force.z / (THICKNESS - height));
                let along = force - vec3(0.0, 0.0, force.z);
                let off = (along - expected).length() / force.z;
                assert!(off < 1e-6, "{name} {way} {height}: {along:?} of {expected:?}");
            }
            assert_eq!(triangles.len(), 2, "{name}");
        }
    }
}

/// What slides steadily is held with `mu N`, at the end of every step.
#[test]
fn what_slides_is_held_by_its_friction() {
    for name in METHODS {
        let mut held = on_a_plane(name, 0.3);
        let place = |i: i32| vec3(0.6, 0.8, 0.0) * (5e-5 * f64::from(i)) + vec3(1e-3, 0.0, 0.6e-3);
        held.put(&[Vec3::ZERO, place(0)]);
        for i in 1..=12 {
            held.lead(&[Vec3::ZERO, place(i)]);
            held.bodies.step();
        }
        let (force, _) = held.felt(1);
        let expected = vec3(0.6, 0.8, 0.0) * (-0.3 * force.z) + vec3(0.0, 0.0, force.z);
        assert!((force - expected).length() < 1e-6 * force.z, "{name}: {force:?} of {expected:?}");
    }
}

/// What is pressed into other tissue, deeper than anything begins to touch, is still pushed out by its law.
#[test]
fn what_is_deep_is_still_pushed_out() {
    let (edges, young) = ([0.04, 0.005], 1e4);
    let up = vec3(0.0, 0.0, 1.0);
    let contact = rubbing(0.0);
    let k = contact.law.stiffness * young / (edges[0] + edges[1]);
    let wide = facet(Vec3::ZERO, up, vec3(1.0, 0.0, 0.0), edges[0]);
    let small = |height| facet(vec3(3e-3, 5e-3, height), -up, vec3(0.6, 0.8, 0.0), edges[1]);
    for name in METHODS {
        let meshes = vec![wide.clone(), small(0.6e-3)];
        let mut held = Held::new(meshes, &[young; 2], &contact, name);
        for i in 0..=11 {
            let depth = 2e-4 * f64::from(i);
            held.lead(&[Vec3::ZERO, -up * depth]);
            let (force, _) = held.force(1);
            let along = expected(&small(0.6e-3 - depth), k, edges[1]);
            assert!((force - up * along).length() < 1e-9, "{name}: {force:?} of {along}");
        }
    }
}

/// In a hollow of two planes a sample stays with one until the other is nearer by a tenth of the thickness.
#[test]
fn in_a_hollow_a_sample_stays_with_its_plane() {
    let half = 0.5f64.sqrt();
    let edge = 0.04;
    // From the line in the middle of the hollow to the middle of a side.
    let inner = edge / 12f64.sqrt();
    let sides = [1.0, -1.0].map(|sign| {
        let (normal, out) = (vec3(-sign * half, 0.0, half), vec3(sign * half, 0.0, half));
        facet(out * inner, normal, vec3(0.0, -sign, 0.0), edge)
    });
    let [right, left] = sides;
    let small = facet(Vec3::ZERO, vec3(0.0, 0.0, -1.0), vec3(0.6, 0.8, 0.0), 2e-3);
    for name in METHODS {
        let meshes = vec![right.clone(), left.clone(), small.clone()];
        let mut held = Held::new(meshes, &[1e4; 3], &rubbing(0.0), name);
        let below = faces(&small).iter().position(|(_, normal)| normal.z < -0.99);
        let sample = 8 + below.expect("a face that looks down") as u32;
        // Whether the sample has met the right plane, from which it is nearer by so many thicknesses.
        let mut is_right = |nearer: f64, is_new: bool| {
            let place = vec3(nearer * THICKNESS * half, 3e-3, 0.7e-3 / half);
            let ways = [Vec3::ZERO, Vec3::ZERO, place];
            if is_new {
                held.put(&ways)
            } else {
                held.lead(&ways)
            }
            held.force(2);
            let pairs = &held.bodies.state.contact.pairs;
            let pair = pairs.iter().find(|pair| pair.sample == sample).expect("a pair");
            // Every tetrahedron has four faces.
            pair.triangle / 4 == 0
        };
        assert!(is_right(0.05, true), "{name}");
        assert!(is_right(-0.09, false), "{name}");
        assert!(!is_right(-0.11, false), "{name}");
        assert!(!is_right(0.09, false), "{name}");
        assert!(is_right(0.11, false), "{name}");
    }
}

/// The force [N] that a wide face at `z = 0` exerts on a small regular tetrahedron, see above; with its `k` [Pa/m].
fn expected(small: &TetMesh, k: f64, edge: f64) -> f64 {
    let area = edge * edge * 3f64.sqrt() / 4.0;
    let of_face = |(middle, normal): (Vec3<f64>, Vec3<f64>)| {
        let t = ((-normal.z - 0.2) / 0.5).clamp(0.0, 1.0);
        let gap = (THICKNESS - middle.z).max(0.0);
        let deep = (0.5 * THICKNESS - middle.z).max(0.0);
        0.5 * area * t * t * (3.0 - 2.0 * t) * (k * gap + 9.0 * k * deep)
    };
    faces(small).into_iter().map(of_face).sum()
}

/// A sample looks again after bodies have travelled together, and after it has turned on the spot.
#[test]
fn what_has_travelled_or_turned_is_found() {
    let (edges, young) = ([0.04, 0.8e-3], 1e4);
    let up = vec3(0.0, 0.0, 1.0);
    let contact = rubbing(0.0);
    let k = contact.law.stiffness * young / (edges[0] + edges[1]);
    let wide = facet(Vec3::ZERO, up, vec3(1.0, 0.0, 0.0), edges[0]);
    let middle = vec3(2.5e-3, 2.5e-3, 1.2e-3);
    for name in METHODS {
        let small = facet(middle, -up, vec3(0.6, 0.8, 0.0), edges[1]);
        let mut held = Held::new(vec![wide.clone(), small], &[young; 2], &contact, name);
        held.bodies.step();
        for i in 1..=5 {
            let drift = vec3(0.01, -0.004, 0.0) * f64::from(i);
            held.lead(&[drift, drift - up * (6e-5 * f64::from(i))]);
            held.bodies.step();
        }
        let (force, _) = held.force(1);
        let area = edges[1] * edges[1] * 3f64.sqrt() / 4.0;
        let along = 0.5 * area * k * 1e-4;
        assert!((force - up * along).length() < 1e-3 * along, "{name}: {force:?} of {along}");
        // From where its face looks up; the middle of its vertices stays.
        let small = facet(vec3(2.5e-3, 2.5e-3, 0.9e-3), up, vec3(1.0, 0.0, 0.0), edges[1]);
        let center = small.vertices().iter().fold(Vec3::ZERO, |sum, x| sum + *x) * 0.25;
        let turned = |angle: f64| {
            let turn = rotation_matrix(vec3(0.0, 1.0, 0.0) * angle);
            move |x: Vec3<f64>| center + turn * (x - center)
        };
        let meshes = vec![wide.clone(), small.clone()];
        let mut held = Held::new(meshes, &[young; 2], &contact, name);
        held.bodies.step();
        for i in 1..=24 {
            let turn = turned(0.1 * f64::from(i));
            held.lead_by(|body, x| if body == 1 { turn(x) } else { x });
            held.bodies.step();
        }
        let (force, _) = held.force(1);
        let vertices = small.vertices().iter().map(|x| turned(2.4)(*x)).collect();
        let (small, _) = TetMesh::new(vertices, small.tets().to_vec(), vec![0]).expect("a mesh");
        let along = expected(&small, k, edges[1]);
        println!("{name}: {force:?} of {along}");
        assert!((force - up * along).length() < 1e-3 * along, "{name}: {force:?} of {along}");
    }
}

/// Neither the bottom of a notch that closes nor the far side of a thin sheet that swells is tissue that is met.
#[test]
fn what_is_near_by_on_its_own_body_is_not_met() {
    let contact = rubbing(0.0);
    let block = block_at([0.0068, 0.004, 0.006], [16, 3, 3], Vec3::ZERO);
    // Triangles of 0.85 mm along its sides: the second ones of both are farther from each other than contact is thick, and
    // nearer to the first ones.
    // Cut open along its middle line, so that its upper face is a notch with this half of its angle [rad].
    let notch = |angle: f64, x: Vec3<f64>| {
        let [sine, cosine] = [libm::sin(angle), libm::cos(angle)];
        vec3(2.0 * x.x * sine, x.y, x.z + 2.0 * x.x.abs() * cosine)
    };
    let thirty = std::f64::consts::FRAC_PI_6;
    let vertices = block.vertices().iter().map(|x| notch(thirty, *x)).collect();
    let (notched, _) =
        TetMesh::new(vertices, block.tets().to_vec(), block.regions().to_vec()).expect("a mesh");
    let open = |x: Vec3<f64>| {
        let across = x.x / (2.0 * libm::sin(thirty));
        vec3(across, x.y, x.z - 2.0 * across.abs() * libm::cos(thirty))
    };
    let mut held = Held::new(vec![notched], &[1e4], &contact, "quasi_newton");
    for i in 0..=10 {
        held.lead_by(|_, x| notch(thirty - 8e-4 * f64::from(i), open(x)));
        held.bodies.step();
        assert!(held.bodies.state.contact.pairs.is_empty(), "{i}");
    }
    let sheet = block_at([6e-3, 4e-3, 0.6e-3], [12, 8, 3], Vec3::ZERO);
    let mut held = Held::new(vec![sheet], &[1e4], &contact, "quasi_newton");
    for i in 0..=10 {
        held.lead_by(|_, x| vec3(x.x, x.y, x.z * (1.0 + 0.02 * f64::from(i))));
        held.bodies.step();
        assert!(held.bodies.state.contact.pairs.is_empty(), "{i}");
    }
}
