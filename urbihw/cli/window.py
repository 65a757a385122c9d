"""A window that shows one image after the other, until it is closed."""

from __future__ import annotations

import queue
import threading
import tkinter
from collections.abc import Iterator

from PIL import ImageTk

from urbihw.cli.options import CliRefused
from urbihw.cli.pictures import PictureFile
from urbihw.exitcodes import EX_CONFIG

POLL_PERIOD_MS: int = 20
"""Milliseconds between two checks for a new image."""


def show(pictures: Iterator[PictureFile], title: str, scale: float) -> None:
    """Show images until the window is closed.  Raises CliRefused when there is no screen, or no more images."""
    try:
        root = tkinter.Tk()
    except tkinter.TclError as error:
        raise CliRefused(
            f"there is no screen to show images on ({error}); save one: --output FILE", EX_CONFIG
        ) from error
    root.title(title)
    view = _View(root, scale)
    news: queue.Queue[PictureFile | CliRefused] = queue.Queue(maxsize=2)
    threading.Thread(target=_fetch, args=(pictures, news), daemon=True).start()
    problem: list[CliRefused] = []

    def check_queue() -> None:
        try:
            view.show(news.get_nowait())
        except queue.Empty:
            pass
        except CliRefused as error:
            problem.append(error)
            root.destroy()
            return
        root.after(POLL_PERIOD_MS, check_queue)

    root.after(POLL_PERIOD_MS, check_queue)
    root.mainloop()
    if problem:
        raise problem[0]


def _fetch(pictures: Iterator[PictureFile], news: queue.Queue[PictureFile | CliRefused]) -> None:
    """Wait for images in a thread beside the window, and put each image or error into the queue."""
    try:
        for picture in pictures:
            news.put(picture)
    except CliRefused as error:
        news.put(error)


class _View:
    """The contents of the window."""

    def __init__(self, root: tkinter.Tk, scale: float) -> None:
        self._scale = scale
        self._label = tkinter.Label(root)
        self._label.pack()
        self._photo: ImageTk.PhotoImage | None = None

    def show(self, news: PictureFile | CliRefused) -> None:
        """Show an image.  Raises an error that was received instead."""
        if isinstance(news, CliRefused):
            raise news
        image = news.decoded().convert("RGB")
        if self._scale != 1.0:
            size = (max(1, round(image.width * self._scale)), max(1, round(image.height * self._scale)))
            image = image.resize(size)
        # Tk does not hold a reference to the image that it shows.
        self._photo = ImageTk.PhotoImage(image)
        self._label.configure(image=self._photo)
