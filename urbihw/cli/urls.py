"""The check of a robot's url for commands that may open its port later, or not at all."""

from __future__ import annotations

from urbihw import buses, platforms
from urbihw.buses.errors import Unavailable
from urbihw.buses.link import Context, split_parameters
from urbihw.kernel.uobject import BadConfig


def check_url(url: str) -> None:
    """Check kind and parameters of a url, which may have those of a platform.  Nothing is opened.

    Raises BadUrl for an unknown kind, an unknown parameter, or a wrong value.
    """
    names: set[str] = set()
    for manifest in platforms.manifests():
        try:
            names |= platforms.load_options(manifest).in_url()
        except BadConfig:  # ``urbihw config check`` reports its error.
            continue
    port, _ = split_parameters(url, names)
    try:
        buses.port_for(port, Context())
    except Unavailable:
        # Its package is missing: the code that opens it says so.
        return
