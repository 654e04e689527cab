//! Screenshots, and recordings of the motion as animated images. A recording keeps simulated time: it takes as long
//! as the motion does in the scene, however fast or slowly it was computed; what was paused takes no time.

use anyhow::{Context, Result, anyhow};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use viscera_picture::{Animation, Image, ImageSize, write_png};
use viscera_resources::files::write_atomic;

/// Where pictures go, in the folder that the program was started in.
pub const FOLDER: &str = "pictures";

/// Simulated time from one picture of a recording to the next [s]. Shorter is smoother, and a larger file.
pub const RECORDED_EVERY: f64 = 0.04;

/// The widest recording [pixels]: a web page's column.
const WIDEST: u32 = 960;

/// Pictures that wait to be compressed. More take memory, fewer lose more of them on a slow machine.
const WAITING: usize = 24;

/// The first free name: "pictures/liver-0001.png".
pub fn free_name(folder: &Path, stem: &str, ending: &str) -> PathBuf {
    (1..)
        .map(|number: u32| folder.join(format!("{stem}-{number:04}.{ending}")))
        .find(|path| !path.exists())
        .unwrap_or_else(|| folder.join(format!("{stem}.{ending}")))
}

/// Puts pictures side by side and writes them as one PNG file.
pub fn save_picture(images: &[Image], path: &Path) -> Result<()> {
    let image = Image::tiled(images, images.len().max(1))?;
    write_atomic(path, &write_png(&image)?)
}

/// A recording in the making, compressed on a thread of its own.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    pictures: Option<SyncSender<Sheet>>,
    thread: Option<JoinHandle<Result<u32>>>,
    /// Simulated time of a frame: the last picture stays for as long [s].
    frame: f64,
    /// Simulated time now, and of the last picture [s].
    now: f64,
    last: f64,
    /// Simulated time so far, of all motions that were begun [s].
    recorded: f64,
    /// Pictures that found no room.
    missed: u32,
}

/// What is sent to be compressed.
enum Sheet {
    /// A picture, and its simulated time [s].
    Picture(Image, f64),
    /// So long the last one stays [s].
    Held(f64),
}

impl Recorder {
    /// Begins a recording of simulations whose frames take so long [s].
    pub fn start(path: PathBuf, frame: f64) -> Result<Self> {
        let (pictures, receive) = sync_channel(WAITING);
        let to = path.clone();
        let thread = std::thread::Builder::new()
            .name("recording".to_owned())
            .spawn(move || compress(&receive, &to))
            .context("cannot start a recording")?;
        let (pictures, thread) = (Some(pictures), Some(thread));
        let (now, last) = (f64::NEG_INFINITY, f64::NEG_INFINITY);
        Ok(Self { path, pictures, thread, frame, now, last, recorded: 0.0, missed: 0 })
    }

    /// Where it will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Simulated time [s] has gone on: whether a picture is due.
    pub fn is_due(&mut self, time: f64) -> bool {
        // It goes back at a reset.
        let begins = !self.now.is_finite() || time < self.now;
        self.recorded += if begins { 0.0 } else { time - self.now };
        self.now = time;
        begins || time >= self.last + RECORDED_EVERY - 1e-9
    }

    /// Adds pictures, side by side.
    pub fn push(&mut self, images: &[Image], time: f64) -> Result<()> {
        self.last = time;
        let image = Image::tiled(images, images.len().max(1))?;
        if let Some(pictures) = &self.pictures
            && let Err(TrySendError::Full(_)) = pictures.try_send(Sheet::Picture(image, time))
        {
            self.missed += 1;
        }
        Ok(())
    }

    /// Ends it and writes the file; returns a summary for the user.
    pub fn finish(mut self) -> Result<String> {
        let count = self.end()?;
        let path = self.path.display();
        let seconds = self.recorded + self.frame;
        let mut summary = format!("{path}: {count} pictures, {seconds:.2} s of simulated time");
        if self.missed > 0 {
            summary.push_str(&format!("; {} were left out, this machine being busy", self.missed));
        }
        Ok(summary)
    }

    fn end(&mut self) -> Result<u32> {
        if let Some(pictures) = self.pictures.take() {
            // A thread that has broken off says why when it is joined.
            let _ = pictures.send(Sheet::Held(self.now - self.last + self.frame));
        }
        match self.thread.take() {
            Some(thread) => {
                thread.join().unwrap_or_else(|_| Err(anyhow!("the recording broke off")))
            }
            None => Ok(0),
        }
    }
}

impl Drop for Recorder {
    /// A window that is closed while it records leaves a whole file.
    fn drop(&mut self) {
        if self.thread.is_some()
            && let Err(error) = self.end()
        {
            eprintln!("error: {}: {error:#}", self.path.display());
        }
    }
}

