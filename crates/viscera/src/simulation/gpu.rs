//! Simulations on a graphics processor.

use std::any::Any;

use super::device::{Backend, DeviceSolver, Engine};
use super::error::{FrameError, SimulationError};
use super::shadowed::ON_DEVICE;
use crate::contact::Wrench;
use crate::layout::Layout;
use crate::model::Model;
use crate::scalar::{Real, Vec3};
use crate::settings::{DeviceRequest, SolverSettings};
use crate::solver::balance::ForceBalance;
use crate::solver::gpu::{Adapter, Device, GpuError, GpuSolver, StepCost};
use crate::solver::{FrameReading, Inputs, Solver, StepError};
use crate::state::{ContactState, State};

impl DeviceSolver<f32> for GpuSolver {
    fn layout(&self) -> &Layout<f32> {
        GpuSolver::layout(self)
    }

    fn stable_step(&self) -> f64 {
        GpuSolver::stable_step(self)
    }

    fn restart(
        &mut self,
        model: &Model<f32>,
        inputs: &Inputs<f32>,
        dt: f64,
    ) -> Result<(), StepError> {
        GpuSolver::restart(self, model, inputs, dt)
    }

    fn steps(
        &mut self,
        model: &Model<f32>,
        inputs: &mut Inputs<f32>,
        dt: f64,
        count: u32,
        act: &mut dyn FnMut(u32, &mut Inputs<f32>),
    ) -> Result<(), FrameError> {
        self.device().check()?;
        Ok(GpuSolver::steps(self, model, inputs, dt, count, act)?)
    }

    fn read_frame(
        &mut self,
        model: &Model<f32>,
        state: &mut State<f32>,
    ) -> Result<u64, FrameError> {
        Ok(GpuSolver::read_frame(self, model, state)?)
    }

    fn read(&self, model: &Model<f32>, state: &mut State<f32>) -> Result<(), FrameError> {
        Ok(GpuSolver::read(self, model, state)?)
    }

    fn read_forces(&mut self) -> Result<u64, FrameError> {
        Ok(GpuSolver::read_forces(self)?)
    }

    fn ask_for_frame(&mut self, reading: FrameReading) -> Result<(), FrameError> {
        Ok(GpuSolver::ask_for_frame(self, reading)?)
    }

    fn take_frame(
        &mut self,
        model: &Model<f32>,
        state: &mut State<f32>,
    ) -> Result<Option<u64>, FrameError> {
        Ok(GpuSolver::take_frame(self, model, state)?)
    }

    fn multipliers(&self, model: &Model<f32>) -> Result<Vec<f32>, FrameError> {
        Ok(GpuSolver::multipliers(self, model)?)
    }

    fn wrenches(&self) -> &[Wrench] {
        GpuSolver::wrenches(self)
    }

    fn contact(&self, model: &Model<f32>, state: &State<f32>) -> Result<ContactState, FrameError> {
        Ok(GpuSolver::contact(self, model, state)?)
    }

    fn force_balance(
        &self,
        model: &Model<f32>,
        state: &State<f32>,
        inputs: &Inputs<f32>,
        balance: &mut ForceBalance,
    ) -> Result<(), FrameError> {
        Ok(GpuSolver::force_balance(self, model, state, inputs, balance)?)
    }

    fn write(&mut self, model: &Model<f32>, state: &State<f32>) {
        let written = GpuSolver::write(self, model, state);
        debug_assert!(written.is_ok(), "{written:?}");
    }

    fn write_velocities(&mut self, velocities: &[Vec3<f32>]) {
        GpuSolver::write_velocities(self, velocities);
    }

    fn second(
        &self,
        model: &Model<f32>,
        state: &State<f32>,
    ) -> Result<Box<dyn DeviceSolver<f32>>, FrameError> {
        match ON_DEVICE {
            Some(_) => Ok(Box::new(GpuSolver::second(self, model, state)?)),
            None => Err(GpuError::OnlyOnCpu.into()),
        }
    }

    fn follow(&mut self, other: &dyn DeviceSolver<f32>) {
        if ON_DEVICE.is_some() {
            GpuSolver::follow(self, other.solver());
        }
    }

    fn solver(&self) -> &GpuSolver {
        self
    }
}

/// The same device with another model; nothing where the CPU computes.
pub(super) fn again<S: Real>(
    backend: &Backend<S>,
    model: &Model<S>,
    settings: &SolverSettings,
) -> Option<Result<Backend<S>, SimulationError>> {
    let device = backend.device()?.solver().device();
    let model: &dyn Any = model;
    let solver = GpuSolver::new(device, model.downcast_ref::<Model<f32>>()?, settings);
    Some(solver.map_err(Into::into).and_then(|solver| {
        let renewed = Backend::new(Engine::Device(Box::new(solver)), backend.choice.clone());
        of_precision(Backend { gives_way: backend.gives_way, ..renewed })
    }))
}

