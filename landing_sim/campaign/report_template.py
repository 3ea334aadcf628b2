"""The look of a campaign's report."""

from __future__ import annotations

from landing_sim.papers.template import CSS

TEMPLATE = (
    """<!doctype html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{{ title }}</title>
<style>
"""
    + CSS
    + """:root { --open: #b7791f; }
.PASS b, .pill.PASS { color: var(--good); } .FAIL b, .pill.FAIL { color: var(--bad); }
.OPEN b, .pill.OPEN { color: var(--open); }
.PASS.verdict { border-left-color: var(--good); } .FAIL.verdict { border-left-color: var(--bad); }
.OPEN.verdict { border-left-color: var(--open); }
td small { font-weight: 400; }
.verdict { font-size: 17px; font-weight: 650; padding: 14px 18px; border-left: 6px solid; margin: 0 0 18px; }
.verdict span { color: var(--ink); font-weight: 400; font-size: 15px; }
td.n small { text-align: right; } td code { white-space: nowrap; }
td.chosen { font-weight: 650; } h2 + p.lead { margin-top: -6px; }
.rule { color: var(--soft); font-size: 13px; max-width: 96ch; margin: 12px 0 0; }
</style>
</head>
<body>
<main>
<h1>{{ title }}</h1>
<p class="lead">{{ description }}{{ " · " if description }}{{ landings }} of
<code>{{ scenario }}</code>, seed {{ seed }}.</p>
<div class="card verdict {{ overall }}"><b>{{ words[overall] }}</b> <span>{{ summary }}</span></div>
<div class="counts">
{% for name, count in outcomes %}
<div class="count"><b>{{ count }}</b>{{ name }}</div>
{% endfor %}
</div>

<div class="card scroll">
<table>
<tr><th>risk</th><th>event</th><th class="n">must be below</th><th class="n">seen</th><th class="n">95 % by count</th>
<th class="n">95 % by tail fit</th>{% if any_rare %}<th class="n">95 % by rare-event run</th>{% endif %}
<th>verdict</th>{% if sweep %}<th class="n">PASS up to</th>{% endif %}</tr>
{% for row in rows %}
<tr>
<td>{{ row.name }}{% if row.source %}<small>{{ row.source }}</small>{% endif %}</td>
<td>{{ row.event }}{% for note in row.notes %}<small>{{ note }}</small>{% endfor %}</td>
<td class="n">{{ row.limit }}</td>
<td class="n">{{ row.count }} of {{ row.n }}
{% if row.go_arounds %}<small>{{ row.go_arounds }} go-around{{ 's' if row.go_arounds > 1 }} left out</small>{% endif %}
{% if row.unmeasured %}<small>{{ row.unmeasured }} without the figure</small>{% endif %}</td>
<td class="n{{ ' chosen' if row.method == 'count' }}">{{ row.by_count }}</td>
<td class="n{{ ' chosen' if row.method == 'tail' }}">{{ row.by_tail }}<small>{{ row.fit }}</small></td>
{% if any_rare %}<td class="n{{ ' chosen' if row.method == 'rare-event' }}">{{ row.by_rare }}</td>{% endif %}
<td><span class="pill {{ row.mark }}">{{ row.verdict }}</span><small>by {{ row.method }}</small></td>
{% if sweep %}<td class="n">{{ row.largest }}</td>{% endif %}
</tr>
{% endfor %}
</table>
</div>
<p class="rule">PASS: the upper end of the two-sided 95 % interval lies below the risk, by count (Clopper–Pearson), by a
rare-event run, or by a generalised Pareto tail whose goodness of fit passes (p ≥ 0.05); FAIL: a lower end lies above it;
else not enough evidence. Flights that ended otherwise than in a landing or a go-around count as the event.
{% if sobol %}Landings of a Sobol sequence are not independent: the bounds by count are then no longer exact.{% endif %}
</p>

{% for section in sections %}
<h2>{{ section.title }}</h2>
{% if section.lead %}<p class="lead">{{ section.lead }}</p>{% endif %}
{% for figure in section.figures %}
<figure class="card">
{% if figure.title %}
<h3>{{ figure.title }}{% if figure.aside %} <span>· {{ figure.aside }}</span>{% endif %}</h3>
{% endif %}
{{ figure.svg | safe }}
{% if figure.caption %}<figcaption>{{ figure.caption }}</figcaption>{% endif %}
</figure>
{% endfor %}
{% for table in section.tables %}
<div class="card scroll" style="margin-bottom: 18px">
<table>
<tr>
{% for heading in table.headings %}
<th{{ ' class="n"' | safe if heading in table.numbers }}>{{ heading }}</th>
{% endfor %}
</tr>
{% for line in table.lines %}
<tr>{% for cell in line %}
{% set heading = table.headings[loop.index0] %}
{% if heading in table.code %}<td><code>{{ cell }}</code></td>
{% elif cell in marks %}<td><span class="pill {{ marks[cell] }}">{{ cell }}</span></td>
{% else %}<td{{ ' class="n"' | safe if heading in table.numbers }}>{{ cell }}</td>{% endif %}
{% endfor %}</tr>
{% endfor %}
</table>
</div>
{% endfor %}
{% endfor %}
</main>
</body>
</html>
"""
)
