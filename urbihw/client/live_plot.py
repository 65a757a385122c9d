"""A live plot of slots in a notebook: a picture in SVG, drawn again a few times a second.  Needs the extra jupyter."""

from __future__ import annotations

import threading
from collections import deque
from html import escape
from typing import Any, Final

from urbihw.client.errors import ClientError
from urbihw.client.iterators import SlotWatch
from urbihw.client.streams import Sample

WIDTH, HEIGHT, MARGIN = 640, 240, 40
DRAW_PERIOD_S: Final = 0.2
COLOURS: Final = ("#1f77b4", "#d62728", "#2ca02c", "#ff7f0e", "#9467bd", "#8c564b")
MAX_SAMPLES: Final = 20_000


class LivePlot:
    """Draws what a watch tells, in a thread, until ``close``; ``widget`` is what the notebook shows."""

    def __init__(self, watch: SlotWatch, seconds: float) -> None:
        """``seconds``: the time that the plot shows.  Raises ImportError without ipywidgets."""
        try:
            from ipywidgets import HTML
        except ImportError:
            watch.close()
            raise ImportError("a live plot needs ipywidgets: pip install ipywidgets") from None
        self.widget: Any = HTML()
        self.error = ""
        self._watch = watch
        self._seconds = seconds
        self._samples: deque[Sample] = deque(maxlen=MAX_SAMPLES)
        self._thread = threading.Thread(target=self._draw, name="live plot", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """End it; the last picture stays."""
        self._watch.close()
        self._thread.join(5)

    def _draw(self) -> None:
        drawn = 0.0
        try:
            for sample in self._watch:
                self._samples.append(sample)
                while self._samples[0].time < sample.time - self._seconds:
                    self._samples.popleft()
                if sample.time >= drawn + DRAW_PERIOD_S:
                    drawn = sample.time
                    self.widget.value = plot_svg(self._watch.slots, list(self._samples), self._seconds)
        except ClientError as error:
            self.error = str(error)

    def _repr_mimebundle_(self, **options: Any) -> Any:
        """What a notebook shows: the widget."""
        return self.widget._repr_mimebundle_(**options)


def plot_svg(slots: tuple[str, ...], samples: list[Sample], seconds: float) -> str:
    """Curves over time, the newest sample at the right, as the text of an SVG picture."""
    numbers = [value for sample in samples for value in sample.values if isinstance(value, int | float)]
    low, high = (min(numbers), max(numbers)) if numbers else (0.0, 1.0)
    span = high - low or 1.0
    end = samples[-1].time if samples else 0.0
    parts = []
    for index, slot in enumerate(slots):
        colour = COLOURS[index % len(COLOURS)]
        points = " ".join(
            f"{WIDTH - MARGIN - (end - sample.time) / seconds * (WIDTH - 2 * MARGIN):.1f},"
            f"{HEIGHT - MARGIN - (sample.values[index] - low) / span * (HEIGHT - 2 * MARGIN):.1f}"
            for sample in samples if isinstance(sample.values[index], int | float)
        )  # fmt: skip
        parts.append(f'<polyline fill="none" stroke="{colour}" points="{points}"/>')
        parts.append(f'<text x="{MARGIN}" y="{14 * (index + 1)}" fill="{colour}">{escape(slot)}</text>')
    parts.append(f'<text x="2" y="{MARGIN}">{high:g}</text><text x="2" y="{HEIGHT - MARGIN}">{low:g}</text>')
    return (f'<svg xmlns="http://www.w3.org/2000/svg" width="{WIDTH}" height="{HEIGHT}" font-size="12" '
            f'fill="currentColor">{"".join(parts)}</svg>')
