//! Labels with their sizes and places.

use viscera::scalar::{Vec3, vec3};

use crate::affine::Side;
use crate::label_map::LabelMap;

/// What a label map has of one label.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelSummary {
    /// The label, 1 or more.
    pub label: u16,
    /// Its name, if it has one.
    pub name: Option<String>,
    /// How many voxels have it.
    pub voxels: u64,
    /// Their volume `[ml]`.
    pub milliliters: f64,
    /// Lowest and highest index along each axis of the image, both included.
    pub voxel_bounds: [[usize; 3]; 2],
    /// The smallest box around all its voxels with their whole extent, in the patient's frame (RAS):
    /// lowest and highest corner `[mm]`.
    pub world_bounds: [Vec3<f64>; 2],
    /// How many pieces it has, where voxels are neighbours across a face.
    pub components: u64,
    /// The faces of the image that it touches: it was probably cut there.
    pub touches_border: Vec<BorderFace>,
}

/// A face of the image that a label touches.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BorderFace {
    /// The axis of the image, 0 to 2.
    pub axis: usize,
    /// True at the end of the axis, false at its start.
    pub at_end: bool,
    /// The side of the patient to which the face looks, the nearest of six.
    pub side: Side,
    /// How many voxels of the label are on the face.
    pub voxels: u64,
}

/// Lists the labels that voxels have, in ascending order; background (0) is left out. It goes through
/// the voxels once, and needs some 8 bytes for each run of equal labels along the first axis.
pub fn summarize(map: &LabelMap) -> Vec<LabelSummary> {
    let mut gathered = Gathered::default();
    let [size_x, size_y, size_z] = map.dims();
    let mut joined = Joined::default();
    // Runs of the slice below, and of the slice at hand, row by row.
    let mut below = Slice::default();
    let mut rows = map.labels().chunks_exact(size_x);
    for z in 0..size_z {
        let mut slice = Slice::default();
        for (y, row) in (0..size_y).zip(&mut rows) {
            slice.rows.push(slice.runs.len());
            let mut start = 0;
            for same in row.chunk_by(|a, b| a == b) {
                let (first, end) = (start, start + same.len());
                start = end;
                let label = same[0];
                if label != 0 {
                    let component = joined.add();
                    gathered.of(label).take_run(map, [first, y, z], end);
                    slice.runs.push(Run { first, end, label, component });
                }
            }
            slice.rows.push(slice.runs.len());
            let own = slice.row(y);
            for other in [y.checked_sub(1).map(|y| slice.row(y)), Some(below.row(y))] {
                for (label, pair) in neighbours(own, other.unwrap_or(&[])) {
                    if joined.join(pair) {
                        gathered.of(label).components -= 1;
                    }
                }
            }
        }
        below = slice;
    }
    gathered.summaries(map)
}

/// Equal labels side by side.
#[derive(Clone, Copy)]
struct Run {
    first: usize,
    end: usize,
    label: u16,
    component: usize,
}

/// The runs of a slice.
#[derive(Default)]
struct Slice {
    runs: Vec<Run>,
    /// Start and end of each row among the runs.
    rows: Vec<usize>,
}

impl Slice {
    /// The runs of a row, none outside.
    fn row(&self, y: usize) -> &[Run] {
        match self.rows.get(2 * y..2 * y + 2) {
            Some(&[start, end]) => &self.runs[start..end],
            _ => &[],
        }
    }
}

/// Pairs of runs of one label that lie side by side; runs are in ascending order.
fn neighbours<'a>(
    mut a: &'a [Run],
    mut b: &'a [Run],
) -> impl Iterator<Item = (u16, [usize; 2])> + 'a {
    std::iter::from_fn(move || {
        while let ([run, rest @ ..], [other, other_rest @ ..]) = (a, b) {
            if run.end <= other.end {
                a = rest;
            } else {
                b = other_rest;
            }
            let overlap = run.first.max(other.first) < run.end.min(other.end);
            if overlap && run.label == other.label {
                return Some((run.label, [run.component, other.component]));
            }
        }
        None
    })
}

/// Components that grow together, a forest of parents (union-find with path halving).
#[derive(Default)]
struct Joined {
    parents: Vec<usize>,
}

