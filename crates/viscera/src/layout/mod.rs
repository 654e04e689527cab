//! A model as the solvers with constraints and forces per element work on it: tetrahedra in blocks of eight, sorted by
//! colour, copies of vertices where there are too few colours, places of multipliers, connected parts. Each method
//! lays a model out as it needs it; the model itself knows of none.
//!
//! Vertices are in the solver's numbering (`Model::numbering`); `order` of each set maps back to the user's numbers.

mod cells;
mod clusters;
mod domains;
pub(crate) mod elements;
#[cfg(feature = "gpu")]
mod joined;
pub(crate) mod lattice;
mod order;
mod parts;
mod pieces;
mod recovered;
mod samples;
mod skin;
mod tets;

use std::ops::Range;
use std::sync::Arc;

#[cfg(feature = "gpu")]
pub(crate) use clusters::CLUSTER_VERTICES;
use clusters::clustered;
pub(crate) use clusters::{HAS_CLUSTERS, SetClusters};
pub use domains::{Domains, Smoothing};
pub(crate) use elements::{Before, Moments};
pub use elements::{ElementSet, ElementSets};
#[cfg(feature = "gpu")]
pub(crate) use joined::Joined;
use order::{Order, cell_by_cell, renumbered_copies};
use parts::Laid;
pub(crate) use parts::Part;
pub(crate) use pieces::PIECE_BLOCKS;
use pieces::in_pieces;
pub(crate) use recovered::{Entry, Frames, PartRanges, RecoveredTables};
pub(crate) use samples::LaidSample;
pub(crate) use skin::LaidSkin;
pub(crate) use tets::TetBlock;
pub use tets::{LaidTet, TetSet};

use crate::coloring::ConstraintGraph;
use crate::elements::law::{ALL_LAWS, LAWS, law_form};
use crate::material::{MaterialConstants, MaterialModel};
use crate::model::{Model, Numbering, for_each_kind};
use crate::scalar::lanes::LANES;
use crate::scalar::{Real, Vec3};
use crate::settings::{Clusters, Colors, Elements, Method, SolverSettings};

/// A model, laid out.
#[derive(Clone, Debug, PartialEq)]
pub struct Layout<S> {
    /// That of the model.
    pub revision: u64,
    /// See [`Model::rest_positions`].
    pub rest_positions: Vec<Vec3<S>>,
    /// See [`Model::masses`].
    pub masses: Vec<S>,
    /// See [`Model::materials`].
    pub materials: Vec<MaterialConstants<S>>,
    /// See [`Model::rest_anchors`].
    pub rest_anchors: Vec<Vec3<S>>,
    /// Tetrahedra of each law of tissue, in the order of [`MaterialModel::ALL`].
    pub tet_sets: [TetSet<S>; LAWS],
    /// Springs, attachments: all elements that are no tetrahedra.
    pub elements: ElementSets<S>,
    /// Number of colours.
    pub color_count: usize,
    /// The most constraints at one vertex.
    pub largest_clique: usize,
    /// Number of multipliers of all constraints, those of padding lanes included.
    pub multiplier_count: usize,
    pub(crate) numbering: Arc<Numbering>,
    /// Connected parts, in the solver's numbering: the order of their first vertices in the user's.
    pub(crate) parts: Arc<[Part]>,
    /// Copies of vertex `v`, in the solver's numbering, are `copy_offsets[v] .. copy_offsets[v + 1]`.
    pub(crate) copy_offsets: Vec<u32>,
    /// What tools touch: part by part, in the model's order.
    pub(crate) samples: Vec<LaidSample>,
    /// The part of each sample, in the model's order.
    pub(crate) sample_parts: Vec<u32>,
    /// Where tissue meets tissue.
    pub(crate) skin: Option<LaidSkin>,
    /// Where the tetrahedra of the stable neo-Hookean law are recovered-gradient tetrahedra.
    pub(crate) recovered: Option<RecoveredTables<S>>,
}

impl<S: Real> Layout<S> {
    /// Colours the constraints and sorts them, as the settings ask for colours and for the form in which the stable
    /// neo-Hookean energy is solved.
    ///
    /// Of a model that was changed after it was built, which may name vertices that there are not, this is the
    /// layout of nothing, whose revision is no model's.
    pub fn new(model: &Model<S>, settings: &SolverSettings) -> Self {
        if !model.is_as_built() {
            return Self { revision: !model.revision, ..Self::of(&Model::nothing(), settings) };
        }
        Self::of(model, settings)
    }

