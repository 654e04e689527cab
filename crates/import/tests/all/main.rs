//! From files to scenes.

mod anatomy;
mod boundary;
mod labels;
mod scans;
mod surfaces;
