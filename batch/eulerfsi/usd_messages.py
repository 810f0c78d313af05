"""What USD says on its own: kept off standard error, or told in words for users."""

from __future__ import annotations

import contextlib
import re
from collections.abc import Callable, Iterator

from pxr import Usd, UsdUtils

from .reasons import one_line, plain_reason


@contextlib.contextmanager
def usd_messages(tell: Callable[[str], None] = lambda _text: None) -> Iterator[None]:
    """Inside the block USD's warnings and notes go to `tell`, one line each, when the block ends; to nobody by default.

    They never reach standard error. Errors are exceptions in Python and not concerned.
    """
    delegate = UsdUtils.CoalescingDiagnosticDelegate()
    try:
        yield
    finally:
        for message in delegate.TakeUncoalescedDiagnostics():
            tell(f"USD: {one_line(message.commentary)}")


def composition_faults(stage: Usd.Stage) -> list[tuple[str, bool]]:
    """What the stage refers to and could not be brought in: (a line, whether the file is there but broken)."""
    return [_composition_fault(one_line(str(error))) for error in stage.GetCompositionErrors()]


_UNOPENED = re.compile(
    r"Could not (?:open asset|load sublayer) @(?P<asset>[^@]*)@ (?:for (?P<arc>\w+) introduced by "
    r"@(?P<by>[^@]*)@<(?P<prim>[^>]*)>|of layer @(?P<root>[^@]*)@)(?: -- (?P<reason>.*?))?[ .;]*(?:; skipping)?[ .;]*$"
)
_NO_FORMAT = "Cannot determine file format"
_NO_PRIM = re.compile(
    r"Unresolved (?P<arc>\w+) prim path @(?P<asset>[^@]*)@<(?P<path>[^>]*)> introduced by "
    r"@(?P<by>[^@]*)@<(?P<prim>[^>]*)>"
)
_CIRCLE = re.compile(r"Sublayer hierarchy with root layer @(?P<root>[^@]*)@ has cycles")


def _composition_fault(text: str) -> tuple[str, bool]:
    if found := _UNOPENED.match(text):
        where = f"{found['by']}: {found['prim']}" if found["by"] else found["root"]
        what, unknown = "no such file", bool(found["reason"]) and found["reason"].startswith(_NO_FORMAT)
        if unknown:
            what = "is left out: USD has no plug-in here for files of this kind"
        elif found["reason"]:
            what = f"cannot be opened: {plain_reason(found['reason'])}"
        return f"{where}: {found['arc'] or 'sublayer'} @{found['asset']}@: {what}", bool(
            found["reason"]
        ) and not unknown
    if found := _NO_PRIM.match(text):
        target = f"@{found['asset']}@<{found['path']}>"
        return f"{found['by']}: {found['prim']}: {found['arc']} {target}: the file has no such prim", False
    if found := _CIRCLE.match(text):
        return f"{found['root']}: its sublayers form a cycle", False
    return text, False
