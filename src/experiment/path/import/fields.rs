//! The columns of a line.

/// What stands between the columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Separator {
    /// Spaces and tabs, any number of them.
    Space,
    Comma,
    Semicolon,
    /// Any of these.
    Any,
}

impl Separator {
    /// That of a line of numbers.
    pub fn of(line: &str) -> Self {
        if line.contains(';') {
            Self::Semicolon
        } else if line.contains(',') {
            Self::Comma
        } else {
            Self::Space
        }
    }

    /// The columns without white space and quotes around them.
    pub fn split(self, line: &str) -> Vec<&str> {
        match self {
            Self::Space => line.split_whitespace().map(unquoted).collect(),
            Self::Comma => line.split(',').map(unquoted).collect(),
            Self::Semicolon => line.split(';').map(unquoted).collect(),
            Self::Any => line
                .split(|c: char| c.is_whitespace() || matches!(c, ',' | ';'))
                .filter(|field| !field.is_empty())
                .map(unquoted)
                .collect(),
        }
    }
}

fn unquoted(field: &str) -> &str {
    let field = field.trim();
    let quoted = |mark| field.strip_prefix(mark).and_then(|field| field.strip_suffix(mark));
    quoted('"').or_else(|| quoted('\'')).unwrap_or(field).trim()
}

/// How many columns a line has up to the last that is not empty: loggers end lines with separators.
pub(super) fn filled(fields: &[&str]) -> usize {
    fields.iter().rposition(|field| !field.is_empty()).map_or(0, |last| last + 1)
}
