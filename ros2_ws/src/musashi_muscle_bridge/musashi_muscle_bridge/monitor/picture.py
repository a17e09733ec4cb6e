"""The dashboard as lines of text for a terminal, in ASCII but for the names that others give.

Whatever a colour says, a word says too.
"""

import math
import textwrap
from collections.abc import Sequence

from rich.console import Group
from rich.text import Text

from musashi_muscle_bridge.monitor.dashboard import (
    JOINTS,
    LEVELS,
    OVERRIDE,
    STATE,
    Dashboard,
    MuscleRow,
    NodeReport,
)
from musashi_muscle_bridge.monitor.keys import KeyPad
from musashi_muscle_bridge.monitor.service_calls import ServiceCalls

_NAME_CELLS = (6, 12)  # at least and at most
_HEAD = " length tension           limit current temp  mode"
_UNITS = "      m      N               N       A degC"
_KEYS = "e EMERGENCY STOP   h hold   c clear faults   q quit"
_CONFIRM = "y clears faults and emergency stop; every other key does not"
_INDENT = " " * 11
_BAR_CELLS = 10
_OTHER_LINES = 14
_SHORT_MODES = {"zero_current": "zero"}
_LEVEL_STYLES = ("", "yellow", "bold red", "bold red")


def picture(
    dashboard: Dashboard,
    calls: ServiceCalls,
    keys: KeyPad,
    now: float,
    clock: str,
    width: int,
    height: int,
) -> Group:
    """Return `height` lines of at most `width` characters.

    now    monotonic time [s]
    clock  the time of day: a picture that stands still shows an old one
    """
    cells = _name_cells(dashboard.muscles(now))
    muscles = _muscles(dashboard, now, max(height - _OTHER_LINES, 1), cells)
    head = [_title(dashboard, clock, width), _rates(dashboard, now), _banner(dashboard, now)]
    nodes = [
        _line("executor   ", dashboard.executor(now)),
        _line("inhibitor  ", dashboard.inhibitor(now)),
        *_nodes(dashboard.reports(now), width),
    ]
    answers = [Text(_plain(line)) for line in calls.lines(now)[:3]]
    confirming = keys.confirming(now)
    foot = Text(_CONFIRM if confirming else _KEYS, style="reverse" if confirming else "bold")
    titles = [
        Text(f"{'muscle':<{cells}}{_HEAD}", style="bold"),
        Text(f"{'':<{cells}}{_UNITS}", style="dim"),
    ]
    above = [*head, *titles, *muscles, Text(), *nodes]
    # Where there is little room, the keys stay, and what was asked for.
    below = [*answers[: max(height - 4, 0)], foot]
    above = above[: max(height - len(below), 0)]
    space = [Text()] * (height - len(above) - len(below))
    lines = [*above, *space, *below]
    for line in lines:
        line.no_wrap, line.overflow = True, "crop"
        line.truncate(width)
    return Group(*lines)


def _title(dashboard: Dashboard, clock: str, width: int) -> Text:
    name = f"fastswing  /{dashboard.namespace}"
    return Text(f"{_plain(name):<{max(width - len(clock), 0)}}{clock}", style="bold")


def _rates(dashboard: Dashboard, now: float) -> Text:
    return Text("   ".join(_rate(dashboard, topic, now) for topic in (STATE, JOINTS, OVERRIDE)))


def _rate(dashboard: Dashboard, topic: str, now: float) -> str:
    pulse = dashboard.pulses[topic]
    publishers = dashboard.publishers.get(topic, 0)
    several = f" ({publishers} PUBLISHERS)" if publishers > 1 else ""
    label = topic.removeprefix("current_")
    if math.isinf(pulse.age(now)):
        return f"{label} none yet{several}"
    rate = pulse.rate(now)
    often = "? Hz" if math.isnan(rate) else f"{rate:.0f} Hz"
    # An age of every topic would not fit, and where there is a rate there is none.
    age = f", {_age(pulse.age(now))} old" if topic == STATE or rate == 0 else ""
    return f"{label} {often}{several}{age}"


def _age(seconds: float) -> str:
    return f"{seconds:.2f} s" if seconds < 10 else f"{seconds:.0f} s"