    /// As [`Layout::new`], for a device: where that computes how tissue meets tissue, parts that may touch are one.
    #[cfg(feature = "gpu")]
    pub(crate) fn on_device(model: &Model<S>, settings: &SolverSettings) -> Self {
        let meets = settings.meets_on_device() && (model.meets_itself() || model.ties_bodies());
        if meets
            && model.is_as_built()
            && let Some((one, joined)) = Joined::new(model)
        {
            let mut layout = Self::of(&one, settings);
            let joined = joined.numbered(model, &layout.numbering);
            if let Some(skin) = &mut layout.skin {
                skin.joined = Some(joined);
            }
            return layout;
        }
        Self::new(model, settings)
    }

    /// Where parts of the model are one.
    #[cfg(feature = "gpu")]
    pub(crate) fn joined(&self) -> Option<&Joined> {
        self.skin.as_ref()?.joined.as_ref()
    }

    fn of(model: &Model<S>, settings: &SolverSettings) -> Self {
        let graph = constraint_graph(model);
        let numbering = &match settings.method {
            Method::Auto | Method::QuasiNewton | Method::Explicit => Arc::new(cell_by_cell(model)),
            Method::Xpbd => Arc::clone(&model.numbering),
        };
        // Forces are added tetrahedron by tetrahedron where no constraint is solved: no colours, but pieces.
        let clusters = match (settings.method, settings.clusters, settings.colors) {
            (Method::Xpbd, Clusters::OfTets(size), Colors::Unlimited) if HAS_CLUSTERS => {
                Some(clustered(model, &graph, numbering, size))
            }
            _ => None,
        };
        let coloring = match (settings.method, &clusters) {
            (Method::Auto | Method::QuasiNewton | Method::Explicit, _) => {
                in_pieces(model, &graph, numbering)
            }
            (Method::Xpbd, Some(clusters)) => clusters.coloring.clone(),
            (Method::Xpbd, None) => {
                let coloring = graph.color(model.vertex_count(), settings.colors);
                debug_assert_eq!(coloring.validate(&graph), None);
                coloring
            }
        };
        let part_of: Vec<u32> =
            numbering.order.iter().map(|&v| model.part_numbers[v as usize]).collect();
        let copy_offsets = renumbered_copies(&coloring, numbering);
        let color_count = coloring.color_count as usize;
        let mut order = Order {
            graph: &graph,
            coloring: &coloring,
            clusters: clusters.as_ref(),
            numbering,
            part_of: &part_of,
            copy_offsets: &copy_offsets,
            multipliers: 0,
            sorted: model.tet_count(),
        };
        let tet_sets =
            ALL_LAWS.map(|law| TetSet::new(model, law, law_form(law, settings), &mut order));
        let elements = ElementSets::new(&model.elements, &mut order);
        let multiplier_count = order.multipliers;
        let parts = Laid {
            part_of: &part_of,
            copy_offsets: &copy_offsets,
            sets: &tet_sets,
            elements: elements.laid(),
            color_count,
        }
        .parts();
        let mut layout = Self {
            revision: model.revision,
            rest_positions: model.rest_positions.clone(),
            masses: model.masses.clone(),
            materials: model.materials.clone(),
            rest_anchors: model.rest_anchors.clone(),
            tet_sets,
            elements,
            color_count,
            largest_clique: coloring.largest_clique as usize,
            multiplier_count: match settings.method {
                Method::Auto | Method::QuasiNewton => 0,
                Method::Xpbd | Method::Explicit => multiplier_count,
            },
            numbering: Arc::clone(numbering),
            parts: Arc::from(parts),
            sample_parts: samples::parts(model),
            samples: samples::laid(model, &model.samples, numbering, &part_of),
            skin: LaidSkin::new(model, settings, numbering, &part_of),
            copy_offsets,
            recovered: None,
        };
        // XPBD has linear tetrahedra; the solver refuses settings that ask it for more.
        if settings.elements == Elements::Recovered && settings.method != Method::Xpbd {
            let domains = Domains::new(model, Smoothing::RECOVERED);
            layout.recovered = Some(RecoveredTables::new(&layout, &domains));
        }
        layout
    }

    /// Number of vertices of all bodies.
    pub fn vertex_count(&self) -> usize {
        self.masses.len()
    }

