//! Tools of the reference: whether they are legal, the forces on them, what a step leaves of contact.

use viscera::contact::{Tool, Wrench};
use viscera::scalar::Vec3;
use viscera::solver::Inputs;

use super::contact::{Contacts, Touched};
use super::{Reference, ReferenceError};

impl Reference {
    /// Force and torque on each tool at `x` [m], in the order of the inputs; friction as `touched` says, see
    /// [`Reference::step_touching`].
    pub fn wrenches(
        &self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
        touched: &[Touched],
    ) -> Result<Vec<Wrench>, ReferenceError> {
        let pinned = self.check(x, inputs)?;
        self.check_touched(inputs, touched)?;
        let mut wrenches = vec![Wrench::default(); inputs.tools.len()];
        for felt in Contacts::new(&self.problem.samples, &inputs.tools, touched).felt(x) {
            let (wrench, tool) =
                (&mut wrenches[felt.tool as usize], &inputs.tools[felt.tool as usize]);
            wrench.force += felt.gradient;
            wrench.torque += (felt.place - tool.pose.translation).cross(felt.gradient);
            if felt.pressed > 0.0 {
                let sample = &self.problem.samples[felt.sample as usize];
                let mut hung = sample.vertices.iter().zip(&sample.weights);
                wrench.touches += 1;
                wrench.pinned += u32::from(hung.all(|(&v, &b)| b == 0.0 || pinned[v as usize]));
                wrench.depth = wrench.depth.max(tool.law.thickness - felt.clearance.value);
            }
        }
        Ok(wrenches)
    }

    /// What the next step takes from one that has ended at `x` [m] and held `touched` constant: planes, anchors and
    /// limits of friction, by sample.
    pub fn touched_after(
        &self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
        touched: &[Touched],
    ) -> Result<Vec<Touched>, ReferenceError> {
        self.check(x, inputs)?;
        self.check_touched(inputs, touched)?;
        Ok(Contacts::new(&self.problem.samples, &inputs.tools, touched).touched_after(x))
    }

    /// Energy [J] of contact and friction at `x` [m].
    pub fn contact_energy(
        &self,
        x: &[Vec3<f64>],
        inputs: &Inputs<f64>,
        touched: &[Touched],
    ) -> Result<f64, ReferenceError> {
        self.check(x, inputs)?;
        self.check_touched(inputs, touched)?;
        let contacts = Contacts::new(&self.problem.samples, &inputs.tools, touched);
        Ok(contacts.felt(x).map(|felt| felt.energy).sum())
    }

    pub(super) fn check_tools(&self, tools: &[Tool]) -> Result<(), ReferenceError> {
        for (tool, Tool { shape, pose, law, .. }) in tools.iter().enumerate() {
            if !pose.is_finite() {
                return Err(ReferenceError::NotFinite { what: "poses of tools" });
            }
            let moved = (!pose.is_rigid()).then_some("its pose is no rotation and translation");
            if let Some(why) = shape.complaint().or_else(|| law.complaint()).or(moved) {
                return Err(ReferenceError::BadTool { tool, why });
            }
        }
        if !tools.is_empty() && self.problem.samples.is_empty() {
            return Err(ReferenceError::NoSamples);
        }
        Ok(())
    }

    pub(super) fn check_touched(
        &self,
        inputs: &Inputs<f64>,
        touched: &[Touched],
    ) -> Result<(), ReferenceError> {
        let (samples, tools) = (self.problem.samples.len(), inputs.tools.len());
        for &Touched { sample, tool, normal, offset, anchor, limit } in touched {
            if sample as usize >= samples || tool as usize >= tools {
                return Err(ReferenceError::UnknownTouch { sample, tool, samples, tools });
            }
            let is_plane = normal.is_finite() && offset.is_finite() && anchor.is_finite();
            if !is_plane || limit.is_nan() || limit < 0.0 {
                return Err(ReferenceError::NotFinite { what: "planes of touched samples" });
            }
        }
        Ok(())
    }
}
