//! The length that 1 in a file stands for, where nobody has said.

use viscera::mesh::topology::BoundingBox;
use viscera::scalar::Vec3;

/// How large organs are: a word of their names, and litres of an adult's.
const ORGANS: [(&str, f64); 18] = [
    ("liver", 1.5),
    ("spleen", 0.2),
    ("kidney", 0.16),
    ("stomach", 0.4),
    ("pancreas", 0.08),
    ("gallbladder", 0.03),
    ("bladder", 0.25),
    ("tongue", 0.07),
    ("heart", 0.6),
    ("lung", 2.5),
    ("brain", 1.3),
    ("uterus", 0.08),
    ("prostate", 0.03),
    ("colon", 0.6),
    ("breast", 0.6),
    ("eye", 0.0065),
    ("thyroid", 0.015),
    ("muscle", 0.3),
];

/// A unit and how it was found.
#[derive(Clone, Debug, PartialEq)]
pub struct Unit {
    /// [m].
    pub meters: f64,
    /// In words, for people.
    pub reason: String,
}

/// Units that files have, most common first.
const COMMON: [(f64, &str); 3] = [(1e-3, "mm"), (1.0, "m"), (1e-2, "cm")];

/// An organ's volume is within this factor of an adult's, from a child's to an enlarged one.
const PLAUSIBLE: f64 = 6.0;

/// The unit of a file, by its name, its size and the volume that it encloses, both in units of the file.
pub fn guess(name: &str, vertices: &[Vec3<f64>], volume: f64) -> Unit {
    let size = BoundingBox::around(vertices).size();
    let longest = size.x.max(size.y).max(size.z);
    let name = name.to_ascii_lowercase();
    // An open sheet encloses nothing.
    let organ = ORGANS.iter().find(|(word, _)| name.contains(word) && volume > 0.0);
    if let Some(&(word, litres)) = organ {
        let wanted = 1e-3 * litres;
        for (meters, text) in COMMON {
            let ratio = volume * cube(meters) / wanted;
            if ratio > 1.0 / PLAUSIBLE && ratio < PLAUSIBLE {
                let has = 1e3 * volume * cube(meters);
                let reason = format!("1 in the file as 1 {text}: a {word} of {}", litres_text(has));
                return Unit { meters, reason };
            }
        }
        // To two digits, so that nobody takes it for a measurement.
        let meters = two_digits(libm::cbrt(wanted / volume));
        let reason = format!(
            "1 in the file as {}: as {} m^3 it would be no {word}, so it has an adult's {}",
            length_text(meters),
            short(volume),
            litres_text(1e3 * volume * cube(meters))
        );
        return Unit { meters, reason };
    }
    for (meters, text) in COMMON {
        let length = longest * meters;
        if (0.02..=0.6).contains(&length) {
            let reason = format!("1 in the file as 1 {text}: {} long then", length_text(length));
            return Unit { meters, reason };
        }
    }
    let meters = two_digits(0.15 / longest);
    let reason = format!(
        "1 in the file as {}: no common unit makes {} of it a part of a body, so it is 15 cm long",
        length_text(meters),
        short(longest)
    );
    Unit { meters, reason }
}

/// Lengths of what is simulated [m], in a unit that was given: from a piece of tissue to a person.
const LENGTHS: std::ops::RangeInclusive<f64> = 1e-3..=3.0;

/// Why a unit is probably not that of a file, see [`guess`], with one that is likely.
pub fn doubt(name: &str, vertices: &[Vec3<f64>], volume: f64, meters: f64) -> Option<String> {
    let size = BoundingBox::around(vertices).size();
    let longest = size.x.max(size.y).max(size.z);
    let likely = guess(name, vertices, volume).meters;
    let name = name.to_ascii_lowercase();
    let unit = |meters: f64| format!("--unit \"{}\"", length_text(meters));
    let organ = ORGANS.iter().find(|(word, _)| name.contains(word) && volume > 0.0);
    if let Some(&(word, litres)) = organ {
        let has = 1e3 * volume * cube(meters);
        let is_likely = (1.0 / PLAUSIBLE..PLAUSIBLE).contains(&(has / litres));
        return (!is_likely).then(|| {
            format!(
                "with {} it has {}, and an adult's {word} has {}; with {} it would have {}",
                unit(meters),
                litres_text(has),
                litres_text(litres),
                unit(likely),
                litres_text(1e3 * volume * cube(likely))
            )
        });
    }
    (!LENGTHS.contains(&(longest * meters))).then(|| {
        format!(
            "with {} it is {} long; with {} it would be {}",
            unit(meters),
            length_text(longest * meters),
            unit(likely),
            length_text(longest * likely)
        )
    })
}

