//! glTF 2.0 in one file (`.glb`): surfaces and how they move, for every viewer of 3D models; Khronos, "glTF 2.0 Specification",
//! 2021. Written only.
//!
//! ```text
//! header   "glTF", version 2, length
//! JSON     what there is: nodes, meshes, materials, accessors
//! BIN      the numbers of accessors, one after another, little-endian
//! ```
//!
//! A frame `k` at time `t_k` is a morph target, the displacements `d_k = x_k - x` of all vertices from rest and those of their
//! normals. Weights are 1 for the target of the frame and 0 for others, and linear between frames:
//!
//! ```text
//! x(t) = x + (1 - s) d_k + s d_(k+1),   s = (t - t_k) / (t_(k+1) - t_k)
//! ```
//!
//! In glTF y points up: a node at the top turns everything, and numbers stay what they are.

use std::fmt::Write;

use super::error::WriteError;
use super::text::name_of;
use crate::mesh::normals::vertex_normals;
use crate::scalar::Vec3;

/// A surface at rest and in each frame.
#[derive(Clone, Copy, Debug)]
pub struct Surface<'a> {
    /// Its name.
    pub name: &'a str,
    /// Red, green, blue and opacity, linear, 0 to 1.
    pub color: [f32; 4],
    /// Vertex indices, wound outwards, shape `[triangle_count]`.
    pub triangles: &'a [[u32; 3]],
    /// Positions at rest `[m]`, z upwards, shape `[vertex_count]`.
    pub rest: &'a [Vec3<f32>],
    /// Positions in each frame `[m]`, shape `[frame_count][vertex_count]`.
    pub frames: &'a [Vec<Vec3<f32>>],
}

/// Types of numbers, uses of views and modes of glTF.
const UNSIGNED_INT: u32 = 5125;
const FLOAT: u32 = 5126;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// A quarter turn about x: z goes to y, and y to -z.
const Y_FROM_Z_UP: &str = "[-0.7071067811865476,0,0,0.7071067811865476]";

/// The bytes of a `.glb` file. `times` `[s]`, shape `[frame_count]`, ascend; without any the surfaces stand still.
pub fn write(times: &[f32], surfaces: &[Surface]) -> Result<Vec<u8>, WriteError> {
    check_times(times)?;
    surfaces.iter().try_for_each(|surface| check(surface, times.len()))?;
    let mut file = File::default();
    let (mut meshes, mut materials, mut nodes) = (Vec::new(), Vec::new(), Vec::new());
    for (at, surface) in surfaces.iter().enumerate() {
        let name = quoted(surface.name);
        nodes.push(format!("{{\"name\":{name},\"mesh\":{at}}}"));
        materials.push(material(&name, surface.color));
        meshes.push(file.mesh(&name, surface, at)?);
    }
    let children = list((0..surfaces.len()).map(|at| at.to_string()));
    let children =
        if surfaces.is_empty() { String::new() } else { format!(",\"children\":{children}") };
    nodes.push(format!("{{\"name\":\"z up\",\"rotation\":{Y_FROM_Z_UP}{children}}}"));
    let animation = file.animation(times, surfaces.len());

    let mut json = String::from("{\"asset\":{\"version\":\"2.0\",\"generator\":\"viscera\"}");
    // Writing to a string cannot fail.
    let _ = write!(
        json,
        ",\"scene\":0,\"scenes\":[{{\"nodes\":[{}]}}],\"nodes\":{}",
        surfaces.len(),
        list(nodes)
    );
    // Lists must not be empty.
    if !surfaces.is_empty() {
        let _ = write!(
            json,
            ",\"materials\":{},\"meshes\":{}{animation},\"accessors\":{},\"bufferViews\":{},\
             \"buffers\":[{{\"byteLength\":{}}}]",
            list(materials),
            list(meshes),
            list(file.accessors),
            list(file.views),
            file.bytes.len()
        );
    }
    json.push('}');
    chunks(json.into_bytes(), file.bytes)
}

/// The header and both chunks, each a multiple of four bytes.
fn chunks(mut json: Vec<u8>, bytes: Vec<u8>) -> Result<Vec<u8>, WriteError> {
    json.resize(json.len().next_multiple_of(4), b' ');
    let chunks = [(json, b"JSON"), (bytes, b"BIN\0")];
    let chunks = chunks.iter().filter(|(bytes, _)| !bytes.is_empty());
    let length = 12 + chunks.clone().map(|(bytes, _)| 8 + bytes.len() as u64).sum::<u64>();
    let Ok(total) = u32::try_from(length) else {
        let (what, limit, format) = ("length", u64::from(u32::MAX), "glTF files");
        return Err(WriteError::TooLarge { what, value: length, limit, format });
    };
    let mut file = Vec::with_capacity(total as usize);
    file.extend_from_slice(b"glTF");
    file.extend_from_slice(&2u32.to_le_bytes());
    file.extend_from_slice(&total.to_le_bytes());
    for (bytes, kind) in chunks {
        file.extend_from_slice(&(bytes.len() as u32).to_le_bytes());
        file.extend_from_slice(*kind);
        file.extend_from_slice(bytes);
    }
    Ok(file)
}

