//! Damages mesh files at random, the same way on every machine, and looks at what readers make of them.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc;
use std::time::{Duration, Instant};

use viscera::mesh::io::{MendedFile, Mesh, MeshFile, ReadReport};
use viscera::mesh::{SurfaceMesh, TetMesh};

use super::Random;
use super::counting::peak_of;
use crate::mesh_formats::{fixture, fixtures};

/// A read takes microseconds; more than this is a loop that does not end, or one over all pairs.
const LONGEST: Duration = Duration::from_secs(1);

/// A read that takes so long does not end.
const ENDLESS: Duration = Duration::from_secs(30);

/// Bytes of memory that a reader may hold for each byte of a file, and for any file at all.
const MEMORY: (usize, usize) = (10, 64 << 10);

/// No more than so many bytes come of one byte of zlib.
pub const LARGEST_DEFLATE_RATIO: usize = 1032;

/// Larger inputs say nothing that smaller ones do not.
const LARGEST_INPUT: usize = 16 << 10;

/// Numbers that mean something as counts, indices or coordinates.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1",
    "2",
    "8",
    "255",
    "65536",
    "2147483647",
    "4294967295",
    "4294967296",
    "9223372036854775807",
    "18446744073709551615",
    "1e999",
    "1e-320",
    "nan",
    "0.5",
];

/// The same as bytes.
const EXTREMES: [u64; 10] = [
    0,
    1,
    2,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fff_ffff_ffff_ffff,
    0xffff_ffff_ffff_ffff,
    // Infinities of both precisions.
    0x7f80_0000,
    0x7ff0_0000_0000_0000,
];

/// Files of one reader, and words that mean something to it.
pub struct Reader {
    files: Vec<MeshFile>,
    words: &'static [&'static str],
    /// Bytes that may come of one byte of the file.
    ratio: usize,
}

