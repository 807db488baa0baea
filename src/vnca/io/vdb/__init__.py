"""OpenVDB files: small, strict and quick. The layout of a file is in this folder's README."""

from vnca.io.vdb.file import VdbFile, open_vdb
from vnca.io.vdb.grid import EMPTY_BOX, Grid
from vnca.io.vdb.header import GridHeader
from vnca.io.vdb.layout import VALUE_TYPES, ValueType
from vnca.io.vdb.metadata import Entry, Metadata
from vnca.io.vdb.transform import Transform
from vnca.io.vdb.tree import Tiles, Tree
from vnca.io.vdb.write import write_vdb

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
