//! The sparse matrix of Newton's method: pattern, assembly, Cholesky factor, and what that costs.
//!
//! Only the lower triangle over free vertices is stored, in columns: three per vertex, each with the
//! three rows of every vertex that shares an element with it.

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::cholesky::{
    LltRef, SymbolicCholesky, SymbolicCholeskyRaw, factorize_symbolic_cholesky,
};
use faer::sparse::{FaerError, SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
use viscera::scalar::{Vec3, vec3};

use super::problem::Problem;

/// Multiplications that one core does per second in a factorisation; for estimates only. Measured
/// 1.5e9 to 6e9 on a server core, larger meshes at the higher end.
const RATE: f64 = 3e9;

/// Newton steps of a typical solve; for estimates only.
const TYPICAL_STEPS: f64 = 10.0;

/// What solving needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cost {
    /// Unknowns: three per free vertex.
    pub unknowns: usize,
    /// Stored entries of the matrix.
    pub matrix_entries: usize,
    /// Stored entries of its Cholesky factor.
    pub factor_entries: usize,
    /// Memory [B] of both, of the scratch, and of the elements' data.
    pub bytes: u64,
    /// Time [s] of one factorisation, roughly.
    pub factor_seconds: f64,
    /// Time [s] of a solve of ten Newton steps, roughly.
    pub solve_seconds: f64,
}

/// Which vertices are unknowns, and where their entries lie.
#[derive(Clone, Debug)]
pub struct Pattern {
    /// Number of each vertex among the free ones; `None` where pinned.
    free_index: Vec<Option<u32>>,
    /// The free vertices in order.
    free: Vec<u32>,
    /// Rows of block column `j`: `block_rows[block_offsets[j] .. block_offsets[j + 1]]`, ascending,
    /// itself first.
    block_offsets: Vec<usize>,
    block_rows: Vec<u32>,
    column_offsets: Vec<usize>,
    rows: Vec<usize>,
}

impl Pattern {
    /// Lists the couplings of a problem with some of its vertices pinned.
    pub fn new(problem: &Problem, pinned: &[bool]) -> Self {
        let mut free = Vec::new();
        let free_index: Vec<Option<u32>> = pinned
            .iter()
            .enumerate()
            .map(|(v, &pinned)| {
                (!pinned).then(|| {
                    free.push(v as u32);
                    free.len() as u32 - 1
                })
            })
            .collect();
        // Groups may be large and overlap much: by vertex, so that no pair is listed twice.
        let groups: Vec<&[u32]> = problem.connections().collect();
        let mut groups_of = vec![Vec::new(); free.len()];
        for (number, group) in (0u32..).zip(&groups) {
            for j in group.iter().filter_map(|&v| free_index[v as usize]) {
                groups_of[j as usize].push(number);
            }
        }
        let mut block_offsets = vec![0];
        let mut block_rows: Vec<u32> = Vec::new();
        let mut last_column = vec![u32::MAX; free.len()];
        for (column, of_column) in (0u32..).zip(&groups_of) {
            last_column[column as usize] = column;
            block_rows.push(column);
            for &group in of_column {
                let members = groups[group as usize].iter();
                for row in members.filter_map(|&v| free_index[v as usize]) {
                    if row > column && last_column[row as usize] != column {
                        last_column[row as usize] = column;
                        block_rows.push(row);
                    }
                }
            }
            let first = block_offsets[column as usize];
            block_rows[first..].sort_unstable();
            block_offsets.push(block_rows.len());
        }
        let (mut column_offsets, mut rows) = (vec![0], Vec::new());
        for j in 0..free.len() {
            let blocks = &block_rows[block_offsets[j]..block_offsets[j + 1]];
            for axis in 0..3 {
                let all = blocks.iter().flat_map(|&row| (0..3).map(move |b| 3 * row as usize + b));
                rows.extend(all.skip(axis));
                column_offsets.push(rows.len());
            }
        }
        Self { free_index, free, block_offsets, block_rows, column_offsets, rows }
    }

    /// The free vertices in order.
    pub fn free(&self) -> &[u32] {
        &self.free
    }

    /// Number of unknowns.
    pub fn unknowns(&self) -> usize {
        3 * self.free.len()
    }

