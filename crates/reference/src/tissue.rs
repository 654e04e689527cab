//! Tissue to second order: energy density, first Piola stress, and the stress's derivative.
//!
//! ```text
//! Saint Venant-Kirchhoff   dP = dF S + F (2 mu dE + lambda tr(dE) I),   dE = sym(F^T dF)
//! stable neo-Hookean       dP = mu dF + lh (cof F : dF) cof F + (lh (J - 1) - mu) d(cof F)
//! viscosity                as Saint Venant-Kirchhoff of C - C_n, times eta/dt
//! ```
//!
//! Energies and stresses are the library's own; only the derivative is added here.

use faer::{Mat, Side};
use viscera::elements::green_strain::{self, Voigt};
use viscera::elements::neo_hookean;
use viscera::material::MaterialModel;
use viscera::scalar::{Mat3, Vec3};

/// `dP/dF` [Pa]: rows and columns number the entries of `F` column by column.
pub type Stiffness = [[f64; 9]; 9];

/// The constants of one material.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TissueLaw {
    /// Its energy.
    pub model: MaterialModel,
    /// Lame's first parameter [Pa].
    pub lame_lambda: f64,
    /// Lame's second parameter [Pa].
    pub lame_mu: f64,
    /// Retardation time [s].
    pub viscosity: f64,
}

/// Green strain at the start of a step, with the rate `eta/dt` at which leaving it is resisted.
#[derive(Clone, Copy, Debug)]
pub struct Creep {
    /// The strain.
    pub start: Voigt<f64>,
    /// Retardation time over the step.
    pub rate: f64,
}

impl Creep {
    /// At a deformation gradient.
    pub fn new(f: &Mat3<f64>, rate: f64) -> Self {
        Self { start: green_strain::strain(f), rate }
    }
}

impl TissueLaw {
    /// Energy density [Pa].
    pub fn energy_density(&self, f: &Mat3<f64>, creep: Option<&Creep>) -> f64 {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let elastic = match self.model {
            MaterialModel::SaintVenantKirchhoff => {
                green_strain::energy_density(&green_strain::strain(f), lambda, mu)
            }
            MaterialModel::StableNeoHookean => neo_hookean::energy_density(f, lambda, mu),
        };
        elastic
            + creep.map_or(0.0, |creep| {
                let change = strain_change(f, &creep.start);
                creep.rate * green_strain::energy_density(&change, lambda, mu)
            })
    }

    /// First Piola stress [Pa].
    pub fn piola(&self, f: &Mat3<f64>, creep: Option<&Creep>) -> Mat3<f64> {
        let (lambda, mu) = (self.lame_lambda, self.lame_mu);
        let elastic = match self.model {
            MaterialModel::SaintVenantKirchhoff => {
                green_strain::piola(f, &green_strain::strain(f), lambda, mu)
            }
            MaterialModel::StableNeoHookean => neo_hookean::piola(f, lambda, mu),
        };
        creep.map_or(elastic, |creep| {
            let change = strain_change(f, &creep.start);
            elastic + green_strain::piola(f, &change, lambda, mu) * creep.rate
        })
    }

    /// `dP/dF` [Pa].
    pub fn stiffness(&self, f: &Mat3<f64>, creep: Option<&Creep>) -> Stiffness {
        let mut matrix = [[0.0; 9]; 9];
        for column in 0..9 {
            let mut direction = Mat3::ZERO;
            direction.columns[column / 3][column % 3] = 1.0;
            let mut change = match self.model {
                MaterialModel::SaintVenantKirchhoff => {
                    self.green_change(f, &green_strain::strain(f), &direction)
                }
                MaterialModel::StableNeoHookean => self.neo_hookean_change(f, &direction),
            };
            if let Some(creep) = creep {
                let viscous = self.green_change(f, &strain_change(f, &creep.start), &direction);
                change = change + viscous * creep.rate;
            }
            for row in 0..9 {
                matrix[row][column] = change.columns[row / 3][row % 3];
            }
        }
        matrix
    }

