//! The skin as a device knows it: constants, as words.

use bytemuck::{Pod, Zeroable};

use super::extents::{
    Meetings, ON_POINT, POINT_WORDS, SKIN_SAMPLE_WORDS, TIE_WORDS, TRIANGLE_WORDS,
};
use crate::contact::depths;
use crate::contact::skin::Site;
use crate::layout::LaidSkin;

/// Where everything of the skin stands: `SKIN_` and its name in kernels.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
pub struct SkinRow {
    /// Rows in the table.
    pub samples: u32,
    pub ties: u32,
    pub points: u32,
    pub triangles: u32,
    pub nodes: u32,
    pub order: u32,
    pub level_offsets: u32,
    pub level_nodes: u32,
    /// Triangles around each point, neighbours of each vertex that samples hang on.
    pub around_offsets: u32,
    pub around: u32,
    pub neighbour_offsets: u32,
    pub neighbours: u32,
    /// Meetings whose samples hang on each vertex, with weights; corners of triangles that do, four times the triangle and the
    /// corner, with weights.
    pub own_offsets: u32,
    pub own_entries: u32,
    pub reaction_offsets: u32,
    pub reaction_entries: u32,
    /// Distances between bodies that are longer: two bodies and by how much [m].
    pub shifts: u32,
    pub shift_count: u32,
    pub sample_count: u32,
    pub triangle_count: u32,
    pub node_count: u32,
    /// Places among the loads.
    pub meetings: u32,
    pub points_now: u32,
    pub triangles_now: u32,
    pub nodes_now: u32,
    pub sorted: u32,
    pub sorted_too: u32,
    pub torn: u32,
    pub reach: u32,
    /// Whether bodies meet themselves, and others.
    pub itself: u32,
    pub bodies: u32,
    /// Of contact: thickness [m], stiffness, friction; how deep samples may be behind their own body's skin and others' [m].
    pub thickness: f32,
    pub stiffness: f32,
    pub friction: f32,
    pub depth_own: f32,
    pub depth_other: f32,
}

/// Lists in a row: where each begins, one more at the end, and their words.
type Lists = [Vec<u32>; 2];

fn lists<T: AsRef<[u32]>>(all: impl Iterator<Item = T>, words: usize) -> Lists {
    let (mut offsets, mut entries) = (vec![0], Vec::new());
    for list in all {
        entries.extend_from_slice(list.as_ref());
        offsets.push((entries.len() / words) as u32);
    }
    [offsets, entries]
}

/// What is infinite is a number on devices.
fn bits(value: f64) -> u32 {
    (value as f32).min(f32::MAX).to_bits()
}

/// Neighbours of the vertices that samples hang on, where bodies meet themselves.
fn neighbours(skin: &LaidSkin) -> Lists {
    let mut asks = vec![false; skin.skin.topology.vertex_count()];
    for sample in skin.samples.iter().filter(|_| skin.contact.itself) {
        sample.vertices.iter().for_each(|&v| asks[v as usize] = true);
    }
    let of = |(v, asks): (usize, &bool)| match asks {
        true => skin.skin.topology.neighbours(v as u32).to_vec(),
        false => Vec::new(),
    };
    lists(asks.iter().enumerate().map(of), 1)
}

/// Meetings of each vertex's samples, and corners of triangles that hang on it.
fn gathered(skin: &LaidSkin, vertex_count: usize) -> [Lists; 2] {
    let mut own = vec![Vec::new(); vertex_count];
    let tied = skin.ties.iter().map(|(place, _)| *place);
    for (meeting, place) in (0u32..).zip((0..skin.samples.len() as u32).chain(tied)) {
        let sample = &skin.samples[place as usize];
        for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
            if weight != 0.0 {
                own[v as usize].extend([meeting, bits(weight)]);
            }
        }
    }
    let mut reactions = vec![Vec::new(); vertex_count];
    for (triangle, points) in (0u32..).zip(&skin.skin.triangles) {
        for (corner, &point) in (0u32..).zip(points) {
            let point = &skin.skin.points[point as usize];
            for (&v, &weight) in point.vertices.iter().zip(&point.weights) {
                if weight != 0.0 {
                    reactions[v as usize].extend([4 * triangle + corner, bits(weight)]);
                }
            }
        }
    }
    [own, reactions].map(|all| lists(all.iter(), 2))
}

