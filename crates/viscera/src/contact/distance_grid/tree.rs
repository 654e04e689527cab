//! A tree of boxes over triangles: the nearest one, those in a box, and the first on a ray.

use crate::mesh::nearest::closest_point_on_triangle;
use crate::scalar::Vec3;

/// Triangles of a leaf at most.
const LEAF: usize = 4;

/// Deeper than this no tree is: halves of 2^32 triangles.
const DEEPEST: usize = 64;

/// Far from the surface distances may be so much too large, as a share.
const ROUGH: f64 = 2e-3;

/// A box, and what is in it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: Vec3<f64>,
    high: Vec3<f64>,
    /// A leaf's first triangle, else the second child; the first child comes next after its parent.
    next: u32,
    /// Of a leaf; else zero.
    count: u32,
}

/// Triangles in boxes.
#[derive(Clone, Debug)]
pub struct Tree {
    nodes: Vec<Node>,
    /// Corners [m], in the order of leaves.
    triangles: Vec<[Vec3<f64>; 3]>,
    /// Their numbers in the surface.
    numbers: Vec<u32>,
}

impl Tree {
    /// Of at least one triangle.
    pub fn new(triangles: &[[Vec3<f64>; 3]]) -> Self {
        let mut numbers: Vec<u32> = (0..triangles.len() as u32).collect();
        let mut nodes = Vec::with_capacity(triangles.len());
        divide(triangles, &mut numbers, 0, &mut nodes);
        let triangles = numbers.iter().map(|&number| triangles[number as usize]).collect();
        Self { nodes, triangles, numbers }
    }

    /// The distance [m] from a point to the nearest triangle; `most` where all are farther than that. Exact up to `near`;
    /// beyond, up to [`ROUGH`] more than it is: from the middle of a ball all of its triangles are equally far.
    pub fn nearest(&self, point: Vec3<f64>, most: f64, near: f64) -> f64 {
        let mut best = most * most;
        let near = near * near;
        let rough = 1.0 + 2.0 * ROUGH;
        let mut stack = Stack::new();
        stack.push(0, self.nodes[0].distance_squared(point));
        while let Some((index, squared)) = stack.pop() {
            let counted = if best > near { squared * rough } else { squared };
            if counted >= best {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                let first = node.next as usize;
                for triangle in &self.triangles[first..first + node.count as usize] {
                    let near = closest_point_on_triangle(*triangle, point);
                    best = best.min((point - near).length_squared());
                }
                continue;
            }
            let children = [index + 1, node.next];
            let ways = children.map(|child| self.nodes[child as usize].distance_squared(point));
            // The nearer one is looked at first.
            let order = if ways[0] <= ways[1] { [1, 0] } else { [0, 1] };
            for child in order {
                stack.push(children[child], ways[child]);
            }
        }
        best.sqrt()
    }

    /// Calls `act` with the number and the corners of each triangle whose box meets a box, until it says that it has found
    /// something.
    pub fn find_in_box<T>(
        &self,
        (low, high): (Vec3<f64>, Vec3<f64>),
        mut act: impl FnMut(u32, &[Vec3<f64>; 3]) -> Option<T>,
    ) -> Option<T> {
        let mut stack = Stack::new();
        stack.push(0, 0.0);
        while let Some((index, _)) = stack.pop() {
            let node = &self.nodes[index as usize];
            if !meet((node.low, node.high), (low, high)) {
                continue;
            }
            if node.count == 0 {
                stack.push(index + 1, 0.0);
                stack.push(node.next, 0.0);
                continue;
            }
            let first = node.next as usize;
            for place in first..first + node.count as usize {
                let triangle = &self.triangles[place];
                if meet(bounds(triangle), (low, high))
                    && let Some(found) = act(self.numbers[place], triangle)
                {
                    return Some(found);
                }
            }
        }
        None
    }

    /// How far [m] a ray of a direction of length 1 goes until it meets a triangle other than the one it begins on.
    pub fn along_ray(&self, from: Vec3<f64>, direction: Vec3<f64>, own: u32) -> Option<f64> {
        let mut best = f64::INFINITY;
        let mut stack = Stack::new();
        stack.push(0, 0.0);
        while let Some((index, enters)) = stack.pop() {
            let node = &self.nodes[index as usize];
            if enters >= best {
                continue;
            }
            if node.count == 0 {
                for child in [index + 1, node.next] {
                    if let Some(way) = self.nodes[child as usize].enters(from, direction) {
                        stack.push(child, way);
                    }
                }
                continue;
            }
            let first = node.next as usize;
            for place in first..first + node.count as usize {
                if self.numbers[place] != own
                    && let Some(way) = meets_ray(&self.triangles[place], from, direction)
                {
                    best = best.min(way);
                }
            }
        }
        best.is_finite().then_some(best)
    }
}

