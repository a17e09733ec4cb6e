"""Templates of pages: every text from a bag is escaped, and a name that is missing is an error."""

import base64
from pathlib import Path

import numpy as np
from jinja2 import ChoiceLoader, Environment, FileSystemLoader, PackageLoader, StrictUndefined


def page_templates(*folders: Path) -> Environment:
    """Return the templates in `folders`, and below them those of this package.

    `base.html` is an empty page of one file, `page.css` how it looks, `parts.html` tables and
    pictures.
    """
    package = PackageLoader("fastswing_planner", "analysis/report/templates")
    environment = Environment(
        loader=ChoiceLoader([*(FileSystemLoader(folder) for folder in folders), package]),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.filters["decimal"] = decimal_text
    environment.tests["known"] = _is_known
    return environment


def decimal_text(value: float, decimals: int) -> str:
    """Return a number with so many decimals; '–' for an unknown one."""
    return "–" if np.isnan(value) else f"{value:.{decimals}f}"


def _is_known(value: float) -> bool:
    return not np.isnan(value)


def data_url(kind: str, content: bytes) -> str:
    """Return a picture as the address that holds it; `kind`: 'png' or 'svg+xml'."""
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"