impl Joined {
    fn add(&mut self) -> usize {
        let component = self.parents.len();
        self.parents.push(component);
        component
    }

    fn root(&mut self, mut component: usize) -> usize {
        while self.parents[component] != component {
            self.parents[component] = self.parents[self.parents[component]];
            component = self.parents[component];
        }
        component
    }

    /// True where two components became one.
    fn join(&mut self, pair: [usize; 2]) -> bool {
        let [a, b] = pair.map(|component| self.root(component));
        // The older root stays, so that what comes later hangs below it.
        self.parents[a.max(b)] = a.min(b);
        a != b
    }
}

/// What is known of the labels so far.
#[derive(Default)]
struct Gathered {
    /// Position in `entries`, plus 1, by label.
    positions: Vec<u32>,
    entries: Vec<Entry>,
}

struct Entry {
    label: u16,
    voxels: u64,
    low: [usize; 3],
    high: [usize; 3],
    /// Extremes of voxels' centres `[m]`.
    world_low: Vec3<f64>,
    world_high: Vec3<f64>,
    components: u64,
    /// By axis: voxels on the face at its start and at its end.
    border: [[u64; 2]; 3],
}

impl Gathered {
    fn of(&mut self, label: u16) -> &mut Entry {
        if self.positions.is_empty() {
            self.positions = vec![0; 1 << 16];
        }
        let position = &mut self.positions[usize::from(label)];
        if *position == 0 {
            self.entries.push(Entry {
                label,
                voxels: 0,
                low: [usize::MAX; 3],
                high: [0; 3],
                world_low: Vec3::splat(f64::INFINITY),
                world_high: Vec3::splat(f64::NEG_INFINITY),
                components: 0,
                border: [[0; 2]; 3],
            });
            *position = self.entries.len() as u32;
        }
        &mut self.entries[*position as usize - 1]
    }

    fn summaries(mut self, map: &LabelMap) -> Vec<LabelSummary> {
        self.entries.sort_by_key(|entry| entry.label);
        let affine = map.to_world();
        // From a voxel's centre to the end of its extent along the world's axes.
        let [a, b, c] = affine.matrix.columns.map(|v| vec3(v.x.abs(), v.y.abs(), v.z.abs()));
        let half = (a + b + c) * 0.5;
        let summary = |entry: Entry| {
            let mut touches_border = Vec::new();
            for (axis, counts) in entry.border.iter().enumerate() {
                let end = affine.side_at_end(axis);
                for (at_end, side, voxels) in
                    [(false, end.opposite(), counts[0]), (true, end, counts[1])]
                {
                    if voxels > 0 {
                        touches_border.push(BorderFace { axis, at_end, side, voxels });
                    }
                }
            }
            LabelSummary {
                label: entry.label,
                name: map.name(entry.label).map(str::to_owned),
                voxels: entry.voxels,
                milliliters: 1e6 * affine.voxel_volume() * entry.voxels as f64,
                voxel_bounds: [entry.low, entry.high],
                world_bounds: [(entry.world_low - half) * 1e3, (entry.world_high + half) * 1e3],
                components: entry.components,
                touches_border,
            }
        };
        self.entries.into_iter().map(summary).collect()
    }
}

impl Entry {
    /// Takes voxels from `first` up to, and without, `end` along the first axis.
    fn take_run(&mut self, map: &LabelMap, first: [usize; 3], end: usize) {
        let dims = map.dims();
        let count = (end - first[0]) as u64;
        let last = [end - 1, first[1], first[2]];
        self.voxels += count;
        self.components += 1;
        for voxel in [first, last] {
            let [x, y, z] = voxel.map(|index| index as f64);
            // Along a line the extremes are at the ends.
            let centre = map.to_world().to_world(vec3(x, y, z));
            self.world_low = self.world_low.min(centre);
            self.world_high = self.world_high.max(centre);
        }
        for axis in 0..3 {
            self.low[axis] = self.low[axis].min(first[axis]);
            self.high[axis] = self.high[axis].max(last[axis]);
            // A run is a line along the first axis, and one point of the others.
            let on_face = if axis == 0 { 1 } else { count };
            self.border[axis][0] += if first[axis] == 0 { on_face } else { 0 };
            self.border[axis][1] += if last[axis] + 1 == dims[axis] { on_face } else { 0 };
        }
    }
}