/// Adds the node of some triangles and of all below it. Halves by the order of middles along the longest axis; ties by number.
fn divide(triangles: &[[Vec3<f64>; 3]], numbers: &mut [u32], first: usize, nodes: &mut Vec<Node>) {
    let of = |number: u32| bounds(&triangles[number as usize]);
    let (low, high) = numbers[1..].iter().fold(of(numbers[0]), |(low, high), &number| {
        let (a, b) = of(number);
        (low.min(a), high.max(b))
    });
    let own = nodes.len();
    let count = if numbers.len() <= LEAF { numbers.len() as u32 } else { 0 };
    nodes.push(Node { low, high, next: first as u32, count });
    if count > 0 {
        return;
    }
    let size = high - low;
    let axis = (1..3).fold(0, |best, axis| if size[axis] > size[best] { axis } else { best });
    let middle = |number: u32| triangles[number as usize].iter().map(|x| x[axis]).sum::<f64>();
    let half = numbers.len() / 2;
    numbers.select_nth_unstable_by(half, |&a, &b| {
        middle(a).total_cmp(&middle(b)).then_with(|| a.cmp(&b))
    });
    let (lower, upper) = numbers.split_at_mut(half);
    divide(triangles, lower, first, nodes);
    nodes[own].next = nodes.len() as u32;
    divide(triangles, upper, first + half, nodes);
}

impl Node {
    fn distance_squared(&self, point: Vec3<f64>) -> f64 {
        (point - point.max(self.low).min(self.high)).length_squared()
    }

    /// Where a ray enters it [m].
    fn enters(&self, from: Vec3<f64>, direction: Vec3<f64>) -> Option<f64> {
        let (mut begin, mut end) = (0.0_f64, f64::INFINITY);
        for axis in 0..3 {
            if direction[axis] == 0.0 {
                if from[axis] < self.low[axis] || from[axis] > self.high[axis] {
                    return None;
                }
                continue;
            }
            let [a, b] = [self.low, self.high].map(|x| (x[axis] - from[axis]) / direction[axis]);
            begin = begin.max(a.min(b));
            end = end.min(a.max(b));
        }
        (begin <= end).then_some(begin)
    }
}

/// Nodes to look at and a number for each.
struct Stack {
    entries: [(u32, f64); DEEPEST + 1],
    count: usize,
}

impl Stack {
    fn new() -> Self {
        Self { entries: [(0, 0.0); DEEPEST + 1], count: 0 }
    }

    fn push(&mut self, node: u32, number: f64) {
        self.entries[self.count] = (node, number);
        self.count += 1;
    }

    fn pop(&mut self) -> Option<(u32, f64)> {
        self.count = self.count.checked_sub(1)?;
        Some(self.entries[self.count])
    }
}

/// The box around a triangle.
pub fn bounds([a, b, c]: &[Vec3<f64>; 3]) -> (Vec3<f64>, Vec3<f64>) {
    (a.min(*b).min(*c), a.max(*b).max(*c))
}

fn meet(a: (Vec3<f64>, Vec3<f64>), b: (Vec3<f64>, Vec3<f64>)) -> bool {
    (0..3).all(|axis| a.0[axis] <= b.1[axis] && b.0[axis] <= a.1[axis])
}

/// Where a ray meets a triangle [m].
fn meets_ray(&[a, b, c]: &[Vec3<f64>; 3], from: Vec3<f64>, direction: Vec3<f64>) -> Option<f64> {
    let (ab, ac) = (b - a, c - a);
    let across = direction.cross(ac);
    let volume = ab.dot(across);
    if volume == 0.0 {
        return None;
    }
    let away = from - a;
    let second = away.cross(ab);
    let [u, v, way] = [away.dot(across), direction.dot(second), ac.dot(second)].map(|x| x / volume);
    (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && way > 0.0).then_some(way)
}

/// Where two triangles cross, which share two corners at most: an edge of one goes through the inside of the other. What
/// only touches does not cross.
pub fn crossing(first: &[Vec3<f64>; 3], second: &[Vec3<f64>; 3]) -> Option<Vec3<f64>> {
    let through = |edges: &[Vec3<f64>; 3], triangle: &[Vec3<f64>; 3]| {
        (0..3).find_map(|i| goes_through(edges[i], edges[(i + 1) % 3], triangle))
    };
    through(first, second).or_else(|| through(second, first))
}

