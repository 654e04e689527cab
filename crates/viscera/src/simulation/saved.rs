//! A simulation as bytes: saved after a frame and resumed, it goes on to the bit as if it had never stopped.
//!
//! All that is kept between frames is written: positions, velocities, multipliers, what was taken hold of, and
//! how far the scene's changes have come. Settings are not: they come with the scene. Threads, iterations and what
//! acts may be others; meshes, materials and the duration of a frame may not. What was done by hand belongs into the scene file
//! ([`Simulation::live`]).

use super::Simulation;
use super::automatic::{self, Chosen};
use super::device::Backend;
use super::error::LiveError;
use super::holding::{GraspOrigins, tolerance};
use super::instruments::{Instruments, Jaw, there_at};
use crate::contact::{HeldMotion, Kept, Touch};
use crate::layout::Layout;
use crate::model::for_each_kind;
use crate::scalar::rigid::RigidTransform;
use crate::scalar::{Mat3, Real, Vec3};
use crate::settings::Method;
use crate::state::{ContactState, Learned, LearnedPart, State};

/// Raised whenever the bytes mean something else.
const FORMAT: u32 = 12;

/// Methods by the number that stands for them; a new one is added at the end.
const METHODS: [Method; 4] = [Method::Auto, Method::Xpbd, Method::Explicit, Method::QuasiNewton];

/// What the bytes begin with.
const MAGIC: &[u8; 8] = b"viscera\x1a";

/// Why a simulation cannot be resumed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum ResumeError {
    /// It does not begin like one.
    #[error("this is no saved simulation; give a file that was written by saving one")]
    NotSaved,
    /// Bytes are missing or have changed.
    #[error(
        "the saved simulation is damaged or incomplete; save it again, or run the scene from its beginning"
    )]
    Damaged,
    /// It was written by another version.
    #[error(
        "the saved simulation has format {found}, and this program reads {FORMAT}; resume it with the version \
         that saved it"
    )]
    Format {
        /// The format found.
        found: u32,
    },
    /// Its numbers have another precision.
    #[error(
        "the simulation was saved with `precision = \"{saved}\"`; set `solver.precision` to that"
    )]
    Precision {
        /// What it was saved with.
        saved: &'static str,
    },
    /// Another method computed it, and this one cannot go on.
    #[error(
        "the simulation was saved with method \"{saved}\", and what computes it here does it with \"{here}\"; set \
         `solver.method = \"{saved}\"`{}",
        if *.saved == Method::QuasiNewton { " and `solver.device = \"cpu\"`" } else { "" }
    )]
    Method {
        /// What it was saved with.
        saved: Method,
        /// What is in force here.
        here: Method,
    },
    /// It is of another scene.
    #[error(
        "the saved simulation has other {what} than the scene; resume it with the scene, meshes and solver \
         settings with which it was saved, holds and changes by hand among them"
    )]
    OtherScene {
        /// What differs.
        what: &'static str,
    },
    /// A change that the scene made before cannot be made again.
    #[error(transparent)]
    Change(#[from] LiveError),
}

/// Numbers in double precision, which holds those of single precision exactly.
type Vectors = Vec<[f64; 3]>;

#[derive(serde::Serialize, serde::Deserialize)]
struct Saved {
    /// Bytes of a number of the solver.
    precision: u8,
    /// See [`METHODS`].
    method: u8,
    /// See [`fingerprint`].
    model: u64,
    frame: u64,
    /// [s].
    frame_duration: f64,
    changes_made: usize,
    rejected_substeps: u64,
    positions: Vectors,
    velocities: Vectors,
    /// Positions at the beginning of the last frame.
    before: Vectors,
    multipliers: Vec<f64>,
    multiplier_dt: f64,
    /// See [`Learned`].
    pairs: Vectors,
    learned: Vec<LearnedPart>,
    taken: Vec<Option<Vectors>>,
    /// Of each tool the columns of its rotation, and its place.
    tools: Vec<[[f64; 3]; 4]>,
    touches: Vec<SavedTouch>,
    /// Of tissue on tissue.
    pressed: Vec<Kept>,
    torn: Vec<bool>,
    /// Jaws that follow a force, tool by tool.
    jaws: Vec<Jaw>,
    /// Tools that springs hold.
    held: Vec<HeldMotion>,
}

