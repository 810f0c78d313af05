"""USD schema and validators of libeulerfsi.

Importing the package registers the schema plug-in, so that `EulerFsiDomainAPI`, `EulerFsiSolidAPI`,
`EulerFsiEmitterAPI` and `EulerFsiColliderAPI` have their fallbacks, docs and limits. Import it before the first stage
is opened: USD builds its schema registry once. Hosts that do not import it find the same plug-in through
PXR_PLUGINPATH_NAME=<this folder>.
"""

from __future__ import annotations

from pathlib import Path

from pxr import Plug

PLUGIN_FOLDER = Path(__file__).resolve().parent


def register() -> None:
    """Registers schema and validators with USD; calling it again does nothing."""
    Plug.Registry().RegisterPlugins(str(PLUGIN_FOLDER))


register()
