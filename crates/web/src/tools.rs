//! What hands do with instruments: take one from the tray, lead it, put it away.

use serde::Serialize;
use viscera::scalar::Vec3;
use viscera_stage::{Drag, HandId, Surroundings, ToolAct, pick, pick_tool};

use crate::session::{Act, Session};

/// An instrument in a hand, for the page.
#[derive(Debug, Serialize)]
#[serde(rename_all = "camelCase")]
pub struct InHandReport {
    /// The hand's number.
    pub id: HandId,
    /// What it is called.
    pub name: String,
    /// Whether it is the one that pointers and keys lead.
    pub is_active: bool,
    /// Whether it has jaws.
    pub has_jaws: bool,
    /// Whether they are locked.
    pub is_locked: bool,
}

impl Session {
    /// The names of the instruments on the tray.
    pub fn tray(&self) -> Vec<&str> {
        self.tray.iter().map(|instrument| instrument.name.as_str()).collect()
    }

    /// Those in hands.
    pub fn in_hand(&self) -> Vec<InHandReport> {
        let active = self.instruments.active().map(|held| held.id);
        let all = self.instruments.list().iter().map(|held| InHandReport {
            id: held.id,
            name: held.name.clone(),
            is_active: active == Some(held.id),
            has_jaws: held.jaws.is_some(),
            is_locked: held.is_locked,
        });
        all.collect()
    }

    /// What a person should know of instruments since this was last asked.
    pub fn told(&mut self) -> Option<String> {
        let heard = self.runs.iter_mut().find_map(|state| state.run.told());
        self.told.take().or(heard)
    }

    fn surroundings(&self) -> Surroundings {
        let positions = self.runs.first().map_or(&[][..], |state| &state.snapshot.positions);
        let heights = positions.iter().map(|x| x.z).filter(|z| z.is_finite());
        let middle = self.middle;
        let highest = heights.reduce(f32::max).map_or(middle.z, f64::from);
        let top = Vec3 { z: highest, ..middle };
        Surroundings { orbit: self.orbit, middle, top, extent: self.extent }
    }

    /// Takes the instrument of this number from the tray.
    pub fn take_tool(&mut self, number: usize) -> Result<(), String> {
        let around = self.surroundings();
        let Some(instrument) = self.tray.get(number) else {
            return Err(format!("there is no instrument {number}; there are {}", self.tray.len()));
        };
        let act = self.instruments.take(instrument, &around);
        self.act_tool(act)
    }

    /// Whether a pointer at a place [pixels] leads an instrument: a finger leads the active one wherever it is (`anywhere`), a
    /// mouse what it presses on. A tool of the scene is taken in hand by that.
    pub fn press_tool(&mut self, place: [f64; 2], anywhere: bool) -> Result<bool, String> {
        let lenses = self.lenses();
        let found = lenses.iter().position(|lens| lens.area.contains(place));
        let Some((run, loaded)) = found.zip(self.loaded.as_ref()) else { return Ok(false) };
        let Some(state) = self.runs.get(run) else { return Ok(false) };
        let (eye, direction) = (lenses[run].orbit.position(), lenses[run].ray(place));
        let tissue = pick(&loaded.assembly, &state.snapshot, eye, direction);
        let tissue = tissue.map(|hit| (hit.point - eye).length());
        let hit = pick_tool(&state.snapshot.tools, eye, direction);
        let hit = hit.filter(|(_, way)| tissue.is_none_or(|tissue| *way <= tissue));
        let tool = hit.and_then(|(at, _)| state.snapshot.tools.get(at)).cloned();
        let Some(tool) = tool else {
            return Ok(anywhere && self.instruments.active().is_some());
        };
        match tool.hand {
            Some(hand) => {
                self.instruments.activate(hand);
            }
            None => {
                let act = self.instruments.hold(&tool, loaded.assembly.tools.get(tool.number));
                self.act_tool(act)?;
            }
        }
        Ok(true)
    }

    /// Drags the active instrument from one place to another [pixels].
    pub fn drag_tool(&mut self, way: [[f64; 2]; 2], drag: Drag) -> Result<(), String> {
        let lenses = self.lenses();
        let lens = lenses.iter().find(|lens| lens.area.contains(way[0])).or(lenses.first());
        let Some((held, lens)) = self.instruments.active().zip(lens) else { return Ok(()) };
        let nudge = held.dragged(drag, lens, way, self.extent);
        let (id, around) = (held.id, self.surroundings());
        for act in self.instruments.nudge(id, &nudge, &around)? {
            self.act_tool(act)?;
        }
        Ok(())
    }

    /// Opens the jaws of the active instrument by so much [rad]; closes them below zero.
    pub fn open_jaws(&mut self, by: f64) -> Result<(), String> {
        let Some(held) = self.instruments.active() else { return Ok(()) };
        let Some([angle, ..]) = held.jaws else { return Ok(()) };
        let act = self.instruments.open(held.id, angle + by);
        act.map_or(Ok(()), |act| self.act_tool(act))
    }

    /// Locks the jaws of the active instrument, or unlocks them.
    pub fn lock_jaws(&mut self) -> Result<(), String> {
        let active = self.instruments.active().map(|held| held.id);
        let act = active.and_then(|hand| self.instruments.lock(hand));
        act.map_or(Ok(()), |act| self.act_tool(act))
    }

    /// Makes the instrument of a hand active, or the next one.
    pub fn activate_tool(&mut self, hand: Option<HandId>) {
        match hand {
            Some(hand) => {
                self.instruments.activate(hand);
            }
            None => self.instruments.next(),
        }
    }

    /// Puts the active instrument away.
    pub fn put_away(&mut self) -> Result<(), String> {
        let active = self.instruments.active().map(|held| held.id);
        let act = active.and_then(|hand| self.instruments.put_away(hand));
        act.map_or(Ok(()), |act| self.act_tool(act))
    }

    fn act_tool(&mut self, act: ToolAct) -> Result<(), String> {
        self.act(&Act::Tool(act))?;
        self.look()
    }

    /// What a simulation would not take is in no hand, and in no other simulation.
    pub(crate) fn drop_refused(&mut self) {
        let refused: Vec<_> =
            self.runs.iter_mut().flat_map(|state| std::mem::take(&mut state.refused)).collect();
        for (hand, message) in refused {
            if self.instruments.forget(hand) {
                for state in &mut self.runs {
                    state.waiting.push(Act::Tool(ToolAct::PutAway { hand }));
                    // Where it was not taken there is nothing to put away.
                    let _ = state.act_out();
                }
            }
            self.told = Some(message);
        }
    }
}
