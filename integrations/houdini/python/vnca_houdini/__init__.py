# SPDX-License-Identifier: Apache-2.0
"""Paints smoke in the style of a picture, in Houdini.

`request` says what is asked of vnca and `work` asks it, without Houdini; `node` is the SOP and
`farm` the TOP node. vnca runs in a Python of its own: HOUDINI's never has to hold it.
"""
