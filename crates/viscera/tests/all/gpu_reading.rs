//! Frames whose positions stay on the device: the same simulation to the bit, some hundred bytes a frame, and pictures of it.

use crate::common::device::{device, own_device};
use crate::gpu_tools::{SCENE, setting};
use viscera::contact::VertexPressures;
use viscera::scalar::{Vec3, vec3};
use viscera::scene::{Patch, Scene, Selector, read_tray};
use viscera::settings::Place;
use viscera::simulation::{Assembly, Simulation};
use viscera::solver::FrameReading;
use viscera::solver::gpu::{GpuError, GpuSurface, Skin};

/// The block of the other tests, coarser, and the ball at its surface: in frames of one substep.
fn parsed(settings: &[(&str, &str)]) -> (Scene, Assembly) {
    let text = SCENE.replace("23 mm", "21.2 mm").replace("[5, 5, 3]", "[3, 3, 2]");
    let all = [&[("time.frame", "5 ms"), ("solver.substeps", "1")], settings].concat();
    let scene = Scene::parse("block.toml", &text, &all).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
    (scene, assembly.unwrap_or_else(|e| panic!("{e}")))
}

fn on_device() -> Simulation<f32> {
    let (scene, assembly) = parsed(&[]);
    Simulation::on_device(scene, assembly, device()).unwrap_or_else(|e| panic!("{e}"))
}

fn advance(run: &mut Simulation<f32>, reading: FrameReading, frames: u32) {
    (0..frames).for_each(|_| run.advance_reading(reading).unwrap_or_else(|e| panic!("{e}")));
}

/// Two of one scene: all of the first one's frames are read, of the second one's only forces.
fn both() -> [Simulation<f32>; 2] {
    [on_device(), on_device()]
}

const READINGS: [FrameReading; 2] = [FrameReading::State, FrameReading::Forces];

fn assert_same_state([read, unread]: [&Simulation<f32>; 2]) {
    assert!(read.state().positions == unread.state().positions, "positions");
    assert!(read.state().velocities == unread.state().velocities, "velocities");
}

#[test]
fn frames_that_are_not_read_are_those_that_are() {
    let [mut read, mut unread] = both();
    let rest = unread.state().clone();
    for frame in 1..=12 {
        for (run, reading) in [&mut read, &mut unread].into_iter().zip(READINGS) {
            advance(run, reading, 1);
        }
        assert_eq!([read.unread_frames(), unread.unread_frames()], [0, frame]);
        assert!(unread.tool_forces() == read.tool_forces(), "frame {frame}");
    }
    assert!(unread.tool_forces()[0].force[2] > 0.02, "{}", unread.tool_forces()[0]);
    assert!(unread.state() == &rest, "nobody has asked for it");
    // Those who cannot change it have the last frame as well.
    let settings = setting("solver.threads", "1");
    let [fork, unread_fork] = [&read, &unread].map(|run| run.fork::<f64>(&settings));
    let [fork, unread_fork] = [fork, unread_fork].map(|fork| fork.expect("a fork"));
    assert!(fork.state() == unread_fork.state() && fork.frame() == 12);
    let resumed = on_device().resume(&unread.save()).expect("a saved simulation");
    assert_same_state([&read, &resumed]);
    let moment = unread.checkpoint();
    unread.read_state().expect("a device");
    assert_eq!(unread.unread_frames(), 0);
    assert_same_state([&read, &unread]);
    // A moment is gone back to with what it is made of, not with what was read.
    let kept = unread.state().clone();
    advance(&mut unread, FrameReading::Forces, 3);
    unread.restore(&moment).expect("a moment of this simulation");
    assert_eq!(unread.unread_frames(), 0);
    assert!(unread.state().positions == kept.positions);
}

#[test]
fn what_is_measured_is_of_the_last_frame() {
    let [mut read, mut unread] = both();
    for (run, reading) in [&mut read, &mut unread].into_iter().zip(READINGS) {
        advance(run, reading, 9);
        run.measure().expect("measures");
    }
    assert_same_state([&read, &unread]);
    assert_eq!(read.report(), unread.report());
}

