//! Of the tree of a skin.

use super::bounds::{Cone, Patch, Span, unit};
use super::*;
use crate::contact::search::{Closest, closest};
use crate::contact::skin::{Skin, SkinPoint, Topology};
use crate::contact::turn_normals;
use crate::scalar::vec3;

/// A number between -1 and 1 of a fixed sequence.
fn number(i: usize, step: f64) -> f64 {
    2.0 * ((i as f64 * step) % 1.0) - 1.0
}

fn point(i: usize) -> Vec3<f64> {
    vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840))
}

/// Many small triangles of a few bodies, each with a sample in its middle, and where their corners are [m].
fn triangles(count: usize) -> (Skin, Vec<Vec3<f64>>) {
    let mut skin = Skin::default();
    for i in 0..count as u32 {
        let corner = |k: u32| SkinPoint { vertices: [3 * i + k; 4], weights: [1.0, 0.0, 0.0, 0.0] };
        skin.points.extend([0, 1, 2].map(corner));
        skin.triangles.push([0, 1, 2].map(|k| 3 * i + k));
        skin.bodies.push(i % 3);
        skin.sites.push(Site::Triangle(i));
    }
    skin.topology = Topology::new(&skin, &[], 3 * count);
    let corners = |i: usize| {
        let u = unit(point(7 * i + 3));
        let v = unit(u.cross(point(11 * i + 5)));
        [u, v - u * 0.5, (v + u * 0.5) * -1.0].map(|corner| point(i) * 0.1 + corner * 0.004)
    };
    let at = (0..count).flat_map(corners).collect();
    (skin, at)
}

/// By so long a chord normals may turn.
const TURN: f64 = 0.1;

const DRIFT: Vec3<f64> = vec3(0.3, -0.1, 0.2);

/// Samples may be this deep behind triangles of their own body and of others [m].
const DEPTHS: [f64; 2] = [0.015, 0.03];

fn wanted(reach: f64, margin: f64) -> Wanted {
    Wanted { itself: true, bodies: true, reach, depths: DEPTHS, margin, turn: TURN }
}

/// Whether a query may find a triangle that is there: some are left out, as the mesh would have it.
fn suits(skin: &Skin, query: &Query, depths: [f64; 2], triangle: u32, near: &Closest) -> bool {
    let (distance, direction) = near.signed();
    let other = skin.bodies[triangle as usize];
    let depth = depths[usize::from(other != query.body)];
    let kept = query.kept.map(|kept| skin.triangles[kept as usize]);
    let is_kept = kept.is_some_and(|kept| {
        skin.triangles[triangle as usize].iter().any(|point| kept.contains(point))
    });
    triangle % 7 != 1 && -query.outward.dot(direction) > FACES && (distance > -depth || is_kept)
}

/// What the nearest triangle is by looking at all.
fn best_of_all(
    now: SkinNow<'_>,
    query: &Query,
    depths: [f64; 2],
    may: impl Fn(u32) -> bool,
) -> Option<u32> {
    let all = (0..now.skin.triangles.len() as u32)
        .filter(|&t| query.outward.dot(now.normals[t as usize]) < BESIDE && may(t))
        .map(|t| (t, closest(query.p, now.corners(t))))
        .filter(|(t, near)| suits(now.skin, query, depths, *t, near))
        .map(|(t, near)| (near.away.length_squared(), t))
        .filter(|(squared, _)| *squared <= query.reach * query.reach);
    all.min_by(|a, b| a.partial_cmp(b).expect("numbers")).map(|(_, t)| t)
}

