//! Many worlds: each has the bits that it has alone.

use crate::hands::{BLOCK, TOOLS, at, frames, simulation};
use viscera::scalar::rigid::RigidTransform;
use viscera::scalar::vec3;
use viscera::scene::Scene;
use viscera::simulation::{Assembly, LiveError, Simulation};
use viscera::worlds::{Status, Worlds, WorldsError};

const SETTINGS: [(&str, &str); 1] = [("output.force_error", "false")];

fn worlds(text: &str, count: usize, threads: usize) -> Worlds<f32> {
    let scene = Scene::parse("worlds.toml", text, &SETTINGS).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    let assembly = assembly.unwrap_or_else(|e| panic!("{e}"));
    Worlds::new(scene, assembly, count, threads).unwrap_or_else(|e| panic!("{e}"))
}

/// Tissue of its own, and a probe that is led its own way, in a world of this seed.
fn begin(seed: usize, run: &mut Simulation<f32>) -> Result<(), LiveError> {
    let young = ("body.block.material.young".to_owned(), format!("{} kPa", 6 + seed % 5));
    run.change(&[young])?;
    run.take_tool(at("probe", vec3(0.008 + 1e-3 * (seed % 7) as f64, 0.02, 0.024)))?;
    Ok(())
}

/// Leads the probe on, in each frame.
fn lead(seed: usize, run: &mut Simulation<f32>) -> Result<(), LiveError> {
    let probe = run.tools().len() - 1;
    let RigidTransform { rotation, translation } = run.tools()[probe].pose;
    let way = vec3(1e-4 * (seed % 3) as f64, 0.0, -4e-4);
    run.move_tool(probe, RigidTransform { rotation, translation: translation + way })
}

const FRAMES: usize = 5;

fn alone(text: &str, seed: usize) -> Vec<u8> {
    let mut run: Simulation<f32> = simulation(text, &SETTINGS);
    begin(seed, &mut run).expect("a beginning");
    for _ in 0..FRAMES {
        lead(seed, &mut run).expect("a pose");
        frames(&mut run, 1);
    }
    run.save()
}

/// The bits of worlds of these seeds.
fn together(text: &str, seeds: &[usize], threads: usize) -> Vec<Vec<u8>> {
    let mut worlds = worlds(text, seeds.len(), threads);
    worlds.for_each(None, |number, run| begin(seeds[number], run)).expect("a beginning");
    for _ in 0..FRAMES {
        worlds.for_each(None, |number, run| lead(seeds[number], run)).expect("poses");
        worlds.step(1);
    }
    (0..seeds.len()).map(|number| worlds.world(number).expect("a world").save()).collect()
}

/// Seeds that begin alike are this far apart: those of tissue, place and way.
const KINDS: usize = 5 * 7 * 3;

/// Compares all worlds of batches (worlds, threads) with those alone, of `kinds` of seeds.
fn compare(batches: &[(usize, usize)], kinds: usize) {
    let text = format!("{BLOCK}{TOOLS}");
    let expected: Vec<Vec<u8>> = (0..kinds).map(|seed| alone(&text, seed)).collect();
    assert!(expected[0] != expected[1], "worlds are of their own");
    for &(count, threads) in batches {
        // Some order, in which no world is where its seed is.
        let seeds: Vec<usize> = (0..count).map(|i| (4 * i + 3) % kinds % count.max(1)).collect();
        for (bits, seed) in together(&text, &seeds, threads).iter().zip(&seeds) {
            assert!(*bits == expected[*seed], "{count} worlds on {threads} threads, seed {seed}");
        }
    }
}

#[test]
fn a_world_has_the_bits_that_it_has_alone() {
    compare(&[(1, 1), (7, 2), (8, 8), (9, 1), (9, 3)], 9);
}

#[test]
#[ignore = "slow: a thousand worlds"]
fn a_world_has_the_bits_that_it_has_alone_at_length() {
    compare(&[(1000, 2), (1000, 8)], KINDS);
}