/// The same backend, of a precision that is known to be single.
fn of_precision<S: Real>(backend: Backend<f32>) -> Result<Backend<S>, SimulationError> {
    let mut backend = Some(backend);
    let backend: &mut dyn Any = &mut backend;
    let backend = backend.downcast_mut::<Option<Backend<S>>>().and_then(Option::take);
    backend.ok_or(SimulationError::Gpu(GpuError::DoublePrecision))
}

/// What the settings ask for. They do not ask for the CPU, and leave only XPBD to be chosen for.
pub(super) fn choose<S: Real>(
    model: &Model<S>,
    settings: &SolverSettings,
    offered: Option<&Device>,
) -> Result<Backend<S>, SimulationError> {
    let single: &dyn Any = model;
    let Some(single) = single.downcast_ref::<Model<f32>>() else {
        return match settings.device {
            DeviceRequest::Auto => {
                Ok(Backend::cpu(Solver::new(model, settings), "double precision"))
            }
            _ => Err(GpuError::DoublePrecision.into()),
        };
    };
    let chosen = match (&settings.device, offered) {
        (DeviceRequest::Named(name), Some(device)) if device.is_called(name) => {
            on(device, single, settings, "as asked for")?
        }
        (DeviceRequest::Gpu, Some(device)) => on(device, single, settings, "as asked for")?,
        (DeviceRequest::Named(name), _) => asked_for(Some(name), single, settings)?,
        (DeviceRequest::Gpu, None) => asked_for(None, single, settings)?,
        _ => faster(single, settings, offered),
    };
    of_precision(chosen)
}

fn asked_for(
    name: Option<&str>,
    model: &Model<f32>,
    settings: &SolverSettings,
) -> Result<Backend<f32>, GpuError> {
    on(&Adapter::find(name)?.open()?, model, settings, "as asked for")
}

/// The one that is expected to be faster, and the CPU where no device can do it.
fn faster(model: &Model<f32>, settings: &SolverSettings, offered: Option<&Device>) -> Backend<f32> {
    let solver = Solver::new(model, settings);
    // The explicit method, whose small steps would count, is left to the CPU (choice.rs).
    let cost = StepCost::new(solver.layout(), settings, 1);
    let tets = grouped(model.tet_count() as u64);
    // Before any driver is loaded, which takes longer than a small scene.
    if !cost.gpu_pays() {
        let from = grouped(cost.pays_from());
        let reason = format!("the mesh has {tets} tetrahedra; a GPU pays from about {from} on");
        return Backend::cpu(solver, reason);
    }
    let (software, devices): (Vec<String>, Vec<Found>) = match offered {
        Some(device) if device.is_software() => (vec![device.name().to_owned()], Vec::new()),
        Some(device) => (Vec::new(), vec![Found::Device(device.clone())]),
        None => {
            let (software, others): (Vec<_>, Vec<_>) =
                Adapter::all().into_iter().partition(Adapter::is_software);
            let names = software.iter().map(Adapter::name).collect();
            (names, others.into_iter().map(Found::Adapter).collect())
        }
    };
    let mut reason = match software.first() {
        Some(name) => format!("no graphics adapter but software ({name})"),
        None => "no graphics adapter".to_owned(),
    };
    for found in devices {
        let tried = found
            .open()
            .and_then(|device| on(&device, model, settings, &format!("{tets} tetrahedra")));
        match tried {
            Ok(backend) => return Backend { gives_way: true, ..backend },
            Err(error) => reason = error.to_string(),
        }
    }
    Backend::cpu(solver, reason)
}

/// What may compute.
enum Found {
    Device(Device),
    Adapter(Adapter),
}

impl Found {
    fn open(self) -> Result<Device, GpuError> {
        match self {
            Self::Device(device) => Ok(device),
            Self::Adapter(adapter) => adapter.open(),
        }
    }
}

/// A device, for a reason.
pub(super) fn on(
    device: &Device,
    model: &Model<f32>,
    settings: &SolverSettings,
    reason: &str,
) -> Result<Backend<f32>, GpuError> {
    let solver = GpuSolver::new(device, model, settings)?;
    let choice = format!("{}: {reason}", device.name());
    Ok(Backend::new(Engine::Device(Box::new(solver)), choice))
}

/// A count with its thousands apart: "1,280".
fn grouped(count: u64) -> String {
    let digits = count.to_string();
    let mut text = String::new();
    for (place, digit) in digits.chars().enumerate() {
        if place > 0 && (digits.len() - place).is_multiple_of(3) {
            text.push(',');
        }
        text.push(digit);
    }
    text
}
