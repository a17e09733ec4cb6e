"""`make security`: the keystore is laid out as ROS 2 reads it, signed, private and never lost."""

import os
import re
import shutil
import subprocess
from collections.abc import Iterator
from datetime import datetime, timedelta, timezone
from pathlib import Path
from xml.etree import ElementTree

import keystore
import pytest
from cryptography import x509
from cryptography.exceptions import InvalidSignature
from cryptography.hazmat.primitives.serialization import load_pem_private_key
from keystore import KeystoreError, KeystoreRequest, enclave_path, make_keystore
from make_keystore import main
from policy_table import ENCLAVES, NODES

ROOT = Path(__file__).parents[2]

NAMESPACES = ("/", "/left")
DOMAIN = 7
DAYS = 30
PATHS = [enclave_path(namespace, name) for namespace in NAMESPACES for name in ENCLAVES]
RCL_FILES = (
    "identity_ca.cert.pem",
    "cert.pem",
    "key.pem",
    "permissions_ca.cert.pem",
    "governance.p7s",
    "permissions.p7s",
)
"""What `rmw_dds_common::get_security_files` asks for."""

needs_openssl = pytest.mark.skipif(
    shutil.which("openssl") is None, reason="the command openssl is not installed"
)

PERMISSIONS_STRUCTURE = {
    "dds": "permissions",
    "permissions": "grant",
    "grant": "subject_name validity allow_rule default",
    "validity": "not_before not_after",
    "allow_rule": "domains publish subscribe",
    "domains": "id",
    "publish": "topics",
    "subscribe": "topics",
}
GOVERNANCE_STRUCTURE = {
    "dds": "domain_access_rules",
    "domain_access_rules": "domain_rule",
    "domain_rule": "domains allow_unauthenticated_participants enable_join_access_control "
    "discovery_protection_kind liveliness_protection_kind rtps_protection_kind "
    "topic_access_rules",
    "domains": "id",
    "topic_access_rules": "topic_rule",
    "topic_rule": "topic_expression enable_discovery_protection enable_liveliness_protection "
    "enable_read_access_control enable_write_access_control metadata_protection_kind "
    "data_protection_kind",
}
"""Children of each element, in the order of the OMG's schemas (DDS Security 1.1)."""