    /// Number of tetrahedra of all bodies.
    pub fn tet_count(&self) -> usize {
        self.tet_sets.iter().map(TetSet::len).sum()
    }

    /// Number of copies that a sweep works on.
    pub fn copy_count(&self) -> usize {
        self.copy_offsets.last().map_or(0, |&count| count as usize)
    }

    /// True where a vertex has more than one copy.
    pub fn is_split(&self) -> bool {
        self.copy_count() > self.vertex_count()
    }

    /// Number of connected parts: elements connect vertices.
    pub fn part_count(&self) -> usize {
        self.parts.len()
    }

    /// The number of the part that one of the solver's vertices belongs to.
    pub(crate) fn part_at(&self, v: usize) -> usize {
        self.parts.partition_point(|part| part.vertices.end <= v)
    }

    /// The places of a part's samples.
    pub(crate) fn samples_of(&self, part: usize) -> Range<usize> {
        let first = |part: usize| self.samples.partition_point(|s| (s.part as usize) < part);
        first(part)..first(part + 1)
    }

    /// The connected part of a sample of the surface, by its number in the model.
    pub(crate) fn part_of_sample(&self, number: u32) -> usize {
        self.sample_parts.get(number as usize).map_or(0, |&part| part as usize)
    }

    /// The tetrahedra of one law.
    pub fn tets_of(&self, law: MaterialModel) -> &TetSet<S> {
        &self.tet_sets[law as usize]
    }

    /// Whether any tetrahedron is viscous.
    pub fn is_viscous(&self) -> bool {
        self.tet_sets.iter().any(|set| set.viscous)
    }

    /// Blocks of all laws.
    #[cfg(feature = "gpu")]
    pub(crate) fn block_count(&self) -> usize {
        self.tet_sets.iter().map(TetSet::block_count).sum()
    }

    /// The tetrahedra of a set one by one, sorted by colour, with the user's numbers.
    pub fn tets(&self, set: &TetSet<S>) -> impl Iterator<Item = LaidTet<S>> {
        set.places().zip(&set.order).map(|((block, lane), &number)| {
            let constants = &set.blocks[block];
            let user = |v: u32| self.numbering.order[v as usize];
            let count = set.form.multiplier_count();
            let in_cluster = |all: &SetClusters| [all.of_block(block), all.inner[block] as usize];
            LaidTet {
                number: number as usize,
                vertices: constants.vertices.map(|corner| user(corner[lane])),
                copies: set.copies_of(block).map(|corner| corner[lane]),
                inverse_rest_shape: constants.shape(lane),
                rest_volume: constants.rest_volume[lane],
                material: constants.material[lane] as usize,
                color: set.color_offsets.partition_point(|&first| first as usize <= block) - 1,
                cluster: set.clusters.as_ref().map(in_cluster),
                first_multiplier: set.multiplier_offset + LANES * count * block + lane,
            }
        })
    }

    /// The copies of one of the user's vertices.
    pub fn copies_of(&self, vertex: u32) -> Range<usize> {
        let v = self.numbering.of(vertex);
        self.copy_offsets[v] as usize..self.copy_offsets[v + 1] as usize
    }

    /// Bytes of its arrays.
    pub fn bytes(&self) -> usize {
        let sets: usize = self.tet_sets.iter().map(TetSet::bytes).sum();
        sets + self.elements.bytes()
            + size_of_val(&self.rest_anchors[..])
            + size_of_val(&self.rest_positions[..])
            + size_of_val(&self.masses[..])
            + size_of_val(&self.parts[..])
            + self.parts.iter().map(Part::bytes).sum::<usize>()
            + size_of_val(&self.copy_offsets[..])
            + size_of_val(&self.samples[..])
            + size_of_val(&self.sample_parts[..])
            + self.skin.as_ref().map_or(0, LaidSkin::bytes)
            + self.recovered.as_ref().map_or(0, RecoveredTables::bytes)
    }
}

/// Tetrahedra first, then other elements kind by kind.
fn constraint_graph<S: Real>(model: &Model<S>) -> ConstraintGraph {
    let mut graph = ConstraintGraph::new();
    model.tet_vertices.iter().for_each(|tet| graph.push(tet));
    for_each_kind!(model, list => list.vertices.iter().for_each(|all| graph.push(all)));
    graph
}
