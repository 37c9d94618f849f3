//! The report as one page of HTML: no scripts, nothing beside it, light, for A4. Colours never say anything alone: shapes,
//! patterns and words say it too.

mod compare;
mod drawings;
mod map;
mod style;
mod svg;
mod tables;
mod text;

use super::RunReport;
use text::escape;

impl RunReport {
    /// The report as a page of HTML in UTF-8. Earlier runs of the same scenario, in the order in which they were performed, are
    /// compared with this one; those of other scenarios are left out.
    pub fn to_html(&self, earlier: &[RunReport]) -> String {
        let sections = [
            tables::verdict(self),
            tables::goals(self),
            drawings::timeline(self),
            tables::violations(self),
            drawings::force(self),
            map::ways(self),
            map::removals(self),
            tables::structures(self),
            compare::compare(self, earlier),
            tables::metrics(self),
            tables::violations_in_time(self),
        ];
        let title = escape(&self.scenario);
        format!(
            "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
             <meta name=\"viewport\" content=\"width=device-width,initial-scale=1\">\
             <meta http-equiv=\"Content-Security-Policy\" content=\"default-src 'none'; style-src 'unsafe-inline'\">\
             <title>{title} – report</title><style>{}</style></head><body>\n{}{}{}</body></html>\n",
            style::STYLE,
            tables::head(self),
            sections.concat(),
            tables::foot(self),
        )
    }
}

/// A part of the page; none where it has no content.
fn section(class: &str, title: &str, note: &str, content: &str) -> String {
    if content.is_empty() {
        return String::new();
    }
    let note = if note.is_empty() { String::new() } else { format!("<p class=\"note\">{note}</p>") };
    format!("<section class=\"{class}\"><h2>{title}</h2>{note}{content}</section>\n")
}
