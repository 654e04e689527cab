//! Graphics processors: which there are, which one to take, and a device on it.

use std::collections::HashMap;
use std::sync::{Arc, Mutex};

use super::error::GpuError;

/// Values that go from a vertex to a fragment: pictures need three, and some phones offer one fewer than the default.
const INTER_STAGE: u32 = 8;

/// Limits that every device has: WebGPU's defaults, or fewer where nothing needs them. Kernels need no more.
pub fn baseline() -> wgpu::Limits {
    wgpu::Limits { max_inter_stage_shader_variables: INTER_STAGE, ..wgpu::Limits::default() }
}

/// The parts of the baseline that limits lack, in words; nothing where they have all.
pub fn shortfall(limits: &wgpu::Limits) -> Option<String> {
    let mut lacking = String::new();
    let fail = |what: &'static str, asked, given| add_shortfall(&mut lacking, what, [given, asked]);
    baseline().check_limits_with_fail_fn(limits, false, fail);
    (!lacking.is_empty()).then_some(lacking)
}

/// Adds a limit to the list. Not inlined: a page would carry it once for each limit.
#[inline(never)]
fn add_shortfall(lacking: &mut String, what: &str, [given, asked]: [u64; 2]) {
    let comma = if lacking.is_empty() { "" } else { ", " };
    *lacking += &format!("{comma}{what} {given} where {asked} is needed");
}

/// One adapter of this machine.
#[derive(Clone, Debug)]
pub struct Adapter {
    adapter: wgpu::Adapter,
}

impl Adapter {
    /// All adapters: discrete ones first, software last. A browser names none before it was waited for:
    /// [`Adapter::of_browser`].
    pub fn all() -> Vec<Self> {
        if cfg!(target_arch = "wasm32") {
            return Vec::new();
        }
        let backends = wgpu::Backends::PRIMARY;
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor {
            backends,
            ..wgpu::InstanceDescriptor::new_without_display_handle_from_env()
        });
        let mut adapters = pollster::block_on(instance.enumerate_adapters(backends));
        adapters.sort_by_key(|adapter| rank(adapter.get_info().device_type));
        adapters.into_iter().map(|adapter| Self { adapter }).collect()
    }

    /// The adapter that a browser offers, the faster one where it can choose.
    pub async fn of_browser(instance: &wgpu::Instance) -> Result<Self, GpuError> {
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..wgpu::RequestAdapterOptions::default()
        };
        let found = instance.request_adapter(&options).await;
        found.map(|adapter| Self { adapter }).map_err(|_| GpuError::NoAdapter)
    }

    /// The maker's name for it; browsers may keep that for themselves.
    pub fn name(&self) -> String {
        match self.adapter.get_info().name {
            name if name.is_empty() => "the graphics processor".to_owned(),
            name => name,
        }
    }

    /// Name, kind, interface and driver.
    pub fn info(&self) -> wgpu::AdapterInfo {
        self.adapter.get_info()
    }

    /// Its limits.
    pub fn limits(&self) -> wgpu::Limits {
        self.adapter.limits()
    }

    /// Whether a processor does its work: right, but slower than the CPU backend.
    pub fn is_software(&self) -> bool {
        self.info().device_type == wgpu::DeviceType::Cpu
    }

    /// "discrete", "integrated", "virtual", "software" or "other".
    pub fn kind(&self) -> &'static str {
        match self.info().device_type {
            wgpu::DeviceType::DiscreteGpu => "discrete",
            wgpu::DeviceType::IntegratedGpu => "integrated",
            wgpu::DeviceType::VirtualGpu => "virtual",
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::Other => "other",
        }
    }

    /// See [`shortfall`].
    pub fn shortfall(&self) -> Option<String> {
        shortfall(&self.limits())
    }

    /// The first adapter whose name contains the text, whatever its case; without a text the first
    /// that is no software, else the first.
    pub fn find(name: Option<&str>) -> Result<Self, GpuError> {
        let all = Self::all();
        if all.is_empty() {
            return Err(GpuError::NoAdapter);
        }
        let wanted = name.map(str::to_lowercase);
        let found = all.iter().find(|adapter| match &wanted {
            Some(name) => adapter.name().to_lowercase().contains(name),
            None => true,
        });
        match (found, name) {
            (Some(adapter), _) => Ok(adapter.clone()),
            (None, name) => Err(GpuError::UnknownAdapter {
                name: name.unwrap_or_default().to_owned(),
                known: all.iter().map(Self::name).collect::<Vec<_>>().join(", "),
            }),
        }
    }

    /// A device on it, with limits raised where meshes gain by it, and timestamps where it has them.
    pub fn open(&self) -> Result<Device, GpuError> {
        pollster::block_on(self.opening())
    }

    /// As [`Adapter::open`], for who cannot wait.
    pub async fn opening(&self) -> Result<Device, GpuError> {
        if let Some(lacking) = self.shortfall() {
            return Err(GpuError::BelowBaseline { name: self.name(), lacking });
        }
        let has = self.limits();
        let limits = wgpu::Limits {
            max_storage_buffer_binding_size: has.max_storage_buffer_binding_size,
            max_buffer_size: has.max_buffer_size,
            ..baseline()
        };
        self.opening_with(limits).await
    }

    /// A device within limits of the caller's choice, baseline or above.
    pub fn open_with(&self, limits: wgpu::Limits) -> Result<Device, GpuError> {
        pollster::block_on(self.opening_with(limits))
    }

    async fn opening_with(&self, limits: wgpu::Limits) -> Result<Device, GpuError> {
        let timestamps = wgpu::Features::TIMESTAMP_QUERY;
        let request = wgpu::DeviceDescriptor {
            label: Some("viscera"),
            required_features: self.adapter.features() & timestamps,
            required_limits: limits,
            ..wgpu::DeviceDescriptor::default()
        };
        let opened = self.adapter.request_device(&request).await;
        let (device, queue) = opened
            .map_err(|error| GpuError::Refused { name: self.name(), reason: error.to_string() })?;
        let device = Device::from_wgpu(device, queue, self.name());
        device.take_errors();
        Ok(device)
    }
}