fn compress(sheets: &Receiver<Sheet>, path: &Path) -> Result<u32> {
    let mut animation: Option<(Animation, ImageSize)> = None;
    let (mut count, mut held) = (0, 0.0);
    for sheet in sheets {
        let (image, time) = match sheet {
            Sheet::Picture(image, time) => (smaller(&image)?, time),
            Sheet::Held(seconds) => {
                held = seconds;
                continue;
            }
        };
        if animation.is_none() {
            animation = Some((Animation::new(image.size())?, image.size()));
        }
        // A window that changes its size ends no recording: what does not fit is left out.
        if let Some((animation, size)) = &mut animation
            && image.size() == *size
        {
            animation.push(&image, time)?;
            count += 1;
        }
    }
    let Some((animation, _)) = animation else {
        return Err(anyhow!("nothing was recorded; let the simulation run while recording"));
    };
    write_atomic(path, &animation.finish(held)?)?;
    Ok(count)
}

/// Means over squares of pixels, so that the picture is at most [`WIDEST`].
fn smaller(image: &Image) -> Result<Image> {
    let size = image.size();
    let by = size.width().div_ceil(WIDEST);
    if by <= 1 {
        return Ok(image.clone());
    }
    let (width, height) = (size.width() / by, size.height() / by);
    let mut pixels = Vec::with_capacity((width * height) as usize);
    for y in 0..height {
        for x in 0..width {
            let mut sum = [0u32; 3];
            for (dy, dx) in (0..by).flat_map(|dy| (0..by).map(move |dx| (dy, dx))) {
                let pixel = image.pixels()[((by * y + dy) * size.width() + by * x + dx) as usize];
                (0..3).for_each(|c| sum[c] += u32::from(pixel[c]));
            }
            pixels.push(sum.map(|sum| (sum / (by * by)) as u8));
        }
    }
    Image::from_pixels(ImageSize::new(width, height)?, pixels).context("a picture of another size")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(grey: u8) -> Image {
        Image::filled(ImageSize::new(64, 32).expect("a size"), [grey; 3])
    }

    /// Delays of a GIF [s] and its size.
    fn decode(path: &Path) -> (Vec<f64>, [u16; 2]) {
        let file = std::fs::File::open(path).expect("the file");
        let mut decoder = gif::DecodeOptions::new().read_info(file).expect("a GIF");
        let mut delays = Vec::new();
        while let Some(frame) = decoder.read_next_frame().expect("a whole frame") {
            delays.push(f64::from(frame.delay) / 100.0);
        }
        (delays, [decoder.width(), decoder.height()])
    }

    /// Follows a simulation whose frames take so long [s] and are all seen but for every `unseen`th.
    fn follow(recorder: &mut Recorder, frame: f64, count: u32, unseen: u32) -> u32 {
        let mut taken = 0;
        for number in (0..=count).filter(|number| !(number + 1).is_multiple_of(unseen)) {
            let time = f64::from(number) * frame;
            if recorder.is_due(time) {
                recorder.push(&[picture(number as u8), picture(200)], time).expect("room");
                taken += 1;
            }
        }
        taken
    }

    #[test]
    fn a_recording_takes_as_long_as_the_motion() {
        let folder = tempfile::tempdir().expect("a folder");
        // Sixty frames a second, forty, and one computed so slowly that ten are seen.
        for (frame, count) in [(1.0 / 60.0, 40), (0.025, 30), (0.1, 9)] {
            let path = free_name(folder.path(), "liver", "gif");
            let mut recorder = Recorder::start(path.clone(), frame).expect("a recording");
            let taken = follow(&mut recorder, frame, count, 7);
            let summary = recorder.finish().expect("a file");
            let (delays, size) = decode(&path);
            let sum = delays.iter().sum::<f64>();
            let wanted = f64::from(count + 1) * frame;
            assert!((sum - wanted).abs() < 0.01, "{sum} s for {wanted} s");
            assert_eq!((delays.len(), size), (taken as usize, [128, 32]));
            assert!(summary.contains(&format!("{wanted:.2} s of simulated time")), "{summary}");
        }
    }

    #[test]
    fn a_recording_that_is_dropped_is_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = free_name(folder.path(), "liver", "gif");
        let mut recorder = Recorder::start(path.clone(), 0.02).expect("a recording");
        // Begun again in between.
        let taken = (0..2).map(|_| follow(&mut recorder, RECORDED_EVERY, 4, 100)).sum::<u32>();
        drop(recorder);
        assert_eq!((taken, decode(&path).0.len()), (10, 10));
        assert_eq!(free_name(folder.path(), "liver", "gif"), folder.path().join("liver-0002.gif"));
    }

    #[test]
    fn nothing_recorded_leaves_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let recorder = Recorder::start(folder.path().join("x.gif"), 0.02).expect("a recording");
        assert!(recorder.finish().is_err());
        assert_eq!(std::fs::read_dir(folder.path()).expect("the folder").count(), 0);
    }

    #[test]
    fn a_wide_picture_is_made_smaller_by_whole_numbers() {
        let wide = Image::filled(ImageSize::new(2000, 100).expect("a size"), [7, 8, 9]);
        let small = smaller(&wide).expect("a picture");
        assert_eq!((small.size().width(), small.size().height()), (666, 33));
        assert!(small.pixels().iter().all(|pixel| *pixel == [7, 8, 9]));
    }
}
