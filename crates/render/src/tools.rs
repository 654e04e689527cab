//! Tools as solids of steel: the triangles of each shape stay on the device, and only its pose goes there for a picture.

use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::{Vec3, vec3};
use viscera::solver::gpu::Device;
use viscera_picture::{Color, Facets};

use crate::buffers::filled;
use crate::solids::Solid;

/// The triangles of a tool's shape, on the device.
#[derive(Debug)]
pub struct ToolMesh {
    corners: wgpu::Buffer,
    indices: wgpu::Buffer,
    index_count: u32,
}

impl ToolMesh {
    /// Of triangles in the shape's own frame; nothing where there are none, or a place is not finite.
    pub fn new(device: &Device, facets: &Facets) -> Option<Self> {
        let is_finite = facets.positions.iter().all(|x| x.cast::<f32>().is_finite());
        if facets.triangles.is_empty() || !is_finite {
            return None;
        }
        let four = |v: &Vec3<f64>, last: f64| [v.x, v.y, v.z, last].map(|v| v as f32);
        let corners: Vec<[[f32; 4]; 2]> = facets
            .positions
            .iter()
            .zip(&facets.normals)
            .map(|(x, normal)| [four(x, 1.0), four(normal, 0.0)])
            .collect();
        let indices: &[u32] = facets.triangles.as_flattened();
        let buffer = |contents, usage| filled(device, "tool", contents, usage);
        Some(Self {
            corners: buffer(bytemuck::cast_slice(&corners), wgpu::BufferUsages::VERTEX),
            indices: buffer(bytemuck::cast_slice(indices), wgpu::BufferUsages::INDEX),
            index_count: indices.len() as u32,
        })
    }
}

/// A part of a tool, and where it is.
#[derive(Clone, Copy, Debug)]
pub struct ToolView<'a> {
    /// Its triangles.
    pub mesh: &'a ToolMesh,
    /// From its own frame to the world.
    pub pose: RigidTransform,
    /// Its colour, usually [`Color::STEEL`].
    pub color: Color,
    /// How strongly it shines through tissue before it, 0 (not at all) to 1.
    pub see_through: f32,
    /// Whether it throws a shadow.
    pub has_shadow: bool,
}

/// The tools of one picture, placed.
#[derive(Debug)]
pub(crate) struct PlacedTools<'a> {
    tools: Vec<ToolView<'a>>,
    places: wgpu::Buffer,
}

impl<'a> PlacedTools<'a> {
    /// Those that are somewhere; nothing where none is.
    pub fn new(device: &Device, tools: &[ToolView<'a>]) -> Option<Self> {
        let is_somewhere = |tool: &&ToolView<'_>| {
            let ends = [vec3(1.0, 1.0, 1.0), Vec3::ZERO].map(|x| tool.pose.apply(x));
            ends.iter().all(|x| x.cast::<f32>().is_finite())
        };
        let tools: Vec<ToolView<'a>> = tools.iter().filter(is_somewhere).copied().collect();
        let solid = |tool: &ToolView<'_>| {
            let axis = |x, y, z| tool.pose.turn(vec3(x, y, z));
            let axes = [axis(1.0, 0.0, 0.0), axis(0.0, 1.0, 0.0), axis(0.0, 0.0, 1.0)];
            // A comparison with NaN is false.
            let see_through = if tool.see_through > 0.0 { tool.see_through.min(1.0) } else { 0.0 };
            Solid::new(tool.pose.translation, axes, tool.color, see_through)
        };
        let solids: Vec<Solid> = tools.iter().map(solid).collect();
        let bytes = (!solids.is_empty()).then(|| bytemuck::cast_slice(&solids))?;
        let places = filled(device, "places of tools", bytes, wgpu::BufferUsages::VERTEX);
        Some(Self { tools, places })
    }

    /// Draws those that are chosen.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, is_chosen: fn(&ToolView<'_>) -> bool) {
        pass.set_vertex_buffer(1, self.places.slice(..));
        for (number, tool) in (0..).zip(&self.tools).filter(|(_, tool)| is_chosen(tool)) {
            pass.set_vertex_buffer(0, tool.mesh.corners.slice(..));
            pass.set_index_buffer(tool.mesh.indices.slice(..), wgpu::IndexFormat::Uint32);
            pass.draw_indexed(0..tool.mesh.index_count, 0, number..number + 1);
        }
    }
}
