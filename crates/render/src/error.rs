//! Why there is no picture.

use viscera::solver::gpu::GpuError;

/// Why there is no picture.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum RenderError {
    /// The device has failed.
    #[error(transparent)]
    Device(#[from] GpuError),
    /// The picture is larger than the device's textures.
    #[error("a picture of {width} x {height} pixels; {name} draws up to {most} on a side")]
    TooLarge {
        /// Asked [pixels].
        width: u32,
        /// Asked [pixels].
        height: u32,
        /// The device.
        name: String,
        /// Its limit [pixels].
        most: u32,
    },
    /// Values are not those of the surface.
    #[error("{found} values to colour {expected} vertices of a surface with; give one for each")]
    ValueCount {
        /// How many there are.
        found: usize,
        /// How many there must be.
        expected: usize,
    },
    /// The picture did not come back.
    #[error("{name} did not give the picture back; it may be lost: start again, or use the CPU")]
    Lost {
        /// The device.
        name: String,
    },
}
