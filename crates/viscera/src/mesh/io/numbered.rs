//! Vertices that a file has numbers for.

use super::error::{Fault, Place, ReadProblem};
use crate::scalar::Vec3;

/// Vertices as listed in the file.
#[derive(Default)]
pub(super) struct Vertices {
    /// Positions in the unit of the file.
    pub positions: Vec<Vec3<f64>>,
    pub numbers: Vec<u64>,
    pub places: Vec<Place>,
    index: Index,
}

/// From numbers in the file to indices.
#[derive(Default)]
enum Index {
    /// By number, less than all numbers; [`NONE`] where there is no such vertex.
    Table { lowest: u64, of_number: Vec<u32> },
    /// Numbers and indices, ascending.
    Sorted(Vec<(u64, u32)>),
    #[default]
    Empty,
}

const NONE: u32 = u32::MAX;

impl Vertices {
    /// Makes numbers findable; they must all be different.
    pub fn number(&mut self) -> Result<(), Fault> {
        let count = self.numbers.len();
        let bounds = (self.numbers.iter().min(), self.numbers.iter().max());
        let (Some(&lowest), Some(&highest)) = bounds else { return Ok(()) };
        let mut repeated = None;
        if highest - lowest < 4 * count as u64 + 16 {
            let mut of_number = vec![NONE; (highest - lowest) as usize + 1];
            for (index, number) in self.numbers.iter().enumerate() {
                let place = &mut of_number[(number - lowest) as usize];
                if *place == NONE {
                    *place = index as u32;
                } else {
                    repeated = repeated.or(Some(index));
                }
            }
            self.index = Index::Table { lowest, of_number };
        } else {
            let pairs = self.numbers.iter().zip(0..).map(|(number, index)| (*number, index));
            let mut pairs: Vec<(u64, u32)> = pairs.collect();
            pairs.sort_unstable();
            let same = pairs.windows(2).find(|pair| pair[0].0 == pair[1].0);
            repeated = same.map(|pair| pair[1].1 as usize);
            self.index = Index::Sorted(pairs);
        }
        match repeated {
            None => Ok(()),
            Some(index) => {
                let problem = ReadProblem::RepeatedNumber { number: self.numbers[index] };
                Err(Fault { place: self.places.get(index).copied(), problem })
            }
        }
    }

    pub fn find(&self, number: u64) -> Option<u32> {
        match &self.index {
            Index::Empty => None,
            Index::Table { lowest, of_number } => {
                let at = usize::try_from(number.checked_sub(*lowest)?).ok()?;
                of_number.get(at).copied().filter(|index| *index != NONE)
            }
            Index::Sorted(pairs) => {
                let at = pairs.binary_search_by_key(&number, |pair| pair.0).ok()?;
                Some(pairs[at].1)
            }
        }
    }

    fn number_range(&self) -> Option<(u64, u64)> {
        Some((*self.numbers.iter().min()?, *self.numbers.iter().max()?))
    }

    /// The problem of an element that names a vertex which is not there.
    pub fn unknown(&self, element: String, number: u64, place: Option<Place>) -> Fault {
        let vertex_count = self.positions.len();
        let (vertex, numbers) = (number.to_string(), self.number_range());
        let problem = ReadProblem::UnknownVertex { element, vertex, vertex_count, numbers };
        Fault { place, problem }
    }
}
