"""How a page looks: on a desk, on a telephone, on paper."""

CSS = """\
:root { --ink: #14202b; --soft: #566472; --line: #dde3e8; --ground: #f4f6f8; --accent: #0b5c8f;
        --good: #0b6e4f; --bad: #a5340a; --shade: #faf1d2; }
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body { margin: 0; background: var(--ground); color: var(--ink);
       font: 16px/1.5 system-ui, "Segoe UI", Roboto, "Noto Sans", sans-serif; }
main { max-width: 92rem; margin: 0 auto; padding: 1rem; }
header, section, nav { background: #fff; border: 1px solid var(--line); border-radius: 10px;
  padding: 1rem 1.25rem; margin: 0 0 1rem; }
header { background: var(--ink); color: #fff; border: 0; }
header .kind { margin: 0; color: #a9d3ee; font-weight: 600; letter-spacing: .02em; }
h1 { font-size: 1.6rem; line-height: 1.2; margin: .1rem 0 .3rem; overflow-wrap: anywhere; }
header p:last-child { margin: 0; color: #d7e1e9; }
h2 { font-size: 1.2rem; margin: 0 0 .5rem; overflow-wrap: anywhere; }
h2 small { color: var(--soft); font-weight: normal; font-size: .95rem; }
h3 { font-size: 1rem; margin: 1rem 0 .25rem; }
p { margin: .3rem 0; } a { color: var(--accent); } i { color: var(--soft); }
.small { color: var(--soft); font-size: .875rem; }
.notes { background: #fff7e0; border-left: 4px solid #b8860b; border-radius: 6px; margin: 0 0 1rem;
  padding: .5rem 1rem .5rem 2rem; }
section .notes { margin: .5rem 0; }
.verdict.good { border-left: 6px solid var(--good); } .verdict.good h2 { color: var(--good); }
.verdict.bad { border-left: 6px solid var(--bad); } .verdict.bad h2 { color: var(--bad); }
.mark { color: var(--bad); font-weight: 600; }
.shade { background: var(--shade); padding: 0 .3em; }
.first { color: #0072b2; font-weight: 700; } .second { color: #d55e00; font-weight: 700; }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(10.5rem, 1fr)); gap: .6rem;
  margin: .75rem 0; }
.tile { background: var(--ground); border-radius: 8px; padding: .6rem .8rem; }
.tile span { display: block; color: var(--soft); font-size: .875rem; }
.tile b { font-size: 1.5rem; line-height: 1.25; font-variant-numeric: tabular-nums; }
.tile b small { font-size: .95rem; font-weight: normal; }
.pictures { display: grid; grid-template-columns: repeat(auto-fit, minmax(min(21rem, 100%), 1fr));
  gap: .5rem; }
figure { margin: 0; } img { display: block; width: 100%; height: auto; }
.tables { display: grid; grid-template-columns: minmax(0, 1fr) minmax(0, 2.4fr); gap: 1rem 2rem;
  align-items: start; }
.wide { overflow-x: auto; margin: .5rem 0; }
table { border-collapse: collapse; width: 100%; font-variant-numeric: tabular-nums;
  font-size: .9375rem; }
th, td { padding: .3rem .9rem .3rem 0; border-bottom: 1px solid var(--line); text-align: left;
  white-space: nowrap; vertical-align: baseline; }
thead th { color: var(--soft); font-weight: 600; font-size: .8125rem; border-bottom: 2px solid
  var(--soft); white-space: normal; vertical-align: bottom; }
tbody th { font-weight: 600; } td small, th small { color: var(--soft); font-weight: normal; }
@media screen and (max-width: 52rem) {
  main { padding: .5rem; } header, section, nav { padding: .8rem; border-radius: 8px; }
  .tables { grid-template-columns: minmax(0, 1fr); }
  .tiles { grid-template-columns: repeat(2, minmax(0, 1fr)); }
  thead th { white-space: nowrap; }
}
@media print {
  @page { size: A4 landscape; margin: 10mm; }
  body { background: #fff; font-size: 9pt; line-height: 1.35; }
  main { max-width: none; padding: 0; }
  header { background: #fff; color: #000; border-bottom: 2px solid #000; border-radius: 0;
    padding: 0 0 .4rem; }
  header .kind, header p:last-child { color: #333; }
  section, nav { border: 0; padding: 0; }
  .small { font-size: 8pt; } h1 { font-size: 16pt; } h2 { font-size: 12pt; }
  .tiles { grid-template-columns: repeat(4, 1fr); margin: .3rem 0; }
  .tile { border: 1px solid var(--line); padding: .3rem .6rem; }
  .tile b { font-size: 13pt; }
  .swing { break-before: page; } .wide { overflow: visible; margin: .2rem 0; }
  .pictures { grid-template-columns: repeat(3, 1fr); }
  .tables { gap: 0 2rem; grid-template-columns: minmax(0, 1fr) minmax(0, 2.4fr); }
  figure, tr, .tiles, .verdict { break-inside: avoid; } h2, h3 { break-after: avoid; }
  a { color: inherit; text-decoration: none; } ul { margin: .2rem 0; }
  table { font-size: 8pt; } th, td { padding: .05rem .7rem .05rem 0; }
  thead th { font-size: 7.5pt; }
}
"""
