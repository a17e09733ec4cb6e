"""The two documents of DDS Security 1.1: governance of a domain, permissions of a participant."""

from datetime import datetime, timezone
from xml.etree import ElementTree
from xml.etree.ElementTree import Element, SubElement

from dds_names import Access

_XSI = "http://www.w3.org/2001/XMLSchema-instance"
_SCHEMA = "http://www.omg.org/spec/DDS-SECURITY/20170901/omg_shared_ca_{}.xsd"

# Whoever has no valid certificate is not spoken to. All traffic is encrypted and authenticated,
# its sender included, and every topic needs a permission: no topic is exempt.
_DOMAIN_RULE = {
    "allow_unauthenticated_participants": "false",
    "enable_join_access_control": "true",
    "discovery_protection_kind": "ENCRYPT",
    "liveliness_protection_kind": "ENCRYPT",
    "rtps_protection_kind": "ENCRYPT",
}
_TOPIC_RULE = {
    "topic_expression": "*",
    "enable_discovery_protection": "true",
    "enable_liveliness_protection": "true",
    "enable_read_access_control": "true",
    "enable_write_access_control": "true",
    "metadata_protection_kind": "ENCRYPT",
    "data_protection_kind": "ENCRYPT",
}


def _document(kind: str) -> Element:
    schema = _SCHEMA.format(kind)
    return Element("dds", {"xmlns:xsi": _XSI, "xsi:noNamespaceSchemaLocation": schema})


def _fill(parent: Element, values: dict[str, str]) -> None:
    for tag, text in values.items():
        SubElement(parent, tag).text = text


def _text(root: Element) -> bytes:
    ElementTree.indent(root)
    declaration = b'<?xml version="1.0" encoding="UTF-8"?>\n'
    return declaration + ElementTree.tostring(root, encoding="utf-8") + b"\n"


def _date(moment: datetime) -> str:
    return moment.astimezone(timezone.utc).strftime("%Y-%m-%dT%H:%M:%S")


def _domains(parent: Element, domain: int) -> None:
    _fill(SubElement(parent, "domains"), {"id": str(domain)})


def governance(domain: int) -> bytes:
    """Return the rules that everyone in a ROS domain follows."""
    root = _document("governance")
    rule = SubElement(SubElement(root, "domain_access_rules"), "domain_rule")
    _domains(rule, domain)
    _fill(rule, _DOMAIN_RULE)
    _fill(SubElement(SubElement(rule, "topic_access_rules"), "topic_rule"), _TOPIC_RULE)
    return _text(root)


def permissions(
    enclave: str, access: Access, domain: int, not_before: datetime, not_after: datetime
) -> bytes:
    """Return what the participant with the certificate CN=`enclave` may do."""
    root = _document("permissions")
    grant = SubElement(SubElement(root, "permissions"), "grant", {"name": enclave})
    SubElement(grant, "subject_name").text = f"CN={enclave}"
    _fill(
        SubElement(grant, "validity"),
        {"not_before": _date(not_before), "not_after": _date(not_after)},
    )
    rule = SubElement(grant, "allow_rule")
    _domains(rule, domain)
    for tag, names in (("publish", access.publish), ("subscribe", access.subscribe)):
        topics = SubElement(SubElement(rule, tag), "topics")
        for name in sorted(names):
            SubElement(topics, "topic").text = name
    SubElement(grant, "default").text = "DENY"
    return _text(root)