/// Also where points have moved and normals have turned since lists were made, and where lists have no room.
#[test]
fn the_tree_finds_what_looking_at_all_triangles_finds() {
    let (skin, at) = triangles(300);
    let mut tree = Tree::new(&skin, &at);
    let (mut met, mut deep, mut deeper, mut full) = (0, 0, 0, 0);
    for (reach, swing) in [(0.04, 5e-5), (0.04, 5e-4), (0.08, 1e-4), (0.3, 0.0)] {
        let mut normals = Vec::new();
        turn_normals(&skin, &at, &mut normals);
        let now = SkinNow { skin: &skin, at: &at, normals: &normals };
        tree.list(now, wanted(reach, 2.0 * swing + 1e-8));
        let later: Vec<Vec3<f64>> = (0..)
            .zip(&at)
            .map(|(i, x)| *x + DRIFT + point(i + 91) * (swing / 3.0_f64.sqrt()))
            .collect();
        let turned = turn_normals(&skin, &later, &mut normals);
        let since = Since { drift: DRIFT, moved: swing, turned };
        assert_eq!(tree.has_lists(reach, since), turned <= TURN, "{since:?}");
        if turned > TURN {
            tree.list(SkinNow { skin: &skin, at: &later, normals: &normals }, wanted(reach, 1e-8));
        }
        let now = SkinNow { skin: &skin, at: &later, normals: &normals };
        let may = |t: u32| !t.is_multiple_of(5);
        for sample in 0..300 {
            let [a, b, c] = now.corners(sample);
            let mut query = Query {
                p: (a + b + c) * (1.0 / 3.0),
                outward: now.outward(sample, 0.0).0,
                reach,
                depths: DEPTHS,
                body: skin.bodies[sample as usize],
                leaf: tree.leaf_of(sample),
                kept: None,
                first: sample.is_multiple_of(3).then_some((sample + 40) % 300),
            };
            // What it was in touch with may be anything, also deeper than others may be.
            if sample.is_multiple_of(4) {
                query.kept = best_of_all(now, &query, [f64::INFINITY; 2], may);
            }
            let is_met = |t: u32, near: &Closest| suits(&skin, &query, DEPTHS, t, near);
            let found = tree.nearest(now, &query, may, is_met);
            let exact = best_of_all(now, &query, DEPTHS, may);
            assert_eq!(found.map(|found| found.triangle), exact, "{sample} within {reach} m");
            met += usize::from(exact.is_some());
            let depth = found.map_or(0.0, |found| -found.closest.signed().0);
            deep += usize::from(depth > 0.0);
            deeper += usize::from(depth > DEPTHS[1]);
        }
        full += tree.lists.iter().filter(|near| near.is_full).count();
    }
    assert!(met > 400 && deep > 10 && deeper > 5 && full > 10, "{met} {deep} {deeper} {full}");
}

/// What a patch is behind or turned away from it never faces, whatever moves by less than the slack.
#[test]
fn samples_of_an_averted_patch_face_nothing_in_front_of_them() {
    let mut averted = 0;
    for i in 0..4000 {
        let place = |k: usize| point(13 * i + k) * 0.1;
        let cone = |k: usize| {
            let chord = 0.3 + 0.3 * number(i, 0.3 + 0.1 * k as f64);
            let chord = if i.is_multiple_of(3) { 0.0 } else { chord };
            Cone { axis: unit(point(5 * i + k)), chord }
        };
        let span = |k: usize| {
            let half = vec3(0.01, 0.02, 0.015) * (1.0 + number(i, 0.7));
            Span { low: place(k) - half, high: place(k) + half }
        };
        let [one, other] = [1, 2].map(|k| Patch { span: span(k), cone: cone(k) });
        let (reach, slack) = (0.12, 0.004);
        if !one.is_averted(&other, reach, slack) {
            continue;
        }
        averted += 1;
        // Corners of boxes and directions on the border of cones are the worst.
        for j in 0..64 {
            let corner = |patch: &Patch, bits: usize| {
                let [low, high] = [patch.span.low.to_array(), patch.span.high.to_array()];
                let [x, y, z] = [0, 1, 2].map(|axis| [low, high][(bits >> axis) & 1][axis]);
                vec3(x, y, z)
            };
            let direction = |patch: &Patch, k: usize| {
                // A chord of c is an angle of 2 asin(c/2).
                let Cone { axis, chord } = patch.cone;
                let side = unit(point(17 * j + k).cross(axis));
                let angle = 2.0 * (0.5 * chord).asin();
                axis * angle.cos() + side * angle.sin()
            };
            let (outward, normal) = (direction(&one, 3), direction(&other, 4));
            let closer = [normal, outward * -1.0, unit(point(29 * j + i))][j % 3];
            let apart =
                corner(&one, j % 8) - corner(&other, j / 8) + closer * (slack * (1.0 - 1e-9));
            let faces = normal.dot(apart) >= 0.0 && -outward.dot(apart) > FACES * apart.length();
            assert!(apart.length() > reach || !faces, "{i} {j}");
        }
    }
    assert!((200..3800).contains(&averted), "{averted}");
}