/// A [`Touch`].
#[derive(serde::Serialize, serde::Deserialize)]
struct SavedTouch {
    sample: u32,
    tool: u32,
    is_tied: bool,
    pressed: f64,
    anchor: [f64; 3],
    normal: [f64; 3],
    offset: f64,
    force: [f64; 3],
    place: [f64; 3],
}

impl SavedTouch {
    fn of(touch: &Touch) -> Self {
        Self {
            sample: touch.sample,
            tool: touch.tool,
            is_tied: touch.is_tied,
            pressed: touch.pressed,
            anchor: touch.anchor.to_array(),
            normal: touch.normal.to_array(),
            offset: touch.offset,
            force: touch.force.to_array(),
            place: touch.place.to_array(),
        }
    }

    fn back(&self) -> Touch {
        Touch {
            sample: self.sample,
            tool: self.tool,
            anchor: Vec3::from_f64(self.anchor),
            normal: Vec3::from_f64(self.normal),
            offset: self.offset,
            pressed: self.pressed,
            force: Vec3::from_f64(self.force),
            place: Vec3::from_f64(self.place),
            is_tied: self.is_tied,
        }
    }
}

fn bare_pose(pose: &RigidTransform) -> [[f64; 3]; 4] {
    let [a, b, c] = pose.rotation.columns;
    [a, b, c, pose.translation].map(Vec3::to_array)
}

fn dressed_pose(numbers: &[[f64; 3]; 4]) -> RigidTransform {
    let [a, b, c, translation] = numbers.map(Vec3::from_f64);
    RigidTransform { rotation: Mat3::from_columns(a, b, c), translation }
}

fn bare<S: Real>(vectors: &[Vec3<S>]) -> Vectors {
    vectors.iter().map(|v| v.to_array().map(S::to_f64)).collect()
}

fn dressed<S: Real>(vectors: &[[f64; 3]]) -> Vec<Vec3<S>> {
    vectors.iter().map(|v| Vec3::from_f64(*v)).collect()
}

impl<S: Real> Simulation<S> {
    /// The simulation as it is after the last frame. [`Simulation::resume`] of one of the same scene goes on
    /// from there.
    pub fn save(&self) -> Vec<u8> {
        let state = self.whole_state();
        let State { positions, velocities, multipliers, multiplier_dt, learned, contact } = &state;
        let saved = Saved {
            precision: size_of::<S>() as u8,
            method: METHODS.iter().position(|m| *m == self.solver.method).unwrap_or(0) as u8,
            model: fingerprint(self.layout()),
            frame: self.frame,
            frame_duration: self.scene.time.frame,
            changes_made: self.changes_made,
            rejected_substeps: self.rejected_substeps,
            positions: bare(positions),
            velocities: bare(velocities),
            before: bare(&self.before),
            multipliers: multipliers.iter().map(|l| l.to_f64()).collect(),
            multiplier_dt: *multiplier_dt,
            pairs: bare(&learned.pairs),
            learned: learned.parts.clone(),
            taken: self.taken.all().iter().map(|taken| taken.as_deref().map(bare)).collect(),
            tools: contact.poses.iter().map(bare_pose).collect(),
            pressed: contact.pairs.clone(),
            torn: contact.torn.clone(),
            touches: contact.touches.iter().map(SavedTouch::of).collect(),
            jaws: self.instruments.jaws().to_vec(),
            held: contact.held.clone(),
        };
        let mut bytes = MAGIC.to_vec();
        bytes.extend(FORMAT.to_le_bytes());
        let written = postcard::to_allocvec_crc32(&saved, checksum().digest());
        bytes.extend(written.expect("memory is all that it needs"));
        bytes
    }

