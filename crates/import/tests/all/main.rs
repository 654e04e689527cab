//! From files to scenes.

mod anatomy;
mod labels;
mod scans;
mod surfaces;
