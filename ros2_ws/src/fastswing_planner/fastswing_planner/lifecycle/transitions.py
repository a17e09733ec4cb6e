"""What becomes of a lifecycle transition."""

import traceback
from collections.abc import Callable

from rclpy.impl.rcutils_logger import RcutilsLogger
from rclpy.lifecycle import TransitionCallbackReturn

from fastswing_planner.errors import PlannerError


def attempt(
    verb: str, action: Callable[[], None], logger: RcutilsLogger
) -> TransitionCallbackReturn:
    """Return what became of `action`; what it raises is logged.

    A PlannerError refuses the transition, any other exception is a defect.
    """
    try:
        action()
    except PlannerError as error:
        logger.error(f"cannot {verb}: {error}")
        return TransitionCallbackReturn.FAILURE
    except Exception:
        logger.error(f"cannot {verb}:\n{traceback.format_exc()}")
        return TransitionCallbackReturn.ERROR
    return TransitionCallbackReturn.SUCCESS
