//! Screenshots, and recordings of the motion as animated images.

use anyhow::{Context, Result, anyhow};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::JoinHandle;
use viscera_cli::files::write_whole;
use viscera_picture::{Animation, Image, ImageSize, write_png};

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
    write_whole(path, &write_png(&image)?)
}

/// A recording in the making, compressed on a thread of its own.
#[derive(Debug)]
pub struct Recorder {
    path: PathBuf,
    pictures: Option<SyncSender<Image>>,
    thread: Option<JoinHandle<Result<u32>>>,
    /// The simulated time of the last picture [s].
    last: f64,
    /// Pictures that found no room.
    missed: u32,
}

impl Recorder {
    /// Begins a recording.
    pub fn start(path: PathBuf) -> Result<Self> {
        let (pictures, receive) = sync_channel(WAITING);
        let to = path.clone();
        let thread = std::thread::Builder::new()
            .name("recording".to_owned())
            .spawn(move || compress(&receive, &to))
            .context("cannot start a recording")?;
        let (pictures, thread) = (Some(pictures), Some(thread));
        Ok(Self { path, pictures, thread, last: f64::NEG_INFINITY, missed: 0 })
    }

    /// Where it will be.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Whether a picture is due at a simulated time [s].
    pub fn is_due(&self, time: f64) -> bool {
        // Time goes back at a reset.
        time >= self.last + RECORDED_EVERY - 1e-9 || time < self.last
    }

    /// Adds pictures, side by side.
    pub fn push(&mut self, images: &[Image], time: f64) -> Result<()> {
        self.last = time;
        let image = Image::tiled(images, images.len().max(1))?;
        if let Some(pictures) = &self.pictures
            && let Err(TrySendError::Full(_)) = pictures.try_send(image)
        {
            self.missed += 1;
        }
        Ok(())
    }

    /// Ends it and writes the file; what to tell a person.
    pub fn finish(mut self) -> Result<String> {
        let count = self.end()?;
        let mut told = format!("{}: {count} pictures", self.path.display());
        if self.missed > 0 {
            told.push_str(&format!("; {} were left out, this machine being busy", self.missed));
        }
        Ok(told)
    }

    fn end(&mut self) -> Result<u32> {
        self.pictures = None;
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

fn compress(pictures: &Receiver<Image>, path: &Path) -> Result<u32> {
    let mut animation: Option<(Animation, ImageSize)> = None;
    let mut count = 0;
    for image in pictures {
        let image = smaller(&image)?;
        if animation.is_none() {
            animation = Some((Animation::new(image.size(), RECORDED_EVERY)?, image.size()));
        }
        // A window that changes its size ends no recording: what does not fit is left out.
        if let Some((animation, size)) = &mut animation
            && image.size() == *size
        {
            animation.push(&image)?;
            count += 1;
        }
    }
    let Some((animation, _)) = animation else {
        return Err(anyhow!("nothing was recorded; let the simulation run while recording"));
    };
    write_whole(path, &animation.finish()?)?;
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

    #[test]
    fn a_recording_that_is_dropped_is_whole() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = free_name(folder.path(), "liver", "gif");
        let mut recorder = Recorder::start(path.clone()).expect("a recording");
        for step in 0..5u8 {
            let time = f64::from(step) * RECORDED_EVERY;
            assert!(recorder.is_due(time) && (step == 0 || !recorder.is_due(time - 0.01)));
            recorder.push(&[picture(40 * step), picture(200)], time).expect("room for a picture");
        }
        drop(recorder);
        let file = std::fs::File::open(&path).expect("the file");
        let mut decoder = gif::DecodeOptions::new().read_info(file).expect("a GIF");
        assert_eq!((decoder.width(), decoder.height()), (128, 32));
        let mut frames = 0;
        while decoder.read_next_frame().expect("a whole frame").is_some() {
            frames += 1;
        }
        assert_eq!(frames, 5);
        assert_eq!(free_name(folder.path(), "liver", "gif"), folder.path().join("liver-0002.gif"));
    }

    #[test]
    fn nothing_recorded_leaves_no_file() {
        let folder = tempfile::tempdir().expect("a folder");
        let recorder = Recorder::start(folder.path().join("x.gif")).expect("a recording");
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
