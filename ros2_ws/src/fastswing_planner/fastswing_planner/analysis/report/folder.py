"""The folder that `analyse --output` writes: page, record, and a picture of each swing."""

from collections.abc import Sequence
from pathlib import Path

from fastswing_planner.analysis.measured_swing import swing_label
from fastswing_planner.analysis.report.drawing_style import joint_styles, muscle_styles
from fastswing_planner.analysis.report.page import page
from fastswing_planner.analysis.report.record import json_text
from fastswing_planner.analysis.report.results import Results
from fastswing_planner.analysis.report.swing_drawing import save_swing

RECORD_NAME = "analysis.json"


def write_folder(
    output: Path, page_name: str, results: Results, formats: Sequence[str]
) -> list[Path]:
    """Write everything, and return the files, the page first; raises OSError.

    formats  of the pictures: 'png', 'svg'
    """
    output.mkdir(parents=True, exist_ok=True)
    written = [output / page_name, output / RECORD_NAME]
    written[0].write_text(page(results), encoding="utf-8")
    written[1].write_text(json_text(results) + "\n", encoding="utf-8")
    swings = results.swings
    joints, muscles = joint_styles(swings), muscle_styles(swings)
    for number, swing in enumerate(swings, 1):
        for suffix in formats:
            path = output / f"swing_{number:03d}_{swing.method.replace(' ', '_')}.{suffix}"
            save_swing(path, swing, joints, muscles, results.limits, swing_label(swing))
            written.append(path)
    return written
