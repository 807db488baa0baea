# SPDX-License-Identifier: GPL-3.0-or-later
"""What an artist can mend."""


class ProblemError(Exception):
    """A line that says what is wrong, and what to do."""
