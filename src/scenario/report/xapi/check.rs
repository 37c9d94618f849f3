//! What a learning record store would refuse is refused before.

use super::{Agent, XapiContext};
use crate::scenario::report::ReportError;

pub(super) fn check(actor: &Agent, context: &XapiContext) -> Result<(), ReportError> {
    agent("actor", actor)?;
    if let Some(instructor) = &context.instructor {
        agent("instructor", instructor)?;
    }
    demand("registration", &context.registration, is_uuid, "is no UUID, such as 6ba7b810-9dad-41d1-80b4-00c04fd430c8")?;
    demand("activity_iri", &context.activity_iri, is_iri, "is no absolute IRI, such as https://example.org/mastoid")?;
    demand(
        "timestamp",
        &context.timestamp,
        is_timestamp,
        "is no ISO 8601 time with a zone, such as 2026-11-23T08:00:00Z",
    )?;
    demand("language", &context.language, is_language, "is no language tag, such as en or de-CH")
}

fn demand(field: &'static str, text: &str, is: fn(&str) -> bool, reason: &str) -> Result<(), ReportError> {
    if is(text) {
        return Ok(());
    }
    let excerpt: String = text.chars().take(60).collect();
    Err(ReportError::Statement { field, reason: format!("{excerpt:?} {reason}") })
}

fn agent(field: &'static str, agent: &Agent) -> Result<(), ReportError> {
    let wrong = |reason: &str| Err(ReportError::Statement { field, reason: reason.to_string() });
    match (&agent.mbox, &agent.account) {
        _ if agent.object_type != "Agent" => wrong("its objectType is not Agent"),
        (Some(mbox), None) => demand(field, mbox, is_mail, "is no mail address after mailto:"),
        (None, Some(account)) if account.name.is_empty() => wrong("its account has no name"),
        (None, Some(account)) => {
            demand(field, &account.home_page, is_iri, "is no absolute IRI of an account's home page")
        }
        _ => wrong("it needs either a mail address or an account, and not both"),
    }
}

fn is_mail(mbox: &str) -> bool {
    let is_part = |part: &str| !part.is_empty() && !part.contains(|c: char| c.is_whitespace() || c == '@');
    let parts = mbox.strip_prefix("mailto:").and_then(|address| address.split_once('@'));
    parts.is_some_and(|(name, host)| is_part(name) && is_part(host))
}

fn is_uuid(text: &str) -> bool {
    let is_hyphen = |index| matches!(index, 8 | 13 | 18 | 23);
    let is_right = |(index, byte): (usize, u8)| if is_hyphen(index) { byte == b'-' } else { byte.is_ascii_hexdigit() };
    text.len() == 36 && text.bytes().enumerate().all(is_right)
}

/// A scheme, a colon and something, without what no IRI holds.
fn is_iri(text: &str) -> bool {
    let is_bad = |c: char| c.is_whitespace() || c.is_control() || "<>\"{}|\\^`".contains(c);
    text.split_once(':').is_some_and(|(scheme, rest)| {
        let is_scheme = scheme.starts_with(|c: char| c.is_ascii_alphabetic())
            && scheme.chars().all(|c| c.is_ascii_alphanumeric() || "+-.".contains(c));
        is_scheme && !rest.is_empty() && !text.contains(is_bad)
    })
}

/// `YYYY-MM-DDThh:mm:ss`, perhaps parts of a second, and `Z` or an offset (RFC 3339).
fn is_timestamp(text: &str) -> bool {
    // `-00:00` says that the zone is not known, which a statement must not.
    if !text.is_ascii() || text.len() < 20 || text.ends_with("-00:00") {
        return false;
    }
    let (stem, mut rest) = text.split_at(19);
    let fits = |text: &str, shape: &str| {
        let fits = |(byte, shape): (u8, u8)| if shape == b'0' { byte.is_ascii_digit() } else { byte == shape };
        text.len() == shape.len() && text.bytes().zip(shape.bytes()).all(fits)
    };
    if let Some(parts) = rest.strip_prefix('.') {
        let end = parts.find(|c: char| !c.is_ascii_digit()).unwrap_or(parts.len());
        if end == 0 {
            return false;
        }
        rest = &parts[end..];
    }
    let number =
        |range: std::ops::Range<usize>| stem.get(range).and_then(|digits| digits.parse::<u32>().ok()).unwrap_or(99);
    let is_zone = rest == "Z" || fits(rest, "+00:00") || fits(rest, "-00:00");
    let is_date = (1..=12).contains(&number(5..7)) && (1..=31).contains(&number(8..10));
    let is_time = number(11..13) < 24 && number(14..16) < 60 && number(17..19) <= 60;
    fits(stem, "0000-00-00T00:00:00") && is_zone && is_date && is_time
}

fn is_language(text: &str) -> bool {
    let is_part = |part: &str| (1..=8).contains(&part.len()) && part.bytes().all(|byte| byte.is_ascii_alphanumeric());
    text.split('-').all(is_part) && text.starts_with(|c: char| c.is_ascii_alphabetic())
}