@pytest.fixture(scope="module")
def store(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("security") / "keystore"
    mask = os.umask(0)  # the modes must not depend on it
    try:
        make_keystore(path, KeystoreRequest(NAMESPACES, DOMAIN, DAYS))
    finally:
        os.umask(mask)
    return path


@pytest.fixture(params=PATHS[::5])
def enclave(request: pytest.FixtureRequest, store: Path) -> Path:
    return store / "enclaves" / str(request.param).lstrip("/")


def certificate(path: Path) -> x509.Certificate:
    return x509.load_pem_x509_certificate(path.read_bytes())


def files_of(folder: Path) -> set[str]:
    return {str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file()}


def verified(document: Path, authority: Path) -> bytes | None:
    """Return a signed document's content as openssl sees it, or None if the signature is wrong."""
    files = ["-in", str(document), "-CAfile", str(authority)]
    command = ["openssl", "smime", "-verify", "-text", *files]
    run = subprocess.run(command, capture_output=True, check=False)
    return run.stdout.replace(b"\r\n", b"\n") if run.returncode == 0 else None


# Layout.


def test_an_enclave_holds_every_file_that_ros_asks_for(enclave: Path) -> None:
    assert set(RCL_FILES) <= files_of(enclave)


def test_no_enclave_is_left_out(store: Path) -> None:
    folders = {f"/{path.parent}" for path in map(Path, files_of(store / "enclaves"))} - {"/."}
    assert folders == set(PATHS)


def test_every_node_of_the_suite_has_an_enclave() -> None:
    assert {policy.node for policy in NODES} <= set(ENCLAVES)


@pytest.mark.parametrize("name", ["mock.launch.xml", "robot.launch.xml"])
def test_a_launch_file_starts_each_node_in_its_own_enclave(name: str) -> None:
    launch = ROOT / "ros2_ws/src/musashi_muscle_bridge/launch" / name
    nodes = list(ElementTree.parse(launch).getroot().iter("node"))
    assert nodes
    for node in nodes:
        assert node.attrib["exec"] in ENCLAVES
        assert node.attrib["ros_args"] == f"--enclave $(var enclave)/{node.attrib['exec']}"


def test_two_keystores_have_the_same_files(store: Path, tmp_path: Path) -> None:
    make_keystore(tmp_path / "again", KeystoreRequest(NAMESPACES, DOMAIN, DAYS))
    assert files_of(tmp_path / "again") == files_of(store)


def without_validity(document: Path) -> str:
    return re.sub(r"<not_(before|after)>[^<]*", "", document.read_text())


def test_two_keystores_permit_the_same(store: Path, tmp_path: Path) -> None:
    make_keystore(tmp_path / "again", KeystoreRequest(NAMESPACES, DOMAIN, DAYS))
    for document in store.rglob("*.xml"):
        again = tmp_path / "again" / document.relative_to(store)
        assert without_validity(again) == without_validity(document)


def test_an_enclave_can_be_copied_to_another_computer(enclave: Path) -> None:
    assert not any(path.is_symlink() for path in enclave.iterdir())


# Keys and certificates.


def test_private_keys_are_for_their_owner_alone(store: Path) -> None:
    keys = list(store.rglob("*key.pem"))
    assert len(keys) == len(PATHS) + 2
    assert {key.stat().st_mode & 0o777 for key in keys} == {0o600}


def test_folders_are_for_their_owner_alone(store: Path) -> None:
    folders = [store, *(path for path in store.rglob("*") if path.is_dir())]
    assert {folder.stat().st_mode & 0o777 for folder in folders} == {0o700}


def test_every_private_key_is_another(store: Path) -> None:
    keys = list(store.rglob("*key.pem"))
    assert len({key.read_bytes() for key in keys}) == len(keys)


def test_a_key_belongs_to_its_certificate(enclave: Path) -> None:
    key = load_pem_private_key((enclave / "key.pem").read_bytes(), password=None)
    assert key.public_key() == certificate(enclave / "cert.pem").public_key()


def test_a_certificate_names_its_enclave(enclave: Path, store: Path) -> None:
    name = certificate(enclave / "cert.pem").subject.rfc4514_string()
    assert name == f"CN=/{enclave.relative_to(store / 'enclaves')}"


def test_the_identity_authority_has_signed_a_certificate(enclave: Path) -> None:
    authority = certificate(enclave / "identity_ca.cert.pem")
    certificate(enclave / "cert.pem").verify_directly_issued_by(authority)


def test_the_permissions_authority_has_signed_no_identity(enclave: Path) -> None:
    issuer = certificate(enclave / "cert.pem").issuer
    assert issuer != certificate(enclave / "permissions_ca.cert.pem").subject


def test_another_keystores_authority_is_not_accepted(enclave: Path, tmp_path: Path) -> None:
    make_keystore(tmp_path / "other", KeystoreRequest())
    other = certificate(tmp_path / "other/public/identity_ca.cert.pem")
    with pytest.raises(InvalidSignature):
        certificate(enclave / "cert.pem").verify_directly_issued_by(other)


def test_a_nodes_certificate_cannot_make_others(enclave: Path) -> None:
    extensions = certificate(enclave / "cert.pem").extensions
    assert not extensions.get_extension_for_class(x509.BasicConstraints).value.ca


def test_no_authoritys_private_key_is_in_an_enclave(store: Path) -> None:
    secrets = {path.read_bytes() for path in (store / "private").iterdir()}
    assert len(secrets) == 2
    assert not secrets & {path.read_bytes() for path in (store / "enclaves").rglob("*.pem")}


# Signed documents.


@needs_openssl
@pytest.mark.parametrize("name", ["governance", "permissions"])
def test_openssl_accepts_the_signature(enclave: Path, name: str) -> None:
    content = verified(enclave / f"{name}.p7s", enclave / "permissions_ca.cert.pem")
    assert content is not None


@needs_openssl
def test_what_is_signed_is_what_the_xml_says(enclave: Path) -> None:
    content = verified(enclave / "permissions.p7s", enclave / "permissions_ca.cert.pem")
    assert content == (enclave / "permissions.xml").read_bytes()


@needs_openssl
def test_the_identity_authority_cannot_sign_permissions(enclave: Path) -> None:
    assert verified(enclave / "permissions.p7s", enclave / "identity_ca.cert.pem") is None


@needs_openssl
@pytest.mark.parametrize("share", [0.0, 0.25, 0.5, 0.75, 1.0])
@pytest.mark.parametrize("name", ["governance", "permissions"])
def test_one_tampered_byte_breaks_the_signature(
    store: Path, tmp_path: Path, name: str, share: float
) -> None:
    bridge = store / "enclaves/bridge"
    content = bytearray((bridge / f"{name}.p7s").read_bytes())
    first, last = content.index(b"<dds"), content.rindex(b"</dds>") + len("</dds>") - 1
    content[round(first + share * (last - first))] ^= 1
    tampered = tmp_path / "tampered.p7s"
    tampered.write_bytes(content)
    assert verified(tampered, bridge / "permissions_ca.cert.pem") is None


def structure(element: ElementTree.Element) -> Iterator[tuple[str, str]]:
    """Yield each inner element with its children, a list of topics as one."""
    children = " ".join(child.tag for child in element)
    if element.tag == "topics":
        assert set(children.split()) == {"topic"}
    elif children:
        yield element.tag, children
    for child in element:
        yield from structure(child)


def test_permissions_are_built_as_the_omgs_schema_says(enclave: Path) -> None:
    root = ElementTree.parse(enclave / "permissions.xml").getroot()
    assert dict(structure(root)) == PERMISSIONS_STRUCTURE


def test_the_governance_is_built_as_the_omgs_schema_says(store: Path) -> None:
    root = ElementTree.parse(store / "enclaves/governance.xml").getroot()
    assert dict(structure(root)) == GOVERNANCE_STRUCTURE


def test_what_is_not_permitted_is_denied(enclave: Path) -> None:
    root = ElementTree.parse(enclave / "permissions.xml").getroot()
    assert root.findtext(".//default") == "DENY"


def test_permissions_belong_to_the_certificates_name(enclave: Path) -> None:
    root = ElementTree.parse(enclave / "permissions.xml").getroot()
    name = certificate(enclave / "cert.pem").subject.rfc4514_string()
    assert root.findtext(".//subject_name") == name


@pytest.mark.parametrize("name", ["enclaves/governance.xml", "enclaves/bridge/permissions.xml"])
def test_documents_hold_in_the_chosen_domain_alone(store: Path, name: str) -> None:
    domains = ElementTree.parse(store / name).getroot().find(".//domains")
    assert domains is not None
    assert [(child.tag, child.text) for child in domains] == [("id", str(DOMAIN))]


def test_no_participant_without_keys_is_let_in(store: Path) -> None:
    root = ElementTree.parse(store / "enclaves/governance.xml").getroot()
    assert root.findtext(".//allow_unauthenticated_participants") == "false"


def test_no_topic_is_exempt_from_protection(store: Path) -> None:
    root = ElementTree.parse(store / "enclaves/governance.xml").getroot()
    (rule,) = root.iter("topic_rule")
    assert [child.text for child in rule] == ["*", *["true"] * 4, *["ENCRYPT"] * 2]


# Expiry.


def test_keys_end_after_the_chosen_days(store: Path) -> None:
    left = certificate(store / "enclaves/bridge/cert.pem").not_valid_after_utc - datetime.now(
        timezone.utc
    )
    assert timedelta(days=DAYS - 1) < left <= timedelta(days=DAYS)


def test_certificates_and_permissions_end_together(enclave: Path) -> None:
    root = ElementTree.parse(enclave / "permissions.xml").getroot()
    ends = {
        certificate(enclave / name).not_valid_after_utc.strftime("%Y-%m-%dT%H:%M:%S")
        for name in ("cert.pem", "identity_ca.cert.pem", "permissions_ca.cert.pem")
    }
    assert ends == {root.findtext(".//not_after")}


# The command.


def test_the_command_says_when_the_keys_end(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["--output", str(tmp_path / "keystore"), "--days", "10"]) == 0
    end = certificate(tmp_path / "keystore/public/identity_ca.cert.pem").not_valid_after_utc
    assert f"valid until {end:%Y-%m-%d %H:%M} UTC" in capsys.readouterr().out


def test_an_existing_keystore_is_kept(tmp_path: Path) -> None:
    path = tmp_path / "keystore"
    main(["--output", str(path)])
    before = (path / "private/identity_ca.key.pem").read_bytes()
    assert main(["--output", str(path)]) == 1
    assert (path / "private/identity_ca.key.pem").read_bytes() == before


def test_the_refusal_says_why_and_how_to_renew(tmp_path: Path) -> None:
    with pytest.raises(KeystoreError, match=r"exists and is kept.*use --replace"):
        make_keystore(tmp_path, KeystoreRequest())


def test_a_replaced_keystore_is_renamed_not_lost(tmp_path: Path) -> None:
    path = tmp_path / "keystore"
    main(["--output", str(path)])
    before = (path / "private/identity_ca.key.pem").read_bytes()
    assert main(["--output", str(path), "--replace"]) == 0
    assert (tmp_path / "keystore.old1/private/identity_ca.key.pem").read_bytes() == before


def test_a_keystore_that_cannot_be_written_leaves_nothing_behind(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def full(_root: Path, _files: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(keystore, "_write", full)
    assert main(["--output", str(tmp_path / "keystore")]) == 1
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["--namespace", "left"], "'left' is no namespace; expected one such as /left"),
        (["--domain", "233"], "'233' is no ROS domain; expected 0 to 232"),
        (["--days", "0"], "'0' days; expected 1 to 3650"),
    ],
)
def test_a_wrong_argument_is_told(
    arguments: list[str], text: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        main(["--output", str(tmp_path / "keystore"), *arguments])
    assert text in capsys.readouterr().err


# The repository.


def git(*arguments: str) -> subprocess.CompletedProcess[str]:
    if shutil.which("git") is None or not (ROOT / ".git").exists():
        pytest.skip("not a git working copy")
    return subprocess.run(["git", *arguments], cwd=ROOT, capture_output=True, text=True)


@pytest.mark.parametrize("name", ["keystore", "keystore.old1", ".keystore.abc"])
def test_git_ignores_the_keystore(name: str) -> None:
    assert git("check-ignore", "-q", f"{name}/private/identity_ca.key.pem").returncode == 0


@pytest.mark.parametrize("what", ["CERTIFICATE", "PRIVATE KEY"])
def test_no_key_and_no_certificate_is_committed(what: str) -> None:
    assert git("grep", "-lI", "-e", f"-----BEGIN .*{what}").stdout == ""
