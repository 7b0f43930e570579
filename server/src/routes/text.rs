//! What people type, checked once. Nothing is escaped here: text stays text, and pages show it as text.

use crate::error::{Error, Result};

/// One line without control characters, not empty, of at most `most` characters; spaces around it are taken off.
pub(super) fn one_line(field: &str, text: &str, most: usize) -> Result<String> {
    let text = text.trim();
    if text.is_empty() {
        return Err(refused(field, "must not be empty"));
    }
    if text.chars().any(char::is_control) {
        return Err(refused(field, "must be one line without control characters"));
    }
    at_most(field, text, most)
}

/// Any lines, may be empty; other control characters than line ends and tabs are refused.
pub(super) fn lines(field: &str, text: &str, most: usize) -> Result<String> {
    if text.chars().any(|c| c.is_control() && !matches!(c, '\n' | '\r' | '\t')) {
        return Err(refused(field, "must not contain control characters"));
    }
    at_most(field, text.trim(), most)
}

fn at_most(field: &str, text: &str, most: usize) -> Result<String> {
    if text.chars().count() > most {
        return Err(refused(field, &format!("must have at most {most} characters")));
    }
    Ok(text.to_string())
}

/// The name of an account.
pub fn account_name(text: &str) -> Result<String> {
    let name = one_line("name", text, 64)?;
    let good = |c: char| c.is_alphanumeric() || matches!(c, ' ' | '.' | '_' | '-' | '@' | '+');
    if name.chars().all(good) {
        Ok(name)
    } else {
        Err(refused("name", "may have letters, digits, and . _ - @ +"))
    }
}

/// A file name without a path, safe in an address, in a header and on any disk; the ending is kept.
pub(super) fn file_name(text: &str, otherwise: &str) -> String {
    let last = text.rsplit(['/', '\\']).next().unwrap_or_default();
    let safe = |c: char| if c.is_ascii_alphanumeric() || matches!(c, '.' | '-' | '_') { c } else { '_' };
    let name: String = last.chars().map(safe).collect();
    let name = name.trim_start_matches(['.', '_']);
    // Safe text is ASCII, so bytes are characters.
    let name = &name[name.len().saturating_sub(100)..];
    let name = name.trim_start_matches(['.', '_']);
    if name.is_empty() { otherwise.to_string() } else { name.to_string() }
}

pub(super) fn refused(field: &str, what: &str) -> Error {
    Error::unprocessable("bad_field", format!("{field} {what}."))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_files_have_no_way_out() {
        let check = |sent: &str, expected: &str| assert_eq!(file_name(sent, "model.asc"), expected, "{sent}");
        check("model.ply", "model.ply");
        check("../../etc/passwd", "passwd");
        check("C:\\scans\\mug.asc", "mug.asc");
        check("..", "model.asc");
        check("a\r\nSet-Cookie: x.ply", "a__Set-Cookie__x.ply");
        check("Tasse\u{202e}ylp.exe", "Tasse_ylp.exe");
        check("", "model.asc");
        assert_eq!(file_name(&"x".repeat(500), "m").len(), 100);
    }

    #[test]
    fn html_stays_text() {
        assert_eq!(one_line("title", " <b>Mug</b> ", 20).unwrap(), "<b>Mug</b>");
        assert!(one_line("title", "a\nb", 20).is_err());
        assert!(one_line("title", "  ", 20).is_err());
        assert!(lines("description", "a\nb\0", 20).is_err());
        assert!(account_name("ann<script>").is_err());
    }
}
