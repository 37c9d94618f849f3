//! Texts and numbers of the page. Whatever comes from a log passes through [`escape`].

use crate::scenario::metrics::MetricKind;

/// A text that is only a text in HTML and SVG: no markup, no control characters, none that turn the direction of what follows.
pub(super) fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            '\'' => escaped += "&#39;",
            '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}' | '\u{fffe}' | '\u{ffff}' => {}
            letter if letter.is_control() => escaped.push(' '),
            letter => escaped.push(letter),
        }
    }
    escaped
}

/// At most so many letters of a text, escaped: for labels in drawings.
pub(super) fn label(text: &str, most: usize) -> String {
    if text.chars().count() <= most {
        return escape(text);
    }
    let short: String = text.chars().take(most.saturating_sub(1)).collect();
    format!("{}…", escape(short.trim_end()))
}

/// A number with about three digits that count.
pub(super) fn number(value: f64) -> String {
    let size = value.abs();
    let text = match size {
        _ if !value.is_finite() => return "–".to_string(),
        _ if size == 0.0 => return "0".to_string(),
        _ if !(1e-4..1e7).contains(&size) => format!("{value:.2e}"),
        _ if size >= 99.95 => format!("{value:.0}"),
        _ if size >= 9.995 => format!("{value:.1}"),
        _ if size >= 0.9995 => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    };
    text.replace('-', "−")
}

/// A number without zeros behind its point: for what people chose, such as limits and ticks.
pub(super) fn short(value: f64) -> String {
    let text = number(value);
    if text.contains('.') && !text.contains('e') {
        text.trim_end_matches('0').trim_end_matches('.').to_string()
    } else {
        text
    }
}

/// A value with its unit, in the size that people use.
pub(super) fn quantity(value: f64, unit: &str) -> String {
    match unit {
        "s" if value.abs() >= 89.5 => clock(value),
        "m" if value.abs() < 1.0 => format!("{} mm", number(value * 1e3)),
        "m/s" if value.abs() < 1.0 => format!("{} mm/s", number(value * 1e3)),
        "1" | "" => number(value),
        _ => format!("{} {}", number(value), escape(unit)),
    }
}

/// The value of a metric: shares in percent, counts without a point.
pub(super) fn metric(kind: MetricKind, value: f64, unit: &str) -> String {
    match kind {
        MetricKind::Economy | MetricKind::CurvedStrokes | MetricKind::SeenRemoval | MetricKind::HiddenView => {
            percent(value)
        }
        MetricKind::CriticalContacts => format!("{value:.0}"),
        _ => quantity(value, unit),
    }
}

/// A share in percent.
pub(super) fn percent(share: f64) -> String {
    if share.is_finite() { format!("{:.0} %", 100.0 * share) } else { "–".to_string() }
}

/// A time as minutes and seconds.
pub(super) fn clock(time_s: f64) -> String {
    if !time_s.is_finite() {
        return "–".to_string();
    }
    let seconds = time_s.max(0.0).round() as u64;
    let (hours, minutes, seconds) = (seconds / 3600, seconds / 60 % 60, seconds % 60);
    if hours > 0 { format!("{hours}:{minutes:02}:{seconds:02} h") } else { format!("{minutes}:{seconds:02} min") }
}

/// A time in a table: minutes, seconds, tenths.
pub(super) fn moment(time_s: f64) -> String {
    if !time_s.is_finite() {
        return "–".to_string();
    }
    let tenths = (time_s.max(0.0) * 10.0).round() as u64;
    format!("{}:{:02}.{}", tenths / 600, tenths / 10 % 60, tenths % 10)
}
