//! Where the fine surfaces of a real scan's organs lie.

use viscera::mesh::SurfaceMesh;
use viscera::mesh::winding::Solid;
use viscera::scalar::{Mat3, Vec3, vec3};
use viscera_import::{Found, Options, parts};
use viscera_volume::{Affine, LabelMap};

const FILE: &str = "abdomen_labels.nii.gz";

fn scan() -> Option<(LabelMap, viscera_volume::VolumeReport)> {
    let bytes = super::anatomy::data(FILE)?;
    Some(viscera_volume::read(FILE, &bytes, Default::default()).expect("a map"))
}

fn skins(map: &LabelMap, organs: &[&str]) -> Vec<(String, SurfaceMesh)> {
    let (_, report) = scan().expect("data");
    let labels = organs.iter().map(|name| (*name).to_owned()).collect();
    let options = Options { labels, shapes_only: true, ..Options::default() };
    let found = Found::Labels(map.clone(), report);
    let made = parts(FILE, found, &options, &mut |_| ()).unwrap_or_else(|error| panic!("{error}"));
    let skin = |part: viscera_import::Part| (part.name, part.skin.expect("a surface"));
    made.parts.into_iter().map(skin).collect()
}

/// The share that is within a bound, and the largest.
fn spread(mut distances: Vec<f64>, bound: f64) -> (f64, f64) {
    distances.sort_by(f64::total_cmp);
    let within = distances.partition_point(|distance| *distance <= bound);
    let largest = distances.last().copied().unwrap_or(f64::INFINITY);
    (within as f64 / distances.len().max(1) as f64, largest)
}

/// From a point to the nearest face between a voxel of the label and one of another or of none [voxels]. The image ends
/// with such faces, too.
fn to_boundary(map: &LabelMap, label: u16, at: Vec3<f64>) -> f64 {
    const REACH: i64 = 3;
    let at = at.to_array();
    let nearest = at.map(|x| libm::round(x) as i64);
    let has = |voxel: [i64; 3]| {
        let inside = voxel.iter().all(|x| *x >= 0);
        inside && map.label_at(voxel.map(|x| x as usize)) == Some(label)
    };
    let mut least = f64::INFINITY;
    for x in -REACH..=REACH {
        for y in -REACH..=REACH {
            for z in -REACH..=REACH {
                let voxel = [nearest[0] + x, nearest[1] + y, nearest[2] + z];
                for axis in 0..3 {
                    let mut next = voxel;
                    next[axis] += 1;
                    if has(voxel) == has(next) {
                        continue;
                    }
                    let squares = (0..3).map(|other| {
                        let away = at[other] - voxel[other] as f64;
                        match other == axis {
                            true => away - 0.5,
                            false => (away.abs() - 0.5).max(0.0),
                        }
                    });
                    least = least.min(squares.map(|d| d * d).sum::<f64>().sqrt());
                }
            }
        }
    }
    least
}

#[test]
fn fine_surfaces_lie_on_the_boundary_of_their_labels() {
    let Some((map, _)) = scan() else { return };
    let organs = ["liver", "gallbladder", "stomach", "kidney_left", "kidney_right", "spleen"];
    for (name, skin) in skins(&map, &organs) {
        let label = map.names().iter().find(|(_, known)| **known == name).expect("a label");
        let place = |x: &Vec3<f64>| to_boundary(&map, *label.0, map.to_world().to_voxel(*x));
        let (share, largest) = spread(skin.vertices.iter().map(place).collect(), 0.5);
        println!("{name}: {share:.4} within half a voxel, none farther than {largest:.2}");
        assert!(share > 0.95, "{name}: {share}");
        assert!(largest < 1.5, "{name}: {largest}");
    }
}

