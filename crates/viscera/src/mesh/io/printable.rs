//! Text of a file for people.

/// A text without characters that could rewrite the terminal which shows it, or break its line.
pub(super) fn printable(text: &str) -> String {
    let is_unprintable = |c: char| {
        // Separators of lines, and turns of the direction of writing.
        c.is_control() || matches!(c, '\u{2028}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
    };
    text.replace(is_unprintable, "?")
}
