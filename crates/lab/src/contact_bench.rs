//! Two scenes of contact beside other simulators: a ball that is pressed into a block, and a block on an incline.
//!
//! [`write_scenes`] writes meshes and truths for all of them, [`run`] is one run of the library.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, Result, bail, ensure};
use viscera::contact::ContactLaw;
use viscera::material::MaterialModel;
use viscera::mesh::TetMesh;
use viscera::scalar::{Scalar, Vec3, vec3};
use viscera::settings::Method;
use viscera::solver::Solver;
use viscera::state::State;
use viscera_resources::files::write_atomic;

use crate::bars::text;
use crate::contact_cases::{Pressing, Sampling, Sliding, Way};
use crate::load_cases::{FRAME_RATE, NEAR, tissue};
use crate::settling::KEPT_VELOCITY;

const YOUNG: f64 = 1e4;
const POISSON: f64 = 0.3;

/// Of the ball [m].
const RADIUS: f64 = 0.012;

/// How far it goes below the top [mm].
const DEPTHS: [u32; 3] = [2, 4, 8];

/// Edge of the block's cells [m] by the mesh's name, and their number.
const BLOCKS: [(&str, f64, [usize; 3]); 2] =
    [("s", 0.005, [12, 12, 6]), ("m", 0.003_75, [16, 16, 8])];

/// Frames in which the ball goes down, and in which it is held.
const PRESSING: u32 = 60;
const HELD: u32 = 120;

/// Frames at the end over which the force is averaged, and at the beginning that are not timed.
const COUNTED: usize = 10;
const SKIPPED: usize = 3;

/// A contact that gives by micrometres.
const RIGID: ContactLaw = ContactLaw { stiffness: 1e3, thickness: 1e-5, friction: 0.0 };

/// The block on the incline: edges [m], cells.
const SIZE: [f64; 3] = [0.02, 0.02, 0.01];
const CELLS: [usize; 3] = [6, 6, 3];
const FRICTION: f64 = 0.5;

/// The benchmark's names of laws.
const LAWS: [(&str, MaterialModel); 2] =
    [("snh", MaterialModel::StableNeoHookean), ("stvk", MaterialModel::SaintVenantKirchhoff)];

/// The ball of radius [`RADIUS`] in the middle of a block; where contact begins counts as its surface.
fn pressing(size: &str, model: MaterialModel, law: ContactLaw, depth: f64) -> Result<Pressing> {
    let known = BLOCKS.iter().find(|(name, ..)| *name == size);
    let &(_, edge, cells) = known.with_context(|| format!("there is no block `{size}`"))?;
    let tissue = tissue(model, YOUNG, POISSON)?;
    let radius = RADIUS - law.thickness;
    let block = Pressing::on_block(cells, edge, radius, tissue)?;
    Ok(Pressing { law, depth: depth - law.thickness, ..block })
}

/// Of [`FRICTION`], at an angle [degrees].
fn sliding(law: ContactLaw, degrees: f64, frames: u32) -> Result<Sliding> {
    Ok(Sliding {
        size: Vec3::from_f64(SIZE),
        cells: CELLS,
        tissue: tissue(MaterialModel::StableNeoHookean, YOUNG, POISSON)?,
        law: ContactLaw { friction: FRICTION, ..law },
        angle: degrees.to_radians(),
        frames,
    })
}

/// Writes block-s.txt and so on, incline.txt, and truths.json: of each block, law and depth the force [N] with a nearly
/// rigid contact, with more samples of the surface, with the library's four of each triangle, and with its usual contact.
pub fn write_scenes(folder: &Path) -> Result<Vec<PathBuf>> {
    let mut files = Vec::new();
    let mut write = |name: &str, text: &str| -> Result<()> {
        let file = folder.join(name);
        write_atomic(&file, text.as_bytes())?;
        files.push(file);
        Ok(())
    };
    let mut truths = Vec::new();
    for (size, ..) in BLOCKS {
        let block = pressing(size, LAWS[0].1, RIGID, 0.0)?;
        let low = |v: usize| block.mesh.vertices()[v].z < NEAR;
        write(&format!("block-{size}.txt"), &text(&block.mesh, low))?;
        for (name, model) in LAWS {
            truths.extend(truths_of(size, name, model)?);
        }
    }
    write("incline.txt", &text(&lying(&sliding(ContactLaw::default(), 0.0, 0)?)?, |_| false))?;
    write("truths.json", &format!("[{}]\n", truths.join(",\n ")))?;
    Ok(files)
}

