//! Texts of kernels as a device compiles them: without comments and indents, which every page would load for nothing. Lines keep
//! their numbers.

/// The bytes of a text that are no part of a comment or an indent.
pub const fn length(text: &str) -> usize {
    let (bytes, mut at, mut kept) = (text.as_bytes(), 0, 0);
    while at < bytes.len() {
        at = next(bytes, at);
        if at < bytes.len() {
            (at, kept) = (at + 1, kept + 1);
        }
    }
    kept
}

/// Those bytes, `N` being their number.
pub const fn shortened<const N: usize>(text: &str) -> [u8; N] {
    let (bytes, mut at, mut kept) = (text.as_bytes(), 0, 0);
    let mut all = [0; N];
    while kept < N {
        at = next(bytes, at);
        all[kept] = bytes[at];
        (at, kept) = (at + 1, kept + 1);
    }
    all
}

/// The next place from one on that is kept: behind an indent, and at the end of the line where a comment begins. WGSL has no texts in
/// which slashes could stand.
const fn next(bytes: &[u8], mut at: usize) -> usize {
    if at == 0 || bytes[at - 1] == b'\n' {
        while at < bytes.len() && bytes[at] == b' ' {
            at += 1;
        }
    }
    if at + 1 < bytes.len() && bytes[at] == b'/' && bytes[at + 1] == b'/' {
        while at < bytes.len() && bytes[at] != b'\n' {
            at += 1;
        }
    }
    at
}

/// The text of files beside the one that asks, in a row.
macro_rules! kernel_text {
    ($($file:literal),+) => {{
        const WHOLE: &str = concat!($(include_str!($file)),+);
        const TEXT: [u8; $crate::elements::text::length(WHOLE)] =
            $crate::elements::text::shortened(WHOLE);
        const SHORT: &str = match core::str::from_utf8(&TEXT) {
            Ok(text) => text,
            Err(_) => WHOLE,
        };
        SHORT
    }};
}

pub(crate) use kernel_text;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_indents_are_left_out_and_lines_stay() {
        const TEXT: &str =
            "  // equation: a / b\n  let x = 1.0 / y; // of µ\n\n    //\nfn f() {}//";
        const SHORT: [u8; length(TEXT)] = shortened(TEXT);
        assert_eq!(str::from_utf8(&SHORT), Ok("\nlet x = 1.0 / y; \n\n\nfn f() {}"));
        let kernel = kernel_text!("mod.wgsl", "kinds.wgsl");
        let whole = concat!(include_str!("mod.wgsl"), include_str!("kinds.wgsl"));
        assert_eq!(kernel.lines().count(), whole.lines().count());
        assert!(!kernel.contains("//") && kernel.len() < whole.len());
        let code = |text: &str| -> Vec<String> {
            let before = |line: &str| {
                line.split("//").next().unwrap_or("").trim_start_matches(' ').to_owned()
            };
            text.lines().map(before).collect()
        };
        assert_eq!(code(kernel), code(whole));
    }
}
