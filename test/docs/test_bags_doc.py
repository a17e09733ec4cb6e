"""docs/bags.md is true: figures, options, limits and pictures."""

import re
from pathlib import Path

import pytest
import yaml

from fastswing_planner.analysis.figures import FIGURES
from fastswing_planner.analysis.verdicts.criteria import parse_criteria
from fastswing_planner.commands.analyse import main

DOCS = Path(__file__).parents[2] / "docs"
TEXT = (DOCS / "bags.md").read_text()


@pytest.mark.parametrize("name", FIGURES)
def test_every_figure_is_explained(name: str) -> None:
    assert re.search(rf"^\|.*`{name}`", TEXT, re.MULTILINE)


def test_the_example_of_limits_can_be_used() -> None:
    examples = re.findall(r"```yaml\n(.*?)```", TEXT, re.DOTALL)
    limits = [parse_criteria(yaml.safe_load(one)) for one in examples if "each_swing" in one]
    assert len(limits) == 1


def test_every_option_of_analyse_is_named(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["--help"])
    options = set(re.findall(r"--[a-z-]+", capsys.readouterr().out)) - {"--help"}
    assert {option for option in options if option not in TEXT} == set()


@pytest.mark.parametrize("image", re.findall(r"\]\((images/[^)]+)\)", TEXT))
def test_every_picture_is_there(image: str) -> None:
    assert (DOCS / image).stat().st_size > 10_000