/// What a tool touches is read with the balance, and else when it is asked for: the pressures of both add up to its force.
#[test]
fn what_tools_touch_is_known() {
    let mut runs = both();
    runs.iter_mut().for_each(|run| advance(run, FrameReading::Forces, 8));
    let [balanced, unread] = &mut runs;
    balanced.send_frame(FrameReading::Balance).expect("a frame");
    while !balanced.take_frame().expect("a device") {}
    advance(unread, FrameReading::Forces, 1);
    assert!(unread.touches().is_empty(), "where tissue is now is not known");
    unread.read_state().expect("a device");
    assert!(unread.state().contact.touches.is_empty());
    let touches = unread.touches().into_owned();
    assert_eq!(touches, balanced.state().contact.touches);
    let count = unread.model().vertex_count();
    let pressures = VertexPressures::of(&unread.model().samples, &touches, count);
    let [x, y, z] = unread.tool_forces()[0].force;
    let force = vec3(x, y, z).length();
    // Normals of a ball differ from sample to sample: their forces add up to no less than the one on the tool.
    assert!(
        pressures.force() >= force * (1.0 - 1e-5) && pressures.force() < 1.5 * force,
        "{force}"
    );
}

/// How fast a run moves is what it has moved since the frame that was read before, however many frames that is.
#[test]
fn speeds_are_those_between_frames_that_were_read() {
    let text = SCENE.split("[[tool]]").next().expect("a block").replace("[5, 5, 3]", "[3, 3, 2]");
    let settings = [("world.gravity", "9.81 m/s^2"), ("time.frame", "5 ms")];
    let scene = Scene::parse("block.toml", &text, &settings).unwrap_or_else(|e| panic!("{e}"));
    let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned())).expect("a block");
    let mut run = Simulation::<f32>::on_device(scene, assembly, device()).expect("a simulation");
    advance(&mut run, FrameReading::State, 2);
    let before = run.state().positions.clone();
    advance(&mut run, FrameReading::Forces, 3);
    assert!(run.rest().is_none(), "where it is now is not known");
    run.measure().expect("measures");
    let ways = run.state().positions.iter().zip(&before);
    let farthest = ways.map(|(a, b)| (a.cast::<f64>() - b.cast()).length()).fold(0.0, f64::max);
    let rest = run.rest().expect("nothing touches it");
    assert!((rest.speed / (farthest / 0.015) - 1.0).abs() < 1e-9 && farthest > 1e-5, "{rest:?}");
}

/// A device at hand is taken where settings mean it, not where they name another.
#[test]
fn a_name_is_that_of_the_device_at_hand_or_of_another() {
    let with = |name: &str| {
        let (scene, assembly) = parsed(&[("solver.device", name)]);
        Simulation::<f32>::with_device(scene, assembly, device().clone())
    };
    let name = device().name().to_uppercase();
    for meant in ["gpu", name.split(' ').next().expect("a word")] {
        let run = with(meant).unwrap_or_else(|e| panic!("{meant}: {e}"));
        assert!(run.gpu().is_some_and(|gpu| gpu.device().is_same(device())), "{meant}");
    }
    let error = with("abacus").expect_err("no such adapter").to_string();
    assert!(error.contains("no adapter is called `abacus`"), "{error}");
}

/// Holds, tools and settings find the tissue where it is, not where it was read last.
#[test]
fn hands_find_tissue_where_it_is() {
    let [mut read, mut unread] = both();
    // As thick as the ball or thicker: the surface's samples stay.
    let tray = "[[tool]]\nname = \"probe\"\nkind = \"sphere\"\nradius = \"7 mm\"\n";
    let mut probe = read_tray("tray.toml", tray).unwrap_or_else(|e| panic!("{e}")).remove(0);
    probe.placement.translation = vec3(0.006, 0.006, 0.024);
    let patch = Patch {
        body: 0,
        selector: Selector::Nearest { point: vec3(0.03, 0.03, 0.015), count: 4 },
        purpose: "hand".to_owned(),
        place: Place::Override { key: "hand".into() },
    };
    let mut before = Vec::new();
    for (run, reading) in [&mut read, &mut unread].into_iter().zip(READINGS) {
        // The ball has come down: what is held now is not at rest.
        advance(run, reading, 8);
        let hold = run.take_hold("hand", patch.clone(), None).expect("a hold");
        run.lead(hold, vec3(0.0, 0.0, 2e-3)).expect("a hold");
        advance(run, reading, 2);
        run.take_tool(probe.clone()).expect("a probe");
        advance(run, reading, 2);
        run.let_go(hold).expect("it is held");
        advance(run, reading, 1);
        run.put_away(1).expect("the probe");
        advance(run, reading, 1);
        run.change(&setting("world.gravity", "9.81 m/s^2")).expect("a setting");
        advance(run, reading, 2);
        before.push(run.unread_frames());
        run.read_state().expect("a device");
    }
    assert_eq!(before, [0, 2]);
    assert_same_state([&read, &unread]);
    assert_eq!(read.live(), unread.live());
}

