//! What a run does with files that lie where its own go.

use crate::common::{Bench, TINY};

#[test]
fn what_no_run_wrote_stays_among_the_frames() {
    let bench = Bench::new(TINY);
    let frames = ["--frames", "3", "--set", "output.picture=false"];
    bench.summary_of(&frames);
    // A run that was killed leaves a frame that no list names, and one that it has just begun.
    let frame = bench.read("out/frames/tets_000003.vtu");
    bench.write("out/frames/tets_000009.vtu", &frame);
    bench.write("out/frames/tets_000010.vtu.part", b"");
    for name in ["tets_mine.vtu", "tets_1.vtu", "surface_of_liver.vtu"] {
        bench.write(&format!("out/frames/{name}"), b"mine");
    }
    bench.summary_of(&frames);
    let files = bench.files("out/frames");
    let ours = (0..=3).map(|k| format!("tets_{k:06}.vtu"));
    let mut expected: Vec<String> = ours.collect();
    expected.extend(["tets_mine.vtu", "tets_1.vtu", "surface_of_liver.vtu"].map(String::from));
    expected.sort();
    assert_eq!(files.into_iter().collect::<Vec<_>>(), expected);
    // One that a frame would be written over is refused before anything is removed.
    bench.write("out/frames/tets_000002.vtu", b"<VTKFile>mine");
    let message = bench.run(&frames).error().to_owned();
    assert!(message.contains("out/frames/tets_000002.vtu: no run of viscera wrote"), "{message}");
    assert_eq!(bench.read("out/frames/tets_000002.vtu"), b"<VTKFile>mine");
    assert!(bench.files("out").contains("summary.json"));
}
