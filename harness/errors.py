"""The errors that a person can cure, and that the command line prints as one line."""

from __future__ import annotations


class InputError(Exception):
    """Input that no command can work with: an option, a file, a folder.

    The message is one line that names the value and the remedy. The command line prints it
    without a traceback and exits with 2.
    """
