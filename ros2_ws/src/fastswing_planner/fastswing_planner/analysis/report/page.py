"""One page with everything that was found: no other file, no network, no script."""

import time
from collections.abc import Sequence

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.findings import BagFindings
from fastswing_planner.analysis.report.comparison_drawing import comparison_pictures
from fastswing_planner.analysis.report.drawing_style import joint_styles, muscle_styles
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.report.swing_section import Picture, SwingSection, method_title
from fastswing_planner.analysis.report.templating import data_url, page_templates
from fastswing_planner.analysis.report.text import (
    LATENCY_TITLES,
    TOPIC_HEAD,
    change_text,
    counted,
    counter_lines,
    figure_title,
    topic_cells,
)
from fastswing_planner.analysis.verdicts.comparison import Comparison

CONTENTS_FROM = 3
"""A page with at least so many swings has a table of contents."""


def page(results: Results) -> str:
    """Return the page."""
    swings = results.swings
    joints, muscles = joint_styles(swings), muscle_styles(swings)
    templates = page_templates()
    templates.filters.update(
        change=change_text,
        counted=counted,
        counter_lines=counter_lines,
        figure_title=figure_title,
        method_title=method_title,
        topic_cells=topic_cells,
    )
    return templates.get_template("page.html").render(
        title=_title(results),
        recorded=_recorded(results.findings),
        findings=results.findings,
        check=results.check,
        comparison=results.comparison,
        overlays=_overlays(results.comparison),
        figures=FIGURES,
        sections=[SwingSection(swing, results.limits, joints, muscles) for swing in swings],
        contents_from=CONTENTS_FROM,
        topic_head=TOPIC_HEAD,
        tolerance=swings[0].tolerance if swings else 0.1,
        latencies=list(LATENCY_TITLES.values()),
    )


def _title(results: Results) -> str:
    if results.comparison is not None:
        first, second = results.comparison.names
        return f"{first} beside {second}"
    sources = [one.source for one in results.findings]
    return ", ".join(sources[:3]) + (f" and {len(sources) - 3} more" if len(sources) > 3 else "")


def _recorded(findings: Sequence[BagFindings]) -> str:
    """Return when the first bag began; empty if no bag tells."""
    began = [one.began_ns for one in findings if one.began_ns]
    if not began:
        return ""
    return time.strftime("%Y-%m-%d %H:%M:%S UTC", time.gmtime(min(began) / 1e9))


def _overlays(comparison: Comparison | None) -> list[Picture]:
    if comparison is None:
        return []
    pictures = comparison_pictures(comparison.first, comparison.second)
    return [Picture(data_url("svg+xml", picture), title) for title, picture in pictures.items()]
