//! Words and names of a file as they are shown to people: short, and on one line of a terminal.

/// Enough of a word to recognise it.
pub(super) fn shorten(word: &[u8]) -> String {
    cut(word, 40)
}

/// A name of a file as it is shown, and found by: whole, but for damage.
pub(super) fn name_of(text: &str) -> String {
    cut(text.as_bytes(), 200)
}

/// So many bytes of a text, for one line of a terminal.
fn cut(text: &[u8], shown: usize) -> String {
    let start = String::from_utf8_lossy(&text[..text.len().min(shown)]);
    printable(&start) + if text.len() > shown { "..." } else { "" }
}

/// A text without characters that could rewrite the terminal which shows it, or break its line.
pub(super) fn printable(text: &str) -> String {
    let is_unprintable = |c: char| {
        // Separators of lines, and turns of the direction of writing.
        c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.replace(is_unprintable, "?")
}