#[test]
fn worlds_go_back_to_their_beginning_and_repeat_it() {
    let text = format!("{BLOCK}{TOOLS}");
    let mut worlds = worlds(&text, 4, 2);
    let first: Vec<_> = (0..4).map(|n| worlds.world(n).expect("a world").save()).collect();
    worlds.step(3);
    let third: Vec<_> = (0..4).map(|n| worlds.world(n).expect("a world").save()).collect();
    // Two of them, of which one was taken hold of and has other tissue.
    worlds.for_each(Some(&[false, false, true, false]), begin).expect("a beginning");
    worlds.step(2);
    worlds.reset(Some(&[false, true, true])).expect("a beginning");
    let frame =
        |worlds: &Worlds<f32>| [0, 1, 2, 3].map(|n| worlds.world(n).map_or(0, |w| w.frame()));
    assert_eq!(frame(&worlds), [5, 0, 0, 5]);
    let world = |worlds: &Worlds<f32>, number: usize| worlds.world(number).expect("a world").save();
    assert!(world(&worlds, 1) == first[1]);
    assert_eq!(worlds.world(2).map(|world| world.tools().len()), Some(2));
    worlds.step(3);
    assert!(world(&worlds, 1) == third[1]);
    // Its tissue stays what it was set to.
    assert!(world(&worlds, 2) != third[2]);
    let softer = [("body.block.material.young".to_owned(), "10 kPa".to_owned())];
    worlds.for_each(Some(&[false, false, true]), |_, run| run.change(&softer)).expect("a change");
    worlds.reset(None).expect("a beginning");
    worlds.step(3);
    for number in 0..4 {
        assert!(world(&worlds, number) == third[number], "world {number}");
    }
}

/// A world whose numbers run away, and one whose iterations end early, leave their neighbours as they are alone.
#[test]
fn a_world_in_trouble_leaves_the_others_as_they_are() {
    let text = BLOCK.replace("gravity = 0", "gravity = 9.81").replace("= 9.81", "= \"9.81 m/s^2\"");
    let mut good = worlds(&text, 1, 1);
    good.step(4);
    let expected = good.world(0).expect("a world").save();
    let mut worlds = worlds(&text, 8, 2);
    let pairs = |all: &[&str]| -> Vec<(String, String)> {
        let pairs = all.iter().map(|pair| pair.split_once('=').expect("a pair"));
        pairs.map(|(key, value)| (key.to_owned(), value.to_owned())).collect()
    };
    let wild = pairs(&["world.gravity=1e38 m/s^2", "solver.method=xpbd"]);
    let few = pairs(&["solver.method=xpbd", "solver.substeps=1", "solver.iterations=1"]);
    worlds
        .for_each(None, |number, run| match number {
            3 => run.change(&wild),
            5 => run.change(&few),
            _ => Ok(()),
        })
        .expect("changes");
    worlds.step(4);
    for number in [0, 1, 2, 4, 6, 7] {
        assert_eq!(worlds.status(number), Status::Fine, "world {number}");
        assert!(worlds.world(number).expect("a world").save() == expected, "world {number}");
    }
    assert_eq!(worlds.status(5), Status::Unsolved);
    assert_eq!(worlds.status(3), Status::Failed);
    assert!(worlds.failure(3).expect("a reason").to_string().contains("diverged"));
    assert_eq!((worlds.status(8), worlds.failure(8)), (Status::Failed, None));
    let frame = worlds.world(3).expect("a world").frame();
    worlds.step(2);
    assert_eq!(worlds.world(3).expect("a world").frame(), frame, "it is not stepped any more");
    let usual = pairs(&["world.gravity=9.81 m/s^2", "solver.method=auto"]);
    worlds
        .for_each(Some(&[false, false, false, true]), |_, run| run.change(&usual))
        .expect("usual");
    worlds.reset(None).expect("a beginning");
    worlds.step(4);
    assert!(worlds.world(3).expect("a world").save() == expected);
}

#[test]
fn worlds_that_cannot_be() {
    let scene = Scene::parse("worlds.toml", BLOCK, &[]).expect("a scene");
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("meshes");
    let refused = |count, threads| {
        Worlds::<f32>::new(scene.clone(), assembly.clone(), count, threads).map(|_| ()).unwrap_err()
    };
    assert_eq!(refused(0, 1), WorldsError::NoWorld);
    for threads in [0, 1025] {
        assert!(refused(2, threads).to_string().contains("from 1 to 1024"));
    }
}