/// Volumes of tetrahedra below this share of the cube of their size are nothing: rounding.
const NOTHING: f64 = 1e-12;

fn goes_through(p: Vec3<f64>, q: Vec3<f64>, &[a, b, c]: &[Vec3<f64>; 3]) -> Option<Vec3<f64>> {
    let (low, high) =
        [a, b, c, q].iter().fold((p, p), |(low, high), x| (low.min(*x), high.max(*x)));
    let size = (high - low).length();
    let least = NOTHING * size * size * size;
    let normal = (b - a).cross(c - a);
    let [above, below] = [p, q].map(|x| (x - a).dot(normal));
    if !(above > least && below < -least || above < -least && below > least) {
        return None;
    }
    let way = q - p;
    let sides = [(a, b), (b, c), (c, a)].map(|(from, to)| way.dot((from - p).cross(to - p)));
    let is_inside =
        sides.iter().all(|side| *side > least) || sides.iter().all(|side| *side < -least);
    is_inside.then(|| p + way * (above / (above - below)))
}

/// Corners of the triangles of a surface whose indices are legal.
pub fn corners_of(vertices: &[Vec3<f64>], triangles: &[[u32; 3]]) -> Vec<[Vec3<f64>; 3]> {
    triangles.iter().map(|triangle| triangle.map(|v| vertices[v as usize])).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scalar::vec3;

    /// Triangles of a fixed sequence in a cube of edge 2.
    fn triangles(count: usize) -> Vec<[Vec3<f64>; 3]> {
        let number = |i: usize, step: f64| 2.0 * ((i as f64 * step) % 1.0) - 1.0;
        let at = |i: usize| vec3(number(i, 0.618034), number(i, 0.754878), number(i, 0.569840));
        (0..count).map(|i| [0, 1, 2].map(|k| at(i) + at(7 * i + k + 1) * 0.2)).collect()
    }

    #[test]
    fn the_nearest_of_a_tree_is_the_nearest_of_all() {
        let all = triangles(300);
        let tree = Tree::new(&all);
        for i in 0..200 {
            let point = triangles(201)[i + 1][0] * 1.5;
            let away =
                |triangle: &[Vec3<f64>; 3]| closest_point_on_triangle(*triangle, point) - point;
            let each = all.iter().map(|triangle| away(triangle).length());
            let nearest = each.fold(f64::INFINITY, f64::min);
            assert_eq!(tree.nearest(point, f64::INFINITY, f64::INFINITY), nearest);
            let rough = tree.nearest(point, f64::INFINITY, 0.0);
            assert!((nearest..=nearest * (1.0 + 2.0 * ROUGH)).contains(&rough));
            // A bound that is too small is told as it is.
            assert_eq!(tree.nearest(point, 0.5 * nearest, nearest), 0.5 * nearest);
        }
    }

    #[test]
    fn triangles_that_touch_do_not_cross() {
        let flat = [vec3(0.0, 0.0, 0.0), vec3(1.0, 0.0, 0.0), vec3(0.0, 1.0, 0.0)];
        let upright = |low: f64| [vec3(0.2, 0.2, low), vec3(0.3, 0.2, 1.0), vec3(0.2, 0.4, 1.0)];
        assert!(crossing(&flat, &upright(-0.1)).is_some());
        assert_eq!(crossing(&flat, &upright(0.0)), None);
        assert_eq!(crossing(&flat, &upright(0.1)), None);
        // With a corner in common, and through each other all the same.
        let shared = [vec3(0.0, 0.0, 0.0), vec3(0.4, 0.3, 0.2), vec3(0.4, 0.3, -0.2)];
        let at = crossing(&flat, &shared).expect("they cross");
        assert!((at - vec3(0.4, 0.3, 0.0)).length() < 1e-12);
    }

    #[test]
    fn a_ray_meets_what_is_first() {
        let wall = |x: f64| [vec3(x, -1.0, -1.0), vec3(x, 2.0, -1.0), vec3(x, -1.0, 2.0)];
        let tree = Tree::new(&[wall(3.0), wall(1.0), wall(2.0), wall(0.0), wall(4.0)]);
        let along = vec3(1.0, 0.0, 0.0);
        assert_eq!(tree.along_ray(Vec3::ZERO, along, 3), Some(1.0));
        assert_eq!(tree.along_ray(vec3(4.5, 0.0, 0.0), along, 9), None);
    }
}