fn rank(kind: wgpu::DeviceType) -> u32 {
    match kind {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    }
}

/// A device that solvers share, and the kernels compiled for it so far.
#[derive(Clone, Debug)]
pub struct Device {
    pub(super) device: wgpu::Device,
    pub(super) queue: wgpu::Queue,
    name: String,
    pub(super) pipelines: Arc<Mutex<HashMap<String, Pipeline>>>,
    lost: Arc<Mutex<Option<String>>>,
}

/// A kernel ready to run.
#[derive(Clone, Debug)]
pub(super) struct Pipeline {
    pub pipeline: wgpu::ComputePipeline,
    pub storage: wgpu::BindGroupLayout,
}

impl Device {
    /// A device of the caller's, a window's for example, whose buffers it can then draw from. To hear of
    /// its loss this replaces the callback that the caller may have set; clone the result rather than
    /// make a second one of the same device.
    pub fn from_wgpu(device: wgpu::Device, queue: wgpu::Queue, name: String) -> Self {
        let lost = Arc::new(Mutex::new(None));
        let told = Arc::clone(&lost);
        device.set_device_lost_callback(move |_, reason| {
            if let Ok(mut lost) = told.lock() {
                *lost = Some(reason);
            }
        });
        Self { device, queue, name, pipelines: Arc::default(), lost }
    }

    /// The adapter's name.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Whether both are one: what the one has made the other can use.
    pub fn is_same(&self, other: &Self) -> bool {
        // The graphics interface compares numbers that begin anew with each of its instances.
        Arc::ptr_eq(&self.pipelines, &other.pipelines)
    }

    /// Whether settings that ask for this name mean it. A browser has one device and may keep its name for itself.
    pub fn is_called(&self, name: &str) -> bool {
        cfg!(target_arch = "wasm32") || self.name.to_lowercase().contains(&name.to_lowercase())
    }

    /// Makes something whose memory may be too little. That is an error then, and the device, which others may use, goes on.
    pub(super) fn making<T>(
        &self,
        make: impl FnOnce() -> Result<T, GpuError>,
    ) -> Result<T, GpuError> {
        // A browser says so later, and loses the device.
        if cfg!(target_arch = "wasm32") {
            return make();
        }
        // What follows from it, the use of memory that there is not, is of no interest.
        let of_memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let of_use = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let made = make();
        let of_use = pollster::block_on(of_use.pop());
        let refused = |error: wgpu::Error| {
            let reason = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
            Err(GpuError::Refused { name: self.name.clone(), reason })
        };
        match pollster::block_on(of_memory.pop()) {
            Some(_) => Err(GpuError::NoRoom { name: self.name.clone() }),
            None => of_use.map_or(made, refused),
        }
    }