    /// Goes on from where another simulation of the same scene was saved, on whatever computes the steps here:
    /// to the bit on the same backend. Forces and the force balance are known again after the next frame.
    pub fn resume(mut self, saved: &[u8]) -> Result<Self, ResumeError> {
        let saved = read(saved)?;
        if usize::from(saved.precision) != size_of::<S>() {
            let saved = if saved.precision == 8 { "f64" } else { "f32" };
            return Err(ResumeError::Precision { saved });
        }
        if saved.frame_duration != self.scene.time.frame {
            return Err(ResumeError::OtherScene { what: "frame duration, `time.frame`," });
        }
        self.frame = saved.frame;
        while self.changes_made < saved.changes_made {
            if self.scene.changes.len() <= self.changes_made {
                return Err(ResumeError::OtherScene { what: "changes of settings" });
            }
            self.make_change()?;
        }
        // The last frame's tools.
        let begun = self.frame.saturating_sub(1) as f64 * self.scene.time.frame;
        self.sample_for(begun)?;
        let there = there_at(&self.assembly.tools, begun, tolerance(&self.scene));
        let method = METHODS.get(usize::from(saved.method)).ok_or(ResumeError::Damaged)?;
        self.take_method(*method)?;
        let vertices = self.model.vertex_count();
        let constraints = self.layout().multiplier_count;
        let lengths = [saved.positions.len(), saved.velocities.len(), saved.before.len()];
        for (what, fits) in [
            ("vertices", lengths == [vertices; 3]),
            ("constraints", [0, constraints].contains(&saved.multipliers.len())),
            ("meshes, materials or solver settings", saved.model == fingerprint(self.layout())),
            ("motions", self.takes(&saved.taken)),
            ("tools", self.knows(&saved, &there)),
        ] {
            if !fits {
                return Err(ResumeError::OtherScene { what });
            }
        }
        self.taken =
            GraspOrigins::of(saved.taken.iter().map(|t| t.as_deref().map(dressed)).collect());
        self.instruments = Instruments::of(saved.jaws, there, self.time());
        self.choose_substeps();
        self.before = dressed(&saved.before);
        self.rejected_substeps = saved.rejected_substeps;
        self.put(State {
            positions: dressed(&saved.positions),
            velocities: dressed(&saved.velocities),
            multipliers: saved.multipliers.iter().map(|&l| S::from_f64(l)).collect(),
            multiplier_dt: saved.multiplier_dt,
            learned: Learned { pairs: dressed(&saved.pairs), parts: saved.learned },
            contact: ContactState {
                poses: saved.tools.iter().map(dressed_pose).collect(),
                held: saved.held,
                touches: saved.touches.iter().map(SavedTouch::back).collect(),
                pairs: saved.pressed,
                torn: saved.torn,
            },
        });
        let mut inputs = self.inputs_at(self.time());
        self.place_held(&mut inputs.tools);
        self.inputs = inputs;
        self.measure_tissue();
        Ok(self)
    }

    /// Goes on with the method that a simulation was saved with, where "auto" has chosen another one: a device has XPBD
    /// where the CPU has the quasi-Newton method.
    fn take_method(&mut self, saved: Method) -> Result<(), ResumeError> {
        let here = self.solver.method;
        if saved == here {
            return Ok(());
        }
        let refused = ResumeError::Method { saved, here };
        if self.scene.solver.method != Method::Auto || self.callers_device {
            return Err(refused);
        }
        let Chosen { settings, oscillations, solver } =
            automatic::keep_method(&self.scene, &self.assembly, &self.model, saved);
        self.backend =
            Backend::choose(&self.model, &settings, solver, &self.offered).map_err(|_| refused)?;
        (self.solver, self.oscillations) = (settings, oscillations);
        self.resumed_method = Some(saved);
        self.choose_substeps();
        Ok(())
    }

