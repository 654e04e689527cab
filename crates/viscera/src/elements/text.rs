//! Texts of kernels as a device compiles them: without comments, which every page would load for nothing. Lines keep their numbers.

/// The bytes of a text that are no part of a comment.
pub const fn length(text: &str) -> usize {
    let (bytes, mut at, mut kept) = (text.as_bytes(), 0, 0);
    while at < bytes.len() {
        at = after_comment(bytes, at);
        if at < bytes.len() {
            (at, kept) = (at + 1, kept + 1);
        }
    }
    kept
}

/// Those bytes, `N` being their number.
pub const fn without_comments<const N: usize>(text: &str) -> [u8; N] {
    let (bytes, mut at, mut kept) = (text.as_bytes(), 0, 0);
    let mut all = [0; N];
    while kept < N {
        at = after_comment(bytes, at);
        all[kept] = bytes[at];
        (at, kept) = (at + 1, kept + 1);
    }
    all
}

/// The end of the line where a comment begins at a place, else the place. WGSL has no texts in which slashes could stand.
const fn after_comment(bytes: &[u8], mut at: usize) -> usize {
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
            $crate::elements::text::without_comments(WHOLE);
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
    fn comments_are_left_out_and_lines_stay() {
        const TEXT: &str = "// equation: a / b\nlet x = 1.0 / y; // of µ\n\n//\nfn f() {}//";
        const SHORT: [u8; length(TEXT)] = without_comments(TEXT);
        assert_eq!(str::from_utf8(&SHORT), Ok("\nlet x = 1.0 / y; \n\n\nfn f() {}"));
        let kernel = kernel_text!("mod.wgsl", "kinds.wgsl");
        let whole = concat!(include_str!("mod.wgsl"), include_str!("kinds.wgsl"));
        assert_eq!(kernel.lines().count(), whole.lines().count());
        assert!(!kernel.contains("//") && kernel.len() < whole.len());
        let code = |text: &str| -> Vec<String> {
            let before = |line: &str| line.split("//").next().unwrap_or("").to_owned();
            text.lines().map(before).collect()
        };
        assert_eq!(code(kernel), code(whole));
    }
}
