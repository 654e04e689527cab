//! Segments of 3D Slicer, see "Segmentation labelmap file format" in its documentation: keys
//! `Segment<k>_Name`, `_LabelValue` and `_Layer`. Files from before layers (Slicer 4.10) have neither
//! label values nor layers: segment `k` is 1 in volume `k` of the list.

use std::collections::BTreeMap;

use crate::collect::SegmentPlaces;
use crate::error::{Fault, bad_field, clean_name, unsupported};

use super::header::{Field, Header};

#[derive(Default)]
struct Segment {
    name: Option<String>,
    id: Option<String>,
    label_value: Option<u16>,
    layer: Option<usize>,
}

/// The segments of a file, in the order of their numbers.
pub(super) struct Segments(BTreeMap<u32, Segment>);

impl Segments {
    pub fn read(header: &Header) -> Result<Self, Fault> {
        let mut segments: BTreeMap<u32, Segment> = BTreeMap::new();
        for (key, Field { line, text }) in &header.keys {
            if key.starts_with("Segmentation_") {
                // "MasterRepresentation" before Slicer 5.2.
                if key.ends_with("Representation") && text.contains("Fractional") {
                    let advice = "export a binary label map in 3D Slicer";
                    let found = "a fractional segmentation";
                    return Err(Fault::at(*line, unsupported(found, advice)));
                }
                continue;
            }
            let Some((number, what)) =
                key.strip_prefix("Segment").and_then(|rest| rest.split_once('_'))
            else {
                continue;
            };
            let Ok(number) = number.parse::<u32>() else { continue };
            let bad = |expected| Fault::at(*line, bad_field(key.as_str(), expected, text));
            match what {
                "Name" => segments.entry(number).or_default().name = clean_name(text),
                "ID" => segments.entry(number).or_default().id = clean_name(text),
                "LabelValue" => {
                    let value = text.trim().parse().ok().filter(|&value: &u16| value > 0);
                    let value = value.ok_or_else(|| bad("a label from 1 to 65535"))?;
                    segments.entry(number).or_default().label_value = Some(value);
                }
                "Layer" => {
                    let layer = text.trim().parse();
                    let layer = layer.map_err(|_| bad("the number of a layer, 0 or more"))?;
                    segments.entry(number).or_default().layer = Some(layer);
                }
                _ => {}
            }
        }
        Ok(Self(segments))
    }

    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Names of labels. Where layers were merged, segments are numbered from 1 in their order.
    pub fn names(&self, merged: bool) -> BTreeMap<u16, String> {
        let labels = 1..=u16::MAX;
        let named = self.0.values().zip(labels).filter_map(|(segment, label)| {
            let name = segment.name.as_ref().or(segment.id.as_ref())?;
            let label = if merged { label } else { segment.label_value.unwrap_or(label) };
            Some((label, name.clone()))
        });
        named.collect()
    }

    /// Which segment a value in a layer stands for.
    pub fn places(&self, layers: usize) -> Result<SegmentPlaces, Fault> {
        let mut places = SegmentPlaces::new();
        for (position, (number, segment)) in self.0.iter().enumerate() {
            let label = u16::try_from(position + 1).map_err(|_| {
                let advice = "export fewer segments";
                Fault::from(unsupported(format!("{} segments", self.0.len()), advice))
            })?;
            let layer = segment.layer.unwrap_or(position);
            if layer >= layers {
                let field = format!("Segment{number}_Layer");
                let expected = "one of the layers of the image, counting from 0";
                return Err(bad_field(field, expected, layer).into());
            }
            places.insert((layer, segment.label_value.unwrap_or(1)), label);
        }
        Ok(places)
    }
}
