"""The part of JSON Schema that MathOptFormat's schema uses, read literally: an independent judge of what we write."""

from __future__ import annotations

from typing import Any

_TYPES: dict[str, type | tuple[type, ...]] = {
    "object": dict, "array": list, "string": str, "number": (int, float), "integer": int, "boolean": bool,
}  # fmt: skip
KNOWN = {
    "type", "const", "enum", "required", "properties", "items", "minItems", "maxItems", "minimum", "uniqueItems",
    "oneOf", "$ref", "description", "examples", "title", "$schema", "$id", "definitions",
}  # fmt: skip


def violations(value: Any, schema: dict[str, Any], root: dict[str, Any], where: str = "") -> list[str]:
    """What a schema has against a value, place by place; empty where it is valid."""
    assert set(schema) <= KNOWN, set(schema) - KNOWN
    if "$ref" in schema:
        return violations(value, root["definitions"][schema["$ref"].removeprefix("#/definitions/")], root, where)
    found: list[str] = []
    if "type" in schema:
        kind = _TYPES[schema["type"]]
        if not isinstance(value, kind) or (isinstance(value, bool) and schema["type"] != "boolean"):
            return [f"{where}: no {schema['type']}"]
    if "const" in schema and value != schema["const"]:
        found.append(f"{where}: not {schema['const']}")
    if "enum" in schema and value not in schema["enum"]:
        found.append(f"{where}: {value} is none of the enum")
    if isinstance(value, dict):
        found += [f"{where}: no {name}" for name in schema.get("required", ()) if name not in value]
        for name, inner in schema.get("properties", {}).items():
            if name in value:
                found += violations(value[name], inner, root, f"{where}/{name}")
    if isinstance(value, list):
        if not schema.get("minItems", 0) <= len(value) <= schema.get("maxItems", len(value)):
            found.append(f"{where}: {len(value)} items")
        if "items" in schema:
            for k, item in enumerate(value):
                found += violations(item, schema["items"], root, f"{where}/{k}")
    if "minimum" in schema and value < schema["minimum"]:
        found.append(f"{where}: {value} is less than {schema['minimum']}")
    if "oneOf" in schema:
        fitting = [not violations(value, inner, root, where) for inner in schema["oneOf"]]
        if sum(fitting) != 1:
            found.append(f"{where}: fits {sum(fitting)} of oneOf")
    return found
