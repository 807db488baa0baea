"""OpenVDB files: small, strict and quick. The layout of a file is in this folder's README."""

from vnca.io.vdb.file import VdbFile, open_vdb, write_vdb
from vnca.io.vdb.grid import EMPTY_BOX, Grid
from vnca.io.vdb.header import GridHeader
from vnca.io.vdb.layout import VALUE_TYPES, ValueType
from vnca.io.vdb.metadata import Entry, Metadata, Transform
from vnca.io.vdb.tree import Tiles, Tree

__all__ = [
    "EMPTY_BOX",
    "VALUE_TYPES",
    "Entry",
    "Grid",
    "GridHeader",
    "Metadata",
    "Tiles",
    "Transform",
    "Tree",
    "ValueType",
    "VdbFile",
    "open_vdb",
    "write_vdb",
]
