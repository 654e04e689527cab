//! What a run advises can be done.

use viscera::simulation::MeshReport;

#[test]
fn edges_that_no_mesh_can_have_are_not_advised() {
    let report = |edge_for_five_percent: f64| MeshReport {
        displacement: 0.3,
        stiffness: 0.3,
        force: 0.3,
        edge: 9e-3,
        edge_for_five_percent,
        complete: true,
    };
    let advice = |edge: f64| report(edge).advice().unwrap_or_default();
    assert_eq!(advice(3e-3), "for 5 % take edges of about 3.00 mm, now 9.00 mm");
    let far = advice(0.14e-3);
    assert!(far.contains("those of 4.50 mm") && !far.contains("0.14"), "{far}");
}
