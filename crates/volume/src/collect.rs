//! Values become labels, one after the other. What a scan has and labels do not, fractions, negative
//! numbers, thousands of values, is noticed on the way.

use std::collections::BTreeMap;

use crate::error::{Plain, VolumeProblem, sizes_text};
use crate::read::Limits;

/// More labels than this are grey values of a scan. The largest atlases of the body or the brain have
/// some hundred structures; a CT scan has some thousand grey values.
const MOST_LABELS: usize = 1024;

/// Where images of several layers put a segment: the layer and the value there.
pub(crate) type SegmentPlaces = BTreeMap<(usize, u16), u16>;

/// Collects the values of an image.
pub(crate) struct Values {
    dims: [usize; 3],
    announced: u64,
    came: u64,
    labels: Vec<u16>,
    /// Slope and intercept, where values are stored by a scale.
    scale: Option<(f64, f64)>,
    seen: Box<[bool; 1 << 16]>,
    odd: Option<Odd>,
    layers: Option<Layers>,
}

/// Values that are no labels.
struct Odd {
    first: f64,
    /// The place of the first, counting all values.
    place: u64,
    low: f64,
    high: f64,
}

/// Layers over each other, of which voxels have one label in the end.
struct Layers {
    count: usize,
    places: SegmentPlaces,
    layer: usize,
    label: u16,
    segments_here: usize,
    overlaps: u64,
    strays: u64,
}

/// Labels of all voxels.
pub(crate) struct Collected {
    pub labels: Vec<u16>,
    /// Voxels that lie in several segments.
    pub overlaps: u64,
    /// Voxels of layers with a value that no segment has.
    pub strays: u64,
}

impl Values {
    /// For an image of these sizes, with that many layers. Nothing is allocated for it yet.
    pub fn new(sizes: [u64; 3], layers: u64, limits: Limits) -> Result<Self, VolumeProblem> {
        let all = [sizes[0], sizes[1], sizes[2], layers];
        let text = || if layers == 1 { sizes_text(&sizes) } else { sizes_text(&all) };
        if all.contains(&0) {
            return Err(VolumeProblem::NoVoxels { sizes: text() });
        }
        let too_large = || VolumeProblem::TooLarge { sizes: text(), limit: limits.voxels };
        let count = all.iter().try_fold(1_u64, |product, &size| product.checked_mul(size));
        let announced = count.filter(|&count| count <= limits.voxels).ok_or_else(too_large)?;
        let to_usize = |size: u64| usize::try_from(size).map_err(|_| too_large());
        let voxels = to_usize(announced / layers)?;
        let dims = [to_usize(sizes[0])?, to_usize(sizes[1])?, to_usize(sizes[2])?];
        debug_assert_eq!(dims.iter().product::<usize>(), voxels);
        Ok(Self {
            dims,
            announced,
            came: 0,
            labels: Vec::new(),
            scale: None,
            seen: Box::new([false; 1 << 16]),
            odd: None,
            layers: None,
        })
    }

    /// Values are multiplied by a slope, then an intercept is added.
    pub fn scaled_by(mut self, scale: Option<(f64, f64)>) -> Self {
        self.scale = scale;
        self
    }

    /// Each voxel has several values, one per layer; `places` says which segment they stand for. Of
    /// several segments in a voxel the one with the highest label stays.
    pub fn with_layers(mut self, count: usize, places: SegmentPlaces) -> Self {
        let (layer, label, segments_here) = (0, 0, 0);
        let layers = Layers { count, places, layer, label, segments_here, overlaps: 0, strays: 0 };
        self.layers = Some(layers);
        self
    }

    /// Numbers of voxels along the axes.
    pub fn dims(&self) -> [usize; 3] {
        self.dims
    }

    /// How many values there must be, over all layers.
    pub fn announced(&self) -> u64 {
        self.announced
    }

    /// How many values came.
    pub fn came(&self) -> u64 {
        self.came
    }

    fn voxels(&self) -> usize {
        self.dims.iter().product()
    }

