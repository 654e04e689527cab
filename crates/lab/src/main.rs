//! The program `viscera-lab`.

fn main() {}
