//! Vertices in one place.

use std::collections::HashMap;

use crate::mesh::corners::BoundingBox;
use crate::scalar::Vec3;

/// Vertices nearer than this share of the mesh's diagonal are in one place: files in single precision know them no better.
const IN_ONE_PLACE: f64 = 1e-6;

/// How far apart vertices are in one place [m], where nothing else is said.
pub fn reach(vertices: &[Vec3<f64>], has_place: &[bool]) -> f64 {
    let known = vertices.iter().zip(has_place).filter(|(_, has)| **has).map(|(x, _)| *x);
    IN_ONE_PLACE * BoundingBox::around(&known.collect::<Vec<_>>()).size().length()
}

/// For each vertex the first one that lies no farther than `reach` [m] from it, which is often itself; always itself for one
/// without a place.
pub fn first_in_place(vertices: &[Vec3<f64>], has_place: &[bool], reach: f64) -> Vec<u32> {
    // Cells twice as large as the reach: what is near a vertex lies in one of eight.
    let size = if reach > 0.0 { 2.0 * reach } else { 1.0 };
    let cell = |x: f64| (x / size).floor();
    let mut first: Vec<u32> = (0..vertices.len() as u32).collect();
    let mut cells: HashMap<[u64; 3], Vec<u32>> = HashMap::with_capacity(vertices.len());
    for (v, &x) in vertices.iter().enumerate().filter(|(v, _)| has_place[*v]) {
        let at = x.to_array();
        let near: [[f64; 2]; 3] = at.map(|x| [cell(x - reach), cell(x + reach)]);
        let mut found: Option<u32> = None;
        for corner in 0..8usize {
            let key: [f64; 3] = std::array::from_fn(|axis| near[axis][corner >> axis & 1]);
            // Of both halves of an axis there is one cell where they are in the same.
            let is_again =
                (0..3).any(|axis| corner >> axis & 1 == 1 && near[axis][0] == near[axis][1]);
            if is_again {
                continue;
            }
            let known = cells.get(&key.map(bits)).into_iter().flatten();
            let close = known.filter(|&&w| (vertices[w as usize] - x).length() <= reach);
            found = close.copied().chain(found).min();
        }
        match found {
            Some(known) => first[v] = known,
            None => cells.entry(at.map(|x| bits(cell(x)))).or_default().push(v as u32),
        }
    }
    first
}

/// Zero is zero, whatever its sign.
fn bits(x: f64) -> u64 {
    (x + 0.0).to_bits()
}
