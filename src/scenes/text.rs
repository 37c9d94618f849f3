//! Where the components stand in the text of a saved scene.

use std::ops::Range;

/// An entry of the map of an entity's components, or of the resources.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Entry {
    /// The type path.
    pub path: String,
    /// Where that stands, between its quotes.
    pub path_at: Range<usize>,
    /// Where the value stands; to the end where the text is cut off.
    pub value_at: Range<usize>,
}

/// What a text is made of, as far as that matters here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Token<'a> {
    Open(u8),
    Close(u8),
    Colon,
    Comma,
    /// A text between quotes.
    Quoted(&'a str),
    /// A name or number.
    Word(&'a str),
}

/// The tokens of a RON text and where they begin. Comments are left out.
struct Tokens<'a> {
    text: &'a str,
    at: usize,
}

impl<'a> Iterator for Tokens<'a> {
    type Item = (Token<'a>, usize);

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let rest = &self.text[self.at..];
            let first = rest.chars().next()?;
            let start = self.at;
            if rest.starts_with("//") {
                self.at += rest.find('\n').unwrap_or(rest.len());
                continue;
            }
            if rest.starts_with("/*") {
                self.at += comment_length(rest);
                continue;
            }
            let token = match first {
                '(' | '[' | '{' => Token::Open(first as u8),
                ')' | ']' | '}' => Token::Close(first as u8),
                ':' => Token::Colon,
                ',' => Token::Comma,
                '"' => {
                    let length = quoted_length(rest);
                    self.at += length;
                    return Some((Token::Quoted(rest[1..length].trim_end_matches('"')), start));
                }
                // `r#None` is a name: so RON writes one that it has a meaning of its own for.
                'r' if rest[1..].trim_start_matches('#').starts_with('"') => {
                    self.at += raw_length(rest);
                    return Some((Token::Word(&rest[..self.at - start]), start));
                }
                '\'' => {
                    // A letter: its quote may be one itself.
                    let escaped = usize::from(rest[1..].starts_with('\\'));
                    let letters = rest.char_indices().skip(2 + escaped);
                    self.at += letters.clone().find(|(_, c)| *c == '\'').map_or(rest.len(), |(at, _)| at + 1);
                    return Some((Token::Word(&rest[..self.at - start]), start));
                }
                c if is_word(c) => {
                    let length = rest.find(|c| !is_word(c)).unwrap_or(rest.len());
                    self.at += length;
                    return Some((Token::Word(&rest[..length]), start));
                }
                c => {
                    self.at += c.len_utf8();
                    continue;
                }
            };
            self.at += 1;
            return Some((token, start));
        }
    }
}

fn is_word(c: char) -> bool {
    c.is_alphanumeric() || matches!(c, '_' | '.' | '+' | '-' | '#')
}

/// Length of a comment that may hold others.
fn comment_length(text: &str) -> usize {
    let (mut depth, mut at) = (0_usize, 0);
    while at < text.len() {
        let rest = &text.as_bytes()[at..];
        if rest.starts_with(b"/*") {
            (depth, at) = (depth + 1, at + 2);
        } else if rest.starts_with(b"*/") {
            (depth, at) = (depth - 1, at + 2);
            if depth == 0 {
                return at;
            }
        } else {
            at += 1;
        }
    }
    text.len()
}

