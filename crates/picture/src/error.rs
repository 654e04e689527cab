//! What can be wrong with a request for a picture.

/// Why a picture could not be made. Indices count from 0.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum PictureError {
    /// No pixels, or more than can reasonably be held in memory.
    #[error("a picture of {width} x {height} pixels; each side must be 16 to {limit} pixels", limit = crate::image::MAX_SIDE)]
    Size {
        /// Requested width [pixels].
        width: u32,
        /// Requested height [pixels].
        height: u32,
    },
    /// Pictures that are to stand side by side differ in size.
    #[error("picture {index} has another size than the first; draw all with one camera")]
    UnequalSizes {
        /// The first that differs.
        index: usize,
    },
    /// A triangle refers to a vertex that does not exist.
    #[error(
        "{part} {index}: triangle {triangle} refers to vertex {vertex}; there are {vertex_count}"
    )]
    IndexOutOfRange {
        /// "surface" or "outline".
        part: &'static str,
        /// Which one.
        index: usize,
        /// The triangle.
        triangle: usize,
        /// The index it names.
        vertex: u32,
        /// How many vertices there are.
        vertex_count: usize,
    },
    /// Values to colour by do not match the vertices.
    #[error(
        "surface {index} has {vertex_count} vertices and {value_count} values to colour by; give one value per vertex"
    )]
    ValueCount {
        /// The surface.
        index: usize,
        /// How many vertices it has.
        vertex_count: usize,
        /// How many values were given.
        value_count: usize,
    },
    /// A surface is coloured by values, and nothing says which colour a value has.
    #[error(
        "surface {index} is coloured by values; set `color_scale` to say which colour a value has"
    )]
    NoColorScale {
        /// The surface.
        index: usize,
    },
    /// A colour scale without a usable range.
    #[error("colour scale from {min} to {max}; both ends must be finite and the first the smaller")]
    ColorRange {
        /// Lower end, as text.
        min: String,
        /// Upper end, as text.
        max: String,
    },
    /// Frames of one animation differ in size.
    #[error(
        "a frame of {width} x {height} pixels in an animation of {expected_width} x {expected_height}; draw all frames with one camera"
    )]
    FrameSize {
        /// Width of the frame [pixels].
        width: u32,
        /// Height of the frame [pixels].
        height: u32,
        /// Width of the animation [pixels].
        expected_width: u32,
        /// Height of the animation [pixels].
        expected_height: u32,
    },
    /// The picture could not be written in its format.
    #[error("{format} encoding failed: {reason}")]
    Encoding {
        /// "png" or "gif".
        format: &'static str,
        /// The encoder's own words.
        reason: String,
    },
}