    fn green_change(&self, f: &Mat3<f64>, strain: &Voigt<f64>, direction: &Mat3<f64>) -> Mat3<f64> {
        let stress = self.hooke(&tensor(strain));
        let product = f.transpose() * *direction;
        let change = (product + product.transpose()) * 0.5;
        *direction * stress + *f * self.hooke(&change)
    }

    /// `2 mu E + lambda tr(E) I`.
    fn hooke(&self, strain: &Mat3<f64>) -> Mat3<f64> {
        *strain * (2.0 * self.lame_mu) + Mat3::IDENTITY * (self.lame_lambda * strain.trace())
    }

    fn neo_hookean_change(&self, f: &Mat3<f64>, direction: &Mat3<f64>) -> Mat3<f64> {
        let volume_modulus = self.lame_lambda + self.lame_mu;
        let cofactor = f.cofactor();
        let along: f64 = (0..3).map(|c| cofactor.columns[c].dot(direction.columns[c])).sum();
        let pressure = volume_modulus * neo_hookean::volume_change(f) - self.lame_mu;
        *direction * self.lame_mu
            + cofactor * (volume_modulus * along)
            + cofactor_change(f, direction) * pressure
    }
}

fn strain_change(f: &Mat3<f64>, start: &Voigt<f64>) -> Voigt<f64> {
    let mut change = green_strain::strain(f);
    for (c, start) in change.iter_mut().zip(start) {
        *c -= start;
    }
    change
}

/// The strain tensor of six components, whose shear counts twice.
fn tensor(c: &Voigt<f64>) -> Mat3<f64> {
    green_strain::symmetric(&[c[0], c[1], c[2], 0.5 * c[3], 0.5 * c[4], 0.5 * c[5]])
}

/// `d(cof F)` along a direction; `cof F = [f1 x f2, f2 x f0, f0 x f1]`.
pub fn cofactor_change(f: &Mat3<f64>, direction: &Mat3<f64>) -> Mat3<f64> {
    let ([a, b, c], [da, db, dc]) = (f.columns, direction.columns);
    Mat3::from_columns(
        db.cross(c) + b.cross(dc),
        dc.cross(a) + c.cross(da),
        da.cross(b) + a.cross(db),
    )
}

/// Mean pressure of a first Piola stress: `-tr(P F^T)/(3 J)` [Pa].
pub fn pressure(piola: &Mat3<f64>, f: &Mat3<f64>) -> f64 {
    let pairs = piola.columns.iter().zip(&f.columns);
    -pairs.map(|(p, f)| p.dot(*f)).sum::<f64>() / (3.0 * f.determinant())
}

/// The nearest positive semi-definite matrix: negative eigenvalues become zero.
pub fn project(matrix: &mut Stiffness) {
    let full = Mat::from_fn(9, 9, |i, j| 0.5 * (matrix[i][j] + matrix[j][i]));
    // Only a matrix with NaN entries has no eigenvalues; it stays what it is.
    let Ok(eigen) = full.self_adjoint_eigen(Side::Lower) else { return };
    let (values, vectors) = (eigen.S().column_vector(), eigen.U());
    *matrix = [[0.0; 9]; 9];
    for k in 0..9 {
        let value = values[k].max(0.0);
        for i in 0..9 {
            for j in 0..9 {
                matrix[i][j] += value * vectors[(i, k)] * vectors[(j, k)];
            }
        }
    }
}

/// `g_i^T A g_j` as a 3 x 3 block, rows by the force's axis.
pub fn block(matrix: &Stiffness, gi: Vec3<f64>, gj: Vec3<f64>) -> [[f64; 3]; 3] {
    let mut block = [[0.0; 3]; 3];
    for (b, &weight_i) in gi.to_array().iter().enumerate() {
        for (d, &weight_j) in gj.to_array().iter().enumerate() {
            for a in 0..3 {
                for c in 0..3 {
                    block[a][c] += weight_i * weight_j * matrix[3 * b + a][3 * d + c];
                }
            }
        }
    }
    block
}