/// A change builds the solver anew and restarts it, which takes over nothing of what acts on vertices: the next step does.
#[test]
fn loads_and_holds_act_after_a_change() {
    let block = SCENE.split("[[tool]]").next().expect("a block").replace("[5, 5, 3]", "[3, 3, 2]");
    let text = block
        + r#"
        stiffness = "2 N/mm"

        [[force]]
        name = "pull"
        body = "block"
        half_space = { point = [0, 0, "15 mm"], normal = [0, 0, 1] }
        force = ["0.2 N", 0, "0.5 N"]
    "#;
    for method in ["quasi_newton", "explicit", "xpbd"] {
        let settings = [("time.frame", "5 ms"), ("solver.method", method)];
        // Threads change nothing on a device but that it begins anew.
        let runs = [true, false].map(|changes| {
            let scene = Scene::parse("block.toml", &text, &settings);
            let scene = scene.unwrap_or_else(|e| panic!("{e}"));
            let assembly = Assembly::new(&scene, &mut |file| Err(file.to_owned()));
            let run = Simulation::<f32>::on_device(scene, assembly.expect("a block"), device());
            let mut run = run.expect("a simulation");
            advance(&mut run, FrameReading::State, 1);
            if changes {
                run.change(&setting("solver.threads", "1")).expect("a setting");
            }
            advance(&mut run, FrameReading::State, 4);
            run
        });
        let [there, here] = runs.each_ref().map(|run| &run.state().positions);
        let largest = |a: &[Vec3<f32>], b: &[Vec3<f32>]| {
            let far = a.iter().zip(b).map(|(a, b)| (*a - *b).length());
            far.fold(0.0, f32::max)
        };
        let (apart, moved) = (largest(there, here), largest(here, &runs[0].model().rest_positions));
        println!("{method}: {apart} m of {moved} m");
        // Within the accuracy of the method: what solves have learned is forgotten.
        assert!(moved > 1e-3 && apart < 0.01 * moved, "{method}: {apart} m of {moved} m");
    }
}

/// Without waiting as well: what was asked for is what there is.
#[test]
fn frames_that_nobody_waits_for_may_stay_as_well() {
    let [mut read, mut unread] = both();
    for (run, reading) in [&mut read, &mut unread].into_iter().zip(READINGS) {
        for _ in 0..6 {
            run.send_frame(reading).expect("a frame");
            while !run.take_frame().expect("a device") {
                std::thread::yield_now();
            }
        }
    }
    assert_eq!([read.unread_frames(), unread.unread_frames()], [0, 6]);
    unread.read_state().expect("a device");
    assert_same_state([&read, &unread]);
}

/// Velocities that are slowed down between frames are read, whatever was asked for; the processor has all of a frame.
#[test]
fn some_frames_are_always_read() {
    let (scene, assembly) = parsed(&[("time.velocity_factor", "0.9")]);
    let slowed = Simulation::on_device(scene, assembly, device()).expect("a device");
    let (scene, assembly) = parsed(&[("solver.device", "cpu")]);
    let here = Simulation::new(scene, assembly).expect("a simulation");
    for mut run in [slowed, here] {
        advance(&mut run, FrameReading::Forces, 2);
        assert_eq!(run.unread_frames(), 0);
    }
}

