//! Tools in a running simulation: they come and go, and hands take and move them. What hands do becomes part of the scene, so
//! that a scene file with [`Live`](super::Live) behind its other tables does the same to the bit.
//!
//! ```text
//! take_tool, move_tool, open_jaws, lock_jaws, put_away     between frames: keys of a hand, from the next frame on
//! tools_come_and_go                                        as a frame begins: samples, contact and substeps for who is there
//! ```
//!
//! A scene that has tools from its beginning and one that gets them later go through the same function, at the same frame.

use super::Simulation;
use super::acts::Act;
use super::checks::{check_tools, refuse_method};
use super::error::LiveError;
use super::holding::tolerance;
use super::instruments::there_at;
use super::touchable::{Entry, thinnest_until};
use crate::contact::{HeldMotion, Sample, Tool, Touch};
use crate::scalar::rigid::RigidTransform;
use crate::scalar::{Real, Vec3};
use crate::scene::{Hand, Instrument, JawKey, MotionKey, check_angle, key_of};
use crate::state::{ContactState, State};
use std::collections::BTreeMap;

/// Farther from the origin no tool goes [m].
const FARTHEST: f64 = 1e3;

/// How far from a rotation a matrix may be that stands for one: single precision.
const ROTATION: f64 = 1e-5;

/// Who moves a tool.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Holder {
    /// The scene's keys, or nothing.
    Scene,
    /// A hand, which took it up or took it over.
    Hand,
}

/// A tool between two frames.
#[derive(Clone, Debug, PartialEq)]
pub struct ToolState {
    /// Its name in the scene.
    pub name: String,
    /// Who moves it.
    pub holder: Holder,
    /// Whether it is in the scene in the frame to come: it has begun, and was not put away.
    pub is_there: bool,
    /// From its frame to the world.
    pub pose: RigidTransform,
    /// The opening angle of its jaws [rad]; nothing where it has none.
    pub jaw_angle: Option<f64>,
    /// Whether its jaws are locked in the frame to come.
    pub is_locked: bool,
}

impl<S: Real> Simulation<S> {
    /// Puts an instrument into the scene from the next frame on, in a hand, at its [`Instrument::placement`]: one of another
    /// scene, or of a tray ([`crate::scene::read_tray`]). Keys, paths and locks that it has are left out; its jaws begin as
    /// they are written. Returns its number. It is refused inside tissue, and where it is too thin for the mesh.
    pub fn take_tool(&mut self, instrument: Instrument) -> Result<usize, LiveError> {
        let pose = checked(&instrument.name, &instrument.placement)?;
        self.check_tools([&instrument])?;
        let (name, time) = (self.free_name(&instrument.name), self.time());
        let given = self.is_recorded().then(|| instrument.clone());
        let mut tool =
            instrument.taken(name, &pose, time).map_err(crate::scene::SceneError::from)?;
        tool.hands.push(Hand::new(time));
        let all = self.assembly.tools.iter().chain([&tool]);
        let thinnest = thinnest_until(all, time, tolerance(&self.scene)).unwrap_or(f64::INFINITY);
        let samples = self.assembly.samples_for(thinnest);
        let entry = Entry { samples: &samples, time, may_meet_fixed: false };
        self.refresh_state();
        self.assembly.check_entry(&tool, &entry, |v| self.state.positions[v].cast())?;
        if let Some(given) = given {
            self.note(|| Act::take_tool(&given));
        }
        self.instruments.add(&tool);
        self.assembly.tools.push(tool.clone());
        self.scene.tools.push(tool);
        Ok(self.scene.tools.len() - 1)
    }

    /// Says where a tool is to be at the end of the next frame; it goes there steadily. A tool that the scene moves is
    /// taken over: the rest of its keys no longer counts.
    pub fn move_tool(&mut self, tool: usize, pose: RigidTransform) -> Result<(), LiveError> {
        let (now, end) = self.next_frame();
        let at = self.tool_there(tool)?;
        let given = checked(&at.name, &pose)?;
        let keys = [(&at.pose(now), now), (&given, end)].map(|(p, t)| key_of(&at.placement, p, t));
        self.with_hand(tool, |hand| {
            let same = |a: &MotionKey, b: &MotionKey| {
                (a.translation, a.rotation) == (b.translation, b.rotation)
            };
            lead(&mut hand.keys, keys, same, |key| &mut key.time);
        });
        self.note(|| Act::MoveTool { tool, pose: given });
        Ok(())
    }

