//! Names of labels in extensions: XML with a table of labels, as in CARET and Connectome Workbench,
//! `<LabelTable><Label Key="5">liver</Label></LabelTable>`. TotalSegmentator writes it too, under
//! code 0. All other extensions are passed over.

use std::collections::BTreeMap;

use roxmltree::{Document, ParsingOptions};

use crate::error::{VolumeProblem, clean_name, shorten};
use crate::report::Note;
use crate::source::{Part, Source};
use crate::values::ByteOrder;

use super::Version;

/// Larger extensions hold no names of labels: 10,000 take as much. Their trees would need memory.
const LARGEST: usize = 1 << 20;

/// Reads from the end of the header to the first voxel.
pub(super) fn read(
    source: &mut Source<'_>,
    data_offset: u64,
    version: Version,
    notes: &mut Vec<Note>,
) -> Result<BTreeMap<u16, String>, VolumeProblem> {
    let mut names = BTreeMap::new();
    let header_size = version.header_size() as u64;
    let mut part = Part::new("the extensions of the header", data_offset - header_size);
    let mut flag = [0; 4];
    source.take(&mut part, &mut flag)?;
    while flag[0] != 0 && part.needed - part.found >= 8 {
        let mut start = [0; 8];
        source.take(&mut part, &mut start)?;
        let [size, code] = halves(start, version.order);
        let left = part.needed - part.found;
        // The size counts itself and the code.
        let Some(size) = u64::try_from(size).ok().and_then(|size| size.checked_sub(8)) else {
            notes.extend((size != 0).then(|| damaged("it says that its size is below 8 bytes")));
            break;
        };
        if size > left {
            notes.push(damaged("it says that it goes on behind the first voxel"));
            break;
        }
        let mut own = Part { needed: part.found + size, ..part };
        if matches!(code, 0 | 30) && size <= LARGEST as u64 {
            let mut bytes = vec![0; size as usize];
            source.take(&mut own, &mut bytes)?;
            notes.extend(read_names(&bytes, &mut names).err());
        } else {
            let is_passed_over = matches!(code, 0 | 30);
            notes.extend(is_passed_over.then(|| damaged("it is larger than 1 MiB")));
            source.skip(&mut own)?;
        }
        part.found = own.found;
    }
    source.skip(&mut part)?;
    Ok(names)
}

fn halves(bytes: [u8; 8], order: ByteOrder) -> [i32; 2] {
    let [a, b, c, d, e, f, g, h] = bytes;
    [[a, b, c, d], [e, f, g, h]].map(|half| match order {
        ByteOrder::Little => i32::from_le_bytes(half),
        ByteOrder::Big => i32::from_be_bytes(half),
    })
}

fn damaged(reason: &str) -> Note {
    Note::ExtensionDamaged { reason: reason.to_owned() }
}

/// Adds the names of a table of labels, where the extension has one.
fn read_names(bytes: &[u8], names: &mut BTreeMap<u16, String>) -> Result<(), Note> {
    const TABLE: &[u8] = b"<LabelTable";
    let has_table = bytes.windows(TABLE.len()).any(|window| window == TABLE);
    if !has_table {
        return Ok(());
    }
    // Extensions are filled up to a multiple of 16 bytes.
    let text = str::from_utf8(bytes).map_err(|_| damaged("its text is not UTF-8"))?;
    let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
    let options = ParsingOptions { nodes_limit: 100_000, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|error| damaged(&shorten(&format!("not well-formed XML ({error})"))))?;
    let labels = document.descendants().filter(|node| {
        node.has_tag_name("Label")
            && node.parent_element().is_some_and(|parent| parent.has_tag_name("LabelTable"))
    });
    for label in labels {
        let key = label.attribute("Key").and_then(|key| key.trim().parse::<u16>().ok());
        let text: String = label.children().filter_map(|child| child.text()).collect();
        // Key 0 is background, `???` in CARET.
        if let (Some(1..), Some(name)) = (key, clean_name(&text)) {
            names.insert(key.unwrap_or_default(), name);
        }
    }
    Ok(())
}
