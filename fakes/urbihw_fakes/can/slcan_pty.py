"""An slcan adapter on a pseudo terminal, which python-can opens like one on USB."""

from __future__ import annotations

from urbihw_fakes.endpoint import PtyEndpoint


class SlcanPty(PtyEndpoint):
    """Serves a `CanDevice` with the `Slcan` codec; python-can need not wait for the adapter to start."""

    @property
    def url(self) -> str:
        """`can://slcan` and the path."""
        return f"can://slcan{self.path}?sleep_after_open=0"
