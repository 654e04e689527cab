//! Connected parts that may touch, laid out as one part: for devices, which judge a part by its own sums alone.
//!
//! On the processor parts that share a pair in a step are one group (`solver/step/groups.rs`), found anew in every step. A
//! device would need sums over groups whose members change. Instead, parts that may ever share a pair are one part from the
//! beginning: bodies that meet each other, pieces of a body that meets itself, and what ties bind. So a body is judged with
//! another while they are far apart as well.

use crate::elements::kinds::Kind;
use crate::model::{ElementList, Model, Numbering, for_each_kind};
use crate::scalar::Real;
use std::sync::Arc;

/// Connected parts that are one part of a layout.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Joined {
    /// The part of the layout of each of the model's.
    pub of_parts: Vec<u32>,
    /// The model's part of each vertex, in the solver's numbering.
    pub of_vertices: Vec<u32>,
    /// Of the model's parts, whether anchors hold them.
    pub anchored: Vec<bool>,
}

impl Joined {
    /// The lowest of the parts that each may share a pair with; nothing where none may with another.
    fn leads<S: Real>(model: &Model<S>) -> Option<Vec<u32>> {
        let (skin, contact) = (&model.skin, &model.tissue_contact);
        let mut leads: Vec<u32> = (0..model.part_count as u32).collect();
        fn root(leads: &[u32], mut part: u32) -> u32 {
            while leads[part as usize] != part {
                part = leads[part as usize];
            }
            part
        }
        let mut join = |a: u32, b: u32| {
            let [a, b] = [a, b].map(|part| root(&leads, part));
            leads[a.max(b) as usize] = a.min(b);
        };
        let of_point = |point: u32| model.part_of(skin.points[point as usize].vertices[0]) as u32;
        // The first part of each body, or of all bodies.
        let mut first: Vec<Option<u32>> = vec![None; model.bodies.len()];
        for (triangle, &body) in skin.triangles.iter().zip(&skin.bodies) {
            let part = of_point(triangle[0]);
            let group = if contact.bodies { 0 } else { body as usize };
            if contact.bodies || contact.itself {
                join(part, *first[group].get_or_insert(part));
            }
        }
        for tie in &skin.ties {
            let sample = skin.samples[tie.sample as usize].vertices[0];
            join(model.part_of(sample) as u32, of_point(skin.triangles[tie.triangle as usize][0]));
        }
        let all: Vec<u32> = (0..leads.len() as u32).map(|part| root(&leads, part)).collect();
        all.iter().zip(0..).any(|(lead, part)| *lead != part).then_some(all)
    }

    /// The same model with parts that may share pairs as one part, and which they are; nothing where there are none.
    pub fn new<S: Real>(model: &Model<S>) -> Option<(Model<S>, Self)> {
        let leads = Self::leads(model)?;
        // Parts have the order of their first vertices, and so have their leads.
        let mut numbers = vec![0; leads.len()];
        let mut count = 0;
        for (part, &lead) in leads.iter().enumerate() {
            if lead as usize == part {
                numbers[part] = count;
                count += 1;
            }
        }
        let of_parts: Vec<u32> = leads.iter().map(|&lead| numbers[lead as usize]).collect();
        let mut joined = model.clone();
        for part in &mut joined.part_numbers {
            *part = of_parts[*part as usize];
        }
        joined.part_count = count as usize;
        let numbers = &joined.part_numbers;
        joined.numbering =
            Arc::new(Numbering::along_curves(&model.places, numbers, joined.part_count));
        let mut anchored = vec![false; leads.len()];
        for_each_kind!(model, list => hold(list, model, &mut anchored));
        Some((joined, Self { of_parts, of_vertices: Vec::new(), anchored }))
    }

    /// In the numbering of a layout.
    pub fn numbered<S: Real>(self, model: &Model<S>, numbering: &Numbering) -> Self {
        let of_vertices = numbering.order.iter().map(|&v| model.part_numbers[v as usize]);
        Self { of_vertices: of_vertices.collect(), ..self }
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        size_of_val(&self.of_parts[..])
            + size_of_val(&self.of_vertices[..])
            + size_of_val(&self.anchored[..])
    }
}

/// Marks the parts that anchored elements of a kind hold.
fn hold<S: Real, K: Kind<N, M>, const N: usize, const M: usize>(
    list: &ElementList<S, K, N, M>,
    model: &Model<S>,
    anchored: &mut [bool],
) {
    if K::IS_ANCHORED {
        list.vertices.iter().for_each(|all| anchored[model.part_of(all[0])] = true);
    }
}