    /// Whether what was touched, and by what, is there.
    fn knows(&self, saved: &Saved, there: &[bool]) -> bool {
        let samples = self.model.samples.len();
        let is_known = |touch: &SavedTouch| {
            (touch.sample as usize) < samples && (touch.tool as usize) < saved.tools.len()
        };
        let skin = &self.model.skin;
        let is_there = |kept: &Kept| {
            (kept.sample as usize) < skin.samples.len()
                && (kept.triangle as usize) < skin.triangles.len()
        };
        let fits = saved.pressed.iter().all(is_there) && saved.torn.len() <= skin.ties.len();
        let tools = self.assembly.tools.iter().zip(there).filter(|(_, there)| **there);
        let parts: usize = tools.map(|(tool, _)| tool.parts.len()).sum();
        fits && saved.touches.iter().all(is_known)
            && saved.jaws.len() == self.scene.tools.len()
            && saved.tools.len() == parts
            && [0, parts].contains(&saved.held.len())
    }

    /// Whether each motion has as many vertices as were taken hold of.
    fn takes(&self, taken: &[Option<Vectors>]) -> bool {
        let motions = &self.assembly.motions;
        let fits = |(taken, patch): (&Option<Vectors>, &super::ResolvedPatch)| {
            taken.as_ref().is_none_or(|places| places.len() == patch.vertices.len())
        };
        taken.len() <= motions.len() && taken.iter().zip(motions).all(fits)
    }
}

/// Whether bytes begin like a saved simulation.
pub(crate) fn is_saved(bytes: &[u8]) -> bool {
    bytes.starts_with(MAGIC)
}

/// What is different in two saved simulations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SavedDifference {
    /// The place of a vertex.
    Position(usize),
    /// The velocity of a vertex.
    Velocity(usize),
    /// What else is kept between frames.
    Kept,
}

/// The first difference of two simulations of one model that were saved; nothing where there is none.
pub(crate) fn difference_of_saved(
    a: &[u8],
    b: &[u8],
) -> Result<Option<SavedDifference>, ResumeError> {
    if a == b {
        return Ok(None);
    }
    let (a, b) = (read(a)?, read(b)?);
    let bits = |v: &[f64; 3]| v.map(f64::to_bits);
    let first = |a: &Vectors, b: &Vectors| a.iter().zip(b).position(|(a, b)| bits(a) != bits(b));
    let position = first(&a.positions, &b.positions).map(SavedDifference::Position);
    let velocity = first(&a.velocities, &b.velocities).map(SavedDifference::Velocity);
    Ok(position.or(velocity).or(Some(SavedDifference::Kept)))
}

fn checksum() -> crc::Crc<u32> {
    crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC)
}

fn read(bytes: &[u8]) -> Result<Saved, ResumeError> {
    let rest = bytes.strip_prefix(MAGIC).ok_or(ResumeError::NotSaved)?;
    let (format, rest) = rest.split_first_chunk::<4>().ok_or(ResumeError::Damaged)?;
    let found = u32::from_le_bytes(*format);
    if found != FORMAT {
        return Err(ResumeError::Format { found });
    }
    let crc = checksum();
    postcard::from_bytes_crc32(rest, crc.digest()).map_err(|_| ResumeError::Damaged)
}

/// Differs where the model differs, or the order of multipliers: 64 bits of FNV-1a.
fn fingerprint<S: Real>(layout: &Layout<S>) -> u64 {
    let mut hash = layout.revision;
    let mut add =
        |number: u64| hash = (hash ^ number).wrapping_mul(0x0100_0000_01b3).rotate_left(29);
    for set in &layout.tet_sets {
        add(set.form.multiplier_count() as u64);
        add(u64::from(set.viscous));
        set.order.iter().chain(&set.color_offsets).for_each(|&tet| add(tet.into()));
        let clusters = set.clusters.iter().flat_map(|all| all.offsets.iter().chain(&all.inner));
        clusters.for_each(|&number| add(number.into()));
    }
    for_each_kind!(layout, set => {
        set.order.iter().chain(&set.color_offsets).for_each(|&i| add(i.into()));
    });
    hash
}
