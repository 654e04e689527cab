//! A fine surface bound to the tetrahedra, moved and lit on the device: ready to be drawn without a copy.
//!
//! ```text
//! vertices: position [m] x y z 1, normal x y z 0      32 bytes each, two `Float32x4`
//! indices:  three `u32` for each triangle
//! ```

use std::sync::{Arc, OnceLock};

use bytemuck::{Pod, Zeroable};
use wgpu::BufferUsages;

use super::device::Device;
use super::error::GpuError;
use super::limits::MOST_GROUPS;
use super::positions::DevicePositions;
use super::reading;
use super::shown::SHOWS_VALUES;
use super::solver::GpuSolver;
use super::surface_kernels::{
    BINDINGS, POINTS, Ready, STRIDE, WORKGROUP, buffer, check_size, filled, prepare,
};
use crate::layout::Layout;
use crate::mesh::embed::{Embedding, EmbeddingError};
use crate::model::Model;
use crate::scalar::{Vec3, vec3};

/// The surface of one body.
#[derive(Clone, Copy, Debug)]
pub struct Skin<'a> {
    /// Binds its vertices to the body's tetrahedra.
    pub embedding: &'a Embedding,
    /// Three vertices each. One that names a vertex that there is not is passed over.
    pub triangles: &'a [[u32; 3]],
    /// The body's first vertex among the model's, the user's order.
    pub first_vertex: usize,
}

/// The surfaces of all bodies on the device, in one list of vertices. They follow a solver on the same
/// device, or positions that the caller brings.
#[derive(Debug)]
pub struct GpuSurface {
    pub(super) device: Device,
    pub(super) vertices: wgpu::Buffer,
    indices: wgpu::Buffer,
    pub(super) vertex_count: u32,
    triangles: Vec<[u32; 3]>,
    /// Made when first asked for: few pictures show them.
    edges: OnceLock<wgpu::Buffer>,
    placed: Option<Placed>,
    pub(super) bounds: wgpu::Buffer,
    embed: Ready,
    normals: Ready,
}

/// Where the caller puts the tetrahedra's vertices: four floats each.
#[derive(Debug)]
struct Placed {
    positions: wgpu::Buffer,
    count: usize,
    /// In the order of the solver that has this; in the user's where there is none.
    layout: Option<Arc<Layout<f32>>>,
    /// The surface at rest [m], four floats a vertex, where values are shown on it.
    rest: Option<wgpu::Buffer>,
}

/// `Bound` of surface.wgsl.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C)]
struct Bound {
    corners: [u32; 4],
    weights: [f32; 4],
}

