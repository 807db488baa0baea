"""How painted smoke looks, from where no rule was trained to be looked at, and how well."""

from collections.abc import Iterable, Mapping

import numpy as np
import torch
from scipy.ndimage import zoom
from study import Study

from vnca.core import FloatArray
from vnca.core.camera import frame_box
from vnca.core.volume import Volume
from vnca.features import load_network
from vnca.io.film import contact_sheet
from vnca.io.picture import fit, read_image
from vnca.losses.appearance import AppearanceConfig, AppearanceLoss
from vnca.painting import Painting, Roll, StylizeConfig
from vnca.rendering.colour import linear_to_srgb
from vnca.rendering.view import Mode, View, render
from vnca.rule import Rule
from vnca.training.scenes.smoke import PREVIEW_BACKGROUND, PREVIEW_STEP, PREVIEW_VIEWS, smoke_bounds

Viewpoint = tuple[float, float]
"""Azimuth and elevation, degrees."""
AROUND: tuple[Viewpoint, ...] = tuple(
    (azimuth, 10.0) for azimuth in np.arange(22.5, 360, 45).tolist()
)
"""Views from all around."""
SIDES: Mapping[str, Viewpoint] = dict(
    zip(("front", "right", "back", "above"), PREVIEW_VIEWS, strict=True)
)
"""Views by name; a training of a single view has only the front."""
PREVIEW_SIZE = 192
"""Rows and columns of a picture on a sheet, pixels."""
PAINTED = StylizeConfig()
UNPAINTED = StylizeConfig(warmup=0, steps_per_frame=0, strength=0.0, density_strength=0.0)
"""White smoke, as no rule has touched it."""


def paint(rule: Rule, smoke: Volume, config: StylizeConfig = PAINTED) -> Painting:
    """A frame as a rule paints it from nothing."""
    roll = Roll(rule, config, smoke_bounds(smoke, rule.scales.density))
    return roll.paint(smoke, roll.start())


class Judge:
    """Looks at paintings and compares what it sees with the picture.

    The judge is the same whatever a rule was trained with: L_app as the paper has it, and the
    palette, which the paper does not compare, apart from it.
    """

    def __init__(self, study: Study) -> None:
        """Prepare the picture.

        Raises:
            VncaError: If the picture or the network cannot be read.
        """
        self.view, self._place = study.config.view, study.place
        self.style = read_image(study.style)
        self._loss = AppearanceLoss(
            load_network(study.features, study.place),
            self.style,
            AppearanceConfig(pixels=1.0, style_scale=1.0),
            self.view.size,
        )

    @torch.no_grad()
    def look(
        self,
        painting: Painting,
        rule: Rule,
        viewpoint: Viewpoint,
        *,
        size: int | None = None,
        step: float | None = None,
        gamma: float = 1.0,
        mode: Mode | None = None,
    ) -> View:
        """A view of a painting, framed on its smoke; as training looks, unless asked otherwise.

        Args:
            painting: What is looked at.
            rule: The normalisers are its.
            viewpoint: Where from.
            size: Rows and columns, pixels.
            step: Distance between samples along a ray, cells.
            gamma: What the rule's extinction is multiplied by.
            mode: The integrand.
        """
        smoke, scales = painting.smoke, rule.scales
        corners = smoke_bounds(smoke, scales.density)
        lower, upper = (np.asarray(corner) - smoke.origin - 0.5 for corner in corners)
        density, colour = (
            torch.from_numpy(field).to(self._place)
            for field in (painting.density / np.float32(scales.density), painting.colour)
        )
        return render(
            density,
            colour,
            frame_box(lower.tolist(), upper.tolist(), *viewpoint),
            rows=size or self.view.size,
            columns=size or self.view.size,
            gamma=scales.gamma * gamma,
            step=step or self.view.step,
            mode=mode or self.view.mode,
        )

    @torch.no_grad()
    def distance(self, views: Iterable[View]) -> dict[str, float]:
        """How far views are from the picture, on average: L_app, and its palette's distance."""
        found = []
        for view in views:
            picture = linear_to_srgb(view.over(self._loss.background)).permute(2, 0, 1)[None]
            # The same positions are drawn for all.
            generator = torch.Generator().manual_seed(0)
            terms = self._loss(picture, view.opacity[None], generator).terms
            found.append([float(terms["style"] + terms["moments"]), float(terms["pixels"])])
        appearance, palette = np.mean(found, axis=0)
        return {"L_app": float(appearance), "palette": float(palette)}

    def around(self, painting: Painting, rule: Rule) -> dict[str, float]:
        """The distance from all around."""
        return self.distance(self.look(painting, rule, viewpoint) for viewpoint in AROUND)

    def preview_view(
        self,
        painting: Painting,
        rule: Rule,
        viewpoint: Viewpoint = SIDES["front"],
        *,
        gamma: float = 1.0,
        mode: Mode | None = None,
    ) -> FloatArray:
        """A picture for people to look at, linear RGB `[r, c, 3]`."""
        mode = mode or self.view.mode
        step = PREVIEW_STEP if mode == "emission-absorption" else self.view.step
        view = self.look(
            painting, rule, viewpoint, size=PREVIEW_SIZE, step=step, gamma=gamma, mode=mode
        )
        return view.over([PREVIEW_BACKGROUND] * 3).clamp(0, 1).cpu().numpy()

    def sides(self, painting: Painting, rule: Rule) -> dict[str, FloatArray]:
        """Pictures from all sides, by name."""
        return {
            side: self.preview_view(painting, rule, viewpoint) for side, viewpoint in SIDES.items()
        }

    def sheet(self, rows: Mapping[str, Mapping[str, FloatArray]]) -> FloatArray:
        """Rows of pictures after the style, each with the names of its row and its own."""
        head = np.clip(fit(self.style, PREVIEW_SIZE, PREVIEW_SIZE), 0, 1)
        heads = [head, *[None] * (len(rows) - 1)]
        pictures = [[first, *row.values()] for first, row in zip(heads, rows.values(), strict=True)]
        captions = [["", *(f"{name}, {each}" for each in row)] for name, row in rows.items()]
        return contact_sheet(pictures, captions)


def magnified(smoke: Volume, factor: float) -> Volume:
    """The same smoke on a grid so many times finer, linear between cells.

    Velocity is in cells per frame, so it grows alike.
    """

    def finer(field: FloatArray) -> FloatArray:
        factors = [factor] * 3 + [1.0] * (field.ndim - 3)
        values = zoom(field, factors, order=1, mode="nearest", grid_mode=True)
        return np.asarray(values, np.float32)

    x, y, z = (round(factor * cell) for cell in smoke.origin)
    return Volume(
        density=finer(smoke.density),
        velocity=None if smoke.velocity is None else factor * finer(smoke.velocity),
        origin=(x, y, z),
        index_to_world=smoke.index_to_world @ np.diag([1 / factor] * 3 + [1.0]),
        frame=smoke.frame,
    )