def _banner(dashboard: Dashboard, now: float) -> Text:
    age = dashboard.pulses[STATE].age(now)
    words = []
    if math.isinf(age):
        words.append("NO STATE YET: is the bridge active, do its boards answer?")
    elif dashboard.rejected:
        words.append(f"STALE: {dashboard.rejected}")
    elif dashboard.stale(now):
        words.append(f"STALE: no state for {_age(age)}, the numbers are from then")
    if dashboard.emergency(now):
        words.append("EMERGENCY STOP: zero current until clear_faults")
    return Text("   ".join(map(_plain, words)), style="bold red reverse")


def _name_cells(rows: Sequence[MuscleRow]) -> int:
    low, high = _NAME_CELLS
    return min(max([low, *(len(_plain(row.name)) for row in rows)]), high)


def _short(name: str, cells: int) -> str:
    """Return a name that fits: its beginning and end, as names of one arm differ in either."""
    if len(name) <= cells:
        return name
    end = cells // 2
    return f"{name[: cells - end - 1]}~{name[-end:]}"


def _muscles(dashboard: Dashboard, now: float, room: int, cells: int) -> list[Text]:
    rows, stale = dashboard.muscles(now), dashboard.stale(now)
    if len(rows) <= room:
        return [_muscle(row, stale, cells) for row in rows]
    shown, hidden = rows[: room - 1], rows[room - 1 :]
    faulty = [row.name for row in hidden if row.fault]
    also = f", FAULTS at {' '.join(faulty)}" if faulty else ""
    more = Text(_plain(f"and {len(hidden)} more: make the window higher{also}"), style="bold")
    return [*(_muscle(row, stale, cells) for row in shown), more]


def _muscle(row: MuscleRow, stale: bool, cells: int) -> Text:
    numbers = f"{_short(_plain(row.name), cells):<{cells}}{row.length:7.4f} {row.tension:6.1f}"
    rest = f"{_number(row.tension_limit, 5, 0)} {row.current:7.2f} {_number(row.temperature, 4, 0)}"
    mode = _SHORT_MODES.get(row.mode, row.mode)
    line = Text(f"{numbers} ", style="dim" if stale else "")
    line.append("[  stale   ]" if stale else _bar(row), style="" if stale else _bar_style(row))
    line.append(f"{rest}  {'was ' if stale else ''}{mode:<7} ")
    if row.fault:  # it wins over an override, in the bridge too
        line.append(f"! {row.fault}", style="bold red")
    elif row.inhibited:
        line.append("inhibited", style="bold cyan")
    return line


def _number(value: float, width: int, decimals: int) -> str:
    return f"{'-':>{width}}" if math.isnan(value) else f"{value:{width}.{decimals}f}"


def _bar(row: MuscleRow) -> str:
    if not row.tension_limit > 0 or math.isnan(row.tension):
        return f"[{'?':^{_BAR_CELLS}}]"
    cells = min(max(round(row.tension / row.tension_limit * _BAR_CELLS), 0), _BAR_CELLS)
    end = ">" if row.tension > row.tension_limit else "]"
    return f"[{'#' * cells}{'.' * (_BAR_CELLS - cells)}{end}"


def _bar_style(row: MuscleRow) -> str:
    share = row.tension / row.tension_limit
    return "red" if share > 0.8 else "yellow" if share > 0.5 else "green"


def _nodes(reports: Sequence[NodeReport], width: int) -> list[Text]:
    """Return the worst node in one or two lines, and all others in as many."""
    worst = [report for report in reports if report.level][:1]
    first = "" if reports else "no node heard in /diagnostics"
    style = ""
    if worst:
        first = f"{worst[0].name} {LEVELS[worst[0].level]}: {worst[0].text}"
        style = _LEVEL_STYLES[worst[0].level]
    room = max(width - len(_INDENT), 1)
    others = [report for report in reports if report not in worst]
    groups = [
        f"{level}: {' '.join(report.name for report in others if report.level == number)}"
        for number, level in enumerate(LEVELS)
        if any(report.level == number for report in others)
    ]
    lines = [(part, style) for part in textwrap.wrap(_plain(first), room)[:2]]
    lines += [(part, "") for part in textwrap.wrap(_plain("  ".join(groups)), room)[:2]]
    return [
        _line("nodes      " if number == 0 else _INDENT, text, style)
        for number, (text, style) in enumerate(lines)
    ]


def _line(label: str, text: str, style: str = "") -> Text:
    line = Text(label, style="dim")
    line.append(_plain(text), style=f"not dim {style}")
    return line


def _plain(text: str) -> str:
    """Return a text of others without what a terminal would obey."""
    return "".join(letter if letter.isprintable() else " " for letter in text)