    /// Makes room for that many values more, never for more than twice of what came.
    pub fn reserve(&mut self, more: usize) -> Result<(), VolumeProblem> {
        let free = self.labels.capacity() - self.labels.len();
        if self.odd.is_none() && free < more {
            let left = self.voxels() - self.labels.len().min(self.voxels());
            let room = self.labels.len().max(more).min(left);
            let voxels = self.voxels();
            let memory = |_| VolumeProblem::Memory { voxels };
            self.labels.try_reserve_exact(room).map_err(memory)?;
        }
        Ok(())
    }

    /// Takes the next value.
    #[inline]
    pub fn push(&mut self, stored: f64) {
        let value = match self.scale {
            Some((slope, intercept)) => slope * stored + intercept,
            None => stored,
        };
        let place = self.came;
        self.came += 1;
        // Saturates, so that only what is a label survives the way there and back.
        let label = value as u16;
        if f64::from(label) != value {
            self.push_odd(value, place);
            return;
        }
        self.seen[usize::from(label)] = true;
        if self.odd.is_some() {
            return;
        }
        match &mut self.layers {
            None => self.labels.push(label),
            Some(layers) => self.labels.extend(layers.merge(label)),
        }
    }

    #[cold]
    fn push_odd(&mut self, value: f64, place: u64) {
        // The file is refused, and only the range of its values is of interest from here.
        self.labels = Vec::new();
        let odd = self.odd.get_or_insert(Odd {
            first: value,
            place,
            low: f64::INFINITY,
            high: f64::NEG_INFINITY,
        });
        odd.low = odd.low.min(value);
        odd.high = odd.high.max(value);
    }

    /// All labels, or why there are none.
    pub fn finish(self) -> Result<Collected, VolumeProblem> {
        let marks = self.seen.iter();
        let distinct = marks.filter(|&&seen| seen).count();
        let lowest = self.seen.iter().position(|&seen| seen);
        let highest = self.seen.iter().rposition(|&seen| seen);
        let (mut low, mut high) = (
            lowest.map_or(f64::INFINITY, |label| label as f64),
            highest.map_or(f64::NEG_INFINITY, |label| label as f64),
        );
        if let Some(odd) = &self.odd {
            low = low.min(odd.low);
            high = high.max(odd.high);
            if low > high {
                // Nothing is a number.
                (low, high) = (f64::NAN, f64::NAN);
            }
            let place = self.place_text(odd.place);
            let note = format!(", {} at voxel {place}", Plain(odd.first));
            return Err(VolumeProblem::Scan { low, high, note });
        }
        if distinct > MOST_LABELS {
            let note = format!(", {distinct} different ones");
            return Err(VolumeProblem::Scan { low, high, note });
        }
        if self.labels.iter().all(|&label| label == 0) {
            return Err(VolumeProblem::AllBackground { voxels: self.voxels() });
        }
        let (overlaps, strays) = self.layers.map_or((0, 0), |l| (l.overlaps, l.strays));
        Ok(Collected { labels: self.labels, overlaps, strays })
    }

    /// The voxel of a value, as in "(0, 1, 2)".
    fn place_text(&self, place: u64) -> String {
        let layers = self.announced / self.voxels().max(1) as u64;
        let voxel = place / layers.max(1);
        let [x, y, _] = self.dims.map(|size| (size as u64).max(1));
        format!("({}, {}, {})", voxel % x, voxel / x % y, voxel / x / y)
    }
}

impl Layers {
    /// Takes the value of the next layer; a label once all layers of a voxel came.
    fn merge(&mut self, value: u16) -> Option<u16> {
        if value != 0 {
            match self.places.get(&(self.layer, value)) {
                Some(&label) => {
                    self.segments_here += 1;
                    self.label = self.label.max(label);
                }
                None => self.strays += 1,
            }
        }
        self.layer += 1;
        if self.layer < self.count {
            return None;
        }
        self.overlaps += u64::from(self.segments_here > 1);
        let label = self.label;
        (self.layer, self.label, self.segments_here) = (0, 0, 0);
        Some(label)
    }
}