/// What the host sends and reads in a frame with a tool at work: inputs that the device has are not sent again. A kilobyte, and
/// 160 bytes for each part of a tool, are enough for four substeps.
#[test]
fn a_frame_is_some_hundred_bytes() {
    let (scene, assembly) = parsed(&[("solver.substeps", "4")]);
    let mut run = Simulation::on_device(scene, assembly, device()).expect("a simulation");
    advance(&mut run, FrameReading::Forces, 4);
    let solver = |run: &Simulation<f32>| {
        let gpu = run.gpu().expect("a device");
        (gpu.bytes_sent(), gpu.bytes_of_frame(FrameReading::Forces))
    };
    let tools = run.tool_parts().len() as u64;
    for _ in 0..8 {
        let before = solver(&run).0;
        advance(&mut run, FrameReading::Forces, 1);
        let (sent, read) = solver(&run);
        let sent = sent - before;
        println!(
            "{sent} bytes sent, {read} read; {tools} parts of tools, {} substeps",
            run.substeps()
        );
        assert!(sent > 0 && read > 64 && sent + read <= 1024 + 160 * tools, "{sent} and {read}");
    }
    let vertices = run.model().vertex_count() as u64;
    let whole = run.gpu().map(|gpu| gpu.bytes_of_frame(FrameReading::State));
    assert!(whole > Some(32 * vertices), "{whole:?}");
}

/// The processor goes on from the frame that was read last.
#[test]
fn a_lost_device_leaves_what_was_read() {
    let device = own_device();
    let (scene, assembly) = parsed(&[]);
    let mut run = Simulation::on_device(scene, assembly, &device).expect("a simulation");
    advance(&mut run, FrameReading::State, 4);
    let kept = run.state().positions.clone();
    advance(&mut run, FrameReading::Forces, 2);
    device.wgpu().0.destroy();
    // Measures are of the frame before; the next frame is the processor's.
    run.measure().expect("it gives way");
    assert!(run.state().positions == kept);
    advance(&mut run, FrameReading::Forces, 1);
    assert!(!run.is_on_device() && run.frame() == 7 && run.unread_frames() == 0);
    assert!(run.device_warning().is_some());
    let far = |a: &Vec3<f32>, b: &Vec3<f32>| (*a - *b).length();
    let moved = run.state().positions.iter().zip(&kept).map(|(a, b)| far(a, b));
    let moved = moved.fold(0.0, f32::max);
    assert!(moved > 1e-5 && moved < 5e-3, "{moved} m");
}

fn skins(assembly: &Assembly) -> Vec<Skin<'_>> {
    let bodies = assembly.bodies.iter();
    bodies
        .map(|body| Skin {
            embedding: &body.embedding,
            triangles: &body.surface.triangles,
            first_vertex: body.vertices.start,
        })
        .collect()
}

/// A picture of one moment, while the solver goes on: where the host would have put it.
#[test]
fn surfaces_follow_copies_that_stay_on_the_device() {
    let mut run = on_device();
    advance(&mut run, FrameReading::Forces, 9);
    let copy = run.gpu().expect("a device").copy_positions(None, None);
    advance(&mut run, FrameReading::Forces, 3);
    let later = run.gpu().expect("a device").copy_positions(None, None);
    let mut same = on_device();
    let surface = GpuSurface::following_copies(&copy, &skins(run.assembly())).expect("it fits");
    let count = run.model().vertex_count();
    let by_host = GpuSurface::following(device(), count, &skins(run.assembly())).expect("it fits");
    let mut all = Vec::new();
    for (positions, frames) in [(&copy, 9), (&later, 3), (&copy, 0)] {
        advance(&mut same, FrameReading::State, frames);
        surface.place_copy(positions).expect("its own");
        surface.update();
        let found = surface.read().expect("a device");
        if frames > 0 {
            by_host.place(&same.state().positions).expect("as many as there are");
            by_host.update();
            assert!(found == by_host.read().expect("a device"), "after {} frames", same.frame());
        }
        all.push(found);
    }
    assert!(all[0] == all[2] && all[0] != all[1]);
    // Memory of a copy that is no longer needed is taken for the next one; of another solver it is not.
    let again = run.gpu().expect("a device").copy_positions(Some(copy), None);
    surface.place_copy(&again).expect("of the same solver");
    surface.update();
    assert!(surface.read().expect("a device") == all[1]);
    let other = same.gpu().expect("a device").copy_positions(Some(again), None);
    assert!(!surface.follows(&other) && surface.follows(&later));
    assert_eq!(surface.place_copy(&other), Err(GpuError::FollowsSolver));
    assert_eq!(by_host.place_copy(&later), Err(GpuError::FollowsSolver));
    assert_eq!(surface.place(&same.state().positions), Err(GpuError::FollowsSolver));
}
