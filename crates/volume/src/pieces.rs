//! Connected pieces of some labels.

use crate::LabelMap;

/// Voxels of some labels, without crumbs.
pub struct Pieces<'a> {
    map: &'a LabelMap,
    /// The piece of each voxel, counting from 1; 0 for all other voxels.
    piece: Vec<u32>,
    is_kept: Vec<bool>,
    bounds: Option<[[usize; 3]; 2]>,
    /// How many voxels are kept, and in how many pieces.
    pub voxels: usize,
    pub kept: usize,
    /// Pieces that are left out, and their voxels.
    pub crumbs: [usize; 2],
}

impl<'a> Pieces<'a> {
    /// Of voxels that share a face; pieces below a share of the largest are crumbs.
    pub fn of(map: &'a LabelMap, labels: &[u16], crumb: f64) -> Self {
        let dims = map.dims();
        let steps = [1, dims[0], dims[0] * dims[1]];
        let is_of = |place: usize| labels.contains(&map.labels()[place]);
        let mut piece = vec![0u32; map.labels().len()];
        let mut sizes = vec![0usize];
        let mut stack = Vec::new();
        for seed in 0..piece.len() {
            if piece[seed] != 0 || !is_of(seed) {
                continue;
            }
            let number = sizes.len() as u32;
            sizes.push(0);
            piece[seed] = number;
            stack.push(seed);
            while let Some(place) = stack.pop() {
                sizes[number as usize] += 1;
                for axis in 0..3 {
                    let index = place / steps[axis] % dims[axis];
                    let before = (index > 0).then(|| place - steps[axis]);
                    let behind = (index + 1 < dims[axis]).then(|| place + steps[axis]);
                    for next in [before, behind].into_iter().flatten() {
                        if piece[next] == 0 && is_of(next) {
                            piece[next] = number;
                            stack.push(next);
                        }
                    }
                }
            }
        }
        let largest = sizes.iter().copied().max().unwrap_or(0);
        let is_kept: Vec<bool> =
            sizes.iter().map(|&size| size > 0 && size as f64 >= crumb * largest as f64).collect();
        let of =
            |kept: bool| sizes.iter().zip(&is_kept).filter(move |(s, k)| **k == kept && **s > 0);
        let (kept, voxels) = (of(true).count(), of(true).map(|(size, _)| size).sum());
        let crumbs = [of(false).count(), of(false).map(|(size, _)| size).sum()];
        let mut bounds: Option<[[usize; 3]; 2]> = None;
        for (place, &number) in piece.iter().enumerate() {
            if is_kept[number as usize] && number > 0 {
                let at = [0, 1, 2].map(|axis| place / steps[axis] % dims[axis]);
                let [low, high] = bounds.get_or_insert([at, at]);
                for axis in 0..3 {
                    low[axis] = low[axis].min(at[axis]);
                    high[axis] = high[axis].max(at[axis]);
                }
            }
        }
        Self { map, piece, is_kept, bounds, voxels, kept, crumbs }
    }

    /// The lowest and highest indices of kept voxels.
    pub fn bounds(&self) -> Option<[[usize; 3]; 2]> {
        self.bounds
    }

    /// Whether a voxel of the image is kept.
    pub fn has(&self, [x, y, z]: [usize; 3]) -> bool {
        let dims = self.map.dims();
        let number = self.piece[x + dims[0] * (y + dims[1] * z)];
        number > 0 && self.is_kept[number as usize]
    }
}
