"""Requests that come too late: what they asked for may no longer be wanted."""

from fastswing_planner.cdr.stamps import StampFault, age_sec, stamp_fault
from fastswing_planner.errors import StaleRequest
from fastswing_planner.lifecycle.parameters import Parameter

REQUEST_MAX_AGE = Parameter(
    "request_max_age",
    1.0,
    "Older requests are refused, so that an arm does not move long after it was asked to: a "
    "network that was out delivers them late. The clocks of both computers must agree within it.",
    "s",
    0.05,
    60.0,
)
"""Parameter of every node that acts on requests with a stamp."""


def check_request_stamp(what: str, stamp_ns: int, now_ns: int, max_age: float) -> None:
    """Raise StaleRequest for a request whose stamp [ns] is zero, or far from `now_ns` [ns].

    what     what the request is called in the error
    max_age  [s] largest difference, also into the future: that clock says nothing about the age
    """
    fault = stamp_fault(stamp_ns, now_ns, max_age, max_ahead=max_age)
    if fault is None:
        return
    age = age_sec(stamp_ns, now_ns)
    stamp = f"the {what}'s stamp is"
    text = {
        StampFault.ZERO: f"{stamp} zero: fill in when it was made, late ones are not carried out",
        StampFault.OLD: f"the {what} is {age:.2f} s old, at most {max_age:g} s: send it again",
        StampFault.FUTURE: f"{stamp} {-age:.2f} s in the future: do the computers' clocks agree?",
    }
    raise StaleRequest(text[fault])
