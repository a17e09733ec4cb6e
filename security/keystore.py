"""A keystore as ROS 2 (rcl) looks for it: written whole or not at all.

```
private/{identity_ca,permissions_ca}.key.pem    whoever has these can make keys for anybody
public/{identity_ca,permissions_ca}.cert.pem
enclaves/governance.{xml,p7s}
enclaves/[NAMESPACE/]NAME/{cert.pem,key.pem,identity_ca.cert.pem,permissions_ca.cert.pem,
                           governance.p7s,permissions.xml,permissions.p7s}
```
"""

import os
import shutil
import tempfile
from collections.abc import Mapping
from dataclasses import dataclass
from datetime import datetime, timedelta, timezone
from pathlib import Path

from certificates import Identity, make_identity, sign
from dds_documents import governance, permissions
from dds_names import enclave_access
from policy_table import ENCLAVES

# A computer whose clock is behind, or in another time zone, must accept new keys.
_CLOCK_ALLOWANCE = timedelta(days=1)
_FOLDER_MODE, _SECRET_MODE, _PUBLIC_MODE = 0o700, 0o600, 0o644


class KeystoreError(Exception):
    """The keystore cannot be made; the text says why and what to do."""


@dataclass(frozen=True)
class KeystoreRequest:
    """What a keystore is made for.

    namespaces  of the robots, each beginning with a slash
    domain      ROS_DOMAIN_ID in which the keys are valid
    days        how long they are valid
    sim_time    whether the nodes may read /clock
    """

    namespaces: tuple[str, ...] = ("/",)
    domain: int = 0
    days: int = 365
    sim_time: bool = False


@dataclass(frozen=True)
class _Authorities:
    """Who vouches for identities, and who for what they may do."""

    identity: Identity
    permissions: Identity
    not_before: datetime
    not_after: datetime


def enclave_path(namespace: str, name: str) -> str:
    """Return the enclave's name, such as /left/bridge, as `--enclave` takes it."""
    return f"{namespace.rstrip('/')}/{name}"


def _authorities(days: int) -> _Authorities:
    now = datetime.now(timezone.utc).replace(microsecond=0)
    validity = (now - _CLOCK_ALLOWANCE, now + timedelta(days=days))
    return _Authorities(
        make_identity("fastswing identity CA", *validity),
        make_identity("fastswing permissions CA", *validity),
        *validity,
    )


def _enclave(
    path: str, permitted: bytes, signed_governance: bytes, authorities: _Authorities
) -> dict[str, bytes]:
    """Return one enclave's files."""
    own = make_identity(
        path, authorities.not_before, authorities.not_after, issuer=authorities.identity
    )
    return {
        "key.pem": own.key_pem,
        "cert.pem": own.certificate_pem,
        "identity_ca.cert.pem": authorities.identity.certificate_pem,
        "permissions_ca.cert.pem": authorities.permissions.certificate_pem,
        "governance.p7s": signed_governance,
        "permissions.xml": permitted,
        "permissions.p7s": sign(permitted, authorities.permissions),
    }


def _files(request: KeystoreRequest) -> tuple[dict[str, bytes], datetime]:
    """Return every file by its path in the keystore, and when the keys end."""
    authorities = _authorities(request.days)
    rules = governance(request.domain)
    signed_rules = sign(rules, authorities.permissions)
    files = {
        "private/identity_ca.key.pem": authorities.identity.key_pem,
        "private/permissions_ca.key.pem": authorities.permissions.key_pem,
        "public/identity_ca.cert.pem": authorities.identity.certificate_pem,
        "public/permissions_ca.cert.pem": authorities.permissions.certificate_pem,
        "enclaves/governance.xml": rules,
        "enclaves/governance.p7s": signed_rules,
    }
    for namespace in request.namespaces:
        for name, policies in ENCLAVES.items():
            path = enclave_path(namespace, name)
            permitted = permissions(
                path,
                enclave_access(policies, namespace, request.sim_time),
                request.domain,
                authorities.not_before,
                authorities.not_after,
            )
            enclave = _enclave(path, permitted, signed_rules, authorities)
            files |= {f"enclaves{path}/{file}": content for file, content in enclave.items()}
    return files, authorities.not_after


def _write(root: Path, files: Mapping[str, bytes]) -> None:
    for name, content in files.items():
        path = root / name
        for folder in reversed(path.relative_to(root).parents):
            # Not parents=True, which gives the folders between another mode.
            (root / folder).mkdir(mode=_FOLDER_MODE, exist_ok=True)
        mode = _SECRET_MODE if name.endswith("key.pem") else _PUBLIC_MODE
        # The mode is there from the first byte on; a key is never readable for a moment.
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, mode)
        with os.fdopen(descriptor, "wb") as file:
            file.write(content)


def _free_name(path: Path) -> Path:
    number = 1
    while (candidate := path.with_name(f"{path.name}.old{number}")).exists():
        number += 1
    return candidate


def make_keystore(path: Path, request: KeystoreRequest, replace: bool = False) -> datetime:
    """Make a keystore at `path`; return when its keys end.

    An existing one is an error, or, with `replace`, renamed to `path`.old1 and so on.
    """
    if path.exists() and not replace:
        raise KeystoreError(
            f"{path} exists and is kept: new keys shut out every node that has the old ones; "
            "to renew all of them, use --replace"
        )
    path.parent.mkdir(parents=True, exist_ok=True)
    files, not_after = _files(request)
    unfinished = Path(tempfile.mkdtemp(prefix=f".{path.name}.", dir=path.parent))
    try:
        _write(unfinished, files)
        if path.exists():
            path.rename(_free_name(path))
        unfinished.rename(path)
    except BaseException:
        shutil.rmtree(unfinished, ignore_errors=True)
        raise
    return not_after
