"""The look of a paper's report, and of others on the same page style."""

from __future__ import annotations

CSS = """:root { --ink: #1d2433; --soft: #5c677d; --line: #e3e7ee; --good: #2d6a4f; --bad: #b23a2e; --none: #6c757d; }
* { box-sizing: border-box; }
body { margin: 0; background: #f4f6f9; color: var(--ink);
  font: 15px/1.5 system-ui, "Segoe UI", Helvetica, Arial, sans-serif; }
main { max-width: 1120px; margin: 0 auto; padding: 36px 24px 64px; }
h1 { font-size: 27px; line-height: 1.25; margin: 0 0 6px; font-weight: 650; }
h2 { font-size: 19px; margin: 44px 0 12px; font-weight: 650; }
p.lead { color: var(--soft); margin: 0 0 20px; max-width: 78ch; }
.counts { display: flex; gap: 12px; margin: 0 0 22px; flex-wrap: wrap; }
.count { background: #fff; border: 1px solid var(--line); border-radius: 10px; padding: 10px 18px; }
.count b { display: block; font-size: 25px; line-height: 1.2; }
.met b, .pill.met { color: var(--good); } .not_met b, .pill.not_met { color: var(--bad); }
.not_comparable b, .pill.not_comparable { color: var(--none); }
.card { background: #fff; border: 1px solid var(--line); border-radius: 12px; overflow: hidden; }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; width: 100%; font-size: 14px; }
th { text-align: left; color: var(--soft); font-weight: 600; font-size: 12.5px; background: #fafbfc; }
th, td { padding: 8px 12px; border-top: 1px solid var(--line); vertical-align: top; }
tr:first-child th { border-top: 0; }
td.n { text-align: right; white-space: nowrap; font-variant-numeric: tabular-nums; }
th.n { text-align: right; }
td.where { color: var(--soft); white-space: nowrap; }
td small { color: var(--soft); display: block; font-size: 12.5px; line-height: 1.4; }
.pill { font-weight: 650; white-space: nowrap; }
.pill::before { content: ""; display: inline-block; width: 8px; height: 8px; border-radius: 4px; background: currentColor;
  margin-right: 7px; vertical-align: 1px; }
figure { margin: 0 0 22px; padding: 16px 18px 12px; }
figure h3 { margin: 0 0 6px; font-size: 15.5px; }
figure h3 span { color: var(--soft); font-weight: 400; }
figure svg { width: 100%; height: auto; display: block; }
figcaption { color: var(--soft); font-size: 13.5px; margin-top: 6px; max-width: 90ch; }
code { font: 12.5px ui-monospace, Menlo, Consolas, monospace; }
"""

TEMPLATE = (
    """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ paper.title }}</title>
<style>
"""
    + CSS
    + """</style>
</head>
<body>
<main>
<h1>{{ paper.title }}</h1>
<p class="lead">{{ paper.lead }}</p>
<div class="counts">
{% for verdict, count in counts.items() %}
<div class="count {{ verdict }}"><b>{{ count }}</b>{{ words[verdict] }}</div>
{% endfor %}
</div>
<div class="card scroll">
<table>
<tr><th>The paper says</th><th>where</th><th class="n">paper</th><th class="n">ours</th><th>unit</th><th>verdict</th></tr>
{% for row in rows %}
<tr id="{{ row.claim.id }}">
<td>{{ row.claim.statement }}<small>{{ row.claim.how }}{% if row.note %} — {{ row.note }}{% endif %}</small></td>
<td class="where">{{ row.claim.where }}</td>
<td class="n">{{ row.claim.paper_value | number }}</td>
<td class="n">{{ row.value | number }}</td>
<td>{{ row.claim.unit }}</td>
<td><span class="pill {{ row.verdict }}">{{ words[row.verdict] }}</span></td>
</tr>
{% endfor %}
</table>
</div>

<h2>The figures, redrawn with ours</h2>
<p class="lead">{{ paper.figures_lead }}</p>
{% for figure in figures %}
<figure class="card" id="{{ figure.anchor }}">
<h3>{{ figure.title }} <span>· {{ figure.place }}</span></h3>
{{ figure.svg | safe }}
<figcaption>{{ figure.caption }}</figcaption>
</figure>
{% endfor %}

<h2>{{ paper.runs_title }}</h2>
<p class="lead">{{ paper.runs_lead }}</p>
<div class="card scroll">
<table>
<tr><th>what</th><th>settings</th><th>seeds</th></tr>
{% for name, changes, seeds in settings %}
<tr><td>{{ name }}</td><td><code>{{ changes or "none" }}</code></td><td>{{ seeds }}</td></tr>
{% endfor %}
</table>
</div>
<p class="lead" style="margin-top: 16px">
{% for package, version in versions.items() %}{{ package }} {{ version }}{{ ", " if not loop.last }}
{% endfor %}
</p>
</main>
</body>
</html>
"""
)