/// The same labels on other voxels, by the nearest.
fn resampled(map: &LabelMap, dims: [usize; 3], to_world: Affine) -> LabelMap {
    let mut labels = Vec::with_capacity(dims.iter().product());
    for z in 0..dims[2] {
        for y in 0..dims[1] {
            for x in 0..dims[0] {
                let at = to_world.to_world(vec3(x as f64, y as f64, z as f64));
                let voxel = map.to_world().to_voxel(at).to_array().map(|x| libm::round(x) as i64);
                let inside = voxel.iter().all(|x| *x >= 0);
                let label = inside.then(|| map.label_at(voxel.map(|x| x as usize))).flatten();
                labels.push(label.unwrap_or(0));
            }
        }
    }
    LabelMap::new(dims, labels, to_world, map.names().clone()).expect("a map")
}

/// Compares the skins of organs on a map with those on other voxels: within bounds [m], for all but a twentieth.
fn compare(map: &LabelMap, others: &[(&str, [usize; 3], Affine, f64)]) {
    let organs = ["liver", "kidney_left"];
    let skins_before = skins(map, &organs);
    let before = skins_before.iter().map(|(_, skin)| Solid::new(skin).expect("a closed surface"));
    let before: Vec<Solid> = before.collect();
    for &(what, dims, to_world, bound) in others {
        let other = resampled(map, dims, to_world);
        for ((name, skin), solid) in skins(&other, &organs).iter().zip(&before) {
            let distances = skin.vertices.iter().map(|x| solid.nearest(*x)).collect();
            let (share, largest) = spread(distances, bound);
            println!("{what}, {name}: {share:.4} within {bound}, none farther than {largest:.5}");
            assert!(share > 0.95, "{what}, {name}: {share}");
            assert!(largest < 3.0 * bound, "{what}, {name}: {largest}");
        }
    }
}

/// Another order and direction of the axes gives the same shapes, another place of the voxels those that they can resolve.
#[test]
fn organs_are_where_they_are_however_the_image_lies() {
    let Some((map, _)) = scan() else { return };
    let (dims, Affine { matrix, translation }) = (map.dims(), *map.to_world());
    let [a, b, c] = matrix.columns;
    let size = map.to_world().voxel_size()[0];
    let mirrored = Affine {
        matrix: Mat3::from_columns(-a, b, c),
        translation: translation + a * (dims[0] - 1) as f64,
    };
    let permuted = Affine { matrix: Mat3::from_columns(c, a, b), translation };
    // Each slice a tenth of a voxel further along the first axis.
    let sheared = Affine { matrix: Mat3::from_columns(a, b, c + a * 0.1), translation };
    let others = [
        ("mirrored", dims, mirrored, 0.1 * size),
        ("permuted", [dims[2], dims[0], dims[1]], permuted, 0.1 * size),
        ("sheared", dims, sheared, 0.5 * size),
    ];
    compare(&map, &others);
}

/// Compares with voxels of another size [m], whose outermost corner is where that of the map's is.
fn compare_slices(what: &str, map: &LabelMap, thick: [f64; 3]) {
    let (dims, Affine { matrix, translation }) = (map.dims(), *map.to_world());
    let size = map.to_world().voxel_size();
    let ratio: [f64; 3] = std::array::from_fn(|i| thick[i] / size[i]);
    let [a, b, c] = matrix.columns;
    let corner = translation - (a + b + c) * 0.5;
    let [a, b, c] = [a * ratio[0], b * ratio[1], c * ratio[2]];
    let to_world =
        Affine { matrix: Mat3::from_columns(a, b, c), translation: corner + (a + b + c) * 0.5 };
    let dims = std::array::from_fn(|i| libm::ceil(dims[i] as f64 / ratio[i] - 1e-9) as usize);
    compare(map, &[(what, dims, to_world, 0.5 * thick[2])]);
}

#[test]
fn organs_are_where_they_are_in_thick_slices() {
    let Some((map, _)) = scan() else { return };
    let [x, y, z] = map.to_world().voxel_size();
    compare_slices("slices of double thickness", &map, [x, y, 2.0 * z]);
}

#[test]
#[ignore = "slow: four million voxels"]
fn organs_are_where_they_are_in_thick_slices_at_length() {
    let Some((map, _)) = scan() else { return };
    compare_slices("0.7 x 0.7 x 5 mm", &map, [0.7e-3, 0.7e-3, 5e-3]);
}