impl Reader {
    /// The fixtures whose names hold one of these parts, and texts of what no program at hand writes.
    pub fn new(
        parts: &[&str],
        own: &[(&str, &str)],
        words: &'static [&'static str],
        ratio: usize,
    ) -> Self {
        let names = fixtures("").into_iter();
        let names = names.filter(|name| parts.iter().any(|part| name.contains(part)));
        let mut files: Vec<MeshFile> = names.map(|name| fixture(&name)).collect();
        assert!(!files.is_empty(), "{parts:?}");
        for &(name, text) in own {
            let file = MeshFile { name: name.into(), bytes: text.into(), beside: None };
            file.mesh(1.0).unwrap_or_else(|error| panic!("{error}"));
            files.push(file);
        }
        Self::of(files, words, ratio)
    }

    /// These files alone.
    pub fn of(files: Vec<MeshFile>, words: &'static [&'static str], ratio: usize) -> Self {
        Self { files, words, ratio }
    }

    /// The input of this number.
    fn input(&self, number: u64) -> MeshFile {
        let mut random = Random(number);
        let pick = |random: &mut Random| {
            let file = &self.files[below(random, self.files.len())];
            match &file.beside {
                Some(beside) if below(random, 2) == 0 => (file, beside),
                _ => (file, &file.bytes),
            }
        };
        let (file, _) = pick(&mut random);
        let mut file = file.clone();
        let is_beside = file.beside.is_some() && below(&mut random, 2) == 0;
        let (_, other) = pick(&mut random);
        let bytes = if is_beside { file.beside.as_mut() } else { Some(&mut file.bytes) };
        if let Some(bytes) = bytes {
            for _ in 0..1 << below(&mut random, 4) {
                damage(bytes, other, self.words, &mut random);
            }
            bytes.truncate(LARGEST_INPUT);
        }
        file
    }

    /// Reads so many inputs in every way.
    pub fn survives(&self, (count, longest): (u64, Duration)) {
        let start = Instant::now();
        let mut done = 0;
        let mut most = 0.0f64;
        let (sender, receiver) = mpsc::channel();
        std::thread::scope(|scope| {
            scope.spawn(|| watch(receiver));
            // Gone with the loop, so that the watch ends, also when a demand is missed.
            let sender = sender;
            while done < count && start.elapsed() < longest {
                let _ = sender.send(done);
                let file = self.input(done);
                most = most.max(self.read_all_ways(&file, &format!("input {done}")));
                done += 1;
            }
        });
        let rate = done as f64 / start.elapsed().as_secs_f64();
        println!("{done} inputs, {rate:.0} a second, {most:.1} bytes of memory a byte at most");
    }

    /// Memory that was held beside the constant, for each byte of the file.
    fn read_all_ways(&self, file: &MeshFile, what: &str) -> f64 {
        let what = &format!("{what} of {}", file.name);
        let a = self.read(
            file,
            what,
            |file| file.mesh(1.0),
            |mesh, _| match mesh {
                Mesh::Tets(_) => {}
                Mesh::Surface(surface) => check_surface(surface),
            },
        );
        let b = self.read(file, what, |file| file.tets(1.0), check_tets);
        let c = self.read(file, what, |file| file.surface(1.0), |mesh, _| check_surface(mesh));
        let d = self.read(
            file,
            what,
            |file| file.mended(1.0, None).map(|mended| (mended, ReadReport::default())),
            |mended, _| match mended {
                MendedFile::Tets(mended, _) => check_tets(&mended.mesh, &ReadReport::default()),
                MendedFile::Surface(surface, _) => check_surface(surface),
            },
        );
        a.max(b).max(c).max(d)
    }

    fn read<T, E: std::fmt::Display>(
        &self,
        file: &MeshFile,
        what: &str,
        read: impl Fn(&MeshFile) -> Result<(T, ReadReport), E>,
        check: impl Fn(&T, &ReadReport),
    ) -> f64 {
        let start = Instant::now();
        let guarded = || catch_unwind(AssertUnwindSafe(|| read(file)));
        let (outcome, peak) = peak_of(guarded);
        let took = start.elapsed();
        let result = outcome.unwrap_or_else(|_| panic!("{what} makes the reader panic"));
        assert!(took < LONGEST, "{what} takes {took:?}");
        let length = file.bytes.len() + file.beside.as_ref().map_or(0, Vec::len);
        let allowed = MEMORY.0 * self.ratio * length + MEMORY.1;
        assert!(peak <= allowed, "{what}: {length} bytes take {peak} of memory, {allowed} allowed");
        match result {
            Ok((mesh, report)) => {
                check(&mesh, &report);
                let names = report.patches.iter().map(|patch| &patch.name);
                let names = names.chain(report.region_names.iter().map(|(_, name)| name));
                let lists = [&report.skipped, &report.split];
                for name in names.chain(lists.into_iter().flatten().map(|counted| &counted.kind)) {
                    assert!(is_printable(name), "{what}: {name:?}");
                }
            }
            Err(error) => {
                let text = error.to_string();
                let (stem, _) = file.name.rsplit_once('.').expect("a name with an extension");
                assert!(text.starts_with(stem), "{what}: {text:?}");
                assert!(is_printable(&text) && text.len() < 1000, "{what}: {text:?}");
            }
        }
        peak.saturating_sub(MEMORY.1) as f64 / length.max(1) as f64
    }
}

/// Ends the program where an input does not end: nothing else can.
fn watch(inputs: mpsc::Receiver<u64>) {
    let mut last = None;
    loop {
        match inputs.recv_timeout(ENDLESS) {
            Ok(input) => last = Some(input),
            Err(mpsc::RecvTimeoutError::Disconnected) => return,
            Err(mpsc::RecvTimeoutError::Timeout) => {
                eprintln!("input {last:?} of a reader does not end");
                std::process::abort();
            }
        }
    }
}

/// Whether a text is one line, and does nothing to a terminal.
fn is_printable(text: &str) -> bool {
    !text.chars().any(|c| c.is_control() || "\u{2028}\u{2029}\u{202e}\u{2066}".contains(c))
}

