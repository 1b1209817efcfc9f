//! What errors show of a file: little, whatever is in it.

/// What an error shows of a text: a word or a line of a damaged file can be the whole file.
pub(in crate::experiment) fn beginning(text: &str) -> String {
    text.chars().take(40).collect()
}

/// A number in few digits: the largest have 300 before the point, and the smallest as many behind it.
pub(in crate::experiment) fn few(number: f64) -> String {
    let text = number.to_string();
    if text.len() > 24 { format!("{number:e}") } else { text }
}
