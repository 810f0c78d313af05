"""What is wrong with a node, in words for its user."""

from __future__ import annotations

import hou


class Fault(Exception):
    """A node cannot be simulated as it is; messages say why, one line each."""

    def __init__(self, *messages: str) -> None:
        super().__init__("\n".join(messages))
        self.messages = messages


def report(node: hou.OpNode, messages: tuple[str, ...], severe: bool = True) -> None:
    """Shows messages; without a user interface faults are an exception, and the rest is printed."""
    text = "\n".join(messages)
    if hou.isUIAvailable():
        severity = hou.severityType.Error if severe else hou.severityType.Message
        hou.ui.displayMessage(text, title=node.path(), severity=severity)
    elif severe:
        raise hou.NodeError(text)
    else:
        print(text)
