# SPDX-License-Identifier: GPL-3.0-or-later
"""What is read from the scene, and what is put into it.

`source` reads what is to be painted, `mask` where; `result` shows what was, by a `material` or
`mixing` grids.
"""
