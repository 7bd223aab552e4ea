"""Files that are whole or absent."""

from __future__ import annotations

import os
import shutil
from typing import IO, TYPE_CHECKING

from harness.errors import InputError

if TYPE_CHECKING:
    from collections.abc import Callable
    from pathlib import Path

PARTIAL_SUFFIX = ".partial"
"""Ending of files that are being written; one that outlives its writer is rubbish."""


class DiskError(InputError):
    """A file could not be written."""


def write_atomically(path: Path, write: Callable[[IO[bytes]], object]) -> None:
    """Write a file under a temporary name, bring it to the disk, then rename it.

    Parameters
    ----------
    path
        Where the file shall stand; an earlier one is replaced.
    write
        Writes the content to the open file.

    Raises
    ------
    DiskError
        The file could not be written; nothing of it is left, and an earlier one still stands.
    """
    partial = path.with_name(path.name + PARTIAL_SUFFIX)
    try:
        try:
            with partial.open("wb") as file:
                write(file)
                file.flush()
                os.fsync(file.fileno())
            partial.replace(path)
            _sync_folder(path.parent)
        except BaseException:
            remove_quietly(partial)
            raise
    except OSError as error:
        reason = error.strerror or str(error)
        raise DiskError(
            f"cannot write {path}: {reason}; free or change the output folder"
        ) from error


def write_text(path: Path, text: str) -> None:
    """Write a UTF-8 file atomically."""
    write_atomically(path, lambda file: file.write(text.encode()))


def link_or_copy(source: Path, target: Path) -> None:
    """Give a file a second name, or copy it where the disk is another; atomic, as a write is.

    Only for files that are never written in place: both names stand for the same bytes.
    """
    partial = target.with_name(target.name + PARTIAL_SUFFIX)
    try:
        remove_quietly(partial)
        try:
            os.link(source, partial)
        except OSError:
            with source.open("rb") as file:
                write_atomically(target, lambda copy: shutil.copyfileobj(file, copy))
            return
        partial.replace(target)
        remove_quietly(partial)  # a rename onto the same file does nothing
    except OSError as error:
        raise DiskError(
            f"cannot write {target}: {error.strerror}; free or change the output folder"
        ) from error


def remove_quietly(path: Path) -> None:
    """Remove a file if it is there and can be removed."""
    try:
        path.unlink(missing_ok=True)
    except OSError:
        return


def _sync_folder(folder: Path) -> None:
    """Bring a rename to the disk."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
