//! The film of a run: frames are remembered while the scene runs and drawn afterwards, when it is
//! known how far everything moves, so that camera and colours stay the same throughout.

use crate::in_order::make_in_order;
use crate::output::OutputFolder;
use anyhow::Result;
use indicatif::ProgressBar;
use std::sync::atomic::{AtomicBool, Ordering};
use viscera::scalar::Real;
use viscera::simulation::{FrameReport, Simulation};
use viscera_picture::{
    Animation, ImageSize, Look, Medium, PictureError, Seen, Shot, Subject, write_png,
};

/// Frames of the animated image. More make the file large, fewer make it jerky.
const MOST_FRAMES: u64 = 75;

/// Width of the animated image [pixels]: a web page's column.
const ANIMATION_WIDTH: u32 = 640;

/// Pictures from which the animation takes its colours, evenly through its time: a motion shows new colours slowly.
const SAMPLES: usize = 4;

/// How long the last frame stays before the animation begins again [s].
const LAST_FRAME_HELD: f64 = 1.5;

/// Remembered frames.
pub struct Film {
    subject: Subject,
    size: ImageSize,
    every: u64,
    /// The moment of the still picture [s]; the last one where unset.
    still: Option<f64>,
    shots: Vec<Shot>,
}

impl Film {
    /// For a simulation of so many frames.
    pub fn new<S: Real>(simulation: &Simulation<S>, frames: u64) -> Result<Self> {
        let output = &simulation.scene().output;
        let [width, height] = output.picture_size;
        Ok(Self {
            subject: Subject::of(simulation),
            size: ImageSize::new(width, height)?,
            every: frames.div_ceil(MOST_FRAMES).max(1),
            still: output.picture_time,
            shots: Vec::new(),
        })
    }

    /// Remembers a frame where the film needs it; `last` is needed always.
    pub fn push<S: Real>(&mut self, simulation: &Simulation<S>, report: &FrameReport, last: bool) {
        if last || simulation.frame().is_multiple_of(self.every) {
            self.shots.push(self.subject.shot(simulation, report));
        }
    }

    /// Number of pictures to draw, the still one included.
    pub fn picture_count(&self) -> u64 {
        self.shots.len() as u64 + 1
    }

    /// Draws `picture.png` and `motion.gif` on all processors. Returns false where an interruption left the animation
    /// undone.
    pub fn develop(
        &self,
        out: &OutputFolder,
        progress: &ProgressBar,
        interrupted: &AtomicBool,
    ) -> Result<bool> {
        let Some(last) = self.shots.last() else { return Ok(true) };
        let distance = |shot: &Shot| self.still.map_or(0.0, |time| (shot.time - time).abs());
        // Without a wish all are equally near, and the last stays.
        let shown = self
            .shots
            .iter()
            .fold(last, |best, shot| if distance(shot) < distance(best) { shot } else { best });
        let [still, film] =
            [Medium::Picture, Medium::Film].map(|medium| self.subject.look(&self.shots, medium));
        let (still, film) = (still?, film?);
        let draw = |look: &Look, shot: &Shot, seen: &Seen| {
            let drawn = look.draw(shot, seen);
            progress.inc(1);
            drawn
        };
        let (large, small) = (still.seen_at(self.size)?, film.seen_at(self.small_size()?)?);
        let goes_on = || !interrupted.load(Ordering::Relaxed);
        // The still picture, and those from which the animation takes its colours.
        let samples = self.samples();
        let mut drawn = Vec::new();
        let first = |number: usize| match number.checked_sub(1) {
            Some(sample) => Ok((draw(&film, &self.shots[samples[sample]], &small)?, None)),
            None => {
                let picture = draw(&still, shown, &large)?;
                let png = write_png(&picture)?;
                Ok((picture, Some(png)))
            }
        };
        let is_whole = make_in_order(1 + samples.len(), first, |made: Result<_, PictureError>| {
            match made? {
                (_, Some(png)) => out.write("picture.png", &png)?,
                (sample, None) => drawn.push(sample),
            }
            Ok(goes_on())
        })?;
        if !is_whole {
            return Ok(false);
        }
        let mut animation = Animation::in_colors_of(&drawn, small.size())?;
        let picture = |number: usize| match samples.binary_search(&number) {
            Ok(sample) => Ok(drawn[sample].clone()),
            Err(_) => draw(&film, &self.shots[number], &small),
        };
        let mut times = self.shots.iter().map(|shot| shot.time);
        let pictures = self.shots.len();
        let is_whole = make_in_order(pictures, picture, |image: Result<_, PictureError>| {
            animation.push(&image?, times.next().unwrap_or_default())?;
            Ok(goes_on())
        })?;
        if is_whole {
            out.write("motion.gif", &animation.finish(LAST_FRAME_HELD)?)?;
        }
        Ok(is_whole)
    }

    /// The shots from which the animation takes its colours, ascending; the last is one.
    fn samples(&self) -> Vec<usize> {
        let (shots, count) = (self.shots.len(), SAMPLES.min(self.shots.len()));
        (1..=count).map(|k| k * shots / count - 1).collect()
    }

    fn small_size(&self) -> Result<ImageSize> {
        let (width, height) = (self.size.width(), self.size.height());
        if width <= ANIMATION_WIDTH {
            return Ok(self.size);
        }
        // Both sizes are a few thousand pixels at most.
        let height = (height * ANIMATION_WIDTH).div_ceil(width).max(16);
        Ok(ImageSize::new(ANIMATION_WIDTH, height)?)
    }
}