    /// True where the block of two vertices lies in the stored triangle.
    pub fn holds(&self, row: u32, column: u32) -> bool {
        let index = |v: u32| self.free_index[v as usize];
        matches!((index(row), index(column)), (Some(i), Some(j)) if i >= j)
    }

    fn symbolic(&self) -> SymbolicSparseColMatRef<'_, usize> {
        let n = self.unknowns();
        SymbolicSparseColMatRef::new_checked(n, n, &self.column_offsets, None, &self.rows)
    }
}

/// Values for a pattern.
#[derive(Clone, Debug)]
pub struct MatrixValues {
    values: Vec<f64>,
}

impl MatrixValues {
    /// Zeros.
    pub fn new(pattern: &Pattern) -> Self {
        Self { values: vec![0.0; pattern.rows.len()] }
    }

    /// Adds a 3 x 3 block, where it lies in the stored triangle.
    pub fn add(&mut self, pattern: &Pattern, row: u32, column: u32, block: &[[f64; 3]; 3]) {
        let index = |v: u32| pattern.free_index[v as usize];
        let (Some(i), Some(j)) = (index(row), index(column)) else { return };
        let j = j as usize;
        let blocks = &pattern.block_rows[pattern.block_offsets[j]..pattern.block_offsets[j + 1]];
        let Ok(place) = blocks.binary_search(&i) else { return };
        for axis in 0..3 {
            let first = pattern.column_offsets[3 * j + axis];
            for b in 0..3 {
                // The diagonal block has no entries above the diagonal.
                if place > 0 || b >= axis {
                    self.values[first + 3 * place + b - axis] += block[b][axis];
                }
            }
        }
    }

    /// Adds a multiple of another matrix of the same pattern.
    pub fn add_scaled(&mut self, other: &Self, factor: f64) {
        for (value, other) in self.values.iter_mut().zip(&other.values) {
            *value += factor * other;
        }
    }

    /// Calls back with row, column and value of every stored entry: of the lower triangle.
    pub fn entries(&self, pattern: &Pattern, mut with: impl FnMut(usize, usize, f64)) {
        for column in 0..pattern.unknowns() {
            for at in pattern.column_offsets[column]..pattern.column_offsets[column + 1] {
                with(pattern.rows[at], column, self.values[at]);
            }
        }
    }

    /// Adds to every entry of the diagonal.
    pub fn shift(&mut self, pattern: &Pattern, amount: f64) {
        for &first in &pattern.column_offsets[..pattern.unknowns()] {
            self.values[first] += amount;
        }
    }

    /// The largest entry of the diagonal.
    pub fn largest_diagonal(&self, pattern: &Pattern) -> f64 {
        let diagonal = pattern.column_offsets[..pattern.unknowns()].iter();
        diagonal.map(|&first| self.values[first].abs()).fold(0.0, f64::max)
    }

    /// The matrix times a vector over all vertices; pinned ones count as zero.
    pub fn multiply(&self, pattern: &Pattern, x: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let input = gather(pattern, x);
        let mut output = vec![0.0; input.len()];
        for column in 0..input.len() {
            for at in pattern.column_offsets[column]..pattern.column_offsets[column + 1] {
                let row = pattern.rows[at];
                output[row] += self.values[at] * input[column];
                if row != column {
                    output[column] += self.values[at] * input[row];
                }
            }
        }
        scatter(pattern, &output, x.len())
    }
}

/// Why there is no factor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FactorError {
    /// Some curvature is negative or no number.
    Indefinite,
    /// There is not enough memory, or the matrix has more entries than can be numbered.
    TooLarge,
    /// Somebody wants no more of it.
    Stopped,
}

impl From<FaerError> for FactorError {
    fn from(_: FaerError) -> Self {
        Self::TooLarge
    }
}

/// The order of elimination, found once per pattern, and the memory of the factor.
pub struct Factorization {
    symbolic: SymbolicCholesky<usize>,
    values: Vec<f64>,
    scratch: Option<MemBuffer>,
}

impl Factorization {
    /// Analyses a pattern.
    pub fn new(pattern: &Pattern) -> Result<Self, FactorError> {
        let (order, params) = (Default::default(), Default::default());
        let symbolic = factorize_symbolic_cholesky(pattern.symbolic(), Side::Lower, order, params)?;
        Ok(Self { symbolic, values: Vec::new(), scratch: None })
    }