fn sample_rows(skin: &LaidSkin) -> Vec<u32> {
    let row = |sample: &crate::layout::LaidSample| {
        let number = sample.number as usize;
        let mut row = [0; SKIN_SAMPLE_WORDS];
        row[..4].copy_from_slice(&sample.vertices);
        row[4..8].copy_from_slice(&sample.weights.map(bits));
        // Each side is the foundation of the other, and has half of the area.
        row[8] = bits(0.5 * sample.area);
        row[9] = bits(sample.stiffness);
        row[10] = match skin.skin.sites[number] {
            Site::Triangle(triangle) => triangle,
            Site::Point(point) => point | ON_POINT,
        };
        row[11] = skin.skin.sample_bodies[number];
        row[12] = sample.part;
        row
    };
    skin.samples.iter().flat_map(row).collect()
}

fn tie_rows(skin: &LaidSkin) -> Vec<u32> {
    let row = |&(place, number): &(u32, u32)| {
        let tie = &skin.skin.ties[number as usize];
        let mut row = [0; TIE_WORDS];
        row[..2].copy_from_slice(&[place, tie.triangle]);
        row[2..5].copy_from_slice(&tie.weights.map(bits));
        row[5..8].copy_from_slice(&tie.rest.map(bits));
        row[8..].copy_from_slice(&[bits(tie.stiffness), bits(tie.strength)]);
        row
    };
    skin.ties.iter().flat_map(row).collect()
}

fn triangle_rows(skin: &LaidSkin) -> Vec<u32> {
    let bodies = skin.skin.bodies.iter().zip(&skin.stiffness);
    let row = |(points, (&body, &stiffness)): (&[u32; 3], (&u32, &f64))| {
        let [a, b, c] = *points;
        let row: [u32; TRIANGLE_WORDS] = [a, b, c, body, bits(stiffness)];
        row
    };
    skin.skin.triangles.iter().zip(bodies).flat_map(row).collect()
}

fn point_rows(skin: &LaidSkin) -> Vec<u32> {
    let row = |point: &crate::contact::skin::SkinPoint| {
        let mut row = [0; POINT_WORDS];
        row[..4].copy_from_slice(&point.vertices);
        row[4..].copy_from_slice(&point.weights.map(bits));
        row
    };
    skin.skin.points.iter().flat_map(row).collect()
}

/// Puts a skin into a table by `add`, which returns where words begin; its vectors begin at `first` among the loads. Returns
/// its row.
pub fn put(
    skin: &LaidSkin,
    meetings: Meetings,
    first: u64,
    add: &mut dyn FnMut(&[u32]) -> u32,
) -> SkinRow {
    let (nodes, levels) = skin.tree.rows();
    let [level_offsets, level_nodes] = lists(levels.iter(), 1);
    let shifts: Vec<u32> =
        (skin.skin.shifts.iter()).flat_map(|&([a, b], shift)| [a, b, bits(shift)]).collect();
    let around = |point: u32| skin.skin.topology.around(point);
    let [around_offsets, around] = lists((0..meetings.points).map(around), 1);
    let [neighbour_offsets, neighbours] = neighbours(skin);
    let vertex_count = skin.skin.topology.vertex_count();
    let [[own_offsets, own_entries], [reaction_offsets, reaction_entries]] =
        gathered(skin, vertex_count);
    let mut places = [0; 8];
    let mut next = first;
    for (place, extent) in places.iter_mut().zip(meetings.extents()) {
        *place = next as u32;
        next += extent;
    }
    let [of_meetings, points_now, triangles_now, nodes_now, sorted, sorted_too, torn, reach] =
        places;
    let law = &skin.contact.law;
    let [depth_own, depth_other] =
        depths(&skin.contact, crate::contact::DEEPEST).map(|depth| depth as f32);
    SkinRow {
        samples: add(&sample_rows(skin)),
        ties: add(&tie_rows(skin)),
        points: add(&point_rows(skin)),
        triangles: add(&triangle_rows(skin)),
        nodes: add(nodes.as_flattened()),
        order: add(skin.tree.order()),
        level_offsets: add(&level_offsets),
        level_nodes: add(&level_nodes),
        around_offsets: add(&around_offsets),
        around: add(&around),
        neighbour_offsets: add(&neighbour_offsets),
        neighbours: add(&neighbours),
        own_offsets: add(&own_offsets),
        own_entries: add(&own_entries),
        reaction_offsets: add(&reaction_offsets),
        reaction_entries: add(&reaction_entries),
        shifts: add(&shifts),
        shift_count: skin.skin.shifts.len() as u32,
        sample_count: meetings.samples,
        triangle_count: meetings.triangles,
        node_count: meetings.nodes,
        meetings: of_meetings,
        points_now,
        triangles_now,
        nodes_now,
        sorted,
        sorted_too,
        torn,
        reach,
        itself: skin.contact.itself.into(),
        bodies: skin.contact.bodies.into(),
        thickness: law.thickness as f32,
        stiffness: law.stiffness as f32,
        friction: law.friction as f32,
        depth_own,
        depth_other,
    }
}