/// The block of the incline on the plane `z = 0`.
fn lying(sliding: &Sliding) -> Result<TetMesh> {
    let mesh = viscera::mesh::shapes::Block::new(sliding.size, sliding.cells).mesh()?;
    let middle = vec3(0.5 * sliding.size.x, 0.5 * sliding.size.y, 0.0);
    let places = mesh.vertices().iter().map(|x| *x - middle).collect();
    Ok(TetMesh::new(places, mesh.tets().to_vec(), mesh.regions().to_vec())?.0)
}

/// Truths of all depths, each from the one before, so that a deep ball is on the way that a motion takes.
fn truths_of(size: &str, name: &str, model: MaterialModel) -> Result<Vec<String>> {
    let usual = ContactLaw { friction: 0.0, ..ContactLaw::default() };
    let ways = [(RIGID, 2), (RIGID, 3), (RIGID, 1), (usual, 1)];
    let mut forces = vec![Vec::new(); DEPTHS.len()];
    for (law, cuts) in ways {
        let mut start: Option<Vec<Vec3<f64>>> = None;
        for (depth, forces) in DEPTHS.iter().zip(&mut forces) {
            let mut scene = pressing(size, model, law, 1e-3 * f64::from(*depth))?;
            scene.samples = Sampling::Cut(cuts);
            let begin = start.take().unwrap_or_else(|| scene.mesh.vertices().to_vec());
            let rest = scene
                .truth_from(&begin, 1)
                .or_else(|_| scene.truth_from(&begin, 4))
                .with_context(|| format!("block {size}, {name}, {depth} mm, {cuts} cuts"))?;
            forces.push(rest.force());
            start = Some(rest.positions);
        }
    }
    let row = |(depth, forces): (&u32, &Vec<f64>)| {
        format!(
            "{{\"size\": \"{size}\", \"law\": \"{name}\", \"depth_mm\": {depth}, \"rigid\": {:e}, \
             \"more_samples\": {:e}, \"four\": {:e}, \"usual\": {:e}}}",
            forces[0], forces[1], forces[2], forces[3]
        )
    };
    Ok(DEPTHS.iter().zip(&forces).map(row).collect())
}

/// What one run is asked to be: `press` or `slide`, then KEY=VALUE.
#[derive(Debug, PartialEq)]
struct Request {
    /// Whether the ball presses; otherwise the block lies on the incline.
    presses: bool,
    size: String,
    method: Method,
    schedule: Option<(u32, u32)>,
    law: ContactLaw,
    /// Depth [mm] or angle [degrees].
    amount: f64,
    frames: u32,
}

impl Request {
    fn read(text: &str) -> Result<Self> {
        let mut parts = text.split(',');
        let presses = match parts.next() {
            Some("press") => true,
            Some("slide") => false,
            _ => bail!("`{text}`: begin with press or slide"),
        };
        let mut request = Self {
            presses,
            size: "s".to_owned(),
            method: Method::QuasiNewton,
            schedule: None,
            law: ContactLaw { friction: 0.0, ..ContactLaw::default() },
            amount: 4.0,
            frames: 36,
        };
        for part in parts {
            let (key, value) = part.split_once('=').with_context(|| format!("`{part}`: no ="))?;
            let number = || value.parse::<f64>().with_context(|| format!("`{part}`: no number"));
            match key {
                "size" => value.clone_into(&mut request.size),
                "method" => request.method = method(value)?,
                "schedule" => {
                    let pair = value.split_once('x').and_then(|(substeps, iterations)| {
                        Some((substeps.parse().ok()?, iterations.parse().ok()?))
                    });
                    request.schedule = Some(pair.with_context(|| format!("`{part}`: write 4x10"))?);
                }
                "stiffness" => request.law.stiffness = number()?,
                "thickness" => request.law.thickness = number()?,
                "depth" | "angle" => request.amount = number()?,
                "frames" => request.frames = number()? as u32,
                _ => bail!(
                    "`{part}`: size, method, schedule, stiffness, thickness, depth, angle or frames"
                ),
            }
        }
        ensure!(request.law.complaint().is_none(), "`{text}`: no legal contact");
        Ok(request)
    }

    fn way(&self) -> Way {
        Way { schedule: self.schedule, ..Way::of(self.method).in_single() }
    }
}

fn method(name: &str) -> Result<Method> {
    Ok(match name {
        "xpbd" => Method::Xpbd,
        "quasi_newton" => Method::QuasiNewton,
        "explicit" => Method::Explicit,
        _ => bail!("no method `{name}`: xpbd, quasi_newton or explicit"),
    })
}

