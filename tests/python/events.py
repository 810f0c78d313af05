"""Events of `--progress json`, each checked against docs/progress.schema.json."""

from __future__ import annotations

import functools
import json
from collections.abc import Iterable
from typing import Any

import jsonschema
from conftest import ROOT


@functools.cache
def _validator() -> jsonschema.Draft202012Validator:
    schema = json.loads((ROOT / "docs/progress.schema.json").read_text())
    jsonschema.Draft202012Validator.check_schema(schema)
    return jsonschema.Draft202012Validator(schema)


def event(line: str) -> dict[str, Any]:
    """One event."""
    found = json.loads(line)
    _validator().validate(found)
    return found


def events(text: str | Iterable[str], exit_code: int | None) -> list[dict[str, Any]]:
    """All events of a command. exit_code: what it has ended with, None where it was killed."""
    found = [event(line) for line in (text.splitlines() if isinstance(text, str) else text)]
    ends = [number for number, one in enumerate(found) if one["event"] == "end"]
    assert ends == ([] if exit_code is None else [len(found) - 1])
    if exit_code is not None:
        end, errors = found[-1], [one for one in found if one["event"] == "error"]
        assert end["exit_code"] == exit_code
        assert bool(errors) == bool(exit_code) == bool(end["error"])
        assert end["status"] == ("complete" if not exit_code else "interrupted" if exit_code >= 75 else "failed")
    return found
