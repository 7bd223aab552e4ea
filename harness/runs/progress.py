"""How a run tells a person where it stands."""

from __future__ import annotations

from contextlib import AbstractContextManager, contextmanager, nullcontext
from typing import TYPE_CHECKING, Protocol

from rich.markup import escape
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress as Bar,
    TaskID,
    TextColumn,
    TimeElapsedColumn,
    TimeRemainingColumn,
)

if TYPE_CHECKING:
    from collections.abc import Iterator
    from pathlib import Path

    from rich.console import Console


class Progress(Protocol):
    """Listens to a run."""

    def watch(self, *, folder: Path, scenes: int, finished: int) -> AbstractContextManager[None]:
        """Accompany the scenes; `finished` of them are there already."""
        ...

    def scene_done(self, scene_id: str, seconds: float) -> None:
        """Hear that a scene was computed."""
        ...

    def scene_failed(self, scene_id: str, failure: str) -> None:
        """Hear that a scene was lost."""
        ...

    def note(self, text: str) -> None:
        """Hear something that a person should know."""
        ...


class SilentProgress:
    """Says nothing."""

    def watch(self, *, folder: Path, scenes: int, finished: int) -> AbstractContextManager[None]:
        """See `Progress`."""
        del folder, scenes, finished
        return nullcontext()

    def scene_done(self, scene_id: str, seconds: float) -> None:
        """See `Progress`."""

    def scene_failed(self, scene_id: str, failure: str) -> None:
        """See `Progress`."""

    def note(self, text: str) -> None:
        """See `Progress`."""


class ConsoleProgress:
    """A bar with the time left on a terminal, a line per scene elsewhere.

    Parameters
    ----------
    console
        Where to write; the standard error stream, so that the table can be piped.
    folder_name
        What the folder that takes the scenes is called.
    """

    def __init__(self, console: Console, *, folder_name: str = "run folder") -> None:
        self._console = console
        self._folder_name = folder_name
        # The mean over many scenes: workers finish in bursts.
        self._bar = Bar(
            TextColumn("[bold]scenes[/bold]"),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("ETA"),
            TimeRemainingColumn(),
            console=console,
            speed_estimate_period=600,
            disable=not console.is_terminal,
        )
        self._task: TaskID | None = None
        self._count = self._total = 0

    @contextmanager
    def watch(self, *, folder: Path, scenes: int, finished: int) -> Iterator[None]:
        """See `Progress`."""
        self._count, self._total = finished, scenes
        if finished:
            self.note(f"{finished} of {scenes} scenes are there already")
        self._say(f"{self._folder_name}: {folder}")
        self._task = self._bar.add_task("", total=scenes, completed=finished)
        with self._bar:
            yield

    def scene_done(self, scene_id: str, seconds: float) -> None:
        """See `Progress`."""
        self._advance()
        if not self._console.is_terminal:
            self._say(f"{self._count}/{self._total} {scene_id} in {seconds:.1f} s")

    def scene_failed(self, scene_id: str, failure: str) -> None:
        """See `Progress`."""
        self._advance()
        self._say(f"{self._count}/{self._total} {scene_id} failed: {failure}", style="red")

    def note(self, text: str) -> None:
        """See `Progress`."""
        self._say(text, style="yellow")

    def _advance(self) -> None:
        self._count += 1
        if self._task is not None:
            self._bar.advance(self._task)

    def _say(self, text: str, *, style: str = "") -> None:
        self._console.print(escape(text), style=style, highlight=False, soft_wrap=True)