/// One run of the library in single precision on one thread, as a line of JSON.
pub fn run(text: &str) -> Result<String> {
    let request = Request::read(text)?;
    let mut clock = Clock::default();
    let mut line = String::from("{");
    if request.presses {
        let depth = 1e-3 * request.amount;
        let scene = pressing(&request.size, MaterialModel::StableNeoHookean, request.law, depth)?;
        let (forces, substeps) = press(&scene, &request.way(), &mut clock)?;
        write!(line, "\"forces\": {forces:?}, \"substeps\": {substeps}, ")?;
    } else {
        let scene = sliding(request.law, request.amount, request.frames)?;
        let slide = scene.slide_watched(&request.way(), &mut || clock.tick())?;
        write!(
            line,
            "\"acceleration\": {:e}, \"way\": {:e}, \"ratio\": {:e}, \"rejected\": {:e}, ",
            slide.acceleration, slide.way, slide.ratio, slide.rejected
        )?;
    }
    write!(line, "\"cpu_ms\": {:.5}}}", clock.mean())?;
    Ok(line + "\n")
}

/// Forces [N] at the ends of the last frames, and substeps of a frame.
fn press(scene: &Pressing, way: &Way, clock: &mut Clock) -> Result<(Vec<f64>, u32)> {
    let model = scene.model::<f32>()?;
    let mut solver = Solver::new(&model, &way.settings());
    let mut state = State::at_rest(&model);
    let frame_time = 1.0 / FRAME_RATE;
    // Contact begins above the surface.
    let above = -scene.law.thickness / scene.depth;
    let share = |time: f64| above + (1.0 - above) * (time / f64::from(PRESSING)).min(1.0);
    let substeps = solver.substeps(&scene.inputs(above), frame_time);
    let dt = frame_time / f64::from(substeps);
    let mut forces = Vec::new();
    for frame in 0..PRESSING + HELD {
        for substep in 1..=substeps {
            let time = f64::from(frame) + f64::from(substep) / f64::from(substeps);
            solver.step(&model, &mut state, &scene.inputs(share(time)), dt)?;
        }
        clock.tick();
        for velocity in &mut state.velocities {
            *velocity = *velocity * f32::from_f64(KEPT_VELOCITY);
        }
        forces.push(solver.wrenches().first().map_or(0.0, |wrench| wrench.force.z));
    }
    Ok((forces.split_off(forces.len() - COUNTED), substeps))
}

/// Processor time of frames.
#[derive(Default)]
struct Clock {
    ends: Vec<f64>,
}

impl Clock {
    /// A frame has ended.
    fn tick(&mut self) {
        self.ends.push(processor_time());
    }

    /// Of a frame [ms]: the mean, for some systems count in steps of several milliseconds.
    fn mean(&self) -> f64 {
        let frames = self.ends.len().saturating_sub(SKIPPED + 1);
        match self.ends.as_slice() {
            [.., last] if frames > 0 => (last - self.ends[SKIPPED]) / frames as f64,
            _ => f64::NAN,
        }
    }
}

/// Of this process's first thread [ms], which does all the work here; NaN where the system does not tell.
fn processor_time() -> f64 {
    let text = std::fs::read_to_string("/proc/self/schedstat").unwrap_or_default();
    let nanoseconds = text.split_whitespace().next().and_then(|first| first.parse::<f64>().ok());
    nanoseconds.map_or(f64::NAN, |nanoseconds| 1e-6 * nanoseconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn requests_are_read_and_name_what_is_wrong() {
        let text = "slide,method=xpbd,schedule=4x10,stiffness=2,angle=26.9,frames=600";
        let request = Request::read(text).expect("a request");
        assert_eq!((request.presses, request.frames), (false, 600));
        assert_eq!((request.method, request.schedule), (Method::Xpbd, Some((4, 10))));
        assert_eq!((request.law.stiffness, request.amount), (2.0, 26.9));
        for wrong in
            ["push", "press,method=magic", "press,depth", "press,depth=x", "press,stiffness=-1"]
        {
            assert!(Request::read(wrong).is_err(), "{wrong}");
        }
    }

    /// The ball touches the top without force where its whole radius, contact's thickness among it, is above.
    #[test]
    fn thickness_is_of_the_ball() {
        let usual = ContactLaw::default();
        let scene = pressing("s", MaterialModel::StableNeoHookean, usual, 0.004).expect("a scene");
        let above = -scene.law.thickness / scene.depth;
        let middle = |share: f64| scene.inputs::<f64>(share).tools[0].pose.translation.z;
        assert!((middle(above) - 0.03 - RADIUS).abs() < 1e-12);
        assert!((middle(above) - middle(1.0) - 0.004).abs() < 1e-12);
    }
}
