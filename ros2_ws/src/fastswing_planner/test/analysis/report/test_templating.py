"""Pages from templates: what comes from a bag is text, and nothing may be missing."""

import html
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from jinja2 import UndefinedError

from fastswing_planner.analysis.report.templating import (
    data_url,
    decimal_text,
    page_templates,
)


@given(st.text())
def test_any_text_is_shown_as_it_is(text: str) -> None:
    shown = page_templates().from_string("{{ text }}").render(text=text)
    assert not set(shown) & set("<>\"'")
    assert html.unescape(shown) == text


def test_a_missing_name_is_an_error() -> None:
    with pytest.raises(UndefinedError, match="'nothing' is undefined"):
        page_templates().from_string("{{ nothing }}").render()


def test_a_folder_of_templates_can_stand_on_ours(tmp_path: Path) -> None:
    (tmp_path / "own.html").write_text(
        '{% extends "base.html" %}{% block main %}<p>own</p>{% endblock %}'
    )
    page = page_templates(tmp_path).get_template("own.html").render()
    assert page.startswith("<!DOCTYPE html>")
    assert "--accent" in page
    assert "<p>own</p>" in page


def test_an_unknown_number_is_a_dash() -> None:
    assert (decimal_text(np.nan, 2), decimal_text(1.006, 2)) == ("–", "1.01")


def test_a_picture_is_its_own_address() -> None:
    assert data_url("png", b"abc") == "data:image/png;base64,YWJj"
