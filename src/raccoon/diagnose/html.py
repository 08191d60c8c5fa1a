"""A diagnosis as one HTML file with pictures in it. Needs the extra [report]."""

from __future__ import annotations

import base64
import io
from pathlib import Path
from typing import Any

from raccoon.core.errors import ConfigError
from raccoon.diagnose.report import terminal_report
from raccoon.diagnose.result import Diagnosis, write_text

_PAGE = """<!doctype html>
<html lang="en"><head><meta charset="utf-8"><title>{{ title }}</title><style>
body { font: 16px/1.5 system-ui, sans-serif; max-width: 60rem; margin: 2rem auto; padding: 0 1rem; }
table { border-collapse: collapse; } td, th { padding: .2rem .8rem; border-bottom: 1px solid #ccc;
text-align: left; }
.cause { border-left: 4px solid #b5422c; padding-left: 1rem; margin: 1rem 0; } img { max-width: 100%; }
</style></head><body>
<h1>{{ title }}: {{ verdict }}</h1>
{% for cause in causes %}<div class="cause"><h2>{{ cause.rank }}. {{ cause.name }}</h2><p>{{
cause.explanation }}</p>
<table>{% for name, each in cause.parameters.items() %}<tr><td>{{ name }}</td>
<td>{{ "%.4g" | format(each.value) }} &plusmn; {{ "%.2g" | format(each.std) }} {{ each.unit }}</td>
<td>assumed {{ "%.4g" | format(each.nominal) }}</td></tr>{% endfor %}</table>
<p>Error on unseen data {{ "%.2f" | format(cause.gain.heldout_rmse_before) }} without it,
{{ "%.2f" | format(cause.gain.heldout_rmse_after) }} with it (1 is the noise).
{% if cause.confounded_with %}Cannot be told apart here from: {{ cause.confounded_with | join(", ") }}.{%
endif %}</p>
</div>{% else %}<p>No cause is named.</p>{% endfor %}
{% if depends_on %}<p><b>Something unknown depends on: {{ depends_on | join(", ") }}.</b></p>{% endif %}
{% if picture %}<img alt="Error before and after, by channel" src="data:image/png;base64,{{ picture }}">{%
endif %}
<h2>What was not named, and why</h2><table>{% for each in rejected %}<tr><td>{{ each.id }}</td>
<td>{{ each.reason }}</td></tr>{% endfor %}</table>
{% if manoeuvres %}<h2>Drive this to learn more</h2><ul>{% for each in manoeuvres %}<li>{{ each }}</li>{%
endfor %}
</ul>{% endif %}
<h2>As text</h2><pre>{{ text }}</pre></body></html>
"""


def save_html(diagnosis: Diagnosis, path: str | Path, title: str) -> None:
    """Write the report, atomically. Raises ConfigError where jinja2 or matplotlib is not installed."""
    try:
        import jinja2
    except ImportError as error:
        raise ConfigError(
            "an HTML report needs jinja2 and matplotlib: pip install raccoon[report]"
        ) from error
    page = jinja2.Environment(autoescape=True).from_string(_PAGE)
    text = page.render(
        title=title,
        verdict=str(diagnosis.verdict),
        causes=diagnosis.causes,
        depends_on=diagnosis.unexplained.depends_on,
        picture=_picture(diagnosis),
        rejected=diagnosis.rejected,
        manoeuvres=diagnosis.suggested_manoeuvres,
        text=terminal_report(diagnosis),
    )
    write_text(path, text)


def _picture(diagnosis: Diagnosis) -> str | None:
    """Bars of the held-out error in units of the noise, as base64 PNG."""
    if not diagnosis.channels:
        return None
    figure = error_figure(diagnosis)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=100)
    return base64.b64encode(buffer.getvalue()).decode("ascii")


def error_figure(diagnosis: Diagnosis) -> Any:
    """Error before and after over each channel's noise floor, without any display."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(8.0, 0.6 * len(diagnosis.channels) + 1.2), layout="constrained")
    axes = figure.subplots()
    names = [each.name for each in diagnosis.channels]
    before = [each.rmse_before / each.noise_floor for each in diagnosis.channels]
    after = [each.rmse_after / each.noise_floor for each in diagnosis.channels]
    rows = range(len(names))
    axes.barh([row - 0.2 for row in rows], before, 0.38, label="simulation as it was", color="#b5422c")
    axes.barh([row + 0.2 for row in rows], after, 0.38, label="with the causes", color="#2c6fb5")
    axes.axvline(1.0, color="0.3", linewidth=1.0, linestyle="--", label="noise")
    axes.set_yticks(list(rows), names)
    axes.invert_yaxis()
    axes.set_xlabel("error on unseen data / noise")
    axes.legend()
    return figure