    /// What factorising and solving will take.
    pub fn cost(&self, pattern: &Pattern, problem: &Problem) -> Cost {
        let multiplications: f64 = match self.symbolic.raw() {
            SymbolicCholeskyRaw::Simplicial(factor) => {
                let columns = factor.col_ptr().windows(2);
                columns.map(|ends| ((ends[1] - ends[0]) as f64).powi(2)).sum()
            }
            SymbolicCholeskyRaw::Supernodal(factor) => (0..factor.n_supernodes())
                .map(|s| {
                    let width = factor.supernode_end()[s] - factor.supernode_begin()[s];
                    let below =
                        factor.col_ptr_for_row_idx()[s + 1] - factor.col_ptr_for_row_idx()[s];
                    (1..=width).map(|column| ((column + below) as f64).powi(2)).sum::<f64>()
                })
                .sum(),
        };
        let (matrix, factor) = (pattern.rows.len(), self.symbolic.len_val());
        let scratch = self.scratch_request().unaligned_bytes_required();
        let points = problem.linear.points.len() + 3 * problem.quadratic.points.len();
        // Matrix: pattern, values and a permuted copy. A point: gradients, nodes, stress.
        let bytes = 16 * matrix + 8 * factor + scratch + 200 * points;
        let factor_seconds = 0.5 * multiplications / RATE + 1e-7 * matrix as f64;
        Cost {
            unknowns: pattern.unknowns(),
            matrix_entries: matrix,
            factor_entries: factor,
            bytes: bytes as u64,
            factor_seconds,
            solve_seconds: TYPICAL_STEPS * (factor_seconds + 8e-6 * points as f64),
        }
    }

    fn scratch_request(&self) -> faer::dyn_stack::StackReq {
        let factor =
            self.symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Default::default());
        factor.or(self.symbolic.solve_in_place_scratch::<f64>(1, Par::Seq))
    }

    /// Factorises.
    pub fn factorize(
        &mut self,
        pattern: &Pattern,
        matrix: &MatrixValues,
    ) -> Result<(), FactorError> {
        if !matrix.values.iter().all(|value| value.is_finite()) {
            return Err(FactorError::Indefinite);
        }
        if self.scratch.is_none() {
            let length = self.symbolic.len_val();
            self.values.try_reserve_exact(length).map_err(|_| FactorError::TooLarge)?;
            self.values.resize(length, 0.0);
            let scratch = MemBuffer::try_new(self.scratch_request());
            self.scratch = Some(scratch.map_err(|_| FactorError::TooLarge)?);
        }
        let Some(scratch) = &mut self.scratch else { return Err(FactorError::TooLarge) };
        let matrix = SparseColMatRef::new(pattern.symbolic(), &matrix.values);
        let factor = self.symbolic.factorize_numeric_llt(
            &mut self.values,
            matrix,
            Side::Lower,
            Default::default(),
            Par::Seq,
            MemStack::new(scratch),
            Default::default(),
        );
        factor.map(|_| ()).map_err(|_| FactorError::Indefinite)
    }

    /// Solves with the last factor; pinned vertices get zero.
    pub fn solve(&mut self, pattern: &Pattern, right: &[Vec3<f64>]) -> Vec<Vec3<f64>> {
        let mut solution = gather(pattern, right);
        if let Some(scratch) = &mut self.scratch {
            let rows = solution.len();
            LltRef::new(&self.symbolic, &self.values).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(&mut solution, rows, 1),
                Par::Seq,
                MemStack::new(scratch),
            );
        }
        scatter(pattern, &solution, right.len())
    }
}

fn gather(pattern: &Pattern, x: &[Vec3<f64>]) -> Vec<f64> {
    pattern.free.iter().flat_map(|&v| x[v as usize].to_array()).collect()
}

fn scatter(pattern: &Pattern, values: &[f64], vertex_count: usize) -> Vec<Vec3<f64>> {
    let mut x = vec![Vec3::ZERO; vertex_count];
    for (&v, value) in pattern.free.iter().zip(values.chunks_exact(3)) {
        x[v as usize] = vec3(value[0], value[1], value[2]);
    }
    x
}