    /// Says how far a tool's jaws are to be open at the end of the next frame [rad]; they turn there steadily. The tool is
    /// taken over as [`Simulation::move_tool`] does, and jaws that a closing force drives follow the hand from then on.
    pub fn open_jaws(&mut self, tool: usize, angle: f64) -> Result<(), LiveError> {
        let (now, end) = self.next_frame();
        let at = self.tool_there(tool)?;
        let jaws = at.jaws.as_ref().ok_or_else(|| LiveError::NoJaws { tool: at.name.clone() })?;
        let fail = |problem| LiveError::Jaws { tool: at.name.clone(), problem };
        if !angle.is_finite() {
            return Err(fail("their angle is no number; give radians".to_owned()));
        }
        check_angle(jaws, angle).map_err(fail)?;
        let angle_now = self.instruments.angle(tool, at, now);
        let keys = [(now, angle_now), (end, angle)].map(|(time, value)| JawKey { time, value });
        self.with_hand(tool, |hand| {
            lead(&mut hand.jaw, keys, |a, b| a.value == b.value, |key| &mut key.time);
        });
        self.note(|| Act::OpenJaws { tool, angle });
        Ok(())
    }

    /// Locks a tool's jaws from the next frame on, or unlocks them: what they press on is tied to them. The tool is taken
    /// over as [`Simulation::move_tool`] does.
    pub fn lock_jaws(&mut self, tool: usize, locked: bool) -> Result<(), LiveError> {
        let now = self.time();
        let at = self.tool_there(tool)?;
        if at.jaws.is_none() {
            return Err(LiveError::NoJaws { tool: at.name.clone() });
        }
        self.with_hand(tool, |hand| {
            let open = hand.locks.last_mut().filter(|lock| lock[1] > now);
            match (open, locked) {
                (None, true) => hand.locks.push([now, f64::INFINITY]),
                (Some(lock), false) => lock[1] = now,
                _ => {}
            }
            hand.locks.retain(|[from, to]| from < to);
        });
        self.note(|| Act::LockJaws { tool, locked });
        Ok(())
    }

    /// Takes a tool out of the scene from the next frame on: what it held is free.
    pub fn put_away(&mut self, tool: usize) -> Result<(), LiveError> {
        let now = self.time();
        self.tool_there(tool)?;
        self.with_hand(tool, |hand| hand.end = Some(now));
        self.note(|| Act::PutAway { tool });
        Ok(())
    }

    /// All tools, those that are no longer there among them: their numbers stay.
    pub fn tools(&self) -> Vec<ToolState> {
        let (time, tolerance) = (self.time(), tolerance(&self.scene));
        let state = |(index, tool): (usize, &Instrument)| ToolState {
            name: tool.name.clone(),
            holder: if self.is_by_hand(index) { Holder::Hand } else { Holder::Scene },
            is_there: tool.is_there(time, tolerance),
            pose: tool.pose(time),
            jaw_angle: self.jaw_angle(index),
            is_locked: tool.is_locked(time + tolerance),
        };
        self.assembly.tools.iter().enumerate().map(state).collect()
    }

    /// Tools of the scene from this number on were taken up by hand.
    pub fn first_taken(&self) -> usize {
        self.written.tools.len()
    }

    /// Hands that took tools since the beginning, with the names of these.
    pub(super) fn live_hands(&self) -> Vec<(String, Hand)> {
        let of_tool = |(index, tool): (usize, &Instrument)| {
            let hands = tool.hands.get(self.written_hands(index)..).unwrap_or_default().to_vec();
            hands.into_iter().map(|hand| (tool.name.clone(), hand)).collect::<Vec<_>>()
        };
        self.scene.tools.iter().enumerate().flat_map(of_tool).collect()
    }

    /// Times of the beginning and the end of the next frame [s].
    fn next_frame(&self) -> (f64, f64) {
        (self.time(), (self.frame + 1) as f64 * self.scene.time.frame)
    }

    /// How many hands the scene's file has on a tool.
    fn written_hands(&self, tool: usize) -> usize {
        self.written.tools.get(tool).map_or(0, |written| written.hands.len())
    }

    fn is_by_hand(&self, tool: usize) -> bool {
        let at = self.scene.tools.get(tool);
        at.is_some_and(|at| at.hands.len() > self.written_hands(tool))
    }

    /// A tool that is there.
    fn tool_there(&self, tool: usize) -> Result<&Instrument, LiveError> {
        let at = self.assembly.tools.get(tool);
        let (time, tolerance) = (self.time(), tolerance(&self.scene));
        at.filter(|at| at.is_there(time, tolerance)).ok_or(LiveError::NoTool { tool })
    }

