"""The page around the explorer: its colours, light and dark, and what is heard of its sliders."""

from importlib import resources

_PAGE = """<!doctype html>
<html lang="en"><head>{%metas%}<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{%title%}</title>{%favicon%}{%css%}<style>
:root { color-scheme: light dark; --ink: #1a1a1a; --paper: #ffffff; --faint: #5f6368;
        --tint: #f4f6f8; --good: #00674b; --bad: #a34700; --grid: #e3e6ea; --rail: #b9c0c8;
        --blue: #0072b2; }
@media (prefers-color-scheme: dark) { :root { --ink: #e8e8e8; --paper: #16181b; --faint: #a0a4a8;
        --tint: #1f2226; --good: #4fd0a5; --bad: #ff9d57; --grid: #34383d; --rail: #6b7279;
        --blue: #56b4e9; } }
body { font: 15px/1.45 system-ui, sans-serif; color: var(--ink); background: var(--paper);
       margin: 0; padding: 0.8rem 1rem; }
h1 { font-size: 1.3rem; margin: 0.2rem 0; } h2 { font-size: 1.05rem; }
.verdict { border-left: 0.4rem solid var(--good); background: var(--tint); padding: 0.5rem 0.8rem;
           height: 3.6em; overflow-y: auto; margin: 0.4rem 0 0.8rem; }
.verdict.doubt { border-color: var(--bad); } .verdict.waiting { border-color: var(--rail); }
.columns { display: grid; grid-template-columns: minmax(16rem, 21rem) 1fr; gap: 1rem; }
.graphs { display: grid; grid-template-columns: 1fr 1fr; gap: 0.7rem; }
.graph, .graph.dash-graph { height: 23rem !important; min-width: 0; }
.control { margin-bottom: 0.9rem; }
.label { display: block; font-weight: 600; } .hint { color: var(--faint); overflow-wrap: anywhere; }
#hold label { display: flex; gap: 0.5rem; align-items: baseline; margin: 0.2rem 0; }
pre { background: var(--tint); padding: 0.7rem; overflow-x: auto; } .code { position: relative; }
.code > div { position: absolute; top: 0.5rem; right: 0.7rem; cursor: pointer; }
a { color: inherit; } .links a { margin-right: 1.2rem; }
.graph text:not(.heatmap-label *) { fill: var(--ink) !important; }
.graph .gridlayer path, .graph .zerolinelayer path {
  stroke: var(--grid) !important; }
.graph .modebar-btn path { fill: var(--faint) !important; }
.graph path[style*="stroke: rgb(0, 0, 0)"] { stroke: var(--ink) !important; }
.graph path[style*="stroke: rgb(0, 114, 178)"] { stroke: var(--blue) !important; }
.graph path.point[style*="fill: rgb(0, 0, 0)"] { fill: var(--ink) !important; }
.graph .point path[style*="fill: rgb(0, 114, 178)"] { fill: var(--blue) !important; }
.controls .dash-slider-track { background: var(--rail) !important; }
.controls .dash-slider-range { background: var(--blue) !important; }
.controls .dash-slider-thumb { background: var(--blue) !important;
  border-color: var(--ink) !important; }
.controls .dash-slider-tooltip { background: var(--tint) !important; color: var(--ink) !important;
  box-shadow: none !important; border: 1px solid var(--rail); font-size: 0.8rem;
  padding: 0 0.35rem !important; top: calc(100% + 0.9rem) !important; }
.controls .dash-slider-tooltip * { color: var(--ink) !important; background: none !important; }
.controls .dash-slider-container { padding-bottom: 1.5rem; }
.controls .dash-slider-dot { background: var(--rail) !important; }
#hold label, #plant label, .controls [class*=slider] [class*=mark], .controls summary {
  color: var(--ink) !important; }
.dash-dropdown, .dash-dropdown *, .dash-dropdown-content, .dash-dropdown-content * {
  color: var(--ink) !important; }
.dash-dropdown, .dash-dropdown-content, .dash-dropdown-search,
.dash-dropdown-search-container {
  background: var(--tint) !important; border-color: var(--rail) !important; }
.wide { grid-column: 1 / -1; } .graph.words { overflow-y: auto; height: 23rem; }
.words h2 { margin: 0.2rem 0 0.4rem; font-size: 0.95rem; font-weight: 600; }
.words ul { padding-left: 1.1rem; margin: 0.3rem 0; } .words p { margin: 0.3rem 0; }
#drop { border: 2px dashed var(--rail); border-radius: 0.4rem; padding: 0.6rem; }
#drop.over { border-color: var(--blue); background: var(--tint); }
#drop button, #drop select { font: inherit; color: var(--ink); background: var(--tint);
  border: 1px solid var(--rail); border-radius: 0.3rem; padding: 0.3rem 0.6rem; max-width: 100%; }
#drop p { margin: 0.4rem 0 0; min-height: 1.2em; } #drop label { display: block; margin: 0.3rem 0; }
@media (max-width: 40rem) { .verdict { height: 7.2em; } }
@media (max-width: 62rem) { .columns, .graphs { grid-template-columns: minmax(0, 1fr); } }
</style><script>
// values of the sliders of frequencies and of factors are logarithms
window.dccFunctions = {hertz: v => (10 ** v).toPrecision(3), times: v => (10 ** v).toPrecision(3)};
// a slider's name and value, for who hears the page: its own label, and not its logarithm
const name = () => document.querySelectorAll("[role=slider]").forEach(one => {
  const control = one.closest("label, .control");
  const label = control && control.querySelector(".label");
  if (!label) return;
  const all = [...control.querySelectorAll("[role=slider]")];
  const text = label.textContent + (all.length > 1 ? [", from", ", to"][all.indexOf(one)] : "");
  if (one.getAttribute("aria-label") !== text) one.setAttribute("aria-label", text);
  const log = control.querySelector(".log"), now = one.getAttribute("aria-valuenow");
  const value = log ? (10 ** now).toPrecision(3) + " " + log.dataset.unit : now;
  if (one.getAttribute("aria-valuetext") !== value) one.setAttribute("aria-valuetext", value);
});
new MutationObserver(name).observe(document.documentElement,
  {childList: true, subtree: true, attributes: true, attributeFilter: ["aria-valuenow"]});
{drop}</script></head><body>{%app_entry%}<footer>{%config%}{%scripts%}{%renderer%}</footer></body></html>"""


def page() -> str:
    """The page as Dash fills it in, with the script that takes files."""
    script = resources.files("freqid.pages.explorer").joinpath("drop.js")
    return _PAGE.replace("{drop}", script.read_text(encoding="utf-8"))
