//! What the device has to know of how things are drawn, made once for a canvas.

use viscera::solver::gpu::GpuSurface;

use crate::solids::Meshes;
use crate::target::{COLOR_FORMAT, DEPTH_FORMAT};
use crate::values::ValueBuffer;

/// All shaders are one text: they share the camera and the lights.
const SHADERS: &str = concat!(
    include_str!("shaders/view.wgsl"),
    include_str!("shaders/surface.wgsl"),
    include_str!("shaders/solid.wgsl"),
);

/// Bytes of a body's `Body` in surface.wgsl.
pub(crate) const BODY_BYTES: u64 = 32;

/// Pipelines for surfaces, plain or with values.
#[derive(Debug)]
pub(crate) struct Painted {
    pub plain: wgpu::RenderPipeline,
    pub values: wgpu::RenderPipeline,
}

/// One for each way of drawing, and what they are bound to.
#[derive(Debug)]
pub(crate) struct Pipelines {
    /// Camera and colours of values.
    pub view_layout: wgpu::BindGroupLayout,
    /// A body's colours, by their offset.
    pub body_layout: wgpu::BindGroupLayout,
    /// The shadow map.
    pub shadow_layout: wgpu::BindGroupLayout,
    pub background: wgpu::RenderPipeline,
    pub solid_body: Painted,
    /// The nearest layer of a ghost, as depths only, and its colours after that.
    pub ghost_depth: wgpu::RenderPipeline,
    pub ghost: Painted,
    pub wire: wgpu::RenderPipeline,
    pub solids: wgpu::RenderPipeline,
    pub hidden_solids: wgpu::RenderPipeline,
    pub tools: wgpu::RenderPipeline,
    pub hidden_tools: wgpu::RenderPipeline,
    pub shadow: wgpu::RenderPipeline,
    pub tool_shadow: wgpu::RenderPipeline,
}

impl Pipelines {
    pub fn new(device: &wgpu::Device, samples: u32) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("drawing"),
            source: wgpu::ShaderSource::Wgsl(SHADERS.into()),
        });
        let [view_layout, body_layout, shadow_layout] = layouts(device);
        let all = [Some(&view_layout), Some(&body_layout), Some(&shadow_layout)];
        let layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("drawing"),
            bind_group_layouts: &all,
            immediate_size: 0,
        });
        // The map cannot be bound while it is drawn.
        let without_map = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("shadow"),
            bind_group_layouts: &all[..1],
            immediate_size: 0,
        });
        let surface = [Some(GpuSurface::vertex_layout())];
        let valued = [Some(GpuSurface::vertex_layout()), Some(ValueBuffer::layout())];
        let solid = [Some(GpuSurface::vertex_layout()), Some(Meshes::layout())];
        let make = |recipe: Recipe<'_>| recipe.make(device, &module, &layout, samples);
        let body = |buffers, vertex, fragment, ghost| {
            let (depth, ink) = match ghost {
                false => (Depth::Nearest, Ink::Covers),
                true => (Depth::SameOnly, Ink::Blends),
            };
            make(Recipe { buffers, depth, ink, ..Recipe::new(vertex, Some(fragment)) })
        };
        let painted = |ghost| Painted {
            plain: body(&surface, "place_tissue", "shade_tissue", ghost),
            values: body(&valued, "place_values", "shade_values", ghost),
        };
        let solids = |fragment, depth, ink| {
            let cull = Some(wgpu::Face::Back);
            let recipe = Recipe::new("place_solid", Some(fragment));
            make(Recipe { buffers: &solid, depth, ink, cull, ..recipe })
        };
        let shadow = |buffers, vertex| {
            Recipe { buffers, depth: Depth::Shadow, ..Recipe::new(vertex, None) }.make(
                device,
                &module,
                &without_map,
                1,
            )
        };
        Self {
            background: make(Recipe {
                depth: Depth::Ignored,
                ..Recipe::new("place_background", Some("shade_background"))
            }),
            solid_body: painted(false),
            ghost_depth: make(Recipe {
                buffers: &surface,
                ink: Ink::Nothing,
                ..Recipe::new("place_tissue", Some("shade_tissue"))
            }),
            ghost: painted(true),
            wire: make(Recipe {
                buffers: &surface,
                depth: Depth::NotBehind,
                ink: Ink::Blends,
                topology: wgpu::PrimitiveTopology::LineList,
                ..Recipe::new("place_wire", Some("shade_wire"))
            }),
            solids: solids("shade_solid", Depth::Nearest, Ink::Covers),
            hidden_solids: solids("shade_hidden_solid", Depth::BehindOnly, Ink::Blends),
            tools: solids("shade_tool", Depth::Nearest, Ink::Covers),
            hidden_tools: solids("shade_hidden_solid", Depth::BehindOnly, Ink::Blends),
            shadow: shadow(&surface, "place_shadow"),
            tool_shadow: shadow(&solid, "place_solid_shadow"),
            view_layout,
            body_layout,
            shadow_layout,
        }
    }
}

