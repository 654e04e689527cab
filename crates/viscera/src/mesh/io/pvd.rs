//! ParaView data: one file that lists the files of a time series.

use std::fmt::Write;

/// The text of a `.pvd` file for frames given as time `[s]` and path relative to it.
pub fn write(frames: &[(f64, &str)]) -> String {
    let mut text = String::from(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"0.1\">\n<Collection>\n",
    );
    for (time, file) in frames {
        let file = escape_xml(file);
        // Writing to a string cannot fail.
        let _ = writeln!(text, "<DataSet timestep=\"{time:?}\" part=\"0\" file=\"{file}\"/>");
    }
    text.push_str("</Collection>\n</VTKFile>\n");
    text
}

/// A text as the value of an XML attribute.
pub(super) fn escape_xml(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            // Not allowed in XML at all, not even escaped.
            control if control.is_control() => escaped.push(' '),
            other => escaped.push(other),
        }
    }
    escaped
}
