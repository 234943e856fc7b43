"""The command ``abbe``, as the package installs it."""

from __future__ import annotations

import signal
import sys

from ._abbe import command


def main() -> int:
    """Runs the command line of this process and returns its exit code."""
    # interrupts are the command's own business, as is a pipe that closes
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    return command(["abbe", *sys.argv[1:]])
