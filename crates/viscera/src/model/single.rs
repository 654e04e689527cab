//! Elements that are not tetrahedra, set by set: the only list of their kinds, and how a pass over any of them
//! finds its vertices, copies and multipliers.

use std::ops::Range;

use super::parts::Part;
use super::{AttachmentSet, Model, SpringSet};
use crate::elements::kinds::{Attachment, Energy, Spring, XpbdBlock};
use crate::scalar::lanes::Point;
use crate::scalar::{Real, Vec3};

/// Evaluates an expression with `$set` as the set of each kind in turn.
macro_rules! for_each_kind {
    ($model:expr, $set:ident => $result:expr) => {{
        {
            let $set = &$model.springs;
            $result
        }
        {
            let $set = &$model.attachments;
            $result
        }
    }};
}
pub(crate) use for_each_kind;

/// The elements of one kind, each on `N` vertices with `M` multipliers.
pub(crate) trait ElementSet<S: Real, const N: usize, const M: usize> {
    /// One of them, in the precision of whoever asks.
    type Element<T: Real>: Energy<T, N> + XpbdBlock<T, N, M>;

    /// Element `i`; `anchors` are those of the step, the user's order [m].
    fn element<T: Real>(&self, i: usize, anchors: &[Vec3<S>]) -> Self::Element<T>;

    /// How many there are.
    fn count(&self) -> usize;

    /// The user's vertices.
    fn vertices(&self, i: usize) -> [u32; N];

    /// The copies that a sweep works on.
    fn copies(&self, i: usize) -> [u32; N];

    /// Those of one colour.
    fn color(&self, color: usize) -> Range<usize>;

    /// Those of one connected part.
    fn of_part<'p>(&self, part: &'p Part) -> impl Iterator<Item = usize> + 'p;

    /// Where the first multiplier of the set stands.
    fn first_multiplier(&self) -> usize;

    /// Where the multipliers of an element stand.
    fn multipliers(&self, i: usize) -> Range<usize> {
        let first = self.first_multiplier() + M * i;
        first..first + M
    }

    /// Its multipliers.
    fn read(&self, i: usize, multipliers: &[S]) -> [S; M] {
        let range = self.multipliers(i);
        std::array::from_fn(|p| multipliers[range.start + p])
    }

    /// Where its vertices are, out of positions in the solver's numbering [m].
    fn places(&self, i: usize, model: &Model<S>, x: &[Point<S>]) -> [Vec3<S>; N] {
        self.vertices(i).map(|v| x[model.numbering.of(v)].vec3())
    }
}

fn cast<S: Real, T: Real>(value: S) -> T {
    T::from_f64(value.to_f64())
}

impl<S: Real> ElementSet<S, 2, 1> for SpringSet<S> {
    type Element<T: Real> = Spring<T>;

    fn element<T: Real>(&self, i: usize, _: &[Vec3<S>]) -> Spring<T> {
        Spring { rest_length: cast(self.rest_length[i]), stiffness: cast(self.stiffness[i]) }
    }

    fn count(&self) -> usize {
        self.vertices.len()
    }

    fn vertices(&self, i: usize) -> [u32; 2] {
        self.vertices[i]
    }

    fn copies(&self, i: usize) -> [u32; 2] {
        self.copies[i]
    }

    fn color(&self, color: usize) -> Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    fn of_part<'p>(&self, part: &'p Part) -> impl Iterator<Item = usize> + 'p {
        part.springs()
    }

    fn first_multiplier(&self) -> usize {
        self.multiplier_offset
    }
}

impl<S: Real> ElementSet<S, 1, 3> for AttachmentSet<S> {
    type Element<T: Real> = Attachment<T>;

    fn element<T: Real>(&self, i: usize, anchors: &[Vec3<S>]) -> Attachment<T> {
        let anchor = anchors[self.order[i] as usize].cast();
        Attachment { anchor, stiffness: cast(self.stiffness[i]) }
    }

    fn count(&self) -> usize {
        self.vertices.len()
    }

    fn vertices(&self, i: usize) -> [u32; 1] {
        [self.vertices[i]]
    }

    fn copies(&self, i: usize) -> [u32; 1] {
        [self.copies[i]]
    }

    fn color(&self, color: usize) -> Range<usize> {
        self.color_offsets[color] as usize..self.color_offsets[color + 1] as usize
    }

    fn of_part<'p>(&self, part: &'p Part) -> impl Iterator<Item = usize> + 'p {
        part.attachments()
    }

    fn first_multiplier(&self) -> usize {
        self.multiplier_offset
    }
}
