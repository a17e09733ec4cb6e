"""Makes the keystore for encrypted and authenticated ROS 2 (SROS 2); see SECURITY.md."""

import argparse
import os
import re
import sys
from collections.abc import Sequence
from pathlib import Path

from keystore import KeystoreError, KeystoreRequest, make_keystore

_DEFAULT = Path(__file__).resolve().parents[1] / "keystore"
_NAMESPACE = re.compile(r"(/[A-Za-z_]\w*)+", re.ASCII)
_MAX_DOMAIN = 232
_MAX_DAYS = 3650


def _namespace(text: str) -> str:
    if text != "/" and not _NAMESPACE.fullmatch(text):
        raise argparse.ArgumentTypeError(f"'{text}' is no namespace; expected one such as /left")
    return text


def _domain(text: str) -> int:
    if not text.isdecimal() or int(text) > _MAX_DOMAIN:
        raise argparse.ArgumentTypeError(f"'{text}' is no ROS domain; expected 0 to {_MAX_DOMAIN}")
    return int(text)


def _days(text: str) -> int:
    if not text.isdecimal() or not 1 <= int(text) <= _MAX_DAYS:
        raise argparse.ArgumentTypeError(f"'{text}' days; expected 1 to {_MAX_DAYS}")
    return int(text)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--output", type=Path, default=_DEFAULT, help="the new folder")
    parser.add_argument(
        "--namespace",
        type=_namespace,
        action="append",
        help="of a robot, such as /left; more than once for several (default: /)",
    )
    parser.add_argument(
        "--domain",
        type=_domain,
        default=os.environ.get("ROS_DOMAIN_ID") or "0",
        help="ROS domain in which the keys are valid (default: ROS_DOMAIN_ID, or 0)",
    )
    parser.add_argument(
        "--days", type=_days, default="365", help="how long the keys are valid (default: 365)"
    )
    parser.add_argument("--sim-time", action="store_true", help="let the nodes read /clock")
    parser.add_argument(
        "--replace", action="store_true", help="rename an existing keystore and make new keys"
    )
    return parser


def main(arguments: Sequence[str] | None = None) -> int:
    """Make the keystore and say how to use it."""
    options = _parser().parse_args(arguments)
    namespaces = tuple(dict.fromkeys(options.namespace or ["/"]))
    request = KeystoreRequest(namespaces, options.domain, options.days, options.sim_time)
    try:
        not_after = make_keystore(options.output, request, options.replace)
    except (KeystoreError, OSError) as error:
        print(f"security: {error}", file=sys.stderr)
        return 1
    print(
        f"{options.output}: keys for ROS domain {options.domain}, "
        f"namespaces {', '.join(namespaces)}\n"
        f"valid until {not_after:%Y-%m-%d %H:%M} UTC; after that no node starts with them\n"
        f"move {options.output / 'private'} to a safe place: it makes keys for anybody\n\n"
        f"export ROS_SECURITY_KEYSTORE={options.output.resolve()}\n"
        "export ROS_SECURITY_ENABLE=true ROS_SECURITY_STRATEGY=Enforce"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
