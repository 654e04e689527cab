use viscera::scene::Scene;
use viscera::simulation::*;
#[test]
fn debug() {
    let text = std::fs::read_to_string("../../scenes/liver_retraction.toml").unwrap();
    for (s, i, keep, colors, model) in [
        ("200", "1", "false", "unlimited", "stable_neo_hookean"),
        ("20", "1", "false", "unlimited", "stable_neo_hookean"),
        ("10", "2", "true", "unlimited", "stable_neo_hookean"),
        ("5", "4", "true", "unlimited", "stable_neo_hookean"),
        ("4", "2", "true", "unlimited", "stable_neo_hookean"),
        ("20", "1", "true", "unlimited", "stable_neo_hookean"),
        ("10", "2", "true", "4", "stable_neo_hookean"),
        ("10", "2", "true", "1", "stable_neo_hookean"),
        ("20", "5", "true", "unlimited", "stable_neo_hookean"),
        ("10", "2", "true", "unlimited", "saint_venant_kirchhoff"),
    ] {
        let scene = Scene::parse(
            "liver",
            &text,
            &[
                ("solver.substeps", s),
                ("solver.iterations", i),
                ("solver.rebase", keep),
                ("solver.keep_multipliers", keep),
                ("solver.colors", colors),
                ("body.liver.material.model", model),
                (
                    "solver.rebase_factor",
                    if colors == "1" {
                        "0.25"
                    } else if colors == "4" {
                        "0.5"
                    } else {
                        "1"
                    },
                ),
            ],
        )
        .unwrap();
        let a = Assembly::new(&scene, &mut |_| Err("no".into())).unwrap();
        let n = scene.frame_count();
        let mut sim = Simulation::<f32>::new(scene, a).unwrap();
        let t = std::time::Instant::now();
        println!(
            "frames {s}x{i} keep {keep} colors {colors} {model}: colors {} tets {}",
            sim.model().color_count,
            sim.model().tet_count()
        );
        for f in 0..n {
            sim.advance_frame().unwrap();
            if f % 45 == 44 {
                let r = sim.report();
                println!(
                    "  t {:.2} res {:.1e} stiff {:+.4} vol {:.4} stretch {:.3}..{:.3} inv {} kin {:.1e} el {:.4e} F {:?}",
                    r.time,
                    r.relative_residual,
                    r.stiffness_error,
                    r.deformation.volume_ratio,
                    r.deformation.smallest_stretch,
                    r.deformation.largest_stretch,
                    r.deformation.inverted,
                    r.energy.kinetic,
                    r.energy.elastic,
                    r.patches[1].force
                );
            }
        }
        println!("  {:.2} ms per frame", t.elapsed().as_secs_f64() * 1e3 / n as f64);
    }
}