/// What a way of drawing does with depths.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Depth {
    /// The nearest is drawn, and kept.
    Nearest,
    /// Drawn where it is the nearest; not kept.
    NotBehind,
    /// Drawn where its depth was kept before.
    SameOnly,
    /// Drawn where something is before it.
    BehindOnly,
    /// Drawn everywhere.
    Ignored,
    /// As the nearest, and moved away from the light, more where it falls flat.
    Shadow,
}

impl Depth {
    fn state(self) -> wgpu::DepthStencilState {
        let (keeps, compare) = match self {
            Self::Nearest | Self::Shadow => (true, wgpu::CompareFunction::Less),
            Self::NotBehind | Self::SameOnly => (false, wgpu::CompareFunction::LessEqual),
            Self::BehindOnly => (false, wgpu::CompareFunction::Greater),
            Self::Ignored => (false, wgpu::CompareFunction::Always),
        };
        let bias = match self {
            Self::Shadow => wgpu::DepthBiasState { constant: 4, slope_scale: 2.0, clamp: 0.0 },
            _ => wgpu::DepthBiasState::default(),
        };
        wgpu::DepthStencilState {
            format: DEPTH_FORMAT,
            depth_write_enabled: Some(keeps),
            depth_compare: Some(compare),
            stencil: wgpu::StencilState::default(),
            bias,
        }
    }
}

/// What a way of drawing does with the picture's colours. It stays opaque: windows would show what is behind it.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Ink {
    Covers,
    Blends,
    Nothing,
}

impl Ink {
    fn state(self) -> wgpu::ColorTargetState {
        let (blend, write_mask) = match self {
            Self::Covers => (None, wgpu::ColorWrites::ALL),
            Self::Blends => (Some(wgpu::BlendState::ALPHA_BLENDING), wgpu::ColorWrites::COLOR),
            Self::Nothing => (None, wgpu::ColorWrites::empty()),
        };
        wgpu::ColorTargetState { format: COLOR_FORMAT, blend, write_mask }
    }
}

struct Recipe<'a> {
    vertex: &'a str,
    /// Without one there is no picture to draw into, only depths.
    fragment: Option<&'a str>,
    buffers: &'a [Option<wgpu::VertexBufferLayout<'a>>],
    depth: Depth,
    ink: Ink,
    topology: wgpu::PrimitiveTopology,
    cull: Option<wgpu::Face>,
}

impl<'a> Recipe<'a> {
    fn new(vertex: &'a str, fragment: Option<&'a str>) -> Self {
        Self {
            vertex,
            fragment,
            buffers: &[],
            depth: Depth::Nearest,
            ink: Ink::Covers,
            topology: wgpu::PrimitiveTopology::TriangleList,
            // Both sides: a surface that has turned inside out must not become invisible.
            cull: None,
        }
    }

    fn make(
        &self,
        device: &wgpu::Device,
        module: &wgpu::ShaderModule,
        layout: &wgpu::PipelineLayout,
        samples: u32,
    ) -> wgpu::RenderPipeline {
        let targets = [Some(self.ink.state())];
        device.create_render_pipeline(&wgpu::RenderPipelineDescriptor {
            label: Some(self.vertex),
            layout: Some(layout),
            vertex: wgpu::VertexState {
                module,
                entry_point: Some(self.vertex),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                buffers: self.buffers,
            },
            primitive: wgpu::PrimitiveState {
                topology: self.topology,
                cull_mode: self.cull,
                ..wgpu::PrimitiveState::default()
            },
            depth_stencil: Some(self.depth.state()),
            multisample: wgpu::MultisampleState { count: samples, ..Default::default() },
            fragment: self.fragment.map(|entry| wgpu::FragmentState {
                module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                targets: &targets,
            }),
            multiview_mask: None,
            cache: None,
        })
    }
}

fn layouts(device: &wgpu::Device) -> [wgpu::BindGroupLayout; 3] {
    let make = |label, types: &[wgpu::BindingType]| {
        let entries: Vec<_> = (0..)
            .zip(types)
            .map(|(binding, &ty)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::VERTEX_FRAGMENT,
                ty,
                count: None,
            })
            .collect();
        let descriptor = wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries };
        device.create_bind_group_layout(&descriptor)
    };
    let uniform = |has_dynamic_offset, min_binding_size| wgpu::BindingType::Buffer {
        ty: wgpu::BufferBindingType::Uniform,
        has_dynamic_offset,
        min_binding_size,
    };
    let map = wgpu::BindingType::Texture {
        sample_type: wgpu::TextureSampleType::Depth,
        view_dimension: wgpu::TextureViewDimension::D2,
        multisampled: false,
    };
    let sampler = wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison);
    [
        make("view", &[uniform(false, None), uniform(false, None)]),
        make("body", &[uniform(true, wgpu::BufferSize::new(BODY_BYTES))]),
        make("shadow", &[map, sampler]),
    ]
}