    /// Does something to the hand that has a tool; it takes the tool where the scene has it.
    fn with_hand(&mut self, tool: usize, act: impl Fn(&mut Hand)) {
        let (now, takes) = (self.time(), !self.is_by_hand(tool));
        let after = now + tolerance(&self.scene);
        for tools in [&mut self.scene.tools, &mut self.assembly.tools] {
            let Some(at) = tools.get_mut(tool) else { continue };
            if takes {
                let lock = at.is_locked(after).then_some([now, f64::INFINITY]);
                at.hands.push(Hand { locks: lock.into_iter().collect(), ..Hand::new(now) });
            }
            at.hands.last_mut().into_iter().for_each(&act);
        }
    }

    /// The name, or one with a number behind where it is taken.
    fn free_name(&self, name: &str) -> String {
        let plain = |letter: char| letter.is_alphanumeric() || letter == '_' || letter == '-';
        let name: String = name.chars().map(|c| if plain(c) { c } else { '-' }).collect();
        let is_free = |name: &String| self.scene.tools.iter().all(|tool| tool.name != *name);
        let names = (2..).map(|number| format!("{name}-{number}"));
        std::iter::once(name.clone()).chain(names).find(is_free).unwrap_or(name)
    }

    /// As a frame begins: tools come into the scene and leave it.
    pub(super) fn tools_come_and_go(&mut self) -> Result<(), LiveError> {
        let (time, tolerance) = (self.time(), tolerance(&self.scene));
        let there = there_at(&self.assembly.tools, time, tolerance);
        let stays = |(index, is_there)| is_there == self.instruments.is_there(index);
        if there.iter().copied().enumerate().all(stays) {
            return Ok(());
        }
        let (were_any, count) = (self.instruments.there().contains(&true), there.len());
        self.refresh_state();
        self.sample_for(time)?;
        let comes = |index: &usize| there[*index] && !self.instruments.is_there(*index);
        let samples = self.assembly.builder.samples();
        let entry = Entry { samples, time, may_meet_fixed: true };
        for index in (0..count).filter(comes) {
            let tool = &self.assembly.tools[index];
            self.assembly.check_entry(tool, &entry, |v| self.state.positions[v].cast())?;
        }
        let (frame, are_any) = (self.scene.time.frame, there.contains(&true));
        let places = self.instruments.come_and_go(&self.assembly.tools, there, frame);
        let mut parts = Vec::new();
        self.instruments.parts_at(&self.assembly.tools, time, &mut parts);
        self.state.contact = self.contact_of(&self.state);
        renumber(&mut self.state.contact, &places, &parts);
        if let Some(device) = self.backend.device_mut() {
            device.write(&self.model, &self.state);
        }
        if let Some(shadow) = &mut self.shadow {
            shadow.change_contact(&self.model, |contact| renumber(contact, &places, &parts));
        }
        if were_any != are_any {
            self.choose_substeps();
        }
        Ok(())
    }

    /// What computes takes contact with all tools, these among them.
    fn check_tools<'a>(
        &'a self,
        new: impl IntoIterator<Item = &'a Instrument>,
    ) -> Result<(), LiveError> {
        let all: Vec<&Instrument> = self.assembly.tools.iter().chain(new).collect();
        let all = all.iter().copied();
        check_tools(&self.scene, self.callers_device, all)?;
        Ok(refuse_method(&self.solver).map_err(super::SimulationError::from)?)
    }

    /// Samples as fine as the thinnest of all tools needs that have come by a time [s]. Where that is another mesh of them
    /// than before the model is built again; all that moves stays as it is, and what is touched is touched on.
    pub(super) fn sample_for(&mut self, time: f64) -> Result<(), LiveError> {
        let tolerance = tolerance(&self.scene);
        let Some(thinnest) = thinnest_until(&self.assembly.tools, time, tolerance) else {
            return Ok(());
        };
        let samples = self.assembly.samples_for(thinnest);
        if samples == self.assembly.builder.samples() {
            return Ok(());
        }
        self.check_tools([])?;
        let mut builder = self.assembly.builder.clone();
        builder.set_samples(samples).map_err(super::SimulationError::from)?;
        let model = builder.build::<S>().map_err(super::SimulationError::from)?;
        let backend = self.backend.renew(true, &model, &self.solver, None, &self.offered)?;
        let mut state = self.whole_state();
        let old = self.assembly.builder.samples();
        state.contact.touches = finer(&state, old, builder.samples());
        state.contact.touches.sort_by_key(|touch| {
            (backend.layout().part_of_sample(touch.sample), touch.sample, touch.tool)
        });
        (self.model, self.backend) = (model, backend);
        self.assembly.builder = builder;
        self.shadow = None;
        (self.stepped, self.is_balanced) = (false, false);
        self.put(state);
        Ok(())
    }
}