fn check_tets(mesh: &TetMesh, report: &ReadReport) {
    let count = mesh.vertices().len();
    assert_eq!(mesh.regions().len(), mesh.tets().len());
    for patch in &report.patches {
        assert!(patch.vertices.is_sorted_by(|a, b| a < b), "{patch:?}");
        assert!(patch.vertices.last().is_some_and(|&last| (last as usize) < count), "{patch:?}");
    }
    let mut names: Vec<&str> = report.patches.iter().map(|patch| &*patch.name).collect();
    names.sort_unstable();
    assert!(names.is_sorted_by(|a, b| a < b), "two patches have the same name: {names:?}");
}

fn check_surface(mesh: &SurfaceMesh) {
    let count = mesh.vertices.len() as u32;
    assert!(mesh.triangles.iter().flatten().all(|&vertex| vertex < count));
    assert!(mesh.vertices.iter().all(|x| x.is_finite()));
}

fn below(random: &mut Random, count: usize) -> usize {
    (random.next() % count.max(1) as u64) as usize
}

/// A range of bytes, mostly short.
fn range(random: &mut Random, length: usize) -> std::ops::Range<usize> {
    let longest = 1 << below(random, 10);
    let start = below(random, length + 1);
    start..(start + below(random, longest) + 1).min(length)
}

/// One change.
fn damage(bytes: &mut Vec<u8>, other: &[u8], words: &[&str], random: &mut Random) {
    let at = below(random, bytes.len());
    let own = range(random, bytes.len());
    match below(random, 14) {
        _ if bytes.is_empty() => bytes.extend_from_slice(other),
        0 => bytes[at] = random.next() as u8,
        1 => bytes[at] ^= 1 << below(random, 8),
        2 | 3 => {
            let word = words[below(random, words.len())];
            bytes.splice(at..at, word.bytes());
        }
        4 => {
            let number = NUMBERS[below(random, NUMBERS.len())];
            bytes.splice(at..at, number.bytes());
        }
        5 | 6 => replace_number(bytes, at, random),
        7 => drop(bytes.drain(own)),
        8 => {
            // The same again and again shows what takes time by all pairs.
            let times = if below(random, 8) == 0 { 1 + below(random, 64) } else { 1 };
            let copy = bytes[own.clone()].repeat(times);
            if bytes.len() + copy.len() < LARGEST_INPUT {
                bytes.splice(own.start..own.start, copy);
            }
        }
        9 => {
            let swapped = bytes[own.clone()].to_vec();
            bytes.drain(own);
            let to = below(random, bytes.len() + 1);
            bytes.splice(to..to, swapped);
        }
        10 => {
            let theirs = range(random, other.len());
            bytes.splice(own, other[theirs].iter().copied());
        }
        11 => {
            let (value, width) = (EXTREMES[below(random, EXTREMES.len())], 4 << below(random, 2));
            let mut number = value.to_le_bytes()[..width].to_vec();
            if below(random, 2) == 0 {
                number.reverse();
            }
            // Mostly where numbers stand.
            let at = if below(random, 4) == 0 { at } else { at / 4 * 4 };
            let width = width.min(bytes.len() - at);
            bytes[at..at + width].copy_from_slice(&number[..width]);
        }
        12 => bytes.truncate(at),
        _ => {
            let digits = |byte: &u8| byte.is_ascii_digit();
            if let Some(found) = bytes[at..].iter().position(digits) {
                bytes[at + found] = b'0' + below(random, 10) as u8;
            }
        }
    }
}

/// Another number for the next one of a text.
fn replace_number(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let is_part = |byte: &u8| byte.is_ascii_digit() || b".+-".contains(byte);
    let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit) else { return };
    let start = at + start;
    let length = bytes[start..].iter().position(|byte| !is_part(byte));
    let end = length.map_or(bytes.len(), |length| start + length);
    let number = NUMBERS[below(random, NUMBERS.len())];
    bytes.splice(start..end, number.bytes());
}