fn cube(x: f64) -> f64 {
    x * x * x
}

fn two_digits(value: f64) -> f64 {
    let tens = libm::pow(10.0, 1.0 - libm::log10(value).floor());
    let rounded = (value * tens).round() / tens;
    if rounded.is_finite() && rounded > 0.0 { rounded } else { value }
}

fn short(value: f64) -> String {
    if (1e-2..1e4).contains(&value) { format!("{value:.2}") } else { format!("{value:.1e}") }
}

fn litres_text(litres: f64) -> String {
    match litres >= 1.0 {
        true if litres >= 1e3 => format!("{} m^3", short(1e-3 * litres)),
        true => format!("{litres:.2} l"),
        false => format!("{} ml", millilitres(1e-3 * litres)),
    }
}

/// A volume [m^3] in millilitres, with two digits or more.
pub fn millilitres(volume: f64) -> String {
    let value = 1e6 * volume;
    // So many digits behind the point.
    let digits = match value.abs() {
        size if size >= 9.95 => 0,
        size if size > 0.0 && size.is_finite() => {
            (1.0 - libm::log10(size).floor()).min(9.0) as usize
        }
        _ => 0,
    };
    format!("{value:.digits$}")
}

/// A length as people write it: "32 mm".
pub fn length_text(meters: f64) -> String {
    let millimetres = 1e3 * meters;
    let text = if millimetres >= 100.0 {
        format!("{millimetres:.0}")
    } else {
        format!("{:.4}", millimetres).trim_end_matches('0').trim_end_matches('.').to_owned()
    };
    format!("{text} mm")
}

/// A length no longer than this one, to two digits, as people write it.
pub fn edge_below(meters: f64) -> String {
    let unit = libm::pow(10.0, libm::log10(meters).floor() - 1.0);
    length_text((meters / unit).floor() * unit)
}

#[cfg(test)]
mod tests {
    use super::*;
    use viscera::scalar::vec3;

    fn points(size: f64) -> [Vec3<f64>; 2] {
        [Vec3::ZERO, vec3(size, size / 2.0, size / 3.0)]
    }

    #[test]
    fn an_organ_of_a_common_unit_is_told_by_its_volume() {
        assert_eq!(guess("liver.stl", &points(250.0), 1.4e6).meters, 1e-3);
        assert_eq!(guess("Left_Kidney.obj", &points(0.11), 1.5e-4).meters, 1.0);
        assert_eq!(guess("spleen.ply", &points(12.0), 210.0).meters, 1e-2);
    }

    #[test]
    fn a_unit_that_makes_no_organ_is_doubted() {
        let told = doubt("liver_coarse", &points(5.0), 36.6, 1.0).expect("no liver");
        let parts = [
            "--unit \"1000 mm\" it has 36.60 m^3",
            "liver has 1.50 l",
            "--unit \"34 mm\" it would have 1.44 l",
        ];
        assert!(parts.iter().all(|part| told.contains(part)), "{told}");
        assert_eq!(doubt("liver_coarse", &points(5.0), 36.6, 0.032), None);
        let told = doubt("part", &points(120.0), 1e5, 1.0).expect("too long");
        assert!(told.contains("120000 mm long") && told.contains("\"1 mm\""), "{told}");
        assert_eq!(doubt("part", &points(120.0), 1e5, 1e-3), None);
    }

    #[test]
    fn small_volumes_keep_two_digits() {
        let texts = [1.5e-3, 57.3e-6, 7.46e-6, 3.21e-8, 0.0].map(millilitres);
        assert_eq!(texts, ["1500", "57", "7.5", "0.032", "0"]);
    }

    #[test]
    fn one_of_no_common_unit_gets_an_adults_volume() {
        let unit = guess("liver_coarse.msh", &points(5.0), 36.6);
        assert_eq!(unit.meters, 0.034);
        assert!(unit.reason.contains("no liver"), "{}", unit.reason);
    }

    #[test]
    fn what_has_no_name_is_told_by_its_length() {
        assert_eq!(guess("part.obj", &points(120.0), 1e5).meters, 1e-3);
        assert_eq!(guess("part.obj", &points(0.2), 1e-3).meters, 1.0);
        assert_eq!(guess("part.obj", &points(1e5), 1e12).meters, 1.5e-6);
        assert_eq!(
            guess("liver.obj", &points(120.0), 0.0).meters,
            1e-3,
            "a sheet encloses nothing"
        );
    }
}