impl GpuSurface {
    /// Binds surfaces to the tetrahedra of a solver's model; they are where its last step has brought them.
    pub fn new(
        solver: &GpuSolver,
        model: &Model<f32>,
        skins: &[Skin<'_>],
    ) -> Result<Self, GpuError> {
        solver.layout_of(model)?;
        let order = |v: u32| model.numbering.of(v) as u32;
        let bounds = bounds(model.vertex_count(), order, skins)?;
        check_tets(model, skins)?;
        Self::bind(solver.device(), solver.positions(), &bounds, skins)
    }

    /// Binds surfaces to tetrahedra whose vertices [`GpuSurface::place`] puts somewhere: a simulation on the
    /// CPU, a state at rest. Until then they are at the origin.
    pub fn following(
        device: &Device,
        vertex_count: usize,
        skins: &[Skin<'_>],
    ) -> Result<Self, GpuError> {
        Self::placed(device, (vertex_count, None), &bounds(vertex_count, |v| v, skins)?, skins)
    }

    /// Binds surfaces to tetrahedra whose vertices [`GpuSurface::place_copy`] brings from a solver on the same device: the one
    /// that has made these.
    pub fn following_copies(
        positions: &DevicePositions,
        skins: &[Skin<'_>],
    ) -> Result<Self, GpuError> {
        let DevicePositions { device, layout, .. } = positions;
        let count = layout.vertex_count();
        let order = |v: u32| layout.numbering.of(v) as u32;
        let bounds = bounds(count, order, skins)?;
        let mut surface = Self::placed(device, (count, Some(Arc::clone(layout))), &bounds, skins)?;
        if SHOWS_VALUES && let Some(placed) = &mut surface.placed {
            let rest = at_rest(&layout.rest_positions, skins);
            let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
            placed.rest = Some(filled(device, BINDINGS[5].0, bytemuck::cast_slice(&rest), usage));
        }
        Ok(surface)
    }

    fn placed(
        device: &Device,
        (count, layout): (usize, Option<Arc<Layout<f32>>>),
        bounds: &[Bound],
        skins: &[Skin<'_>],
    ) -> Result<Self, GpuError> {
        let size = size_of::<[f32; 4]>() as u64 * count as u64;
        check_size(device, size, bounds.len())?;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_DST;
        let positions = buffer(device, BINDINGS[POINTS].0, size, usage);
        let surface = Self::bind(device, &positions, bounds, skins)?;
        let placed = Placed { positions, count, layout, rest: None };
        Ok(Self { placed: Some(placed), ..surface })
    }

    fn bind(
        device: &Device,
        positions: &wgpu::Buffer,
        bounds: &[Bound],
        skins: &[Skin<'_>],
    ) -> Result<Self, GpuError> {
        let triangles = triangles(skins);
        let (offsets, others) = around(bounds.len(), &triangles);
        let arrays: [&[u8]; 3] = [
            bytemuck::cast_slice(bounds),
            bytemuck::cast_slice(&offsets),
            bytemuck::cast_slice(&others),
        ];
        let indices: &[u8] = bytemuck::cast_slice(&triangles);
        let size = STRIDE * bounds.len() as u64;
        for bytes in arrays.iter().map(|array| array.len()).chain([indices.len()]) {
            check_size(device, bytes as u64, bounds.len())?;
        }
        check_size(device, size, bounds.len())?;

        let storage = BufferUsages::STORAGE | BufferUsages::COPY_DST | BufferUsages::COPY_SRC;
        let vertices = buffer(device, "surface", size, storage | BufferUsages::VERTEX);
        let [bound, first, pairs] =
            [1, 2, 3].map(|i| filled(device, BINDINGS[i].0, arrays[i - 1], storage));
        let all = [positions, &bound, &first, &pairs, &vertices];
        let index = storage | BufferUsages::INDEX;
        let surface = Self {
            embed: prepare(device, "embed", &[POINTS, 1, 4].map(|i| (i, all[i]))),
            normals: prepare(device, "smooth_normals", &[1, 2, 3, 4].map(|i| (i, all[i]))),
            bounds: bound,
            indices: filled(device, "indices of the surface", indices, index),
            device: device.clone(),
            vertices,
            vertex_count: bounds.len() as u32,
            triangles,
            edges: OnceLock::new(),
            placed: None,
        };
        // Its memory may have been too little.
        device.check()?;
        Ok(surface)
    }

    /// Puts the tetrahedra's vertices [m], the user's order, shape [vertex_count], for the next
    /// [`GpuSurface::update`]. Of a surface that follows a solver, or another number of vertices, an error;
    /// nothing has moved then.
    pub fn place(&self, positions: &[Vec3<f32>]) -> Result<(), GpuError> {
        let Some(placed) = self.placed.as_ref().filter(|placed| placed.layout.is_none()) else {
            return Err(GpuError::FollowsSolver);
        };
        if positions.len() != placed.count {
            let (what, found, expected) = ("positions", positions.len(), placed.count);
            return Err(EmbeddingError::Length { what, found, expected }.into());
        }
        let four = |x: &Vec3<f32>| [x.x, x.y, x.z, 1.0];
        let numbers: Vec<[f32; 4]> = positions.iter().map(four).collect();
        self.device.queue.write_buffer(&placed.positions, 0, bytemuck::cast_slice(&numbers));
        Ok(())
    }

    /// As [`GpuSurface::place`], where a solver on this device has left them: a copy on the device. Of a surface that follows
    /// something else, [`GpuSurface::follows`], an error; nothing has moved then.
    pub fn place_copy(&self, positions: &DevicePositions) -> Result<(), GpuError> {
        let placed = self.placed.as_ref().filter(|_| self.follows(positions));
        let into = &placed.ok_or(GpuError::FollowsSolver)?.positions;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("place the surface") };
        let mut encoder = self.device.device.create_command_encoder(&descriptor);
        let size = into.size().min(positions.buffer.size());
        encoder.copy_buffer_to_buffer(&positions.buffer, 0, into, 0, size);
        self.device.queue.submit([encoder.finish()]);
        Ok(())
    }

    /// Whether it takes copies of these positions: of the same solver.
    pub fn follows(&self, positions: &DevicePositions) -> bool {
        let placed = self.placed.as_ref().and_then(|placed| placed.layout.as_ref());
        placed.is_some_and(|layout| positions.is_of(layout))
    }

    /// Whether it takes copies from a device at all.
    pub fn follows_copies(&self) -> bool {
        self.placed.as_ref().is_some_and(|placed| placed.layout.is_some())
    }

    /// Moves the surface to where the solver's last step, or the caller, has brought the tissue: one
    /// submission, no waiting.
    pub fn update(&self) {
        let wgpu = &self.device.device;
        let descriptor = wgpu::CommandEncoderDescriptor { label: Some("surface") };
        let mut encoder = wgpu.create_command_encoder(&descriptor);
        self.record(&mut encoder);
        self.device.queue.submit([encoder.finish()]);
    }

    /// As [`GpuSurface::update`], in front of what the caller draws: two dispatches.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("surface"),
            timestamp_writes: None,
        });
        self.each_vertex(&mut pass, &[&self.embed, &self.normals]);
    }

    /// A thread for each vertex, kernel by kernel.
    pub(super) fn each_vertex(&self, pass: &mut wgpu::ComputePass<'_>, list: &[&Ready]) {
        let groups = self.vertex_count.div_ceil(WORKGROUP);
        let along = groups.min(MOST_GROUPS);
        for ready in list {
            pass.set_pipeline(&ready.pipeline);
            pass.set_bind_group(0, &ready.storage, &[]);
            pass.dispatch_workgroups(along, groups.div_ceil(along.max(1)), 1);
        }
    }

    /// The positions that copies are put into, and the surface at rest, where it shows values.
    pub(super) fn shown(&self) -> Option<[&wgpu::Buffer; 2]> {
        let placed = self.placed.as_ref()?;
        Some([&placed.positions, placed.rest.as_ref()?])
    }

    /// Positions [m] and normals, [`GpuSurface::vertex_layout`]; for vertex and storage bindings.
    pub fn vertices(&self) -> &wgpu::Buffer {
        &self.vertices
    }

    /// Triangles, three `u32` each; for index and storage bindings.
    pub fn indices(&self) -> &wgpu::Buffer {
        &self.indices
    }

    /// How many vertices there are.
    pub fn vertex_count(&self) -> u32 {
        self.vertex_count
    }

    /// How many indices there are: three for each triangle.
    pub fn index_count(&self) -> u32 {
        3 * self.triangles.len() as u32
    }

    /// The edges of all triangles, each once, two `u32` for each; for index bindings.
    pub fn edges(&self) -> &wgpu::Buffer {
        self.edges.get_or_init(|| {
            let edges = edges(&self.triangles);
            let usage = BufferUsages::INDEX | BufferUsages::COPY_DST;
            filled(&self.device, "edges of the surface", bytemuck::cast_slice(&edges), usage)
        })
    }

    /// How a vertex lies in memory: the position at location 0, the normal at location 1.
    pub fn vertex_layout() -> wgpu::VertexBufferLayout<'static> {
        const ATTRIBUTES: [wgpu::VertexAttribute; 2] =
            wgpu::vertex_attr_array![0 => Float32x4, 1 => Float32x4];
        wgpu::VertexBufferLayout {
            array_stride: STRIDE,
            step_mode: wgpu::VertexStepMode::Vertex,
            attributes: &ATTRIBUTES,
        }
    }

