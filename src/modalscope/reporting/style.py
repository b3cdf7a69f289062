"""The look of a report on screen, in the dark and on paper."""

__all__ = ["STYLE"]

STYLE = """
:root { --ink: #1f2933; --muted: #5b6773; --line: #dde3e8; --paper: #ffffff; --back: #f5f7f9; --accent: #0072b2; --shadow: #d55e00;
  --good: #00734f; }
@media (prefers-color-scheme: dark) { @media screen {
:root { --ink: #e4e8ec; --muted: #9aa7b3; --line: #333d47; --paper: #1b2229; --back: #12171c; --accent: #56b4e9; --shadow: #e69f00;
  --good: #4cc79b; }
} }
* { box-sizing: border-box; }
body { margin: 0 auto; padding: 2rem 1.5rem 3rem; max-width: 1120px; background: var(--back); color: var(--ink);
  font: 15px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif; }
h1 { font-size: 1.75rem; line-height: 1.2; margin: 0 0 .25rem; }
h2 { font-size: 1.15rem; margin: 0 0 .8rem; }
h3 { font-size: 1rem; margin: 1.4rem 0 .5rem; }
header p { margin: 0; }
.muted, figcaption, caption { color: var(--muted); }
nav { margin: 1rem 0 1.2rem; display: flex; flex-wrap: wrap; gap: .35rem 1.1rem; font-size: .9rem; }
a { color: var(--accent); text-decoration: none; }
a:hover { text-decoration: underline; }
section { background: var(--paper); border: 1px solid var(--line); border-radius: 8px; padding: 1.2rem 1.4rem; margin: 0 0 1.1rem; }
p { margin: 0 0 .7rem; max-width: 75ch; }
.verdict { font-size: 1.12rem; }
.loud { font-weight: 600; color: var(--shadow); border-left: 4px solid var(--shadow); padding-left: .7rem; }
.grade { font-weight: 600; white-space: nowrap; }
.grade::before { content: "\\25cf\\00a0"; }
.grade.good, .grade.trusted { color: var(--good); }
.grade.look, .grade.frequency { color: var(--shadow); }
.grade.look::before, .grade.frequency::before { content: "\\25d0\\00a0"; }
.grade.doubtful { color: var(--ink); }
.grade.doubtful::before { content: "\\25cb\\00a0"; }
details { margin: 0 0 .9rem; }
summary { cursor: pointer; color: var(--accent); margin: 0 0 .6rem; }
.scroll { overflow-x: auto; margin: 0 0 .9rem; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; font-size: .92rem; }
caption { text-align: left; padding: 0 0 .35rem; font-size: .9rem; }
th, td { padding: .28rem .7rem; text-align: right; border-bottom: 1px solid var(--line); white-space: nowrap; vertical-align: top; }
th { font-weight: 600; color: var(--muted); border-bottom-width: 2px; vertical-align: bottom;
  white-space: normal; }
th.words, td.words { text-align: left; }
td.words { white-space: normal; min-width: 6rem; }
td[style] { background: color-mix(in srgb, var(--shadow) var(--shade), transparent); }
dl { display: grid; grid-template-columns: max-content 1fr; gap: .2rem 1.4rem; margin: 0 0 .9rem; font-size: .95rem; }
dt { color: var(--muted); }
dd { margin: 0; overflow-wrap: anywhere; }
figure { margin: 0 0 .9rem; }
figure img { display: block; width: 100%; height: auto; background: #fff; border-radius: 5px; }
figcaption { font-size: .9rem; margin-top: .35rem; }
.pair { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(420px, 100%), 1fr)); gap: .8rem 1.2rem; }
.narrow { max-width: 640px; }
.narrow img { width: auto; max-width: 100%; }
pre { background: var(--back); border: 1px solid var(--line); border-radius: 5px; padding: .8rem 1rem;
  overflow-x: auto; font-size: .87rem; }
ol { margin: 0 0 1rem; padding-left: 1.6rem; }
li { margin: 0 0 .25rem; max-width: 90ch; }
li b { font-variant-numeric: tabular-nums; }
@media print {
  @page { margin: 15mm; }
  body { background: #fff; padding: 0; max-width: none; font-size: 10pt; }
  nav { display: none; }
  section { border: 0; border-radius: 0; padding: 0; margin: 0 0 6mm; }
  h2, h3, section > p { break-after: avoid; }
  figure, tr, li, dl, pre { break-inside: avoid; }
  .scroll { overflow: visible; }
  table { font-size: 8.5pt; }
  th, td { padding: .5mm 2mm; }
  pre { white-space: pre-wrap; }
  details::details-content { content-visibility: visible; block-size: auto; }
  summary { list-style: none; color: inherit; font-weight: 600; }
  .pair { grid-template-columns: 1fr 1fr; }
  td[style] { print-color-adjust: exact; -webkit-print-color-adjust: exact; }
}
"""
