//! How the page looks: calm, light, the same on paper.

/// The style sheet.
pub(super) const STYLE: &str = "
:root{--ink:#1d2730;--soft:#5b6771;--line:#d5dbe0;--faint:#f4f6f8;--good:#0072b2;--wrong:#b34a00}
*{box-sizing:border-box}
html{background:#eceff2}
body{margin:24px auto;max-width:210mm;padding:14mm 13mm 10mm;background:#fff;color:var(--ink);
font:13px/1.45 'Segoe UI','Helvetica Neue',Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;
font-variant-numeric:tabular-nums;overflow-wrap:anywhere;box-shadow:0 1px 8px #0002}
header{border-bottom:2px solid var(--ink);padding-bottom:10px;margin-bottom:16px}
.kicker{font-size:11px;letter-spacing:.09em;text-transform:uppercase;color:var(--soft);margin:0}
h1{font-size:25px;line-height:1.2;font-weight:600;margin:2px 0 4px}
.facts{color:var(--soft);margin:0}
.facts b{color:var(--ink);font-weight:600}
h2{font-size:15px;font-weight:600;margin:0 0 2px;break-after:avoid}
.note{color:var(--soft);font-size:11.5px;margin:0 0 8px;break-after:avoid}
section{margin:0 0 22px;break-inside:avoid}
section.long{break-inside:auto}
.verdict{display:grid;grid-template-columns:auto 1fr;gap:4px 24px;align-items:center}
.score{font-size:52px;line-height:1;font-weight:600}
.score small{font-size:16px;font-weight:400;color:var(--soft)}
.badge{display:inline-block;border:1.5px solid currentColor;border-radius:4px;padding:2px 10px;font-weight:600;margin-bottom:6px}
.badge.pass{color:#fff;background:var(--good);border-color:var(--good)}
.badge.fail{color:var(--wrong)}
.badge.none{color:var(--soft)}
.figures{display:grid;grid-template-columns:repeat(5,1fr);gap:0;border:1px solid var(--line);border-radius:5px;margin-top:14px}
.figures div{padding:8px 12px;border-left:1px solid var(--line)}
.figures div:first-child{border-left:0}
.figures b{display:block;font-size:18px;font-weight:600;line-height:1.25}
.figures span{color:var(--soft);font-size:11.5px}
table{border-collapse:collapse;width:100%;margin-top:2px}
th{font-size:11px;font-weight:600;color:var(--soft);text-align:left;border-bottom:1px solid var(--ink);padding:3px 8px 3px 0}
td{border-bottom:1px solid var(--line);padding:4px 8px 4px 0;vertical-align:top}
tr{break-inside:avoid}
thead{display:table-header-group}
th:last-child,td:last-child{padding-right:0}
.n{text-align:right;white-space:nowrap}
.w{white-space:nowrap}
.fit{width:1%}
table + .note{margin-top:8px}
td small{display:block;margin-top:1px;color:var(--soft);font-size:10.5px;line-height:1.35}
.bar{display:block;width:92px;height:8px;margin-top:5px}
.sev{font-weight:600;white-space:nowrap}
.sev.e,.sev.f{color:var(--wrong)}
svg{display:block;width:100%;height:auto;overflow:hidden}
svg.bar{width:92px}
svg text{font:10.5px 'Segoe UI','Helvetica Neue',Helvetica,Arial,'Liberation Sans','DejaVu Sans',sans-serif;fill:var(--ink)}
svg .tick{fill:var(--soft);font-size:10px}
svg .small{font-size:9.5px}
svg .strong{font-weight:600}
svg .num{fill:#fff;font-size:8.5px;font-weight:600}
.grid{stroke:#e4e8ec;stroke-width:.8}
.axis{stroke:#8a949d;stroke-width:1}
.mark{stroke:#b34a00;stroke-width:1;stroke-dasharray:2 2}
.legend{display:flex;flex-wrap:wrap;gap:3px 18px;margin:4px 0 0;padding:0;list-style:none;font-size:11.5px}
.legend svg{display:inline-block;width:26px;height:12px;vertical-align:-1px;margin-right:5px}
.multiples{display:grid;grid-template-columns:repeat(3,1fr);gap:12px 18px;margin-top:6px}
.multiples div{break-inside:avoid;border-top:1px solid var(--line);padding-top:4px}
.multiples b{font-weight:600}
.multiples .now{float:right}
footer{border-top:1px solid var(--line);color:var(--soft);font-size:10.5px;padding-top:6px}
@page{size:A4;margin:13mm 13mm 14mm}
@media print{html{background:#fff}body{margin:0;padding:0;max-width:none;box-shadow:none;font-size:11.5px}
*{-webkit-print-color-adjust:exact;print-color-adjust:exact}}
@media (max-width:560px){.figures{grid-template-columns:repeat(2,1fr)}.multiples{grid-template-columns:1fr}}
";