/// Bodies that may not meet are in no list, nor are those of whom all is beside all.
#[test]
fn lists_leave_out_what_may_not_meet() {
    let (skin, at) = triangles(300);
    let mut normals = Vec::new();
    turn_normals(&skin, &at, &mut normals);
    let now = SkinNow { skin: &skin, at: &at, normals: &normals };
    let mut tree = Tree::new(&skin, &at);
    tree.list(now, Wanted { itself: false, bodies: false, ..wanted(1.0, 0.01) });
    assert!(tree.is_clear());
    tree.list(now, Wanted { bodies: false, ..wanted(0.02, 0.01) });
    assert!(!tree.is_clear());
    for leaf in 0..tree.leaves.len() {
        let body = |place: u32| tree.nodes[place as usize].body;
        let near = tree.lists[leaf];
        let all = &tree.near[near.first as usize..near.end as usize];
        assert!(all.iter().all(|&other| body(other) == body(tree.leaves[leaf])));
    }
    // A sheet that is bent a little is beside itself; a list that is older than its margins says so.
    let flat: Vec<Vec3<f64>> = (0..300)
        .flat_map(|i| {
            let x = vec3(f64::from(i % 20), f64::from(i / 20), 0.0) * 1e-3;
            [vec3(0.0, 0.0, 0.0), vec3(1e-3, 0.0, 0.0), vec3(0.0, 1e-3, 1e-4)]
                .map(|corner| x + corner)
        })
        .collect();
    turn_normals(&skin, &flat, &mut normals);
    tree.list(SkinNow { skin: &skin, at: &flat, normals: &normals }, wanted(0.009, 1e-3));
    assert!(tree.is_clear());
    // Not where normals may turn by 35 degrees.
    let now = SkinNow { skin: &skin, at: &flat, normals: &normals };
    tree.list(now, Wanted { turn: 0.6, ..wanted(0.009, 1e-3) });
    assert!(!tree.is_clear());
    tree.list(now, wanted(0.009, 1e-3));
    let since = Since::default();
    assert!(tree.has_lists(0.009, Since { moved: 4e-4, turned: 0.1, ..since }));
    assert!(!tree.has_lists(0.009, Since { moved: 6e-4, ..since }));
    assert!(!tree.has_lists(0.009, Since { turned: 0.11, ..since }));
}

/// Of two triangles with a common edge the lower, whichever the tree has first.
#[test]
fn of_triangles_that_are_as_near_the_lowest_is_found() {
    for i in 0..100 {
        let place = point(i);
        let corners =
            [vec3(0.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0), vec3(-2.0, 0.5, 0.0), vec3(2.0, 0.5, 0.0)];
        let at = corners.map(|x| place + x * 0.125);
        let points =
            (0..4).map(|v| SkinPoint { vertices: [v; 4], weights: [1.0, 0.0, 0.0, 0.0] }).collect();
        let skin = Skin {
            points,
            triangles: vec![[0, 1, 2], [1, 0, 3]],
            bodies: vec![0; 2],
            sites: vec![Site::Triangle(1)],
            ..Skin::default()
        };
        let mut normals = Vec::new();
        turn_normals(&skin, &at, &mut normals);
        let now = SkinNow { skin: &skin, at: &at, normals: &normals };
        let mut tree = Tree::new(&skin, &at);
        tree.list(now, wanted(1.0, 1e-3));
        tree.lists[0] = Near { is_full: true, ..Near::default() };
        let p = at[0] - vec3(0.0, 5e-4, 0.0);
        let outward = vec3(1.0, 0.0, 0.0);
        let query = Query {
            p,
            outward,
            reach: 1e-3,
            depths: [1.0; 2],
            body: 0,
            leaf: 0,
            kept: None,
            first: None,
        };
        let found = tree.nearest(now, &query, |_| true, |_, _| true);
        assert_eq!(found.map(|found| found.triangle), Some(0), "{i}");
    }
}
