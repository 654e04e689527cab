//! From files to scenes.

mod anatomy;
mod scans;
mod surfaces;
