//! Names of files and labels as scenes and folders take them.

/// The name of a file without its folder and its endings: `liver` of `data/liver.nii.gz`, `scan.v2` of `scan.v2.stl`.
pub fn stem_of(file: &str) -> &str {
    let name = file.rsplit(['/', '\\']).next().unwrap_or(file);
    let cut = |name: &'_ str, ending: &str| {
        let start = name.len().checked_sub(ending.len())?;
        let is_it = start > 0 && name.get(start..)?.eq_ignore_ascii_case(ending);
        is_it.then_some(start)
    };
    let packed = cut(name, ".gz").map_or(name, |end| &name[..end]);
    let stem = match packed.rfind('.') {
        Some(end) if end > 0 => &packed[..end],
        _ => packed,
    };
    // 3D Slicer's segmentations are `liver.seg.nrrd`.
    cut(stem, ".seg").map_or(stem, |end| &stem[..end])
}

/// A name that scenes take: letters, digits, `-` and `_`, not digits alone.
pub fn name_of(text: &str) -> String {
    let mut name = String::new();
    for c in text.trim().chars().flat_map(char::to_lowercase) {
        match plain(c) {
            Some(letters) => name.push_str(letters),
            None if c.is_ascii_alphanumeric() || c == '-' => name.push(c),
            None if name.ends_with('_') => {}
            None => name.push('_'),
        }
    }
    let name = name.trim_matches('_').to_owned();
    match name.is_empty() || name.chars().all(|c| c.is_ascii_digit()) {
        true => format!("body_{name}").trim_end_matches('_').to_owned(),
        false => name,
    }
}

/// A letter with a mark, as it is written where there are none.
fn plain(c: char) -> Option<&'static str> {
    Some(match c {
        'ä' | 'æ' => "ae",
        'ö' | 'ø' | 'œ' => "oe",
        'ü' => "ue",
        'ß' => "ss",
        'å' => "aa",
        'à' | 'á' | 'â' | 'ã' => "a",
        'ç' | 'č' | 'ć' => "c",
        'è' | 'é' | 'ê' | 'ë' | 'ě' | 'ę' => "e",
        'ì' | 'í' | 'î' | 'ï' => "i",
        'ł' => "l",
        'ñ' | 'ń' => "n",
        'ò' | 'ó' | 'ô' | 'õ' => "o",
        'ř' => "r",
        'ś' | 'š' => "s",
        'ù' | 'ú' | 'û' => "u",
        'ý' | 'ÿ' => "y",
        'ź' | 'ż' | 'ž' => "z",
        // A mark of its own behind its letter.
        '\u{300}'..='\u{36f}' => "",
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_named_without_folder_and_endings() {
        for (file, stem) in [
            ("data/liver.nii.gz", "liver"),
            ("liver.NII", "liver"),
            ("Segmentation.seg.nrrd", "Segmentation"),
            ("scan.v2.stl", "scan.v2"),
            ("liver.stl.gz", "liver"),
            (".gz", ".gz"),
            ("liver", "liver"),
            ("a\\b.msh", "b"),
        ] {
            assert_eq!(stem_of(file), stem, "{file}");
        }
    }

    #[test]
    fn names_keep_their_letters() {
        for (text, name) in [
            ("Größe, links", "groesse_links"),
            ("Leber (Segment 4)", "leber_segment_4"),
            ("Cœur", "coeur"),
            ("Drüse", "druese"),
            ("U\u{308}ber", "uber"),
            ("12", "body_12"),
            ("肝臓", "body"),
        ] {
            assert_eq!(name_of(text), name, "{text}");
        }
    }
}