/// Length of a text in quotes with both of them.
fn quoted_length(text: &str) -> usize {
    let mut is_escaped = false;
    for (at, byte) in text.bytes().enumerate().skip(1) {
        match byte {
            _ if is_escaped => is_escaped = false,
            b'\\' => is_escaped = true,
            b'"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Length of a raw text, `r#".."#`.
fn raw_length(text: &str) -> usize {
    let hashes = text[1..].bytes().take_while(|byte| *byte == b'#').count();
    let end = format!("\"{}", "#".repeat(hashes));
    let from = (2 + hashes).min(text.len());
    text[from..].find(&end).map_or(text.len(), |at| from + at + end.len())
}

/// The resources and components of a scene's text. Of a text that is none, what looks like them.
pub(super) fn entries(text: &str) -> Vec<Entry> {
    let mut found: Vec<Entry> = Vec::new();
    // The brackets that are open, as far as they were opened before the entry that is read.
    let mut opened: Vec<u8> = Vec::new();
    // The depth within the entry that is read.
    let mut inside: Option<usize> = None;
    let mut key: Option<(&str, usize)> = None;
    for (token, at) in (Tokens { text, at: 0 }) {
        if let Some(within) = &mut inside {
            let ends = match token {
                Token::Open(_) => {
                    *within += 1;
                    false
                }
                Token::Close(_) if *within == 0 => true,
                Token::Close(_) => {
                    *within -= 1;
                    false
                }
                Token::Comma => *within == 0,
                _ => false,
            };
            if !ends {
                continue;
            }
            inside = None;
            if let Some(entry) = found.last_mut() {
                entry.value_at.end = at;
            }
        }
        match token {
            Token::Open(bracket) => {
                opened.push(bracket);
                key = None;
            }
            Token::Close(_) => {
                opened.pop();
                key = None;
            }
            Token::Quoted(path) if opened.last() == Some(&b'{') => key = Some((path, at + 1)),
            Token::Colon => {
                if let Some((path, start)) = key.take() {
                    let path_at = start..start + path.len();
                    found.push(Entry { path: path.into(), path_at, value_at: at + 1..text.len() });
                    inside = Some(0);
                }
            }
            _ => key = None,
        }
    }
    found
}

/// Where the fields of a value stand that have a name: those of the value itself, and not of what is in them.
pub(super) fn fields(text: &str, value_at: &Range<usize>, name: &str) -> Vec<Range<usize>> {
    let mut found = Vec::new();
    let (mut depth, mut word) = (0_usize, None);
    for (token, at) in (Tokens { text: &text[..value_at.end], at: value_at.start }) {
        match token {
            Token::Open(_) => depth += 1,
            Token::Close(_) => depth = depth.saturating_sub(1),
            Token::Colon if depth == 1 => found.extend(word.take()),
            _ => {}
        }
        word = match token {
            Token::Word(found) if found == name => Some(at..at + name.len()),
            _ => None,
        };
    }
    found
}

/// Byte at which a line and column begin, both from 1; columns count characters.
pub(super) fn byte_of(text: &str, line: usize, column: usize) -> usize {
    let mut start = 0;
    for (number, content) in text.split_inclusive('\n').enumerate() {
        if number + 1 == line {
            let within = content.char_indices().nth(column.saturating_sub(1)).map_or(content.len(), |(at, _)| at);
            return start + within;
        }
        start += content.len();
    }
    text.len()
}

/// Line of a byte, from 1.
pub(super) fn line_of(text: &str, byte: usize) -> usize {
    1 + text.as_bytes()[..byte.min(text.len())].iter().filter(|byte| **byte == b'\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    const SCENE: &str = r###"(
  resources: { "a::Version": (major: 0) }, // "no::Entry": (
  entities: {
    7: (components: {
      "a::B": (text: "x\": {", map: {"not::One": 1}, letter: '"'),
      "a::C": Named(1.0, [2, 3], r#None) /* "no::Other": ( /* nested */ */,
      "a::D": (),
    }),
    8: (components: {"a::B": (text: r#" "}"#, "###;

    #[test]
    fn entries_are_the_components_and_nothing_in_them() {
        let text = format!("{SCENE}{}", "map: (text: 2))})})");
        let found = entries(&text);
        let paths: Vec<&str> = found.iter().map(|entry| &*entry.path).collect();
        assert_eq!(paths, ["a::Version", "a::B", "a::C", "a::D", "a::B"]);
        for entry in &found {
            assert_eq!(text[entry.path_at.clone()], entry.path);
        }
        assert_eq!(
            text[found[2].value_at.clone()].trim(),
            "Named(1.0, [2, 3], r#None) /* \"no::Other\": ( /* nested */ */"
        );
        assert_eq!(text[found[3].value_at.clone()].trim(), "()");
        let named = fields(&text, &found[4].value_at, "text");
        assert_eq!(named.len(), 1, "the one in the map is another's");
        assert_eq!(&text[named[0].clone()], "text");
    }

    #[test]
    fn no_text_can_break_it() {
        let text = format!("{SCENE}ü'\\''\"ß\\");
        for end in (0..=text.len()).filter(|end| text.is_char_boundary(*end)) {
            for entry in entries(&text[..end]) {
                fields(&text[..end], &entry.value_at, "text");
            }
        }
    }

    #[test]
    fn lines_and_columns_lead_to_bytes_and_back() {
        let text = "ab\nüx\n";
        assert_eq!(byte_of(text, 2, 2), 5);
        assert_eq!(line_of(text, 5), 2);
        assert_eq!(byte_of(text, 9, 9), text.len());
    }
}
