"""Painting the files of a sequence tile by tile."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from vnca.core import Box
from vnca.core.field import Field
from vnca.io.painted.parts import PaintedParts, tiles_of
from vnca.io.parts import SmokeParts, VdbSmoke, open_parts
from vnca.io.provenance import Provenance
from vnca.io.sequence import Frame
from vnca.io.vdb import VdbFile
from vnca.painting import Ready
from vnca.painting.painter import Painter
from vnca.painting.read import Read
from vnca.painting.tiles import Tiling
from vnca.painting.tiles.roll import TiledRoll
from vnca.painting.tiles.state import TiledState
from vnca.painting.unfinished import Unfinished


@dataclass(frozen=True, eq=False, kw_only=True)
class TiledPainter(Painter):
    """As `Painter`, which paints the same bytes; one goes on with what the other began.

    Attributes:
        tiling: How frames are cut.
        watch: Is told what is being done.
    """

    tiling: Tiling
    watch: Callable[[str], None]
    _looked_at: list[Box] = field(default_factory=list, init=False)

    @cached_property
    def tiled(self) -> TiledRoll:
        """The rule by tiles."""
        return TiledRoll(self.roll, self.tiling, self.out, self.watch, self.ranks)

    def _start(self) -> TiledState:
        return self.tiled.start()

    def _loaded(self, path: Path, *, handed_over: bool = False) -> Unfinished:
        taken = partial(TiledState.of_stored, folder=self.out, ranks=self.ranks)
        conditions = self.conditions
        return Unfinished.load(path, conditions, self.roll, taken, handed_over=handed_over)

    def _save(self, unfinished: Unfinished, path: Path) -> None:
        state: TiledState = unfinished.state
        whole = replace(unfinished, state=state.gathered(self.out, self.ranks))
        if self.ranks.leads:
            super()._save(whole, path)

    def _opened(self, frame: Frame, file: VdbFile | None) -> SmokeParts:
        return open_parts(
            frame.path, self.smoke, frame=frame.number, lattice=self.lattice, file=file
        )

    def _made_ready(self, smoke: Any) -> tuple[Any, Ready | None]:
        return smoke, None

    def _painted(self, frame: Frame, read: Read, left: Unfinished) -> tuple[TiledState, None]:
        smoke: SmokeParts = read.smoke
        if self.ranks.leads:
            self._look(smoke, read.frame.path)
        state = self.tiled.advance(smoke, left.state)
        if frame not in self.frames:
            return state, None
        mass = self.tiled.mass(smoke, state)
        kept = self._leaves(smoke) if isinstance(smoke, VdbSmoke) else _Whole(self, read)
        finer = self.roll.grid * self.roll.finer
        boxes = list(kept.boxes(self.tiling.edge * self.roll.finer))
        wanted = [box for _, box in boxes]
        boxes = [boxes[number] for number in self.tiled.own(smoke, wanted, finer)]
        near = self.tiled.around(state, [box for _, box in boxes])
        for number, (own, box) in enumerate(boxes, 1):
            painting = self.tiled.painting(smoke, near, box, mass)
            kept.add(own, painting.density_field, painting.colour_field, painting.emission)
            self.watch(f"frame {smoke.frame}: tile {number} of {len(boxes)} painted")
        self.ranks.gather(kept.pieces(), kept.take)
        self._begin_to_write(frame, read, left)
        if self.ranks.leads:
            kept.write(self.target(frame), self.provenance(read))
        return state, None

    def _look(self, smoke: SmokeParts, path: Path) -> None:
        """Look at the velocity in a tile, of each frame in the same one."""
        if not self._looked_at:
            tiles = [tile for tile in tiles_of(smoke.box, self.tiling.edge) if smoke.holds(tile)]
            self._looked_at.extend(tiles[len(tiles) // 2 :][:1])
        for tile in self._looked_at:
            self._velocity.look(smoke.part(tile), path)

    def _leaves(self, smoke: VdbSmoke) -> PaintedParts:
        return PaintedParts(
            *(smoke, self.out),
            colour_grids=self.colour_grids,
            refine=self.refine,
            beyond=self.roll.beyond,
        )


_Part: TypeAlias = tuple[Field | None, ...]


class _Whole:
    """A painted frame whose file is written from memory, as its smoke was read."""

    def __init__(self, painter: TiledPainter, read: Read) -> None:
        roll = painter.roll
        box: Box = read.smoke.box.refined(roll.grid * roll.finer)
        self._painter, self._read = painter, read
        self._box = box if box.is_empty else box.grown(roll.beyond)
        self._parts: list[_Part] = []

    def boxes(self, edge: int) -> Iterator[tuple[Box, Box]]:
        """See `PaintedParts.boxes`."""
        tiles = list(tiles_of(self._box, edge)) or [self._box]
        return ((tile, tile) for tile in tiles)

    def add(self, own: Box, density: Field, colour: Field, emission: Field | None) -> None:
        """See `PaintedParts.add`."""
        self._parts.append(tuple(f and f.within(own) for f in (density, colour, emission)))

    def pieces(self) -> Iterator[_Part]:
        """See `PaintedParts.pieces`."""
        return iter(self._parts)

    def take(self, piece: _Part) -> None:
        """See `PaintedParts.take`."""
        self._parts.append(piece)

    def write(self, path: Path, provenance: Provenance) -> None:
        """See `PaintedParts.write`."""
        density, colour, emission = map(self._joined, zip(*self._parts, strict=True))
        fields = density, colour, emission
        self._painter.write(path, self._read, provenance, fields, self._box)

    def _joined(self, parts: Sequence[Field | None]) -> Any:
        some = [part for part in parts if part is not None]
        if not some:
            return None
        bricks = np.concatenate([part.bricks for part in some])
        values = np.concatenate([part.values for part in some])
        return replace(some[0], bricks=bricks, values=values, box=self._box).in_order()
