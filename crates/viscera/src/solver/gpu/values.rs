//! What of tissue pictures show by colours, found on the device for a frame that stays there.
//!
//! Strain and stress of each tetrahedron, then their means at the vertices of a copy of positions; what a surface between
//! these shows is in `surface_values.rs`. In single precision, for colours: measures are computed on the host.

use wgpu::BufferUsages;

use super::kernels::{self, Kernel, Swept, Variant};
use super::limits::{JOB_STRIDE, MOST_GROUPS};
use super::pipelines::pipeline;
use super::shown::{JOBS, SHOWS_VALUES, TissueValue, jobs};
use super::slots::{Place, Slot};
use super::solver::GpuSolver;
use crate::elements::TetForm;
use crate::layout::Layout;
use crate::scalar::lanes::LANES;

/// Threads of a workgroup.
const WORKGROUP: u32 = 64;

impl GpuSolver {
    /// Whether the device finds values of this kind.
    pub fn shows(&self, value: TissueValue) -> bool {
        match value {
            _ if !SHOWS_VALUES => false,
            TissueValue::Pressure => self.samples().is_some(),
            _ => true,
        }
    }

    /// Writes values into the fourth numbers of positions of a frame, which are on their way there.
    pub(super) fn record_values(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        value: TissueValue,
        points: &wgpu::Buffer,
    ) {
        let of_vertices = |kernel| (kernel, 2);
        let (list, arrays): (&[(&Kernel, usize)], [&wgpu::Buffer; 2]) = match value {
            // Of a surface.
            TissueValue::Displacement => return,
            TissueValue::Strain | TissueValue::Stress => {
                let job = usize::from(value == TissueValue::Stress);
                let [measured, around] = self.values.tets.get_or_init(|| self.make_tets());
                let first = (&kernels::MEASURE_TETS, job);
                (&[first, of_vertices(&kernels::AVERAGE_TETS)], [measured, around])
            }
            TissueValue::Pressure => {
                let areas = self.values.areas.get_or_init(|| self.make_areas());
                (&[of_vertices(&kernels::MEASURE_PRESSURES)], [areas, areas])
            }
        };
        let jobs = jobs(&self.layout);
        let first_job = self.uniforms.jobs.size() - JOB_STRIDE * JOBS as u64;
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some("values"),
            timestamp_writes: None,
        });
        for &(kernel, job) in list {
            let variant = Variant { form: TetForm::GreenStrain, swept: Swept::Vertices };
            let made = pipeline(&self.device, kernel, variant);
            let entries: Vec<_> = kernel
                .slots
                .iter()
                .map(|&slot| wgpu::BindGroupEntry {
                    binding: slot as u32,
                    resource: match slot {
                        Slot::FramePoints => points.as_entire_binding(),
                        Slot::Measured => arrays[0].as_entire_binding(),
                        Slot::Around => arrays[1].as_entire_binding(),
                        own => wgpu::BindingResource::Buffer(self.buffers.bound(Place::Whole(own))),
                    },
                })
                .collect();
            let storage = self.device.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: Some(kernel.entry),
                layout: &made.storage,
                entries: &entries,
            });
            let offset = first_job + JOB_STRIDE * job as u64;
            let groups = jobs[job].count.div_ceil(WORKGROUP);
            let along = groups.min(MOST_GROUPS);
            pass.set_pipeline(&made.pipeline);
            pass.set_bind_group(0, &storage, &[]);
            pass.set_bind_group(1, &self.uniforms.all, &[offset as u32]);
            pass.dispatch_workgroups(along, groups.div_ceil(along.max(1)), 1);
        }
    }

    fn make_tets(&self) -> [wgpu::Buffer; 2] {
        let lanes = vec![0u8; 4 * (LANES * self.layout.block_count()).max(1)];
        let around = around(&self.layout);
        [
            self.filled("values of tetrahedra", &lanes),
            self.filled("tetrahedra of vertices", &bytes(&around)),
        ]
    }

    fn make_areas(&self) -> wgpu::Buffer {
        let mut areas = vec![0.0f64; self.layout.vertex_count().max(1)];
        for sample in &self.layout.samples {
            for (&v, &weight) in sample.vertices.iter().zip(&sample.weights) {
                areas[v as usize] += weight * sample.area;
            }
        }
        let inverse = |area: &f64| if *area > 0.0 { (1.0 / area) as f32 } else { 0.0 };
        let inverse: Vec<f32> = areas.iter().map(inverse).collect();
        self.filled("areas of vertices", bytemuck::cast_slice(&inverse))
    }

    fn filled(&self, label: &str, bytes: &[u8]) -> wgpu::Buffer {
        let buffer = self.device.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size: bytes.len() as u64,
            usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        self.device.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }
}

fn bytes(words: &[u32]) -> Vec<u8> {
    bytemuck::cast_slice(words).to_vec()
}

/// Where the tetrahedra around each vertex begin, one more at the end, and these, by block and lane.
fn around(layout: &Layout<f32>) -> Vec<u32> {
    let count = layout.vertex_count();
    let mut corners: Vec<[u32; 2]> = Vec::with_capacity(4 * layout.tet_count());
    let mut number = 0;
    for set in &layout.tet_sets {
        for (block, &filled) in set.blocks.iter().zip(&set.filled) {
            for lane in 0..usize::from(filled) {
                let tet = number + lane as u32;
                corners.extend(block.vertices.iter().map(|corner| [corner[lane], tet]));
            }
            number += LANES as u32;
        }
    }
    corners.sort_unstable();
    let mut words = Vec::with_capacity(count + 1 + corners.len());
    let mut next = 0;
    for v in 0..=count as u32 {
        next += corners[next..].iter().take_while(|[vertex, _]| *vertex < v).count();
        words.push(count as u32 + 1 + next as u32);
    }
    words.extend(corners.iter().map(|[_, tet]| tet));
    words
}