/// A pose that can be one.
fn checked(tool: &str, pose: &RigidTransform) -> Result<RigidTransform, LiveError> {
    let RigidTransform { rotation, translation } = pose;
    let excess = rotation.transpose() * *rotation - crate::scalar::Mat3::IDENTITY;
    let is_rotation = excess.norm_squared() < ROTATION * ROTATION && rotation.determinant() > 0.0;
    // What is no number is in no range.
    if is_rotation && translation.length() <= FARTHEST {
        return Ok(*pose);
    }
    Err(LiveError::Pose { tool: tool.to_owned() })
}

/// Goes on to the second of two keys from where it is now, the first of them. What stands still needs no keys.
fn lead<K: Copy>(
    keys: &mut Vec<K>,
    [now, end]: [K; 2],
    same: impl Fn(&K, &K) -> bool,
    time: impl Fn(&mut K) -> &mut f64,
) {
    let [now_time, end_time] = [now, end].map(|mut key| *time(&mut key));
    let time_of = |mut key: K| *time(&mut key);
    if keys.last().is_some_and(|last| time_of(*last) == end_time) {
        keys.pop();
    }
    match keys.as_slice() {
        [] => keys.push(now),
        [.., before, last] if same(last, &end) && same(before, last) => {
            keys.pop();
        }
        &[.., mut last] if time_of(last) < now_time => {
            *time(&mut last) = now_time;
            keys.push(last);
        }
        _ => {}
    }
    keys.push(end);
}

/// Parts have other numbers, and some are gone, as `places` says of each that was there; `parts` are there now.
fn renumber(contact: &mut ContactState, places: &[Option<u32>], parts: &[Tool]) {
    let mut poses: Vec<RigidTransform> = parts.iter().map(|part| part.pose).collect();
    for (pose, place) in contact.poses.iter().zip(places) {
        if let Some(kept) = place.and_then(|place| poses.get_mut(place as usize)) {
            *kept = *pose;
        }
    }
    contact.poses = poses;
    if !contact.held.is_empty() {
        let mut held = vec![HeldMotion::default(); parts.len()];
        for (motion, place) in contact.held.iter().zip(places) {
            if let Some(kept) = place.and_then(|place| held.get_mut(place as usize)) {
                *kept = *motion;
            }
        }
        contact.held = held;
    }
    contact.touches.retain_mut(|touch| {
        let place = places.get(touch.tool as usize).copied().flatten();
        touch.tool = place.unwrap_or(touch.tool);
        place.is_some()
    });
}

/// What was touched at coarser samples, at those finer ones that lie nearest to each on its triangle: shifted with them, and
/// shared by their areas.
fn finer<S: Real>(state: &State<S>, old: &[Sample], new: &[Sample]) -> Vec<Touch> {
    let touches = &state.contact.touches;
    let mut touched = BTreeMap::<u32, Vec<&Touch>>::new();
    touches.iter().for_each(|touch| touched.entry(touch.sample).or_default().push(touch));
    let mut of_triangle = BTreeMap::<(u32, [u32; 4]), Vec<u32>>::new();
    for (number, sample) in (0..).zip(old) {
        of_triangle.entry((sample.tet, sample.vertices)).or_default().push(number);
    }
    let apart = |a: &Sample, b: &Sample| -> f64 {
        a.weights.iter().zip(&b.weights).map(|(a, b)| (a - b) * (a - b)).sum()
    };
    let mut all = Vec::new();
    for (number, sample) in (0..).zip(new) {
        let Some(near) = of_triangle.get(&(sample.tet, sample.vertices)) else { continue };
        let nearest = near.iter().min_by(|a, b| {
            let [a, b] = [a, b].map(|&&number| apart(&old[number as usize], sample));
            a.total_cmp(&b)
        });
        let Some(nearest) = nearest else { continue };
        let share = sample.area / old[*nearest as usize].area;
        let corners = sample.vertices.iter().zip(&sample.weights);
        let place = corners.fold(Vec3::ZERO, |sum, (&v, &weight)| {
            sum + state.positions[v as usize].cast::<f64>() * weight
        });
        for touch in touched.get(nearest).into_iter().flatten() {
            let Some(pose) = state.contact.poses.get(touch.tool as usize) else { continue };
            all.push(Touch {
                sample: number,
                anchor: touch.anchor + pose.turn_back(place - touch.place),
                pressed: touch.pressed * share.min(1.0),
                force: touch.force * share.min(1.0),
                place,
                ..**touch
            });
        }
    }
    all
}
