"""The API reference is made from docstrings alone, and from all of them."""

import re
from importlib import import_module
from pathlib import Path
from types import ModuleType

import pytest
from api_reference import build, modules, undocumented
from parameter_page import PACKAGES


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    made = tmp_path_factory.mktemp("reference")
    build(made, ["fastswing_inhibitor"])
    return made


def test_a_module_has_a_page_with_its_docstring(folder: Path) -> None:
    module = import_module("fastswing_inhibitor.inhibition")
    assert module.__doc__
    page = (folder / "fastswing_inhibitor" / "inhibition.html").read_text()
    assert module.__doc__.split(";")[0][:40] in page


def test_nothing_is_fetched_from_elsewhere(folder: Path) -> None:
    for page in folder.rglob("*.html"):
        assert not re.search(r'<(?:script|link|img)[^>]*"(?:https?:)?//', page.read_text()), page


@pytest.mark.parametrize("name", modules(PACKAGES))
def test_everything_public_has_a_docstring(name: str) -> None:
    assert list(undocumented(import_module(name))) == []


def test_a_function_without_docstring_is_found() -> None:
    module = ModuleType("some_module", "Documented.")

    def silent() -> None: ...

    silent.__module__ = module.__name__
    module.silent = silent  # type: ignore[attr-defined]
    assert list(undocumented(module)) == ["some_module.silent"]