    /// Whether a processor does its work: right, but slower than the CPU backend.
    pub fn is_software(&self) -> bool {
        self.device.adapter_info().device_type == wgpu::DeviceType::Cpu
    }

    /// Limits that meshes may use.
    pub fn limits(&self) -> wgpu::Limits {
        self.device.limits()
    }

    /// The device of the graphics interface.
    pub fn wgpu(&self) -> (&wgpu::Device, &wgpu::Queue) {
        (&self.device, &self.queue)
    }

    /// An error where the device is gone, or was asked for more than it could do.
    pub fn check(&self) -> Result<(), GpuError> {
        // Word of a loss comes while polling; where polling fails there is one.
        let _ = self.device.poll(wgpu::PollType::Poll);
        match self.lost.lock().ok().and_then(|lost| lost.clone()) {
            Some(reason) => Err(self.lost(reason)),
            None => Ok(()),
        }
    }

    /// The device is of no use any more, whatever its driver will say: word of a loss may come later than what follows
    /// from it.
    pub(super) fn give_up(&self, reason: String) -> GpuError {
        if let Ok(mut lost) = self.lost.lock() {
            lost.get_or_insert_with(|| reason.clone());
        }
        self.lost(reason)
    }

    pub(super) fn lost(&self, reason: String) -> GpuError {
        GpuError::Lost { name: self.name.clone(), reason: reason.trim_end_matches('.').to_owned() }
    }

    /// Memory that ran out and faults of the driver end the device, not the program; a picture that the browser could
    /// not take costs that picture. What is left is misuse by this library, which should be heard of.
    fn take_errors(&self) {
        let told = Arc::clone(&self.lost);
        self.device.on_uncaptured_error(Arc::new(move |error| {
            let Ok(mut lost) = told.lock() else { return };
            match error {
                wgpu::Error::Validation { ref description, .. } if is_browsers_own(description) => {
                }
                wgpu::Error::Validation { .. } if lost.is_none() => {
                    drop(lost);
                    panic!("{error}");
                }
                wgpu::Error::OutOfMemory { .. } => {
                    lost.get_or_insert("out of memory".into());
                }
                _ => {
                    lost.get_or_insert(error.to_string());
                }
            }
        }));
    }
}

/// Whether an error comes from a copy that only browsers make, of a canvas to their own picture of the page. This
/// library asks for none; where such a picture is gone, the next one is shown.
fn is_browsers_own(description: &str) -> bool {
    description.contains("validating CopyTextureForBrowser")
}

#[cfg(test)]
mod tests {
    use super::super::{Adapter, GpuError};
    use super::is_browsers_own;

    /// What cannot be made is an error for who wanted it, and for nobody else.
    #[test]
    fn a_device_goes_on_where_something_cannot_be_made() {
        let device = Adapter::find(None).and_then(|adapter| adapter.open());
        let device = device.unwrap_or_else(|error| panic!("{error}"));
        let made = |size: u64| {
            device.making(|| {
                let buffer = device.device.create_buffer(&wgpu::BufferDescriptor {
                    label: None,
                    size,
                    usage: wgpu::BufferUsages::STORAGE,
                    mapped_at_creation: false,
                });
                Ok(buffer.size())
            })
        };
        let refused = made(device.limits().max_buffer_size + 4).expect_err("more than the limit");
        assert!(
            matches!(&refused, GpuError::Refused { reason, .. } if reason.len() > 20),
            "{refused}"
        );
        device.check().expect("it is there");
        assert_eq!(made(64), Ok(64));
        let lost = device.making(|| Err::<(), _>(GpuError::OnlyOnCpu));
        assert_eq!(lost, Err(GpuError::OnlyOnCpu));
    }

    #[test]
    fn a_picture_that_the_browser_lost_is_no_misuse() {
        let lost = "[Invalid Texture] is invalid due to a previous error.\n - While validating CopyTextureForBrowser \
                    from [Texture (unlabeled 1088x796 px, TextureFormat::BGRA8Unorm)] to [Invalid Texture]";
        let ours = "[Invalid Buffer] is invalid due to a previous error.\n - While encoding [CommandEncoder]";
        assert!(is_browsers_own(lost));
        assert!(!is_browsers_own(ours));
    }
}