fn check_times(times: &[f32]) -> Result<(), WriteError> {
    for (frame, &time) in times.iter().enumerate() {
        let is_later = frame == 0 || time > times[frame - 1];
        if !(time.is_finite() && time >= 0.0 && is_later) {
            return Err(WriteError::Time { frame, time });
        }
    }
    Ok(())
}

/// Refuses what viewers refuse.
fn check(surface: &Surface, frame_count: usize) -> Result<(), WriteError> {
    let Surface { name, color, triangles, rest, frames } = *surface;
    let (array, point_count) = (|| name.to_owned(), rest.len());
    if triangles.is_empty() {
        return Err(WriteError::NoTriangles { surface: array() });
    }
    if !color.iter().all(|component| (0.0..=1.0).contains(component)) {
        return Err(WriteError::Color { surface: array() });
    }
    for (cell, triangle) in triangles.iter().enumerate() {
        if let Some(&point) = triangle.iter().find(|&&point| point as usize >= point_count) {
            return Err(WriteError::IndexOutOfRange { cell, point, point_count });
        }
    }
    let wrong = |what, wanted, found| WriteError::Length { array: array(), what, wanted, found };
    if frames.len() != frame_count {
        return Err(wrong("frame", frame_count, frames.len()));
    }
    if let Some(entry) = rest.iter().position(|x| !x.is_finite()) {
        return Err(WriteError::NonFinite { array: array(), entry });
    }
    for frame in frames {
        if frame.len() != point_count {
            return Err(wrong("point", point_count, frame.len()));
        }
        // Also where the difference is too large.
        let is_bad = |(x, at_rest): (&Vec3<f32>, &Vec3<f32>)| !(*x - *at_rest).is_finite();
        if let Some(entry) = frame.iter().zip(rest).position(is_bad) {
            return Err(WriteError::NonFinite { array: array(), entry });
        }
    }
    Ok(())
}

/// Accessors in the making: each has a view of its own.
#[derive(Default)]
struct File {
    bytes: Vec<u8>,
    views: Vec<String>,
    accessors: Vec<String>,
}

impl File {
    /// Adds an accessor of entries of `N` numbers of four bytes; its place in the list. `bounds` are JSON.
    fn add<const N: usize>(
        &mut self,
        entries: impl Iterator<Item = [[u8; 4]; N]>,
        (component, target): (u32, Option<u32>),
        bounds: &str,
    ) -> usize {
        let start = self.bytes.len();
        entries.for_each(|entry| self.bytes.extend_from_slice(entry.as_flattened()));
        let length = self.bytes.len() - start;
        let target = target.map(|target| format!(",\"target\":{target}")).unwrap_or_default();
        self.views.push(format!(
            "{{\"buffer\":0,\"byteOffset\":{start},\"byteLength\":{length}{target}}}"
        ));
        let (count, kind) = (length / (4 * N), if N == 3 { "VEC3" } else { "SCALAR" });
        self.accessors.push(format!(
            "{{\"bufferView\":{},\"componentType\":{component},\"count\":{count},\"type\":\"{kind}\"{bounds}}}",
            self.views.len() - 1
        ));
        self.accessors.len() - 1
    }

    /// Positions or displacements, with their bounds.
    fn positions(&mut self, vectors: &[Vec3<f32>]) -> usize {
        let (mut low, mut high) = ([f32::INFINITY; 3], [f32::NEG_INFINITY; 3]);
        for x in vectors {
            for (axis, value) in x.to_array().into_iter().enumerate() {
                low[axis] = low[axis].min(value);
                high[axis] = high[axis].max(value);
            }
        }
        let bounds = format!(",\"min\":{},\"max\":{}", numbers(&low), numbers(&high));
        self.vectors(vectors, &bounds)
    }

    fn vectors(&mut self, vectors: &[Vec3<f32>], bounds: &str) -> usize {
        let entries = vectors.iter().map(|x| x.to_array().map(f32::to_le_bytes));
        self.add(entries, (FLOAT, Some(ARRAY_BUFFER)), bounds)
    }