    /// Waits for the device and reads positions [m] and normals, shape [vertex_count] each.
    pub fn read(&self) -> Result<[Vec<Vec3<f32>>; 2], GpuError> {
        let mut numbers: Vec<[f32; 4]> = Vec::new();
        let whole = (&self.vertices, 0..self.vertices.size());
        reading::read(&self.device, &[whole], |read| {
            numbers.extend_from_slice(bytemuck::cast_slice(read[0]));
        })?;
        let pairs = &numbers.as_chunks::<2>().0[..self.vertex_count as usize];
        let column =
            |i: usize| pairs.iter().map(move |pair| pair[i]).map(|[x, y, z, _]| vec3(x, y, z));
        Ok([0, 1].map(|i| column(i).collect()))
    }
}

/// The tetrahedron that each vertex follows; `order` numbers the tetrahedra's vertices as they lie on the device.
fn bounds(
    vertex_count: usize,
    order: impl Fn(u32) -> u32,
    skins: &[Skin<'_>],
) -> Result<Vec<Bound>, EmbeddingError> {
    let mut bounds = Vec::new();
    for skin in skins {
        let (first, embedding) = (skin.first_vertex, skin.embedding);
        let there = vertex_count.saturating_sub(first);
        let expected = embedding.tet_vertex_count();
        if there < expected {
            let what = "tetrahedron vertices";
            return Err(EmbeddingError::Length { what, found: there, expected });
        }
        let of = |v: u32| order(first as u32 + v);
        let both = embedding.corners().iter().zip(embedding.weights());
        bounds.extend(both.map(|(corners, weights)| Bound {
            corners: corners.map(of),
            weights: weights.map(|weight| weight as f32),
        }));
    }
    Ok(bounds)
}

/// Places of all surfaces where the tetrahedra's vertices are at rest.
fn at_rest(rest: &[Vec3<f32>], skins: &[Skin<'_>]) -> Vec<[f32; 4]> {
    let mut places = Vec::new();
    for Skin { embedding, first_vertex, .. } in skins {
        for (corners, weights) in embedding.corners().iter().zip(embedding.weights()) {
            let sum = corners.iter().zip(weights).fold(Vec3::<f64>::ZERO, |sum, (&v, weight)| {
                sum + rest[first_vertex + v as usize].cast::<f64>() * *weight
            });
            let [x, y, z] = sum.cast::<f32>().to_array();
            places.push([x, y, z, 1.0]);
        }
    }
    places
}

/// Whether every surface follows tetrahedra of the body whose first vertex it names.
fn check_tets(model: &Model<f32>, skins: &[Skin<'_>]) -> Result<(), EmbeddingError> {
    for skin in skins {
        let embedding = skin.embedding;
        let body = model.bodies.iter().find(|body| body.vertices.start == skin.first_vertex);
        let followed = embedding.tets().iter().zip(embedding.corners());
        for (vertex, (&tet, corners)) in followed.enumerate() {
            let corners = corners.map(|v| v + skin.first_vertex as u32);
            let of_body =
                body.and_then(|body| model.tet_vertices.get(body.tets.start + tet as usize));
            if of_body != Some(&corners) {
                return Err(EmbeddingError::OtherTets { vertex });
            }
        }
    }
    Ok(())
}

/// The triangles of all bodies among all vertices, without those that name what there is not.
fn triangles(skins: &[Skin<'_>]) -> Vec<[u32; 3]> {
    let mut all = Vec::new();
    let mut first = 0;
    for skin in skins {
        let count = skin.embedding.weights().len() as u32;
        let legal = skin.triangles.iter().filter(|t| t.iter().all(|&v| v < count));
        all.extend(legal.map(|t| t.map(|v| first + v)));
        first += count;
    }
    all
}

/// Where the triangles around each vertex begin, and the two other corners of each, in the order of the
/// triangles.
fn around(vertex_count: usize, triangles: &[[u32; 3]]) -> (Vec<u32>, Vec<[u32; 2]>) {
    let mut offsets = vec![0u32; vertex_count + 1];
    for &v in triangles.as_flattened() {
        offsets[v as usize + 1] += 1;
    }
    for v in 0..vertex_count {
        offsets[v + 1] += offsets[v];
    }
    let mut next = offsets.clone();
    let mut others = vec![[0; 2]; 3 * triangles.len()];
    for &[a, b, c] in triangles {
        for (v, pair) in [(a, [b, c]), (b, [c, a]), (c, [a, b])] {
            others[next[v as usize] as usize] = pair;
            next[v as usize] += 1;
        }
    }
    (offsets, others)
}

/// Edges of triangles, the lower vertex first, sorted, each once.
fn edges(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let of = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let mut edges: Vec<[u32; 2]> = triangles.iter().flat_map(of).collect();
    for edge in &mut edges {
        edge.sort_unstable();
    }
    edges.sort_unstable();
    edges.dedup();
    edges
}
