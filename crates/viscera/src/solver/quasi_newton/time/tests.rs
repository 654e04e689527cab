//! Steps that are taken again.

use std::ops::ControlFlow;

use super::*;
use crate::layout::Layout;
use crate::material::{Material, MaterialModel};
use crate::mesh::shapes::Block;
use crate::model::ModelBuilder;
use crate::scalar::vec3;
use crate::settings::{Count, Method, SolverSettings};
use crate::solver::balance::ForceBalance;
use crate::solver::cpu::Memory;
use crate::solver::cpu::memory::MethodMemory;
use crate::solver::plan::{Flag, Plan, Stage, Visitor};
use crate::solver::quasi_newton::stage::QuasiNewtonStage;
use crate::solver::{Inputs, Pin, Tether};

/// Walks a step in which these parts store too much.
struct TakenAgain<'a, 's> {
    memory: &'a mut Memory<f64>,
    step: &'a Step<'s, f64>,
    state: &'a mut State<f64>,
    again: [bool; 2],
}

impl Visitor for TakenAgain<'_, '_> {
    fn run(&mut self, stage: &Stage) -> ControlFlow<()> {
        self.memory.run(stage, self.step, self.state);
        if *stage == Stage::QuasiNewton(QuasiNewtonStage::CheckEnergy)
            && let MethodMemory::QuasiNewton(memory) = &mut self.memory.method
        {
            for (number, again) in self.again.into_iter().enumerate().filter(|(_, again)| *again) {
                assert!(again && memory.parts[number].scheme == Scheme::Sdirk2);
                memory.parts[number].scheme = Scheme::Euler;
                self.state.learned.parts[number].count = 0;
            }
        }
        ControlFlow::Continue(())
    }

    fn is_set(&self, flag: Flag) -> bool {
        self.memory.is_set(flag)
    }
}

/// The forces of a step that is taken again by implicit Euler balance, viscous ones included: of both parts, of one,
/// of the other.
#[test]
fn the_equations_of_a_step_taken_again_hold() {
    let mesh = Block::new(vec3(0.06, 0.03, 0.03), [3, 2, 2]).mesh().expect("a bar");
    let mut builder = ModelBuilder::new();
    for law in [MaterialModel::StableNeoHookean, MaterialModel::SaintVenantKirchhoff] {
        let tissue = Material::new(law, 1e4, 0.4, 1000.0).expect("legal");
        let viscous = tissue.with_viscosity(0.02).expect("legal");
        builder.add_body(&mesh, &viscous).expect("a body");
    }
    let settings = SolverSettings {
        method: Method::QuasiNewton,
        iterations: Count::Of(200),
        ..SolverSettings::xpbd()
    };
    let layout = Layout::new(&builder.build::<f64>().expect("a model"), &settings);
    let plan = Plan::new(&layout, &settings);
    let mut memory = Memory::new(&layout, &settings);
    let mut state = State {
        positions: layout.rest_positions.clone(),
        velocities: vec![Vec3::ZERO; layout.vertex_count()],
        multipliers: Vec::new(),
        multiplier_dt: 0.0,
        learned: Learned::default(),
        contact: Default::default(),
    };
    let half = mesh.vertices().len() as u32;
    for number in 1..=6 {
        let way = vec3(2e-4, -1e-4, 3e-4) * f64::from(number);
        let place = |vertex: u32| layout.rest_positions[vertex as usize] + way;
        let pin = |vertex: u32| Pin { vertex, target: place(vertex) };
        let tether = |vertex: u32| Tether { vertex, target: place(vertex), stiffness: 30.0 };
        let inputs = Inputs {
            gravity: vec3(0.0, 0.0, -9.81),
            pins: [0, 5, half, half + 7].map(pin).to_vec(),
            tethers: [9, half + 9].map(tether).to_vec(),
            ..Inputs::default()
        };
        let dt = 1.0 / 120.0;
        let step = Step { layout: &layout, inputs: &inputs, dt, settings: &settings };
        let again = [0, 1].map(|part| number % 3 != part);
        let (memory, state) = (&mut memory, &mut state);
        plan.walk(1, &mut TakenAgain { memory, step: &step, state, again });
        for (part, again) in again.into_iter().enumerate() {
            let solve = if again { dt } else { SHARE * dt };
            assert_eq!(state.learned.parts[part].dt, solve, "step {number}, part {part}");
        }
        let mut balance = ForceBalance::default();
        let mut end = memory.data.end_of_step();
        balance.measure(&layout, state, &inputs, &mut end);
        assert!(balance.load > 1.0, "{} N of loads", balance.load);
        let of_loads = balance.unbalanced / balance.load;
        assert!(of_loads < 1e-8, "step {number}: {of_loads:e} of the loads");
    }
}
