//! What hands do: take hold, lead, let go.

use viscera::scalar::Vec3;
use viscera_stage::{GripTarget, HoldId, Pick, pick, pick_near};

use crate::holds::Hand;
use crate::session::{Act, Grip, Session};

impl Session {
    /// How hands take hold from now on.
    pub fn set_grip(&mut self, grip: Grip) {
        self.grip = grip;
    }

    /// Takes hold of what is seen at a place [pixels]; false where nothing is.
    pub fn grab(&mut self, id: HoldId, place: [f64; 2]) -> Result<bool, String> {
        let lenses = self.lenses();
        let found = lenses.iter().position(|lens| lens.area.contains(place));
        let Some((run, loaded)) = found.zip(self.loaded.as_ref()) else { return Ok(false) };
        let Some(state) = self.runs.get(run) else { return Ok(false) };
        let (from, direction) = (lenses[run].orbit.position(), lenses[run].ray(place));
        match pick(&loaded.assembly, &state.snapshot, from, direction) {
            Some(hit) => self.take(id, run, &hit).map(|()| true),
            None => Ok(false),
        }
    }

    /// Takes hold of the first simulation's tissue nearest to a point [m]; false where it is a centimetre and more away.
    pub fn grab_at(&mut self, id: HoldId, point: Vec3<f64>) -> Result<bool, String> {
        const NEAR: f64 = 0.01;
        let Some((loaded, state)) = self.loaded.as_ref().zip(self.runs.first()) else {
            return Ok(false);
        };
        let found = pick_near(&loaded.assembly, &state.snapshot, point, NEAR);
        let Some(hit) = found else { return Ok(false) };
        // Led from where it was asked for, not from the tissue's nearest point.
        self.take(id, 0, &Pick { point, ..hit }).map(|()| true)
    }

    fn take(&mut self, id: HoldId, run: usize, hit: &Pick) -> Result<(), String> {
        self.release(id)?;
        let Grip { count, stiffness } = self.grip;
        let target = GripTarget { body: hit.body, rest: hit.rest, count, stiffness };
        self.act(&Act::Take(id, target))?;
        self.hands.push(Hand { id, run, taken: hit.point });
        self.look()
    }

    /// Leads a hand to a place [pixels] in the plane of the picture.
    pub fn lead(&mut self, id: HoldId, place: [f64; 2]) -> Result<(), String> {
        let Some(hand) = self.hands.iter().find(|hand| hand.id == id).copied() else {
            return Ok(());
        };
        let way = self.lenses().get(hand.run).and_then(|lens| hand.way_to(lens, place));
        way.map_or(Ok(()), |way| self.act(&Act::Lead(id, way)))
    }

    /// Leads a hand so far from where it took hold [m].
    pub fn lead_by(&mut self, id: HoldId, way: Vec3<f64>) -> Result<(), String> {
        self.act(&Act::Lead(id, way))
    }

    /// Lets go; nothing happens where there is no such hand.
    pub fn release(&mut self, id: HoldId) -> Result<(), String> {
        let before = self.hands.len();
        self.hands.retain(|hand| hand.id != id);
        if self.hands.len() == before { Ok(()) } else { self.act(&Act::LetGo(id)) }
    }

    /// The force [N] with which a hand pulls at the first simulation.
    pub fn force(&self, id: HoldId) -> Vec3<f64> {
        let held = self.runs.first().into_iter().flat_map(|state| &state.snapshot.held);
        held.filter(|hold| hold.id == id).map(|hold| hold.force).next().unwrap_or_default()
    }

    pub(crate) fn act(&mut self, act: &Act) -> Result<(), String> {
        for state in &mut self.runs {
            state.waiting.push(act.clone());
            state.act_out()?;
        }
        self.drop_refused();
        Ok(())
    }
}