    /// A mesh as JSON.
    fn mesh(&mut self, name: &str, surface: &Surface, at: usize) -> Result<String, WriteError> {
        let Surface { triangles, rest, frames, .. } = *surface;
        let corners = triangles.as_flattened().iter().map(|vertex| [vertex.to_le_bytes()]);
        let indices = self.add(corners, (UNSIGNED_INT, Some(ELEMENT_ARRAY_BUFFER)), "");
        let positions = self.positions(rest);
        let normals = normals_of(rest, triangles);
        let at_rest = self.vectors(&normals, "");
        let difference = |to: &[Vec3<f32>], from: &[Vec3<f32>]| -> Vec<Vec3<f32>> {
            to.iter().zip(from).map(|(to, from)| *to - *from).collect()
        };
        let mut targets = Vec::new();
        for frame in frames {
            let moved = self.positions(&difference(frame, rest));
            let turned = difference(&normals_of(frame, triangles), &normals);
            let turned = self.vectors(&turned, "");
            targets.push(format!("{{\"POSITION\":{moved},\"NORMAL\":{turned}}}"));
        }
        let (targets, weights) = match frames {
            [] => Default::default(),
            // VTK counts targets by the weights at rest.
            _ => (
                format!(",\"targets\":{}", list(targets)),
                format!(",\"weights\":{}", numbers(&vec![0.0; frames.len()])),
            ),
        };
        Ok(format!(
            "{{\"name\":{name},\"primitives\":[{{\"attributes\":{{\"POSITION\":{positions},\"NORMAL\":{at_rest}}},\
             \"indices\":{indices},\"material\":{at}{targets}}}]{weights}}}"
        ))
    }

    /// The animation of all surfaces as JSON with the comma before it; nothing without frames.
    fn animation(&mut self, times: &[f32], surfaces: usize) -> String {
        let (Some(first), Some(last)) = (times.first(), times.last()) else { return String::new() };
        if surfaces == 0 {
            return String::new();
        }
        let bounds = format!(",\"min\":{},\"max\":{}", numbers(&[*first]), numbers(&[*last]));
        let keys = times.iter().map(|time| [time.to_le_bytes()]);
        let input = self.add(keys, (FLOAT, None), &bounds);
        let weight = |at: usize| if at.is_multiple_of(times.len() + 1) { 1.0f32 } else { 0.0 };
        let weights = (0..times.len() * times.len()).map(|at| [weight(at).to_le_bytes()]);
        let output = self.add(weights, (FLOAT, None), "");
        let channel =
            |node| format!("{{\"sampler\":0,\"target\":{{\"node\":{node},\"path\":\"weights\"}}}}");
        format!(
            ",\"animations\":[{{\"name\":\"motion\",\"channels\":{},\"samplers\":[{{\"input\":{input},\
             \"interpolation\":\"LINEAR\",\"output\":{output}}}]}}]",
            list((0..surfaces).map(channel))
        )
    }
}

/// Unit normals, in double precision on the way; any direction where triangles leave none.
fn normals_of(positions: &[Vec3<f32>], triangles: &[[u32; 3]]) -> Vec<Vec3<f32>> {
    let positions: Vec<Vec3<f64>> = positions.iter().map(|x| x.cast()).collect();
    let up = Vec3::new(0.0, 0.0, 1.0);
    let unit = |n: Vec3<f64>| if n == Vec3::ZERO { up } else { n.cast() };
    vertex_normals(&positions, triangles).into_iter().map(unit).collect()
}

fn material(name: &str, color: [f32; 4]) -> String {
    let mode = if color[3] < 1.0 { "BLEND" } else { "OPAQUE" };
    // Moist tissue is no metal, and its inside shows where it is cut open.
    format!(
        "{{\"name\":{name},\"doubleSided\":true,\"alphaMode\":\"{mode}\",\"pbrMetallicRoughness\":{{\
         \"baseColorFactor\":{},\"metallicFactor\":0,\"roughnessFactor\":0.5}}}}",
        numbers(&color)
    )
}

/// A text as JSON; it has no control characters.
fn quoted(text: &str) -> String {
    format!("\"{}\"", name_of(text).replace('\\', "\\\\").replace('"', "\\\""))
}

fn list(entries: impl IntoIterator<Item = String>) -> String {
    format!("[{}]", entries.into_iter().collect::<Vec<_>>().join(","))
}

/// With all digits, so that bounds are exact for readers in either precision.
fn numbers(values: &[f32]) -> String {
    list(values.iter().map(|value| format!("{:?}", f64::from(*value))))
}
