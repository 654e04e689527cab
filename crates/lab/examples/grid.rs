//! scratch
use viscera::material::MaterialModel;
use viscera::settings::*;
use viscera_lab::scenes::*;
use viscera_lab::settling::*;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let names =
        args[0].split(',').map(|n| *NAMES.iter().find(|m| **m == n).unwrap()).collect::<Vec<_>>();
    let size = match args[1].as_str() {
        "t" => Size::Tiny,
        "s" => Size::Small,
        _ => Size::Large,
    };
    let list = |s: &str| s.split(',').map(|x| x.parse::<f64>().unwrap()).collect::<Vec<_>>();
    for name in names {
        for &e in &list(&args[2]) {
            for &nu in &list(&args[3]) {
                let scene = Scene::new(
                    name,
                    size,
                    tissue(
                        if args.len() > 6 {
                            MaterialModel::SaintVenantKirchhoff
                        } else {
                            MaterialModel::StableNeoHookean
                        },
                        e,
                        nu,
                    )
                    .unwrap(),
                )
                .unwrap();
                let t0 = std::time::Instant::now();
                let truth = match truth(&scene) {
                    Ok(t) => t,
                    Err(e) => {
                        println!("{scene}: {e:#}");
                        continue;
                    }
                };
                println!(
                    "{scene}: truth {:.2}s min {} inverted {} grad {:.1e}",
                    t0.elapsed().as_secs_f64(),
                    truth.minimum,
                    truth.inverted,
                    truth.standing.gradient
                );
                for &k in &list(&args[4]) {
                    for c in args[5].split(',') {
                        let colors = match c {
                            "g" => Colors::Unlimited,
                            n => Colors::Limited(n.parse().unwrap()),
                        };
                        let (sub, it) = (1.max(k.fract().mul_add(100.0, 0.5) as u32), k as u32);
                        let s = SolverSettings {
                            substeps: sub,
                            iterations: it,
                            colors,
                            ..Default::default()
                        };
                        let t0 = std::time::Instant::now();
                        let settled = settle::<f64>(&scene, &s).unwrap();
                        let t = t0.elapsed().as_secs_f64();
                        let e = compare(&scene, &truth, &settled.positions).unwrap();
                        println!(
                            "   {sub}x{it} {c}: rms {:.1e} s {:.4} vol {:.1e} grad {:.1e} en {:.1e} inv {} rej {:.2} mov {:.2} speed {:.1e} ({t:.1}s){}",
                            e.rms,
                            e.stiffness,
                            e.volume,
                            e.gradient,
                            e.energy,
                            e.inverted,
                            settled.rejected,
                            settled.rejected_moving,
                            settled.speed,
                            if e.is_other_minimum() { " OTHER" } else { "" }
                        );
                    }
                }
            }
        }
    }
}
