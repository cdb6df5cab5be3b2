#pragma once
// How a report looks on the screen, on a phone, in the dark and on paper.

namespace birefit::page {

inline constexpr const char* kStyle = R"css(
:root { --ink: #1d2127; --soft: #5b626c; --line: #d9dde2; --paper: #fff; --accent: #2166ac; color-scheme: light dark;
  --quiet: #3c434d; --pre: #f6f7f9; --warn: #fdf8ec; --warn-line: #d9a441; --good: #1c6b3f; --good-line: #9cc9ae;
  --good-back: #f1f8f3; --fair: #7a4b00; --fair-line: #e0bf7e;
  --fair-back: #fdf6e6; --bad: #9b2c1f; --bad-line: #dfaaa2; --bad-back: #fcf3f1; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; background: var(--paper); color: var(--ink); line-height: 1.5; font-size: 16px;
  font-family: Charter, "Bitstream Charter", "Source Serif 4", "Iowan Old Style", Cambria, Georgia, "DejaVu Serif",
  serif; }
main { max-width: 940px; margin: 0 auto; padding: 36px 28px 64px; }
h1, h2, h3, table, svg, .badge, .key, .eyebrow, code, pre, dt, summary { font-family: "Inter", "Helvetica Neue",
  Helvetica, Arial,
  "Liberation Sans", "DejaVu Sans", sans-serif; }
.eyebrow { font-size: 12px; letter-spacing: .09em; text-transform: uppercase; color: var(--soft); margin: 0 0 4px; }
h1 { font-size: 25px; line-height: 1.25; font-weight: 600; margin: 0 0 14px; overflow-wrap: anywhere;
  letter-spacing: -.01em; }
h2 { font-size: 17px; font-weight: 600; margin: 44px 0 10px; padding-top: 12px; border-top: 1px solid var(--line); }
h3 { font-size: 14px; font-weight: 600; margin: 22px 0 6px; overflow-wrap: anywhere; }
p { margin: 0 0 10px; max-width: 46em; }
.verdict { display: flex; gap: 14px; align-items: baseline; margin: 0 0 22px; }
.verdict p { margin: 0; }
.badge { flex: none; font-size: 12px; font-weight: 600; padding: 3px 10px; border-radius: 999px; border: 1px solid;
  white-space: nowrap; }
.good { color: var(--good); border-color: var(--good-line); background: var(--good-back); }
.fair { color: var(--fair); border-color: var(--fair-line); background: var(--fair-back); }
.bad { color: var(--bad); border-color: var(--bad-line); background: var(--bad-back); }
.key { display: grid; grid-template-columns: repeat(auto-fit, minmax(190px, 1fr)); gap: 0; margin: 0 0 8px;
  border-top: 1px solid var(--line);
  border-left: 1px solid var(--line); }
.key div { padding: 10px 14px 11px; border-right: 1px solid var(--line); border-bottom: 1px solid var(--line);
  min-width: 0; }
.key dt { font-size: 12px; color: var(--soft); overflow-wrap: anywhere; }
.key dd { margin: 1px 0 0; font-size: 18px; font-weight: 500; font-variant-numeric: tabular-nums;
  letter-spacing: -.01em; }
.key small { font-size: 13px; font-weight: 400; color: var(--soft); }
.warnings { border-left: 3px solid var(--warn-line); background: var(--warn); padding: 10px 16px; margin: 18px 0; }
.warnings ul { margin: 4px 0 0; padding-left: 20px; }
figure { margin: 16px 0 22px; }
figcaption { font-size: 14px; color: var(--quiet); margin-top: 6px; max-width: 54em; line-height: 1.45; }
figcaption b { font-family: "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif; font-size: 13px; }
.trio { display: grid; grid-template-columns: repeat(3, minmax(0, 1fr)); gap: 14px; }
.trio.stack { grid-template-columns: minmax(0, 1fr); gap: 8px; }
.trio h4, .pair h4 { font: 600 13px "Helvetica Neue", Helvetica, Arial, "Liberation Sans", sans-serif; margin: 0; }
.pair { display: grid; grid-template-columns: repeat(2, minmax(0, 1fr)); gap: 18px 22px; }
.pair figure { margin: 0; }
svg { display: block; width: 100%; height: auto; }
.narrow { display: none; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums; }
th { font-weight: 600; text-align: right; padding: 5px 9px; border-bottom: 1.5px solid var(--ink);
  white-space: nowrap; vertical-align: bottom; }
td { text-align: right; padding: 4px 9px; border-bottom: 1px solid var(--line); white-space: nowrap; }
th:first-child, td:first-child { text-align: left; padding-left: 0; }
table.full { width: 100%; }
td.name { font-weight: 500; }
td.file { white-space: normal; overflow-wrap: anywhere; min-width: 9em; }
td.name small { display: block; font-weight: 400; color: var(--soft); font-size: 11px; }
td.left, th.left { text-align: left; }
td.value { font-weight: 600; }
.flag { color: var(--bad); font-weight: 600; font-size: 11px; }
table.matrix td, table.matrix th { text-align: center; padding: 4px 5px; border: 0; min-width: 46px;
  font-size: 12px; }
table.matrix td:first-child, table.matrix th:first-child { text-align: left; padding-right: 12px; }
dl.facts { display: grid; grid-template-columns: max-content minmax(0, 1fr); gap: 3px 18px; margin: 0 0 12px;
  font-size: 14px; }
dl.facts dt { color: var(--soft); font-size: 13px; padding-top: 1px; }
dl.facts dd { margin: 0; overflow-wrap: anywhere; }
ul { margin: 4px 0 12px; padding-left: 22px; max-width: 46em; }
li { margin: 2px 0; }
details { margin: 8px 0; }
summary { cursor: pointer; font-size: 14px; font-weight: 500; color: var(--accent); }
pre { font: 12px/1.5 "SFMono-Regular", Menlo, Consolas, "Liberation Mono", "DejaVu Sans Mono", monospace;
  background: var(--pre);
  padding: 12px 14px; overflow-x: auto; white-space: pre-wrap; overflow-wrap: anywhere;
  border: 1px solid var(--line); }
footer { margin-top: 44px; padding-top: 10px; border-top: 1px solid var(--line); font-size: 13px;
  color: var(--soft); }
caption { text-align: left; font-size: 13px; font-weight: 600; padding: 10px 0 2px; }
td code { font-size: 11px; overflow-wrap: anywhere; white-space: normal; }
/* Paper stays white: only the screen is dark. Colours that pictures of numbers have are theirs and stay. */
@media screen and (prefers-color-scheme: dark) {
  :root { --ink: #e4e7eb; --soft: #a3abb6; --line: #353b43; --paper: #15181c; --accent: #7db5ea; --quiet: #c3cad4;
    --pre: #1d2126; --warn: #2b2413; --warn-line: #b98a35; --good: #86d3a4; --good-line: #2f6b47;
  --good-back: #14251b;
    --fair: #eec275; --fair-line: #7a5a1f; --fair-back: #2a2010;
    --bad: #f0988c; --bad-line: #7d3a32; --bad-back: #2b1614; }
  svg [fill="#2b2f36"] { fill: var(--ink); }
  svg [stroke="#2b2f36"], svg [stroke="#5b626c"] { stroke: var(--ink); }
  svg [stroke="#e3e6ea"] { stroke: #2a2f36; }
  svg [fill="#3c434d"] { fill: #c3cad4; }
  svg [stroke="#3c434d"] { stroke: #c3cad4; }
  svg [fill="#2166ac"] { fill: #7db5ea; }
  svg [stroke="#2166ac"] { stroke: #7db5ea; }
  svg.chart [stroke="#c0392b"] { stroke: #f07a6b; }
  svg.chart [fill="#c0392b"] { fill: #f07a6b; }
  svg [fill="#b9c4d3"] { fill: #4a566a; }
  svg [fill="#dfe8f3"] { fill: #22303f; }
  svg [fill="#eff4f9"] { fill: #1b232c; }
}
@media (max-width: 700px) {
  main { padding: 22px 16px 48px; }
  h1 { font-size: 21px; }
  .trio, .pair { grid-template-columns: minmax(0, 1fr); }
  .verdict { display: block; }
  .badge { display: inline-block; margin-bottom: 8px; }
  .key { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  .key div { padding: 8px 10px; }
  .key dd { font-size: 16px; }
  .wide { display: none; }
  .narrow { display: block; }
  dl.facts { grid-template-columns: minmax(0, 1fr); gap: 0; }
  dl.facts dd { margin-bottom: 6px; }
  table.full td:first-child, table.full th:first-child { position: sticky; left: 0; background: var(--paper);
  padding-right: 12px;
    border-right: 1px solid var(--line); min-width: 132px; max-width: 46vw; white-space: normal;
  overflow-wrap: anywhere; }
}
@media print {
  @page { size: A4; margin: 15mm 14mm; }
  * { -webkit-print-color-adjust: exact; print-color-adjust: exact; }
  body { font-size: 10.5pt; }
  main { max-width: none; padding: 0; }
  .wide { display: block; }
  .narrow { display: none; }
  .trio { grid-template-columns: repeat(3, minmax(0, 1fr)); }
  .pair { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  table { font-size: 8pt; }
  th, td { padding: 3px 5px; }
  .scroll { overflow: visible; }
  pre { font-size: 7.5pt; overflow: visible; }
  .flag, td small { font-size: 7pt; }
  td.file { min-width: 0; }
  figure, table, .key, .warnings, tr { break-inside: avoid; }
  h2, h3 { break-after: avoid; }
}
)css";

}  // namespace birefit::page
